"""Settings of the simulated sensors beside the goniometer: encoder and gyroscopes.

Ranges are drawn from uniformly, once for each person.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import radians

from jointz.core.errors import DataError

#: Sensors of the knee's motion that a simulated study can have; the first is always there.
SENSORS = ("goniometer", "encoder", "gyroscopes")
Range = tuple[float, float]


def _check(settings: object, numbers: Sequence[str], ranges: Sequence[str]) -> None:
    """Refuse negative numbers and ranges; None is none."""
    wrong = [
        f"{key} >= 0, got {value:g}"
        for key in numbers
        if not (value := getattr(settings, key) or 0.0) >= 0.0
    ]
    for key in ranges:
        low, high = getattr(settings, key) or (0.0, 0.0)
        if not 0.0 <= low <= high:
            wrong.append(f"{key} from low to high, 0 or more, got {low:g}..{high:g}")
    if wrong:
        raise DataError(f"{type(settings).__name__}: expected {'; '.join(wrong)}.")


@dataclass(frozen=True, slots=True)
class EncoderSettings:
    """An encoder at the joint of the exoskeleton: the knee's angle on the device's side of strap.

    Its gain is not 1 because the axes of device and knee are not one.
    """

    step_rad: float = radians(0.017)  # resolution; 0: none
    lag_range_s: Range = (0.0005, 0.002)  # s: range of the pure delay
    gain_error_sd: float = 0.01  # relative sd of the gain, also as known to the lab
    white_sd_rad: float = radians(0.01)  # white noise
    # s: sd of the lab's knowledge of the lag, once synchronised; None: the lag is not known
    synchronised_sd_s: float | None = 0.0005

    def __post_init__(self) -> None:
        numbers = ("step_rad", "gain_error_sd", "white_sd_rad", "synchronised_sd_s")
        _check(self, numbers, ("lag_range_s",))


@dataclass(frozen=True, slots=True)
class GyroscopeSettings:
    """Two gyroscopes, strapped to shank and thigh, that share one clock of their own.

    Soft tissue is a spring and a damper between bone and sensor, each gyroscope with its own.
    """

    lag_range_s: Range = (0.0, 0.005)  # s: range of the pure delay, the same for both
    gain_error_sd: float = 0.01  # relative sd of each gain, also as known to the lab
    white_sd_rad_s: float = radians(0.5)  # white noise
    bias_sd_rad_s: float = radians(0.5)  # slow drift of the zero
    bias_time_s: float = 100.0  # correlation time of that drift
    # Hz and damping ratio: resonance of a gyroscope on its tissue; None: rigid
    mount_range_hz: Range | None = (20.0, 60.0)
    mount_damping_range: Range = (0.2, 0.6)
    # s: sd of the lab's knowledge of the lags, once synchronised; None: they are not known
    synchronised_sd_s: float | None = 0.0005
    # of the clock by which a device tells its times: zero, and relative sd of its rate
    clock_zero_range_s: Range = (0.0, 1000.0)
    clock_rate_sd: float = 20e-6

    def __post_init__(self) -> None:
        numbers = ("gain_error_sd", "white_sd_rad_s", "bias_sd_rad_s", "synchronised_sd_s")
        ranges = ("lag_range_s", "mount_damping_range", "clock_zero_range_s", "mount_range_hz")
        _check(self, (*numbers, "clock_rate_sd"), ranges)
        if not self.bias_time_s > 0.0 or (self.mount_range_hz and self.mount_range_hz[0] <= 0.0):
            raise DataError("GyroscopeSettings: expected bias_time_s > 0 and mount_range_hz > 0.")


def checked_sensors(sensors: Iterable[str]) -> tuple[str, ...]:
    """Return names of sensors in the order of :data:`SENSORS`, each once.

    Raises DataError if one is unknown, or without the goniometer: it times and limits pulses.
    """
    wanted = set(sensors)
    if not {SENSORS[0]} <= wanted <= set(SENSORS):
        raise DataError(
            f"sensors: expected {SENSORS[0]}, and with it any of {', '.join(SENSORS[1:])}; got "
            f"{', '.join(sorted(wanted)) or 'none'}."
        )
    return tuple(name for name in SENSORS if name in wanted)
