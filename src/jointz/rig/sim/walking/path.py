"""The unperturbed path of the knee in one stride, compiled."""

import math

import numpy as np
from numba import njit

from jointz.rig.sim.walking.layout import HARMONICS, Gait

_TURN = 2.0 * math.pi


@njit(cache=True, nogil=True, error_model="numpy")
def phase_at(gait: np.ndarray, time_s: float) -> tuple[float, float, float]:
    """Return phase (cycles since the heel strike) and its two derivatives."""
    per_s = gait[Gait.RATE_HZ]
    u = (time_s - gait[Gait.START_S]) * per_s
    c1, c3 = gait[Gait.LINEAR], gait[Gait.CUBIC]
    c4, c5 = gait[Gait.QUARTIC], gait[Gait.QUINTIC]
    phase = u * (c1 + u * u * (c3 + u * (c4 + u * c5)))
    rate = c1 + u * u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5))
    bend = u * (6.0 * c3 + u * (12.0 * c4 + u * 20.0 * c5))
    return phase, rate * per_s, bend * per_s * per_s


@njit(cache=True, nogil=True, error_model="numpy")
def path(gait: np.ndarray, time_s: float) -> tuple[float, float, float]:
    """Return the unperturbed angle (rad), its rate and its acceleration."""
    phase, rate, bend = phase_at(gait, time_s)
    cosine_1, sine_1 = math.cos(_TURN * phase), math.sin(_TURN * phase)
    cosine, sine = 1.0, 0.0
    a0, a1, a2 = 0.0, 0.0, 0.0
    d0, d1, d2 = 0.0, 0.0, 0.0
    for h in range(HARMONICS):
        turn = _TURN * h
        p, q = gait[Gait.COSINES + h], gait[Gait.SINES + h]
        value = p * cosine + q * sine
        a0 += value
        a1 += turn * (q * cosine - p * sine)
        a2 -= turn * turn * value
        p, q = gait[Gait.COSINE_CHANGES + h], gait[Gait.SINE_CHANGES + h]
        value = p * cosine + q * sine
        d0 += value
        d1 += turn * (q * cosine - p * sine)
        d2 -= turn * turn * value
        cosine, sine = cosine * cosine_1 - sine * sine_1, sine * cosine_1 + cosine * sine_1
    w0 = phase * phase * phase * (10.0 + phase * (6.0 * phase - 15.0))
    w1 = 30.0 * phase * phase * (1.0 - phase) * (1.0 - phase)
    w2 = 60.0 * phase * (1.0 - phase) * (1.0 - 2.0 * phase)
    slope = a1 + w1 * d0 + w0 * d1
    curvature = a2 + w2 * d0 + 2.0 * w1 * d1 + w0 * d2
    return a0 + w0 * d0, slope * rate, curvature * rate * rate + slope * bend
