"""Choice of the sensors of the joint's motion, which judge each other by the motion of walking."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import xarray as xr

from jointz.core.channels import MOTION_SENSORS
from jointz.core.study import Calibrated
from jointz.gait.timestamps import rate_hz
from jointz.identify.preparation.calibration import value_of
from jointz.identify.preparation.raw_signals import (
    ENCODER,
    JOINT_VELOCITY,
    SHANK_VELOCITY,
    THIGH_VELOCITY,
    sensor_signal,
)
from jointz.identify.preparation.sources import Source

#: A sensor that is silent for longer is not used, share of the recording.
_LEAST_PRESENT = 0.95
#: Time over which sensors are averaged to be compared; usual gains over the goniometer, and sizes
#: of the shank's velocity over the joint's.
_COMPARED_S, _LIKE_GAINS, _SIZES = 0.02, (0.7, 1.4), (0.1, 5.0)
_CLOSE_GAINS = (0.85, 1.18)
#: A larger error is no gain, but a unit, a direction or another signal.
_GAINS = (0.2, 5.0)
#: Gains of sensors that agree, one over the other.
_AGREEING = 1.25
#: Sd of the goniometer's gain where it is taken from the other sensors, as a share.
_GAIN_SD = 0.1
_NEEDS_SHANK = "; it goes with shank_velocity"


@dataclass(frozen=True, slots=True)
class SensorChoice:
    """Sensors beside the goniometer that are used, and what contradicts them."""

    used: tuple[str, ...] = ()
    unused: tuple[str, ...] = ()  # channels that some recordings have
    # sensor that is left out -> its motion of walking over that of the goniometer
    odd: Mapping[str, float] = field(default_factory=dict)
    # gain of a goniometer that the other sensors contradict and that agree with each other
    goniometer_gain: float | None = None
    disagree: bool = False  # whether the sensors make two camps
    closely: bool = True  # whether the used ones show the goniometer's motion but for a sixth

    def notes(self) -> Iterator[str]:
        """Yield what a reader must know of sensors that are not used or not trusted."""
        for name in self.unused:
            gains = [g for sensor, g in self.odd.items() if sensor in (name, JOINT_VELOCITY)]
            shown = f" (it shows {gains[0]:.2f} of the goniometer's motion)" if gains else ""
            yield (
                f"{name} was not used{shown}. It must be in all recordings with pulses (and in "
                "those that unperturbed walking is learned from), alive for 95 % of each, and show "
                "the motion of the angle: check its unit and its direction"
                f"{_NEEDS_SHANK if name == 'thigh_velocity' else ''}."
            )
        if self.goniometer_gain is not None:
            others = " and ".join(map(_shown_name, self.used))
            yield (
                f"the angle shows {self.goniometer_gain:.2f} of the motion that "
                f"{others} show, which agree with each other: its gain was taken "
                "from them. Check the goniometer."
            )


def choose_sensors(sources: Sequence[Source]) -> SensorChoice:
    """Return the sensors that all recordings have, alive, and that agree with each other.

    If all but one agree, the odd one is left out; of a goniometer only the gain is.
    """
    present = _present(sources)
    gains = {name: [_gain(source, name) for source in sources] for name in present}
    like = {n for n, values in gains.items() if all(_between(v, _LIKE_GAINS) for v in values)}
    far = {
        name: float(np.median(values))
        for name, values in gains.items()
        if name not in like and all(_between(v, _GAINS) for v in values)
    }
    used, gain = tuple(n for n in present if n in like), None
    # Two gyroscopes are as many as goniometer and encoder.
    disagree = bool(far) and (not used or JOINT_VELOCITY in far)
    if len(far) > 1 and max(far.values()) <= _AGREEING * min(far.values()):
        used, gain, disagree = tuple(far), 1.0 / float(np.mean(list(far.values()))), False
    taken = {SHANK_VELOCITY, THIGH_VELOCITY} if JOINT_VELOCITY in used else set()
    left = [name for name in MOTION_SENSORS if name not in taken | set(used)]
    return SensorChoice(
        used=used,
        unused=tuple(n for n in left if any(n in s.input.recording for s in sources)),
        odd={name: value for name, value in far.items() if name not in used},
        goniometer_gain=gain,
        disagree=disagree,
        closely=all(_between(value, _CLOSE_GAINS) for name in used for value in gains[name]),
    )


def with_goniometer_gain(source: Source, gain: float) -> Source:
    """Return a recording whose angle has a gain that is known from other sensors."""
    entry = Calibrated(value=gain, sd=_GAIN_SD * gain)
    known = source.input.calibration.model_copy(update={"angle_gain": entry})
    return replace(source, input=replace(source.input, calibration=known))


def _shown_name(sensor: str) -> str:
    return f"{SHANK_VELOCITY} minus {THIGH_VELOCITY}" if sensor == JOINT_VELOCITY else sensor


def _between(value: float, limits: tuple[float, float]) -> bool:
    return limits[0] <= value <= limits[1]


def _present(sources: Sequence[Source]) -> list[str]:
    """Return the sensors that all recordings have, alive."""

    def everywhere(channel: str) -> bool:
        return bool(sources) and all(_measures(s.input.recording, channel) for s in sources)

    sensors = [ENCODER] if everywhere(ENCODER) else []
    if everywhere(SHANK_VELOCITY):
        sensors.append(JOINT_VELOCITY if everywhere(THIGH_VELOCITY) else SHANK_VELOCITY)
    return sensors


def _measures(recording: xr.Dataset, channel: str) -> bool:
    """Return whether a sensor was there and alive."""
    if channel not in recording:
        return False
    values = recording[channel].to_numpy()
    finite = np.isfinite(values)
    return bool(finite.mean() >= _LEAST_PRESENT and np.ptp(values[finite]) > 0.0)


def _gain(source: Source, name: str) -> float:
    """Return the motion that a sensor shows over the goniometer's; 0 if it cannot be compared.

    Walking moves the shank alone by another share of the joint's motion: that is 1 in any size.
    """
    recording, known = source.input.recording, source.input.calibration
    time, angle = recording["time"].to_numpy(), recording["angle"].to_numpy()
    if name == ENCODER and np.array_equal(recording[ENCODER].to_numpy(), angle, equal_nan=True):
        return 0.0  # the same sensor twice
    every = max(1, round(_COMPARED_S * rate_hz(time)))
    n = time.size // every
    if n < 2:
        return 0.0
    angle = angle / value_of(known.angle_gain, 1.0)
    rows = np.stack([time, angle, sensor_signal(source, name)])[:, : n * every]
    at, angle, shown = rows.reshape(3, n, every).mean(axis=2)
    motion = angle if name == ENCODER else np.gradient(angle, at)
    both = np.isfinite(motion) & np.isfinite(shown)
    motion, shown = (v[both] - v[both].mean() for v in (motion, shown))
    power = float(motion @ motion)
    if power == 0.0:
        return 0.0  # of a goniometer that shows no motion, no gain is known
    if name == SHANK_VELOCITY:
        return 1.0 if _between(np.sqrt(float(shown @ shown) / power), _SIZES) else 0.0
    return float(shown @ motion) / power
