"""Instruments of a calibration: a goniometer with an offset, a footswitch in volts."""

from dataclasses import dataclass
from math import exp, radians, sqrt

import numpy as np

from jointz.rig.devices.interface import SensorDescription, SensorSample
from jointz.rig.sim.benches.running_plant import RunningPlant
from jointz.rig.sim.people import Person, within_errors
from jointz.rig.sim.presets import Preset
from jointz.rig.sim.simulated_devices import SimulatedFootswitch, SimulatedSensor, Wiring

_ZERO_SD_RAD = radians(3.0)
# Volts of the switch: off and on the ground, range over people; noise; creep of both, share.
_OPEN_RANGE_V, _CLOSED_RANGE_V = (0.1, 0.5), (2.2, 3.2)
_NOISE_SD_V = 0.03
_CREEP_SD, _CREEP_TIME_S = 0.04, 20.0


def draw_angle_zero(person: Person, preset: Preset) -> float:
    """Return what the goniometer of a person shows at the true zero, rad."""
    if preset.name == "clean":
        return 0.0
    return _ZERO_SD_RAD * within_errors(float(person.stream("angle zero").standard_normal()))


@dataclass(frozen=True, slots=True)
class ContactLevels:
    """Voltages of a footswitch."""

    open_v: float  # V: mean with the heel off the ground
    closed_v: float  # V: mean with the heel on the ground
    noise_sd_v: float  # V: sd of white noise
    creep_sd: float  # relative sd of the slow creep of both levels, an Ornstein-Uhlenbeck process


def draw_contact_levels(person: Person, preset: Preset) -> ContactLevels:
    """Return the levels of a person's footswitch."""
    shares = person.stream("contact levels").random(2).tolist()
    open_v, closed_v = (
        low + share * (high - low)
        for (low, high), share in zip((_OPEN_RANGE_V, _CLOSED_RANGE_V), shares, strict=True)
    )
    if preset.name == "clean":
        return ContactLevels(open_v, closed_v, 0.0, 0.0)
    return ContactLevels(open_v, closed_v, _NOISE_SD_V, _CREEP_SD)


class OffsetSensor(SimulatedSensor):
    """A goniometer that does not show zero at zero."""

    def __init__(
        self, wiring: Wiring, description: SensorDescription, *, offset_rad: float
    ) -> None:
        super().__init__(wiring, "angle", description)
        self._offset_rad = offset_rad

    def read(self) -> list[SensorSample]:
        """Return all samples queued since the last read, oldest first."""
        offset = self._offset_rad
        return [sample._replace(value=sample.value + offset) for sample in super().read()]


class VoltageFootswitch(SimulatedFootswitch):
    """The switch under the heel as a voltage."""

    def __init__(
        self,
        wiring: Wiring,
        plant: RunningPlant,
        description: SensorDescription,
        *,
        levels: ContactLevels,
        rng: np.random.Generator,
    ) -> None:
        super().__init__(wiring, plant, description)
        self._levels, self._rng = levels, rng
        self._keep = exp(-1.0 / (description.sample_rate_hz * _CREEP_TIME_S))
        self._creep = float(rng.standard_normal())

    def read(self) -> list[SensorSample]:
        """Return all samples queued since the last read, oldest first."""
        return [sample._replace(value=self._volts(sample.value)) for sample in super().read()]

    def _volts(self, closed: float) -> float:
        levels = self._levels
        creep, white = self._rng.standard_normal(2).tolist()
        self._creep = self._keep * self._creep + sqrt(1.0 - self._keep**2) * creep
        level = levels.open_v + closed * (levels.closed_v - levels.open_v)
        return float(level * (1.0 + levels.creep_sd * self._creep) + levels.noise_sd_v * white)
