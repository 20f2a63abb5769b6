"""The exact recursion from torque to angle of a second-order joint, and its noise.

Compiled pieces of :mod:`jointz.kernels.series.second_order`.
"""

import numpy as np
from numba import njit

BAND = 3  # of the covariance: the recursion spans three samples
_TAYLOR_TERMS = 40
#: Torque samples on either side that a lag between samples takes in. The gain is within 1e-4 up
#: to a quarter of the sampling rate, within 4e-4 up to 0.4 of it.
REACH = 16


@njit(cache=True, nogil=True)
def transfer_coefficients(
    stiffness: float, damping: float, inertia: float, step_s: float
) -> np.ndarray:
    """Return a1, a2, b0, b1, b2 of the exact recursion from torque to angle.

    Returns (5,): of angle[k] + a1 angle[k-1] + a2 angle[k-2] = b0 torque[k] + b1 torque[k-1] + b2
    torque[k-2], with the torque straight between samples.
    """
    k = stiffness * step_s**2 / inertia
    b = damping * step_s / inertia
    # Row by row: power of the matrix over i!, and the sums over i!, (i+1)!, (i+2)!.
    p00, p01, p10, p11 = 1.0, 0.0, 0.0, 1.0
    e00, e01, e10, e11 = 0.0, 0.0, 0.0, 0.0
    f01, f11, g01, g11 = 0.0, 0.0, 0.0, 0.0
    for i in range(_TAYLOR_TERMS):
        e00, e01, e10, e11 = e00 + p00, e01 + p01, e10 + p10, e11 + p11
        f01, f11 = f01 + p01 / (i + 1), f11 + p11 / (i + 1)
        g01, g11 = g01 + p01 / ((i + 1) * (i + 2)), g11 + p11 / ((i + 1) * (i + 2))
        q00, q01 = -k * p01, p00 - b * p01
        q10, q11 = -k * p11, p10 - b * p11
        p00, p01, p10, p11 = q00 / (i + 1), q01 / (i + 1), q10 / (i + 1), q11 / (i + 1)
    gain = step_s**2 / inertia
    late0, late1 = gain * g01, gain * g11
    early0, early1 = gain * f01 - late0, gain * f11 - late1
    out = np.empty(5)
    out[0] = -(e00 + e11)
    out[1] = e00 * e11 - e01 * e10
    out[2] = late0
    out[3] = early0 - e11 * late0 + e01 * late1
    out[4] = -e11 * early0 + e01 * early1
    return out


@njit(cache=True, nogil=True)
def whiten(residual: np.ndarray, band: np.ndarray) -> bool:
    """Solve L w = residual in place, L the Cholesky factor of the banded covariance.

    ``residual`` (n,): becomes w; ``band`` (n, 3): the covariance of a row with itself and the two
    before it. Returns false where the covariance is not positive definite.
    """
    n = residual.size
    for k in range(n):
        for m in range(min(k, BAND - 1), -1, -1):
            total = band[k, m]
            for s in range(m + 1, min(k, BAND - 1) + 1):
                total -= band[k, s] * band[k - m, s - m]
            if m > 0:
                band[k, m] = total / band[k - m, 0]
            elif total <= 0.0:
                return False
            else:
                band[k, 0] = np.sqrt(total)
        value = residual[k]
        for m in range(1, min(k, BAND - 1) + 1):
            value -= band[k, m] * residual[k - m]
        residual[k] = value / band[k, 0]
    return True


@njit(cache=True, nogil=True)
def interpolated(torque: np.ndarray, at: float, n: int) -> np.ndarray:
    """Return samples of the torque from a place between its samples.

    ``torque`` (m,) N*m: beyond its ends it stays as it is there; ``at``: place of the first, in
    samples; ``n``: how many.
    """
    whole = int(np.floor(at))
    taps = np.empty(2 * REACH)
    for j in range(taps.size):
        x = at - whole + REACH - 1 - j
        turn = np.pi * x / REACH
        taps[j] = np.sinc(x) * (0.42 + 0.5 * np.cos(turn) + 0.08 * np.cos(2.0 * turn))
    taps /= taps.sum()
    first = whole - REACH + 1
    held = np.empty(n + taps.size)
    for i in range(held.size):
        held[i] = torque[min(max(first + i, 0), torque.size - 1)]
    out = np.zeros(n)
    for j in range(taps.size):
        out += taps[j] * held[j : j + n]
    return out


@njit(cache=True, nogil=True)
def recursion_error(
    angle: np.ndarray, torque: np.ndarray, taps: np.ndarray, first: int
) -> np.ndarray:
    """Return the recursion's left minus right side, samples before the window being zero.

    ``angle``, ``torque`` (n,): rad, N*m; ``taps`` (2, 3): factors of angle and torque, from
    :func:`transfer_coefficients`; ``first``: rows left out at the beginning.
    """
    out = np.zeros(angle.size - first)
    for k in range(first, angle.size):
        for i in range(min(k, BAND - 1) + 1):
            out[k - first] += taps[0, i] * angle[k - i] - taps[1, i] * torque[k - i]
    return out


@njit(cache=True, nogil=True)
def covariance_band(
    n: int, first: int, taps: np.ndarray, variances: tuple[float, float]
) -> np.ndarray:
    """Return (n - first, 3): covariance of a row with itself and the two before it.

    ``n``, ``first``: samples, and rows left out at the beginning; ``taps`` (2, 3): factors of
    angle and torque, from :func:`transfer_coefficients`; ``variances`` (float, float): of the white
    noise of angle (rad^2) and torque (N^2 m^2).
    """
    band = np.zeros((n - first, BAND))
    for k in range(first, n):
        if k > first + BAND and k > BAND:  # from here on every row is the same
            band[k - first] = band[k - first - 1]
            continue
        for m in range(min(k - first, BAND - 1) + 1):
            angle_part, torque_part = 0.0, 0.0
            for i in range(min(k - m, BAND - 1 - m) + 1):
                angle_part += taps[0, i] * taps[0, i + m]
                torque_part += taps[1, i] * taps[1, i + m]
            band[k - first, m] = variances[0] * angle_part + variances[1] * torque_part
    return band
