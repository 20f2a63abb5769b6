"""What is doubtful about a fitted torque model, and what to do about it."""

import numpy as np

from jointz.identify.actuators.actuator_record import ActuatorRecord, velocity_noise
from jointz.identify.actuators.actuator_regression import Regression
from jointz.identify.actuators.actuator_terms import Terms, rest_share

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


def explains_nothing(regression: Regression) -> bool:
    """Tell whether the current explains none of the torque."""
    if regression.is_saturated:
        return False
    low, high = regression.interval("torque_constant")
    return low <= 0.0 <= high


def notes(
    record: ActuatorRecord, terms: Terms, regression: Regression, *, gear_ratio: float
) -> tuple[str, ...]:
    """Return all that a reader of the numbers must know."""
    found = []
    if regression.doubt:
        missing = (
            "there are no values" if regression.is_saturated else "the values have no interval"
        )
        found.append(f"undecided, {missing}: {regression.doubt}")
    found += [regression.caution] if regression.caution else []
    found += [f"{name} is undecided: {why}" for name, why in terms.left_out.items()]
    found += _on_speed(record, regression)
    if not regression.is_saturated:
        found += _on_constant(regression)
        found += _on_signs(record, regression)
        found += _on_inertia(record, regression, gear_ratio)
    return tuple(found)


def _on_constant(regression: Regression) -> list[str]:
    """Judge the torque constant: its sign, and whether a motor has such a one."""
    if explains_nothing(regression):
        low, high = regression.interval("torque_constant")
        return [
            f"torque_constant is undecided: its interval, {low:.2g} to {high:.2g} N*m/A, holds "
            "zero: the current explains none of the torque. Check both columns"
        ]
    found = []
    value = regression.value("torque_constant")
    low, high = PLAUSIBLE_TORQUE_CONSTANT
    if value < 0.0 and not regression.doubt:
        found.append(
            f"the torque constant is negative ({value:.3g} N*m/A): the sensor counts against the "
            "current. Turn it with torque_sign -1 (--torque-sign -1), or 1 if it was -1"
        )
    elif not low <= value <= high:
        found.append(
            f"the torque constant of {value:.3g} N*m/A is implausible: motors of robot joints have "
            f"{low:g} to {high:g} N*m/A. Check gear_ratio and the units of current and torque; if "
            "the motor's data sheet agrees, all is well"
        )
    return found


def _is_current(record: ActuatorRecord) -> bool:
    """Tell whether the torque is a multiple of the current but for rounding."""
    torque = record.torque - record.torque.mean()
    current = record.current - record.current.mean()
    rest = torque - current * float(torque @ current) / float(current @ current)
    return bool(np.linalg.norm(rest) <= _PROPORTIONAL * np.linalg.norm(torque))


def _on_signs(record: ActuatorRecord, regression: Regression) -> list[str]:
    if regression.doubt:
        return []
    if _is_current(record):
        return [
            "the torque is the current times a number: one and the same signal, or a torque that "
            "was computed. Give the torque sensor's column"
        ]
    if regression.value("torque_constant") <= 0.0:
        return []
    found = []
    for name in _FRICTIONS:
        if name not in regression.names or regression.value(name) >= 0.0:
            continue
        if regression.interval(name)[1] < 0.0:
            found.append(
                f"{name} is negative: the speed counts against the current. Turn the sign of the "
                "speed"
            )
        else:
            found.append(
                f"{name} is negative ({regression.value(name):.2g}), which no friction is, though "
                "its interval reaches zero: the record hardly tells it, or something moves the "
                "torque that the model lacks. Check the columns of speed and torque"
            )
    return found


def _on_speed(record: ActuatorRecord, regression: Regression) -> list[str]:
    if record.velocity is None:
        return []
    found = []
    speed = np.abs(record.velocity)
    fastest = float(np.quantile(speed, 0.95))
    if fastest > FASTEST_OUTPUT_RAD_S:
        found.append(
            f"the speed reaches {fastest:.3g} rad/s, faster than outputs of joint actuators turn "
            f"({FASTEST_OUTPUT_RAD_S:g} rad/s): is it the motor's, before the gear, or in deg/s or "
            "rpm? Viscous friction and inertia go with it. Give the unit (COL:deg/s), or the "
            "output's speed"
        )
    if "coulomb_friction" not in regression.names:
        return found
    at_rest = rest_share(record.velocity)
    if at_rest > _NOTED_REST_SHARE:
        found.append(
            f"{100 * at_rest:.0f} % of the samples stand nearly still: friction there is whatever "
            "holds, which the model has not, so torque_constant and friction read low. Leave these "
            "samples out, or keep the output moving"
        )
    guessed = float(np.mean((speed < velocity_noise(record.velocity)) & (speed > 0.0)))
    if guessed > _NOTED_GUESSED_SHARE:
        found.append(
            f"at {100 * guessed:.1f} % of the samples the speed is smaller than its noise and its "
            "sign a guess: coulomb_friction may read low by up to as much. Filter the speed, or "
            "move faster"
        )
    return found


def _on_inertia(record: ActuatorRecord, regression: Regression, gear_ratio: float) -> list[str]:
    if "rotor_inertia" not in regression.names:
        return []
    found = []
    noise = record.acceleration_noise_share
    if noise > _NOTED_NOISE_SHARE:
        found.append(
            f"the acceleration is a difference of the speed, about {100 * noise:.0f} % of its "
            "variance is noise: rotor_inertia reads low by about as much"
        )
    at_motor = regression.value("rotor_inertia") / gear_ratio**2
    low, high = PLAUSIBLE_ROTOR_INERTIA
    if not regression.doubt and not low <= at_motor <= high:
        found.append(
            f"the rotor inertia of {at_motor:.2g} kg*m^2 at the motor is implausible: motors of "
            f"robot joints have {low:g} to {high:g} kg*m^2. Check rate, the units of speed and "
            "time, and gear_ratio"
        )
    return found
