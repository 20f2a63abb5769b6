r"""How a joint at rest beside its path answers a torque, as a late sensor shows it, compiled.

:math:`J\ddot x + B(t)\dot x + K(t)x = \tau(t)` with K, B and J straight lines in time, solved by
Runge and Kutta's fourth-order method under torque that is linear between samples. The derivative
of x with respect to a parameter obeys the same equation, driven by minus what the parameter is
multiplied by (Tomovic and Vukobratovic 1972, sensitivity equations), and is solved beside it. The
sensor - a second-order resonance, a first-order lag and a delay, each of which may be absent - is
linear and the same for all of them.
"""

import numpy as np
from numba import njit

#: Columns of the motion: x, then its derivatives with respect to these.
MOTION, STIFFNESS, STIFFNESS_SLOPE, DAMPING, DAMPING_SLOPE, INERTIA, INERTIA_SLOPE, SHARE = range(8)
COLUMNS = 8
#: A first-order lag shorter than this share of a step does nothing.
_INSTANT = 1e-3


@njit(cache=True, nogil=True, error_model="numpy")
def joint_motion(
    torque: np.ndarray,
    share: float,
    impedance: np.ndarray,
    middle_s: np.ndarray,
    period_s: float,
    substeps: int,
) -> np.ndarray:
    """Return the motion of a joint from rest and its derivatives.

    ``torque`` (2, n) N*m at the samples, ``share`` of its second row in it; ``impedance`` (6,): K,
    its slope, B, its slope, J, its slope, with the values at ``middle_s`` (3,). ``substeps``: steps
    from one sample to the next. Returns ((n - 1) * substeps + 1, 8): the angle in rad, its
    derivatives with respect to the six and to ``share``.
    """
    n = torque.shape[1]
    h = period_s / substeps
    out = np.zeros(((n - 1) * substeps + 1, COLUMNS))
    x, v = np.zeros(COLUMNS), np.zeros(COLUMNS)
    to_x, to_v = np.zeros((4, COLUMNS)), np.zeros((4, COLUMNS))
    for i in range(n - 1):
        for step in range(substeps):
            for stage in range(4):
                part = 0.0 if stage == 0 else (0.5 if stage < 3 else 1.0)
                u = (step + part) / substeps
                t = (i + u) * period_s
                known = torque[0, i] + u * (torque[0, i + 1] - torque[0, i])
                counted = torque[1, i] + u * (torque[1, i + 1] - torque[1, i])
                since_K, since_B, since_J = t - middle_s[0], t - middle_s[1], t - middle_s[2]
                K = impedance[0] + impedance[1] * since_K
                B = impedance[2] + impedance[3] * since_B
                J = impedance[4] + impedance[5] * since_J
                back = part * h
                angle, rate = x[0], v[0]
                if stage > 0:
                    angle += back * to_x[stage - 1, 0]
                    rate += back * to_v[stage - 1, 0]
                total = known + share * counted
                bend = (total - B * rate - K * angle) / J
                drives = (
                    total,
                    -angle,
                    -angle * since_K,
                    -rate,
                    -rate * since_B,
                    -bend,
                    -bend * since_J,
                    counted,
                )
                for j in range(COLUMNS):
                    xj, vj = x[j], v[j]
                    if stage > 0:
                        xj += back * to_x[stage - 1, j]
                        vj += back * to_v[stage - 1, j]
                    to_x[stage, j] = vj
                    to_v[stage, j] = (drives[j] - B * vj - K * xj) / J
            row = i * substeps + step + 1
            for j in range(COLUMNS):
                x[j] += h / 6.0 * (to_x[0, j] + 2.0 * (to_x[1, j] + to_x[2, j]) + to_x[3, j])
                v[j] += h / 6.0 * (to_v[0, j] + 2.0 * (to_v[1, j] + to_v[2, j]) + to_v[3, j])
                out[row, j] = x[j]
    return out


def sensed(
    motion: np.ndarray,
    *,
    step_s: float,
    samples_s: np.ndarray,
    delay_s: float,
    lag_s: float,
    resonance_hz: float = 0.0,
    damping_ratio: float = 0.0,
) -> np.ndarray:
    """Return what a sensor shows of a motion that begins at rest.

    ``motion`` (m, k): signals at even steps, zero before the first; ``samples_s`` (n,): when the
    sensor is read. Pure delay, first-order lag, and a second-order low-pass of gain one before it,
    each of which may be absent. Returns (n, k); signals are straight between steps, which the
    filters follow exactly.
    """
    return np.asarray(sense(motion, step_s, samples_s, delay_s, lag_s, resonance_hz, damping_ratio))


@njit(cache=True, nogil=True, error_model="numpy")
def _first_order(signals: np.ndarray, step_s: float, lag_s: float) -> np.ndarray:
    """Filter signals that are straight between steps, exactly."""
    keep = np.exp(-step_s / lag_s)
    out = np.empty_like(signals)
    m, k = signals.shape
    for j in range(k):
        y = 0.0
        before = 0.0
        for i in range(m):
            now = signals[i, j]
            behind = lag_s * (now - before) / step_s  # of a straight line, in the long run
            y = now - behind + (y - before + behind) * keep
            out[i, j] = y
            before = now
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _second_order(
    signals: np.ndarray, step_s: float, resonance_hz: float, damping_ratio: float
) -> np.ndarray:
    """Filter signals that are straight between steps, exactly; damping ratio below 1."""
    rate = 2.0 * np.pi * resonance_hz
    decay, turn = damping_ratio * rate, rate * np.sqrt(1.0 - damping_ratio**2)
    fade = np.exp(-decay * step_s)
    cosine, sine = fade * np.cos(turn * step_s), fade * np.sin(turn * step_s) / turn
    out = np.empty_like(signals)
    m, k = signals.shape
    for j in range(k):
        y = w = before = 0.0
        for i in range(m):
            now = signals[i, j]
            slope = (now - before) / step_s
            # About the straight line that it follows in the long run, it rings freely.
            behind = 2.0 * damping_ratio / rate * slope
            off, rush = y - before + behind, w - slope
            y = now - behind + off * (cosine + decay * sine) + rush * sine
            w = slope + rush * (cosine - decay * sine) - off * rate**2 * sine
            out[i, j] = y
            before = now
    return out


@njit(cache=True, nogil=True)
def _read(signals: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return signals at places between their steps: zero before the first, straight after."""
    m, k = signals.shape
    out = np.zeros((places.size, k))
    for i in range(places.size):
        if places[i] <= 0.0:
            continue
        low = min(int(places[i]), m - 2)
        u = places[i] - low
        for j in range(k):
            out[i, j] = signals[low, j] + u * (signals[low + 1, j] - signals[low, j])
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def sense(
    motion: np.ndarray,
    step_s: float,
    samples_s: np.ndarray,
    delay_s: float,
    lag_s: float,
    resonance_hz: float,
    damping_ratio: float,
) -> np.ndarray:
    """Return what :func:`sensed` returns; for compiled callers.

    Parameters
    ----------
    motion, step_s, samples_s, delay_s, lag_s, resonance_hz, damping_ratio
        As :func:`sensed` takes them.
    """
    shown = motion
    if resonance_hz > 0.0:
        shown = _second_order(shown, step_s, resonance_hz, damping_ratio)
    if lag_s > _INSTANT * step_s:
        shown = _first_order(shown, step_s, lag_s)
    return _read(shown, samples_s / step_s - delay_s / step_s)
