"""Motion of a joint under torque, and what a late sensor shows of it.

Signals are straight between their steps, which the filters follow exactly.
"""

import numpy as np
from numba import njit

#: A first-order lag shorter than this share of a step does nothing.
_INSTANT = 1e-3


@njit(cache=True, nogil=True, error_model="numpy")
def joint_motion(
    torque: np.ndarray, stiffness: float, damping: float, inertia: float, step_s: float
) -> np.ndarray:
    """Return the motion of a joint from rest, rad, by torque (n,) N*m (Runge-Kutta 4)."""
    out = np.zeros(torque.size)
    x = v = 0.0
    for i in range(torque.size - 1):
        dx = dv = to_x = to_v = 0.0
        for stage in range(4):
            part = 0.0 if stage == 0 else (0.5 if stage < 3 else 1.0)
            drive = torque[i] + part * (torque[i + 1] - torque[i])
            angle, rate = x + part * step_s * to_x, v + part * step_s * to_v
            to_x, to_v = rate, (drive - damping * rate - stiffness * angle) / inertia
            weight = 1.0 if stage in (0, 3) else 2.0
            dx, dv = dx + weight * to_x, dv + weight * to_v
        x, v = x + step_s / 6.0 * dx, v + step_s / 6.0 * dv
        out[i + 1] = x
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
    """Return what a sensor shows, (n,), of a motion (m,) that begins at rest.

    ``samples_s`` (n,): when the sensor is read. Pure delay, first-order lag, and a second-order
    low-pass of gain one before it, each of which may be absent.
    """
    shown = motion
    if resonance_hz > 0.0:
        shown = _second_order(shown, step_s, resonance_hz, damping_ratio)
    if lag_s > _INSTANT * step_s:
        shown = _first_order(shown, step_s, lag_s)
    return _read(shown, (samples_s - delay_s) / step_s)


@njit(cache=True, nogil=True, error_model="numpy")
def _first_order(signal: np.ndarray, step_s: float, lag_s: float) -> np.ndarray:
    keep = np.exp(-step_s / lag_s)
    out = np.empty_like(signal)
    y = before = 0.0
    for i in range(signal.size):
        now = signal[i]
        behind = lag_s * (now - before) / step_s  # of a straight line, in the long run
        y = now - behind + (y - before + behind) * keep
        out[i] = y
        before = now
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _second_order(
    signal: np.ndarray, step_s: float, resonance_hz: float, damping_ratio: float
) -> np.ndarray:
    """Filter with a damping ratio below 1."""
    rate = 2.0 * np.pi * resonance_hz
    decay, turn = damping_ratio * rate, rate * np.sqrt(1.0 - damping_ratio**2)
    fade = np.exp(-decay * step_s)
    cosine, sine = fade * np.cos(turn * step_s), fade * np.sin(turn * step_s) / turn
    out = np.empty_like(signal)
    y = w = before = 0.0
    for i in range(signal.size):
        now = signal[i]
        slope = (now - before) / step_s
        # About the straight line that it follows in the long run, it rings freely.
        behind = 2.0 * damping_ratio / rate * slope
        off, rush = y - before + behind, w - slope
        y = now - behind + off * (cosine + decay * sine) + rush * sine
        w = slope + rush * (cosine - decay * sine) - off * rate**2 * sine
        out[i] = y
        before = now
    return out


def _read(signal: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return a signal at places between its steps: zero before the first, straight after."""
    low = np.clip(places.astype(int), 0, signal.size - 2)
    between = signal[low] + (places - low) * (signal[low + 1] - signal[low])
    return np.asarray(np.where(places > 0.0, between, 0.0))
