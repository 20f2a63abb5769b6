"""Single pulses of the mass-spring experiment beside the Cramer-Rao bound.

The bound is derived here from numerical sensitivities of an exact simulation (matrix
exponential, torque linear between samples): encoder noise of 1e-5 rad, torque exact, K, B, J
and the lag free; for raw records initial angle and velocity and an offset of the torque too.
"""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.linalg import expm

from jointz.identify.bench.pulse_likelihood import NoiseLevels, fit_pulse

LOADS = {1: (168.0, 0.0364), 4: (273.0, 0.07)}
DAMPING = 0.163  # the actuator's own
ENCODER_SD = 1e-5
STEP = 1 / 900.0
TRACKING_S = 0.0075
WINDOWS_S = (0.1, 0.25)
MOST, SEEDS = 1.1, 400
#: K, B, J, lag, initial angle, initial velocity, offset of the torque.
DIFFERENCES = np.array([1e-3, 1e-5, 1e-6, 1e-6, 1e-6, 1e-4, 1e-3])


@dataclass(frozen=True)
class Case:
    """A load, a window and a kind of record."""

    load: int
    window_s: float
    signal: str

    @property
    def n(self) -> int:
        return int(self.window_s / STEP + 1e-6) + 1

    @property
    def truth(self) -> np.ndarray:
        stiffness, inertia = LOADS[self.load]
        return np.array([stiffness, DAMPING, inertia, 0.0, 0.0, 0.0, 0.0])

    @property
    def n_free(self) -> int:
        return 4 if self.signal == "response" else 7


def torque_at(t: np.ndarray) -> np.ndarray:
    """The trapezoid behind a first-order actuator: four ramps, each answered exactly."""
    total = np.zeros_like(t)
    for corner, slope in zip((0.0, 0.075, 0.175, 0.25), (1, -1, -1, 1), strict=True):
        s = np.maximum(t - corner, 0.0)
        total += slope * 7.0 / 0.075 * (s - TRACKING_S * (1.0 - np.exp(-s / TRACKING_S)))
    return total


def simulate(p: np.ndarray, n: int) -> np.ndarray:
    """Angle at the samples of the window; the torque on the load is the record ``lag`` later."""
    stiffness, damping, inertia, lag, angle, velocity, offset = p
    m = np.zeros((4, 4))
    m[0, 1], m[2, 3] = 1.0, 1 / STEP
    m[1, :3] = [-stiffness / inertia, -damping / inertia, 1 / inertia]
    e = expm(m * STEP)
    torque = torque_at(STEP * np.arange(n) + lag) - offset
    state, out = np.array([angle, velocity]), np.empty(n)
    for i in range(n):
        out[i] = state[0]
        if i + 1 < n:
            state = e[:2, :2] @ state + (e[:2, 2] - e[:2, 3]) * torque[i] + e[:2, 3] * torque[i + 1]
    return out


def bound(case: Case) -> np.ndarray:
    """Least sd of an unbiased estimate of K, B, J and lag."""
    slopes = []
    for i in range(case.n_free):
        step = np.zeros(7)
        step[i] = DIFFERENCES[i]
        high, low = simulate(case.truth + step, case.n), simulate(case.truth - step, case.n)
        slopes.append((high - low) / (2 * DIFFERENCES[i]))
    sensitivity = np.array(slopes).T / ENCODER_SD
    size = np.linalg.norm(sensitivity, axis=0)
    scaled = sensitivity / size
    return (np.sqrt(np.diag(np.linalg.inv(scaled.T @ scaled))) / size)[:4]


def estimates(case: Case) -> np.ndarray:
    """Estimates of K, B, J and lag, one row a seed."""
    clean = simulate(case.truth, case.n)
    time = STEP * np.arange(-30, case.n + 30)
    torque = torque_at(time)
    rows = []
    for seed in range(SEEDS):
        rng = np.random.default_rng(seed)
        angle = np.zeros(time.size)
        angle[30 : 30 + case.n] = clean + rng.normal(scale=ENCODER_SD, size=case.n)
        fit = fit_pulse(
            time,
            angle,
            torque,
            onset_s=0.0,
            window_s=case.window_s,
            signal=case.signal,
            noise=NoiseLevels(ENCODER_SD, 0.0),
        )
        rows.append([np.nan if p.value is None else p.value for p in fit.parameters])
    return np.array(rows)


@pytest.mark.slow
@pytest.mark.parametrize("signal", ["response", "raw"])
def test_estimates_scatter_hardly_more_than_the_cramer_rao_bound(signal):
    cases = [Case(load, window_s, signal) for window_s in WINDOWS_S for load in LOADS]

    ratios = []
    for case in cases:
        errors = estimates(case) - case.truth[:4]
        ratios.append(np.sqrt(np.mean(errors**2, axis=0)) / bound(case))

    assert np.max(ratios) <= MOST
