"""Time of one frequency response, impulse response and bandwidth, each with its own budget.

Their accuracy beside the Cramer-Rao bound is in tests/unit/identify/test_nonparametric_accuracy.py.
With ``--benchmark-disable`` each runs once.
"""

import numpy as np
import pytest
from benchmarks.figures import Figures, at_most
from scipy.signal import butter, sosfilt

from jointz.identify.actuators.bandwidth import identify_bandwidth
from jointz.identify.series.joint import identify_joint

RATE = 1000.0
BUDGET_S = 0.05


@pytest.fixture(scope="module")
def record() -> dict[str, np.ndarray]:
    """30 s at 1 kHz of a joint (K 80, B 1.2, J 0.03) under 4 N*m RMS below 30 Hz, with noise."""
    rng = np.random.default_rng(0)
    n = 30_000
    torque = sosfilt(butter(3, 30.0, fs=RATE, output="sos"), rng.standard_normal(n))
    torque *= 4.0 / torque.std()
    s = 2j * np.pi * np.fft.rfftfreq(n, 1.0 / RATE)
    angle = np.fft.irfft(np.fft.rfft(torque) / (80.0 + 1.2 * s + 0.03 * s**2), n)
    return {
        "angle": angle + 1e-3 * rng.standard_normal(n),
        "torque": torque + 0.33 * rng.standard_normal(n),
    }


def within_budget(benchmark, what: str, figures: Figures, *, quick: bool) -> None:
    if not benchmark.enabled:
        return
    median_s, asked = benchmark.stats["median"], at_most(1e3 * BUDGET_S)
    figures.alone(f"{what} of 30 s at 1 kHz, median", 1e3 * median_s, "ms", asked=asked)
    assert quick or median_s < BUDGET_S


@pytest.mark.parametrize("model", ["frf", "irf"])
def test_time_of_a_joint(benchmark, record, model, quick, figures):
    fit = benchmark(identify_joint, **record, rate_hz=RATE, model=model)

    assert fit.parameter("stiffness").value == pytest.approx(80.0, rel=0.01)
    what = {"frf": "frequency response", "irf": "impulse response"}[model]
    within_budget(benchmark, what, figures, quick=quick)


def test_time_of_a_bandwidth(benchmark, record, quick, figures):
    command = record["torque"]
    torque = sosfilt(butter(2, 17.0, fs=RATE, output="sos"), command)

    fit = benchmark(identify_bandwidth, command=command, torque=torque, rate_hz=RATE)

    assert fit.bandwidth_hz == pytest.approx(17.0, rel=0.02)
    within_budget(benchmark, "bandwidth", figures, quick=quick)
