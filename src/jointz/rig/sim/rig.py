"""A simulated person in a simulated exoskeleton, as an experiment is handed it."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import pandas as pd

from jointz.core.clock import Clock
from jointz.core.gait_phases import REFERENCE_SPEED_M_S, stride_time_ratio
from jointz.core.protocols.protocol_models import LoadSpec
from jointz.core.protocols.pulse_models import Pulse
from jointz.core.study import Calibrated, CalibrationSpec, DeviceSpec
from jointz.rig.devices.interface import Devices, SensorDescription, Stretch, Wearer
from jointz.rig.sim.benches.running_plant import RunningPlant
from jointz.rig.sim.calibration_benches.calibration_instruments import OffsetSensor, draw_angle_zero
from jointz.rig.sim.descriptions import (
    exoskeleton,
    footswitch,
    goniometer,
    inverse_dynamics,
    motion_sensor,
)
from jointz.rig.sim.ground_truth import condition_truth
from jointz.rig.sim.people import Person, draw_person, personal_preset
from jointz.rig.sim.presets import Preset
from jointz.rig.sim.presets import preset as preset_named
from jointz.rig.sim.sensors.motion_sensors import known_of_sensors, own_clock, with_sensors
from jointz.rig.sim.simulated_devices import (
    SimulatedActuator,
    SimulatedFootswitch,
    SimulatedMoment,
    SimulatedMotionSensor,
    SimulatedSensor,
    Wiring,
)
from jointz.rig.sim.walking.gait_motion import ConditionShift, GaitMotion, draw_shift, knee_size_at
from jointz.rig.sim.walking.injection import Injection
from jointz.rig.sim.walking.known_addition import draw_addition
from jointz.rig.sim.walking.plant_build import Grid, PlantBuild, build_plant

#: A lab weighs the frame and measures where its centre is.
_FRAME_SD = 0.1


class SimulatedRig:
    """A rig whose truth is known.

    All randomness comes from the person's seed and number, the name of the
    condition and the number of the stretch: nothing else changes a sample.

    Parameters
    ----------
    person : Person
        Who walks.
    preset : Preset
        How well person and instruments behave. The rig keeps it with the person's own values.
    grid : Grid, optional
        Sample rate of all devices, steps of the physics; 500 Hz by default.
    speed_m_s : float, m/s
        Of the treadmill: faster strides are shorter in time and bend the knee more. The
        impedance at a phase of the cycle is the person's at any speed.
    zeroed : bool
        Whether the goniometer is zeroed when it is taped on; else it shows its own zero.
    sensors : collection of str, optional
        Sensors of the knee's motion: ``goniometer``, and with it ``encoder`` and ``gyroscopes``.
        By default those of the preset; what it lacks has the sensor's default settings.
    loads : mapping of str to LoadSpec, optional
        Condition -> its known addition to the knee; the true one is drawn within the stated sd.

    Attributes
    ----------
    inject : Injection
        What is to go wrong; nothing at first.
    """

    def __init__(
        self,
        person: Person,
        preset: Preset,
        *,
        grid: Grid | None = None,
        speed_m_s: float = REFERENCE_SPEED_M_S,
        zeroed: bool = True,
        sensors: Collection[str] | None = None,
        loads: Mapping[str, LoadSpec] | None = None,
    ) -> None:
        self.person = person
        self.preset = with_sensors(personal_preset(person, preset), sensors)
        self.grid = grid or Grid()
        self.speed_m_s = speed_m_s
        self.inject = Injection()
        self.loads = {
            name: draw_addition(spec, person, preset) for name, spec in (loads or {}).items()
        }
        self._angle_zero_rad = 0.0 if zeroed else draw_angle_zero(person, preset)

    @property
    def wearer(self) -> Wearer:
        """The participant."""
        return Wearer(self.person.id, self.person.mass_kg, self.person.height_m)

    @property
    def calibration(self) -> CalibrationSpec:
        """Gains, friction and frame as a laboratory knows them, with SD.

        The goniometer's lag was not measured; those of encoder and gyroscopes were where the preset
        says that they were synchronised.
        """
        gains = {
            "torque_gain": self.preset.actuator.gain_error_sd,
            "angle_gain": self.preset.goniometer.gain_error_sd,
            "friction_gain": self.preset.actuator.friction_error_sd,
        }
        entries = {name: Calibrated(value=1.0, sd=sd) for name, sd in gains.items() if sd > 0.0}
        body = self.preset.body
        if body is not None:
            frame = body.frame_mass_kg * body.frame_distance_m**2
            entries["intrinsic_inertia"] = Calibrated(value=frame, sd=_FRAME_SD * frame)
        entries |= known_of_sensors(self.person, self.preset)
        return CalibrationSpec(**entries)

    @property
    def device(self) -> DeviceSpec | None:
        """The exoskeleton's frame on the shank, where the preset gives it a body."""
        body = self.preset.body
        if body is None:
            return None
        return DeviceSpec(mass_kg=body.frame_mass_kg, centre_m=body.frame_distance_m)

    @property
    def coupling(self) -> str:
        """What the exoskeleton is coupled to the leg with: ``strap`` or ``rigid``."""
        return "rigid" if self.preset.body is None else "strap"

    def open(self, condition: str, *, worn: bool, segment: int, clock: Clock) -> Devices:
        """Return the devices, ``UNCONFIGURED``, for one uninterrupted stretch of a condition."""
        build = self.build(worn=worn, condition=condition)
        motion = self.motion(condition, segment)
        running = RunningPlant(build, motion, purpose=condition, segment=segment)
        wiring = Wiring(running, clock, self.inject)
        return Devices(
            angle=self._goniometer(wiring, goniometer(build)),
            contact=SimulatedFootswitch(wiring, running, footswitch(build)),
            actuator=SimulatedActuator(wiring, exoskeleton(build)) if build.worn else None,
            torque=SimulatedMoment(wiring, "torque", inverse_dynamics(build)),
            **self._motion_sensors(wiring, running.motion_channels, build),
        )

    def _motion_sensors(
        self, wiring: Wiring, channels: Collection[str], build: PlantBuild
    ) -> dict[str, Any]:
        """Return encoder and gyroscopes by channel; the encoder's clock is the actuator's."""
        own = own_clock(self.person, self.preset)
        return {
            name: SimulatedMotionSensor(
                wiring,
                motion_sensor(build, name),
                clock=(0.0, 0.0) if name == "joint_encoder" else own,
            )
            for name in channels
        }

    def _goniometer(self, wiring: Wiring, description: SensorDescription) -> SimulatedSensor:
        if self._angle_zero_rad == 0.0:
            return SimulatedSensor(wiring, "angle", description)
        return OffsetSensor(wiring, description, offset_rad=self._angle_zero_rad)

    def notes(self) -> Mapping[str, Any]:
        """Return preset, seed and grid, without the truth."""
        return {
            "simulated": True,
            "preset": self.preset.name,
            "seed": self.person.seed,
            "grid": asdict(self.grid),
        }

    def truth(
        self,
        condition: str,
        *,
        worn: bool,
        stretches: Sequence[Stretch],
        pulses: pd.DataFrame,
        shapes: Mapping[str, Pulse] | None = None,
        window_s: float = 0.1,
    ) -> dict[str, Any]:
        """Return the truth about a condition, ready for JSON.

        Parameters
        ----------
        condition : str
            Name of the protocol's condition.
        worn : bool
            Whether the exoskeleton was worn.
        stretches : sequence of Stretch
            Number, offset and end of each that was recorded.
        pulses : pandas.DataFrame
            Columns ``pulse, onset_s, duration_s, amplitude_nm, timing_point, completed``;
            times with the offset added.
        shapes : mapping of str to Pulse, optional
            Shape by its name, which stands in the column ``shape``; "" for the only one. Pulses of
            an unknown shape are holds.
        window_s : float, s
            From the onset: over which stiffness, damping and inertia are averaged.
        """
        return condition_truth(
            self.build(worn=worn, condition=condition),
            motions=[self.motion(condition, stretch.segment) for stretch in stretches],
            stretches=stretches,
            pulses=pulses,
            shapes=shapes or {},
            window_s=window_s,
        )

    def shift(self, condition: str) -> ConditionShift:
        """Return how the unperturbed knee of a condition differs from the person's."""
        return draw_shift(self.preset.gait, self.person.stream(f"shift {condition}"))

    def motion(self, condition: str, segment: int) -> GaitMotion:
        """Return the strides of one stretch, from the first on."""
        return GaitMotion(
            self.preset.gait,
            stride_time_s=self.person.stride_time_s * stride_time_ratio(self.speed_m_s),
            knee_size=knee_size_at(self.speed_m_s),
            shift=self.shift(condition),
            rng=self.person.stream(f"gait {condition}", segment),
            stumbles=self.inject.stumbles,
        )

    def build(self, *, worn: bool, condition: str = "") -> PlantBuild:
        """Return the constants of the plant, with the known addition of a condition."""
        load = self.loads.get(condition)
        return build_plant(self.person, self.preset, grid=self.grid, worn=worn, load=load)


def simulated_rig(
    number: int,
    *,
    preset: str = "nominal",
    seed: int = 1,
    sample_rate_hz: float = 500.0,
    speed_m_s: float = REFERENCE_SPEED_M_S,
    not_zeroed: Collection[str] = (),
    sensors: Collection[str] | None = None,
    loads: Mapping[str, LoadSpec] | None = None,
) -> SimulatedRig:
    """Return the rig of one participant of the seeded population.

    Parameters
    ----------
    number : int
        Of the participant, from 0.
    preset : str
        ``clean``, ``nominal``, ``hard``, ``anthropometric`` or ``realistic``.
    seed : int
        Of the population.
    sample_rate_hz : float, Hz
        Of all devices.
    speed_m_s : float, m/s
        Of the treadmill.
    not_zeroed : collection of str
        Ids of those whose goniometer shows its own zero.
    sensors : collection of str, optional
        ``goniometer``, and with it ``encoder`` and ``gyroscopes``; by default those of the preset,
        of which ``realistic`` has all and the others the goniometer.
    loads : mapping of str to LoadSpec, optional
        Condition -> its known addition to the knee.

    Examples
    --------
    >>> simulated_rig(0, preset="hard").wearer.id
    'S01'
    """
    person = draw_person(number, seed=seed)
    return SimulatedRig(
        person,
        preset_named(preset),
        grid=Grid(sample_rate_hz),
        speed_m_s=speed_m_s,
        zeroed=person.id not in not_zeroed,
        sensors=sensors,
        loads=loads,
    )
