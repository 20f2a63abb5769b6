r"""Motion that the current alone would give an actuator against a spring.

:math:`k\theta + F(t)\tanh(\dot\theta/v_0) = \tau(t)`, without the error of the torque that moves
the measured angle too: an instrument for the direction of the motion. It need not be exact.
"""

from math import tanh

import numpy as np

_STEP_S = 0.01
_SMALL_RAD = 1e-9
_PASSES = 30


def driven_velocity(
    time: np.ndarray,
    drive: np.ndarray,
    friction: np.ndarray,
    *,
    stiffness: float,
    smooth_rad_s: float,
) -> np.ndarray:
    """Return the velocity that torque and friction give, rad/s."""
    grid = np.arange(time[0], time[-1] + _STEP_S, _STEP_S)
    pulls, holds = (np.interp(grid, time, values).tolist() for values in (drive, friction))
    angle, velocity = pulls[0] / stiffness, []
    for pull, hold in zip(pulls, holds, strict=True):
        step = _step(pull - stiffness * angle, hold, stiffness, _STEP_S * smooth_rad_s)
        angle += step
        velocity.append(step / _STEP_S)
    return np.asarray(np.interp(time, grid, velocity))


def _step(pull: float, hold: float, stiffness: float, smooth_rad: float) -> float:
    """Return the root of ``stiffness * x + hold * tanh(x / smooth_rad) = pull``.

    By Newton's method from zero, of the size: there the left side is steepest, so that no step
    passes the root.
    """
    x, size = 0.0, abs(pull)
    for _ in range(_PASSES):
        share = tanh(x / smooth_rad)
        slope = stiffness + hold * (1.0 - share**2) / smooth_rad
        change = (size - stiffness * x - hold * share) / slope
        x += change
        if change < _SMALL_RAD:
            break
    return x if pull > 0.0 else -x
