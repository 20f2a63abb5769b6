"""Warnings about a fitted torque model, and what to do about them."""

from collections.abc import Iterator

import numpy as np

from jointz.identify.actuators.actuator_record import ActuatorRecord, velocity_noise
from jointz.identify.actuators.actuator_terms import Terms, rest_share
from jointz.identify.record.block_regression import BlockRegression

#: Torque constants of motors in robot joints and exoskeletons, N*m/A on the motor's side.
PLAUSIBLE_TORQUE_CONSTANT = (0.02, 0.5)
#: Inertia of such motors, kg*m^2 on the motor's side, and the fastest that their outputs turn.
PLAUSIBLE_ROTOR_INERTIA = (1e-7, 1e-2)
FASTEST_OUTPUT_RAD_S = 30.0
#: Above this share of noise in a differenced speed the bias of the inertia is told.
_NOTED_NOISE_SHARE = 0.01
#: Above this share of samples at rest static friction is in the fit; above that one of samples
#: whose speed is smaller than its noise their sign is a guess too often.
_NOTED_REST_SHARE = 0.1
_NOTED_GUESSED_SHARE = 0.01
_FRICTIONS = ("viscous_friction", "coulomb_friction")
_PROPORTIONAL = 1e-9


def explains_nothing(fit: BlockRegression) -> bool:
    """Tell whether the current explains none of the torque."""
    if fit.is_saturated:
        return False
    low, high = fit.interval("torque_constant")
    return low <= 0.0 <= high


def actuator_warnings(
    record: ActuatorRecord, terms: Terms, fit: BlockRegression, *, gear_ratio: float
) -> Iterator[str]:
    """Yield all that a reader of the numbers must know."""
    if fit.doubt:
        missing = "there are no values" if fit.is_saturated else "the values have no interval"
        yield f"undecided, {missing}: {fit.doubt}"
    if record.n_gaps:
        yield f"time has {record.n_gaps} gap(s) and is left out: only an inertia would need it"
    if fit.caution:
        yield fit.caution
    for name, why in terms.left_out.items():
        yield f"{name} is undecided: {why}"
    if record.velocity is not None:
        yield from _on_speed(record.velocity, fit)
    if not fit.is_saturated:
        yield from _on_constant(fit)
        if not fit.doubt:
            yield from _on_signs(record, fit)
        if "rotor_inertia" in fit.names:
            yield from _on_inertia(record, fit, gear_ratio)


def _on_constant(fit: BlockRegression) -> Iterator[str]:
    """Judge the torque constant: its sign, and whether a motor has such a one."""
    value, (low, high) = fit.value("torque_constant"), PLAUSIBLE_TORQUE_CONSTANT
    if explains_nothing(fit):
        lowest, highest = fit.interval("torque_constant")
        yield (
            f"torque_constant is undecided: its interval, {lowest:.2g} to {highest:.2g} N*m/A, "
            "holds zero: the current explains none of the torque. Check both columns"
        )
    elif value < 0.0 and not fit.doubt:
        yield (
            f"the torque constant is negative ({value:.3g} N*m/A): the sensor counts against the "
            "current. Turn it with torque_sign -1 (--torque-sign -1), or 1 if it was -1"
        )
    elif not low <= value <= high:
        yield (
            f"the torque constant of {value:.3g} N*m/A is implausible: motors of robot joints have "
            f"{low:g} to {high:g} N*m/A. Check gear_ratio and the units of current and torque; if "
            "the motor's data sheet agrees, all is well"
        )


def _is_current(record: ActuatorRecord) -> bool:
    """Tell whether the torque is a multiple of the current but for rounding."""
    torque = record.torque - record.torque.mean()
    current = record.current - record.current.mean()
    rest = torque - current * float(torque @ current) / float(current @ current)
    return bool(np.linalg.norm(rest) <= _PROPORTIONAL * np.linalg.norm(torque))


def _on_signs(record: ActuatorRecord, fit: BlockRegression) -> Iterator[str]:
    if _is_current(record):
        yield (
            "the torque is the current times a number: one and the same signal, or a torque that "
            "was computed. Give the torque sensor's column"
        )
        return
    if fit.value("torque_constant") <= 0.0:
        return
    for name in _FRICTIONS:
        if name not in fit.names or fit.value(name) >= 0.0:
            continue
        if fit.interval(name)[1] < 0.0:
            yield (
                f"{name} is negative: the speed counts against the current. Turn the sign of the "
                "speed"
            )
        else:
            yield (
                f"{name} is negative ({fit.value(name):.2g}), which no friction is, though "
                "its interval reaches zero: the record hardly tells it, or something moves the "
                "torque that the model lacks. Check the columns of speed and torque"
            )


def _on_speed(velocity: np.ndarray, fit: BlockRegression) -> Iterator[str]:
    speed = np.abs(velocity)
    fastest = float(np.quantile(speed, 0.95))
    if fastest > FASTEST_OUTPUT_RAD_S:
        yield (
            f"the speed reaches {fastest:.3g} rad/s, faster than outputs of joint actuators turn "
            f"({FASTEST_OUTPUT_RAD_S:g} rad/s): is it the motor's, before the gear, or in deg/s or "
            "rpm? Viscous friction and inertia go with it. Give the unit (COL:deg/s), or the "
            "output's speed"
        )
    if "coulomb_friction" not in fit.names:
        return
    at_rest = rest_share(velocity)
    if at_rest > _NOTED_REST_SHARE:
        yield (
            f"{100 * at_rest:.0f} % of the samples stand nearly still: friction there is whatever "
            "holds, which the model has not, so torque_constant and friction read low. Leave these "
            "samples out, or keep the output moving"
        )
    guessed = float(np.mean((speed < velocity_noise(velocity)) & (speed > 0.0)))
    if guessed > _NOTED_GUESSED_SHARE:
        yield (
            f"at {100 * guessed:.1f} % of the samples the speed is smaller than its noise and its "
            "sign a guess: coulomb_friction may read low by up to as much. Filter the speed, or "
            "move faster"
        )


def _on_inertia(record: ActuatorRecord, fit: BlockRegression, gear_ratio: float) -> Iterator[str]:
    noise = record.acceleration_noise_share
    if noise > _NOTED_NOISE_SHARE:
        yield (
            f"the acceleration is a difference of the speed, about {100 * noise:.0f} % of its "
            "variance is noise: rotor_inertia reads low by about as much"
        )
    at_motor = fit.value("rotor_inertia") / gear_ratio**2
    low, high = PLAUSIBLE_ROTOR_INERTIA
    if not fit.doubt and not low <= at_motor <= high:
        yield (
            f"the rotor inertia of {at_motor:.2g} kg*m^2 at the motor is implausible: motors of "
            f"robot joints have {low:g} to {high:g} kg*m^2. Check rate, the units of speed and "
            "time, and gear_ratio"
        )
