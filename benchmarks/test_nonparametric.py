"""Time of one frequency response, impulse response and bandwidth, each with its own budget.

Their accuracy beside the Cramer-Rao bound is in tests/unit/identify/test_nonparametric_accuracy.py.
With ``--benchmark-disable`` each runs once.
"""

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from jointz.identify.actuators.bandwidth import identify_bandwidth
from jointz.identify.series.frequency_response import identify_frequency_response
from jointz.identify.series.impulse_response import identify_impulse_response

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


@pytest.mark.parametrize("identify", [identify_frequency_response, identify_impulse_response])
def test_time_of_a_joint(benchmark, record, identify):
    fit = benchmark(identify, **record, rate_hz=RATE)

    assert fit.parameter("stiffness").value == pytest.approx(80.0, rel=0.01)
    if benchmark.enabled:
        assert benchmark.stats["median"] < BUDGET_S


def test_time_of_a_bandwidth(benchmark, record):
    command = record["torque"]
    torque = sosfilt(butter(2, 17.0, fs=RATE, output="sos"), command)

    fit = benchmark(identify_bandwidth, command=command, torque=torque, rate_hz=RATE)

    assert fit.bandwidth_hz == pytest.approx(17.0, rel=0.02)
    if benchmark.enabled:
        assert benchmark.stats["median"] < BUDGET_S
