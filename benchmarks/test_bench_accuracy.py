"""Single pulses of the mass-spring experiment beside the Cramer-Rao bound, and their speed.

The bound is derived here from numerical sensitivities of an exact simulation (matrix
exponential, torque linear between samples): encoder noise of 1e-5 rad, torque exact, K, B, J
and the lag free; for raw records initial angle and velocity and an offset of the torque too.
With ``--benchmark-disable`` few seeds run and no figure is asserted.
"""

from dataclasses import dataclass
from time import perf_counter

import numpy as np
from benchmarks.figures import Figures, Peer, at_most
from scipy.linalg import expm

from jointz.identify.bench.pulse_likelihood import NoiseLevels, fit_pulse

LOADS = {1: (168.0, 0.0364), 2: (273.0, 0.0364), 3: (168.0, 0.07), 4: (273.0, 0.07)}
DAMPING = 0.163  # the actuator's own
ENCODER_SD = 1e-5
STEP = 1 / 900.0
TRACKING_S = 0.0075
WINDOWS_S = (0.1, 0.25)
NEEDED_RATIO, NEEDED_SECONDS, N_PULSES = 1.1, 10.0, 1120
FULL, QUICK = 400, 10
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


CASES = [Case(c, w, s) for s in ("response", "raw") for w in WINDOWS_S for c in LOADS]


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


def fits(case: Case, n_seeds: int) -> np.ndarray:
    """Estimates of K, B, J and lag, one row a seed."""
    clean = simulate(case.truth, case.n)
    time = STEP * np.arange(-30, case.n + 30)
    torque = torque_at(time)
    rows = []
    for seed in range(n_seeds):
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


def test_ratio_to_the_cramer_rao_bound(quick: bool, figures: Figures) -> None:
    print(
        f"\n{'record':<10}{'window':>8}{'case':>6}   bound K % / B / B % / J % / lag us, RMSE/bound"
    )
    worst = 0.0
    for case in CASES:
        least = bound(case)
        values = fits(case, QUICK if quick else FULL)
        ratio = np.sqrt(np.mean((values - case.truth[:4]) ** 2, axis=0)) / least
        stiffness, inertia = LOADS[case.load]
        shares = least * [100 / stiffness, 1.0, 100 / inertia, 1e6]
        print(
            f"{case.signal:<10}{case.window_s * 1e3:>5.0f} ms{case.load:>6}   "
            f"{shares[0]:.4f} / {shares[1]:.6f} / {100 * least[1] / DAMPING:.3f} / "
            f"{shares[2]:.4f} / {shares[3]:.2f}   {np.round(ratio, 3)}"
        )
        worst = max(worst, float(np.max(ratio)))
    print(f"largest ratio {worst:.3f}")
    figures.beside(
        f"RMSE of K, B, J and lag of single pulses on the bench, worst of {len(CASES)} cases",
        Peer("Cramer-Rao bound"),
        (worst, 1.0),
        "",
        asked=at_most(NEEDED_RATIO),
    )
    if not quick:
        assert worst <= NEEDED_RATIO


def test_speed_of_a_whole_study(quick: bool, figures: Figures) -> None:
    n = QUICK if quick else N_PULSES
    case = Case(1, 0.25, "response")
    fits(case, 2)  # compiles before the clock runs
    start = perf_counter()
    values = fits(case, n)
    seconds = perf_counter() - start
    print(f"\n{n} pulses in {seconds:.2f} s on one core")
    figures.alone(f"{n} single pulses on one core", seconds, "s", asked=at_most(NEEDED_SECONDS))
    assert np.isfinite(values).all()
    if not quick:
        assert seconds <= NEEDED_SECONDS
