import numpy as np
import pytest
from scipy import signal

from jointz.kernels.series.spectra import blackman_tukey, welch


def make_pair(seed: int = 0, n: int = 20_000) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    x = signal.lfilter([1.0], [1.0, -0.7], rng.standard_normal(n))
    y = signal.lfilter([0.3], [1.0, -0.5], x) + 0.5 * rng.standard_normal(n)
    return x, y


def first_order_loop(cutoff_hz: float) -> tuple[np.ndarray, np.ndarray]:
    """Noise below 40 Hz through a loop of a known bandwidth, 30 s at 1 kHz."""
    low_pass = signal.butter(3, 40.0, fs=1000.0, output="sos")
    command = signal.sosfilt(low_pass, np.random.default_rng(0).standard_normal(30_000))
    loop = signal.butter(1, cutoff_hz, fs=1000.0, output="sos")
    return command, signal.sosfilt(loop, command)


def minus_3_db(spectra) -> float:
    f, gain = spectra.frequency_hz, np.abs(spectra.response)
    wanted = gain[1] * 10 ** (-3 / 20)
    after = np.flatnonzero(gain < wanted)[0]
    return np.interp(-wanted, -gain[[after - 1, after]], f[[after - 1, after]])


def test_welch_is_scipy_s_with_whole_segments_and_the_mean_taken_once():
    x, y = make_pair()
    x, y = x - x.mean(), y - y.mean()
    settings = {"fs": 100.0, "window": "hann", "nperseg": 200, "noverlap": 100, "detrend": False}

    found = welch(x, y, rate_hz=100.0, window_s=2.0)

    inside = slice(1, -1)  # scipy counts zero and half the rate once, not twice
    assert found.frequency_hz == pytest.approx(signal.welch(x, **settings)[0])
    assert found.auto_in[inside] == pytest.approx(signal.welch(x, **settings)[1][inside])
    assert found.cross[inside] == pytest.approx(signal.csd(x, y, **settings)[1][inside])
    assert found.coherence == pytest.approx(signal.coherence(x, y, **settings)[1])


def test_blackman_tukey_is_the_plain_sum_over_lags():
    x, y = make_pair(n=500)
    x, y = x - x.mean(), y - y.mean()
    longest = 12

    found = blackman_tukey(x, y, rate_hz=100.0, window_s=longest / 100.0)

    f = found.frequency_hz[[0, 7, 40]]
    for auto, cross, hz in zip(found.auto_in[[0, 7, 40]], found.cross[[0, 7, 40]], f, strict=True):
        slow_auto = slow_cross = 0.0
        for k in range(-longest, longest + 1):
            inside = slice(max(0, -k), x.size - max(0, k))
            later = slice(max(0, k), x.size + min(0, k))
            weight = 0.5 + 0.5 * np.cos(np.pi * k / longest)
            turn = np.exp(-2j * np.pi * hz * k / 100.0)
            slow_auto += weight * np.sum(x[inside] * x[later]) / x.size * turn
            slow_cross += weight * np.sum(x[inside] * y[later]) / x.size * turn
        assert auto == pytest.approx(2.0 * slow_auto.real / 100.0)
        assert cross == pytest.approx(2.0 * slow_cross / 100.0)


@pytest.mark.parametrize("estimate", [welch, blackman_tukey])
def test_the_scatter_of_a_density_is_that_of_its_averages(estimate):
    rng = np.random.default_rng(1)
    densities = []
    for _ in range(60):
        x = rng.standard_normal(4000)
        found = estimate(x, x, rate_hz=100.0, window_s=2.0)
        densities.append(found.auto_in[20:-20:20])
    densities = np.array(densities)

    ratio = densities.var(axis=0).mean() / densities.mean() ** 2

    assert ratio == pytest.approx(1.0 / found.n_averages, rel=0.25)


def test_30_lags_at_1_khz_read_a_bandwidth_of_10_hz_as_27():
    """SCIENCE 3, trap 13: the window of MATLAB's spa resolves 33 Hz."""
    command, torque = first_order_loop(10.0)

    coarse = blackman_tukey(command, torque, rate_hz=1000.0, window_s=0.03)
    fine = blackman_tukey(command, torque, rate_hz=1000.0, window_s=2.0)

    assert coarse.resolution_hz == pytest.approx(100.0 / 3.0)
    assert minus_3_db(coarse) == pytest.approx(27.0, abs=1.0)
    assert minus_3_db(fine) == pytest.approx(10.0, abs=0.3)


@pytest.mark.parametrize("estimate", [welch, blackman_tukey])
@pytest.mark.parametrize("window_s", [0.001, 1000.0])
def test_a_window_that_does_not_fit_is_refused(estimate, window_s):
    with pytest.raises(ValueError, match=r"expected a (window|longest lag) of"):
        estimate(*make_pair(), rate_hz=100.0, window_s=window_s)


@pytest.mark.parametrize("estimate", [welch, blackman_tukey])
def test_records_that_do_not_belong_together_are_refused(estimate):
    with pytest.raises(ValueError, match="one length"):
        estimate(np.zeros(100), np.zeros(90), rate_hz=100.0, window_s=0.2)
    with pytest.raises(ValueError, match="rate_hz > 0"):
        estimate(np.zeros(100), np.zeros(100), rate_hz=0.0, window_s=0.2)
