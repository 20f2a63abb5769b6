import numpy as np
import pytest
from scipy import signal

from jointz.kernels.series.impulse_response_estimate import estimate_response

TRUE = np.array([0.0, 1.0, 0.6, 0.2, -0.1, 0.0])


def make_record(seed: int = 0, n: int = 3000, noise: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    x = signal.lfilter([1.0], [1.0, -0.8], rng.standard_normal(n))
    return x, np.convolve(x, TRUE)[:n] + noise * rng.standard_normal(n)


def test_a_known_response_comes_back():
    found = estimate_response(*make_record(), first_lag=-2, last_lag=6)

    assert found.lags.tolist() == list(range(-2, 7))
    assert found.response == pytest.approx([0.0, 0.0, *TRUE, 0.0], abs=1e-9)
    assert found.vaf_pct == pytest.approx(100.0)


@pytest.mark.parametrize("correlation", [0.0, 0.9])
def test_the_bounds_are_the_scatter_also_for_slow_noise(correlation):
    responses, sds = [], []
    for seed in range(80):
        x, y = make_record(seed)
        noise = np.random.default_rng(1000 + seed).standard_normal(x.size)
        y = y + 0.3 * signal.lfilter([1.0], [1.0, -correlation], noise)
        found = estimate_response(x, y, first_lag=0, last_lag=5)
        responses.append(found.response)
        sds.append(found.sd)

    scatter = np.sqrt(np.mean((np.array(responses) - TRUE) ** 2, axis=0))

    assert np.mean(sds) == pytest.approx(scatter.mean(), rel=0.15)


@pytest.mark.parametrize(
    ("x", "y", "first", "last"),
    [
        (np.arange(200.0), np.arange(200.0), 0, 100),
        (*make_record(), 1, 5),
        (*make_record(), -5, -1),
        (make_record()[0], np.ones(3000), 0, 5),
    ],
    ids=["short", "lags after zero", "lags before zero", "constant"],
)
def test_what_has_no_response_is_refused(x, y, first, last):
    with pytest.raises(ValueError, match=r"samples|lag|constant"):
        estimate_response(x, y, first_lag=first, last_lag=last)
