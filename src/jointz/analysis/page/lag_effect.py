"""Effect of a lag of the angle on a fit that treats angle and torque as simultaneous."""

import numpy as np

from jointz.kernels.filtering import lowpass_zero_phase
from jointz.results.estimates import Response

# The low-pass needs a few periods of its cut-off; the pulse continues after the window.
_MARGIN_S = 0.3
_STEP_S = 1e-3


def fit_with_lag(
    response: Response,
    impedance: tuple[float, float, float],
    *,
    lag_s: float,
    cutoff_hz: float,
    window_s: float,
) -> tuple[float, float, float]:
    """Return the K, B, J that a regression gives if the angle is late and nothing else is wrong.

    The joint is linear and at rest, the lag a pure delay, and there is no noise; torque is
    regressed on angle, velocity and acceleration (4.2). After the low-pass of 20 Hz a sensor with a
    time constant differs little from a delay.
    """
    from scipy.optimize import nnls
    from scipy.signal import lsim

    stiffness, damping, inertia = impedance
    end_s = float(response.time_s[-1])
    time = np.arange(-_MARGIN_S, end_s + _MARGIN_S, _STEP_S)
    torque = np.interp(time, response.time_s, response.torque, left=0.0)
    _, angle, _ = lsim(([1.0], [inertia, damping, stiffness]), torque, time - time[0])
    seen = np.interp(time - lag_s, time, angle, left=0.0)
    smooth_angle, smooth_torque = (
        lowpass_zero_phase(x, cutoff_hz=cutoff_hz, rate_hz=1.0 / _STEP_S) for x in (seen, torque)
    )
    velocity = np.gradient(smooth_angle, _STEP_S)
    motion = np.column_stack([smooth_angle, velocity, np.gradient(velocity, _STEP_S)])
    inside = (time >= -0.5 * _STEP_S) & (time <= window_s + 0.5 * _STEP_S)
    scale = np.abs(motion[inside]).max(axis=0)
    scaled, _ = nnls(motion[inside] / scale, smooth_torque[inside])
    k, b, j = scaled / scale
    return float(k), float(b), float(j)
