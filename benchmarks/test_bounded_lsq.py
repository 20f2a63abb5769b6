"""Bounded fits of bootstrap resamples beside scipy's lsq_linear.

A fit is a resample's average of 50 trials and a bounded fit of 100 x 3 to it,
on both sides. The table takes turns between the two sides, so that both see the
same noise of the machine. With ``--benchmark-disable`` the same code runs once,
on a small problem, and no figure is asserted.
"""

import os
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from time import perf_counter

import numpy as np
import pytest
from benchmarks.figures import Figures, at_least, of_package
from scipy.optimize import lsq_linear

from jointz.kernels.bounded_lsq import bootstrap_fits
from jointz.kernels.resampling import resample_weights

N_TRIALS, N_SAMPLES = 50, 100
#: True K of each case, N*m/rad, and how many times the peer's speed is needed.
CASES = {"no bound active": (100.0, 50.0), "one bound active": (-50.0, 500.0)}
NEEDED_FITS_PER_S = 0.8e6


@dataclass(frozen=True)
class Sizes:
    """How much work a table takes."""

    n_resamples: int
    n_peer: int
    n_turns: int


FULL = Sizes(n_resamples=20_000, n_peer=100, n_turns=7)
QUICK = Sizes(n_resamples=300, n_peer=3, n_turns=1)


def one_blas_thread() -> AbstractContextManager[object]:
    """Hold BLAS to one thread; without threadpoolctl the environment must say so."""
    try:
        from threadpoolctl import threadpool_limits
    except ImportError:
        if os.environ.get("OPENBLAS_NUM_THREADS") != "1":
            print("threadpoolctl is absent: set OPENBLAS_NUM_THREADS=1 for one thread")
        return nullcontext()
    return threadpool_limits(limits=1)


def make_trials(stiffness: float) -> np.ndarray:
    """Trials of a pulse response with the sizes of a walking study, (P, 4, T)."""
    rng = np.random.default_rng(0)
    time = np.linspace(0.0, 0.1, N_SAMPLES)
    omega = 2 * np.pi * np.array([4.0, 7.0, 11.0])[:, None]
    angle = np.sin(omega * time).sum(axis=0)
    velocity = (omega * np.cos(omega * time)).sum(axis=0)
    acceleration = (-(omega**2) * np.sin(omega * time)).sum(axis=0)
    motion = np.stack([angle, velocity, acceleration]) * (0.1 / np.abs(angle).max())
    motion = motion * rng.uniform(0.9, 1.1, size=(N_TRIALS, 1, 1))
    torque = np.einsum("c,pct->pt", [stiffness, 1.0, 0.02], motion)
    torque += rng.normal(scale=0.5, size=torque.shape)
    return np.concatenate([motion, torque[:, None]], axis=1)


def peer_fits(weights: np.ndarray, trials: np.ndarray) -> np.ndarray:
    """Fit resample by resample with scipy's default solver."""
    flat = trials.reshape(len(trials), -1)
    fits = []
    for row in weights:
        average = (row @ flat).reshape(4, -1)
        fits.append(lsq_linear(average[:3].T, average[3], bounds=(0, np.inf)).x)
    return np.array(fits)


def take_turns(weights: np.ndarray, trials: np.ndarray, sizes: Sizes) -> tuple[float, float]:
    """Return the least time of one fit, ours and the peer's, in seconds."""
    ours, peer = [], []
    for _ in range(sizes.n_turns):
        start = perf_counter()
        bootstrap_fits(weights, trials)
        middle = perf_counter()
        peer_fits(weights[: sizes.n_peer], trials)
        ours.append((middle - start) / sizes.n_resamples)
        peer.append((perf_counter() - middle) / sizes.n_peer)
    return min(ours), min(peer)


def test_ratio_to_lsq_linear(quick: bool, figures: Figures) -> None:
    sizes = QUICK if quick else FULL
    weights = resample_weights(N_TRIALS, sizes.n_resamples, np.random.default_rng(1))
    times = {}
    with one_blas_thread():
        for case, (stiffness, _) in CASES.items():
            trials = make_trials(stiffness)
            few = bootstrap_fits(weights[: sizes.n_peer], trials)  # compiles before the clock runs
            assert ((few.active == 1) == (stiffness < 0)).all()
            # The default solver's tolerance is 1e-10 of its cost: four digits at a bound.
            np.testing.assert_allclose(
                few.bounded, peer_fits(weights[: sizes.n_peer], trials), rtol=1e-3, atol=1e-3
            )
            times[case] = take_turns(weights, trials, sizes)
    print(f"\n{'case':<18}{'jointz':>12}{'lsq_linear':>13}{'ratio':>8}{'million fits/s':>16}")
    lsq = of_package("lsq_linear", "scipy")
    for case, (ours, peer) in times.items():
        row = f"{ours * 1e6:>9.2f} us{peer * 1e6:>10.1f} us{peer / ours:>8.0f}{1e-6 / ours:>16.2f}"
        print(f"{case:<18}{row}")
        what, both = f"bounded fit of a resample, {case}", (ours * 1e6, peer * 1e6)
        figures.beside(what, lsq, both, "us", asked=at_least(CASES[case][1]))
        asked = at_least(1e-6 * NEEDED_FITS_PER_S)
        figures.alone(f"bounded fits, {case}", 1e-6 / ours, "million/s", asked=asked)
    if quick:
        return
    for case, (ours, peer) in times.items():
        assert peer / ours >= CASES[case][1], case
        assert 1.0 / ours >= NEEDED_FITS_PER_S, case


@pytest.mark.parametrize("case", list(CASES))
def test_bootstrap_fits(benchmark, quick: bool, case: str) -> None:
    n_resamples = (QUICK if quick else FULL).n_resamples
    trials = make_trials(CASES[case][0])
    weights = resample_weights(N_TRIALS, n_resamples, np.random.default_rng(1))
    with one_blas_thread():
        fits = benchmark(bootstrap_fits, weights, trials)
    assert np.isfinite(fits.bounded).all()


@pytest.mark.parametrize("case", list(CASES))
def test_peer_fits(benchmark, quick: bool, case: str) -> None:
    n_resamples = (QUICK if quick else FULL).n_peer
    trials = make_trials(CASES[case][0])
    weights = resample_weights(N_TRIALS, n_resamples, np.random.default_rng(1))
    with one_blas_thread():
        fits = benchmark(peer_fits, weights, trials)
    assert fits.shape == (n_resamples, 3)
