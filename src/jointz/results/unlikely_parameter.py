"""Parameters of leg and instruments that contradict what was known of them, with remedies."""

from dataclasses import dataclass
from typing import Final

_LAG: Final = "measure the lag anew (jointz calibrate) and enter it under [calibration]"
_GAIN: Final = "calibrate the gain of this sensor and enter it under [calibration]"
_FIX: Final = "fix the sensor better, or state the resonance of its mount under [priors]"
_STRAP: Final = "check coupling in study.toml; measure strap and tissue, and enter them in [priors]"
_REFLEX: Final = "use pulses of both directions; check that muscles were as active in all strides"
_BODY: Final = "check mass_kg, height_m, the unit of the torque, and that a strap holds the device"
_LOOK: Final = "look at the responses: jointz explore"
#: Begin of a name under ``[priors]`` or ``[calibration]`` -> remedy; the first that fits.
_REMEDIES: Final = {
    "angle_lag": _LAG,
    "sensor_": _LAG,
    "encoder_delay": _LAG,
    "gyroscope_delay": _LAG,
    "goniometer_gain": _GAIN,
    "encoder_gain": _GAIN,
    "gyroscope_gain": _GAIN,
    "goniometer_": _FIX,
    "shank_": _FIX,
    "thigh_": _FIX,
    "device_share": _STRAP,
    "strap_": _STRAP,
    "skin_share": _STRAP,
    "half_angle": "use pulses of several sizes; check that the joint meets no stop",
    "reflex_": _REFLEX,
    "friction": "measure the torque, or the friction of the actuator on a bench",
    "torque_error": "calibrate the gain of the torque and enter it under [calibration]",
    "inertia": _BODY,
}


@dataclass(frozen=True, slots=True)
class UnlikelyParameter:
    """A parameter of instruments or leg that is far from what was known before the data."""

    # as ``[priors]`` or ``[calibration]`` names it; ``inertia`` and ``inertia_of_point`` are those
    # of leg and device, the mean over timing points and the farthest
    name: str
    value: float  # what the responses need, SI
    expected: float  # median of prior or calibration, SI
    low: float  # lower end of its 95 % interval, SI
    high: float  # upper end, SI
    sds: float  # standard deviations that the value is off, on the scale of the prior

    @property
    def remedy(self) -> str:
        """Measurement or check that may resolve the contradiction."""
        return next((r for begin, r in _REMEDIES.items() if self.name.startswith(begin)), _LOOK)

    @property
    def advice(self) -> str:
        """The contradiction in a sentence, with its remedy."""
        return f"{self}; {self.remedy}"

    def __str__(self) -> str:
        return (
            f"{self.name} is {self.value:.3g}, expected {self.expected:.3g} "
            f"({self.low:.3g} to {self.high:.3g}): {self.sds:.1f} SDs off"
        )
