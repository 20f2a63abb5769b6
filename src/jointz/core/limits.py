"""Safety limits: a device states its own, a protocol can only tighten them."""

from collections.abc import Iterator
from typing import Annotated

from pydantic import Field

from jointz.core.checked_model import Check, CheckedModel, Problem
from jointz.core.errors import ProtocolError

Positive = Annotated[float, Field(gt=0)]
#: A stop lasts as long as the fade; 50 for 0.05 would leave torque on for most of a minute.
Moment = Annotated[float, Field(gt=0, le=1)]
#: A knee that a pulse moves by more than this is not near where it would be without.
Displacement = Annotated[float, Field(gt=0, le=1)]
#: Pulses may fill their share of the last so many seconds.
DUTY_WINDOW_S = 10.0
#: After a command of zero the joint moves on for a while; a displacement is judged by where it
#: would be after so long at its present rate. The torque goes on for 18 ms: the actuator answers
#: 6 ms late with a time constant of 12 ms. Then a leg of J = 0.3 kg*m^2, K = 70 N*m/rad and
#: B = 2.6 N*m*s/rad (means of adults over the gait cycle) coasts. Pushed from rest it stops after
#: its velocity times exp(-z * acos(z) / sqrt(1 - z^2)) / w, w = sqrt(K / J), z = B / (2 sqrt(K J)):
#: 45 ms.
ACTUATOR_LATE_S = 0.018
LOOK_AHEAD_S = ACTUATOR_LATE_S + 0.045


class SafetyLimits(CheckedModel):
    """Limits on requests, which are clamped, and on measurements, which trip the gate.

    Torque, its rate and current bound what is sent to the device. Posture,
    velocity, temperature and the age of samples are measured. A pulse's count
    and duty bound what a wearer is exposed to. The displacement by a pulse, in
    walking, has a limit only where one is given.
    """

    torque_nm: Positive
    torque_rate_nm_s: Positive
    current_a: Positive
    angle_min_rad: float
    angle_max_rad: float
    velocity_rad_s: Annotated[float, Field(gt=0, le=200)]
    temperature_c: Annotated[float, Field(gt=0, le=200)]
    sensor_age_s: Moment
    pulse_count: Annotated[int, Field(gt=0)]
    pulse_duty: Annotated[float, Field(gt=0, le=1)]
    consecutive_overruns: Annotated[int, Field(gt=0, le=100)]
    fade_s: Moment
    displacement_rad: Displacement | None = None

    def checks(self) -> tuple[Check, ...]:
        """Return the checks between limits."""
        return (lambda: _posture_problems(self.angle_min_rad, self.angle_max_rad),)


class LimitsOverride(CheckedModel):
    """The limits a protocol tightens; what it leaves out stays as the device has it."""

    torque_nm: Positive | None = None
    torque_rate_nm_s: Positive | None = None
    current_a: Positive | None = None
    angle_min_rad: float | None = None
    angle_max_rad: float | None = None
    velocity_rad_s: Positive | None = None
    temperature_c: Positive | None = None
    sensor_age_s: Positive | None = None
    pulse_count: Annotated[int, Field(gt=0)] | None = None
    pulse_duty: Annotated[float, Field(gt=0, le=1)] | None = None
    consecutive_overruns: Annotated[int, Field(gt=0)] | None = None
    fade_s: Positive | None = None
    displacement_rad: Displacement | None = None

    def checks(self) -> tuple[Check, ...]:
        """Return the checks between limits."""
        return (lambda: _posture_problems(self.angle_min_rad, self.angle_max_rad),)


def tightened(limits: SafetyLimits, override: LimitsOverride) -> SafetyLimits:
    """Return a device's limits with those that a protocol tightens."""
    values = override.model_dump(exclude_none=True)
    problems = [
        f"safety.{name}: {value:g} is looser than the device's own {getattr(limits, name):g}. "
        "A protocol can only tighten a limit."
        for name, value in values.items()
        if _looser(name, value, getattr(limits, name))
    ]
    together = {**limits.model_dump(), **values}
    problems += [
        f"safety.{p.key[0]}: {p.message} The device's own range is {limits.angle_min_rad:g} to "
        f"{limits.angle_max_rad:g} rad."
        for p in _posture_problems(together["angle_min_rad"], together["angle_max_rad"])
    ]
    if problems:
        raise ProtocolError("safety", problems)
    return SafetyLimits.model_validate(together)


def _looser(name: str, value: float, device_limit: float | None) -> bool:
    if device_limit is None:  # the device has no such limit
        return False
    return value < device_limit if name == "angle_min_rad" else value > device_limit


def _posture_problems(lowest: float | None, highest: float | None) -> Iterator[Problem]:
    if lowest is not None and highest is not None and lowest >= highest:
        yield Problem(
            ("angle_min_rad",),
            f"expected less than angle_max_rad = {highest:g} rad, got {lowest:g} rad.",
        )
