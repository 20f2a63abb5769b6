"""A smooth curve over the cycle, against dense Gaussian conditioning and curves that are known."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from jointz.kernels.series import periodic_process
from jointz.kernels.series.periodic_process import periodic_curve

PHASES = np.array([0.05, 0.2, 0.4, 0.55, 0.7, 0.85])
FINE = np.linspace(0.0, 1.0, 51)


def curve_of(values, sd, *, at=FINE, phases=PHASES, systematic=0.0, process_sd=1.0):
    n = phases.size
    return periodic_curve(
        phases,
        values,
        sd**2 * np.eye(n),
        systematic=np.full(n, systematic),
        at=at,
        sd=process_sd,
    )


def test_one_length_is_ordinary_conditioning(monkeypatch):
    """Level, values and curve as one normal vector, the level's prior very wide."""
    monkeypatch.setattr(periodic_process, "_LENGTHS", np.array([0.15]))
    values, sd, at = np.array([3.0, 1.0, 2.0, 5.0, 4.0, 2.5]), 0.3, np.array([0.3, 0.95])
    places = np.concatenate([PHASES, at])
    apart = np.pi * (places[:, None] - places[None, :])
    joint = 16.0 * np.exp(-2.0 * (np.sin(apart) / (2.0 * np.pi * 0.15)) ** 2) + 1e6
    seen = joint[:6, :6] + sd**2 * np.eye(6)
    mean = joint[6:, :6] @ np.linalg.solve(seen, values)
    variance = np.diag(joint[6:, 6:] - joint[6:, :6] @ np.linalg.solve(seen, joint[:6, 6:]))

    curve = curve_of(values, sd, at=at, process_sd=4.0)
    np.testing.assert_allclose(curve.value, mean, atol=2e-4)
    np.testing.assert_allclose(curve.high - curve.low, 3.92 * np.sqrt(variance), rtol=1e-3)


def test_systematic_errors_do_not_average_out():
    dense = np.arange(60) / 60.0
    values = 2.0 + np.cos(2.0 * np.pi * dense)
    quiet = curve_of(values, 0.3, phases=dense)
    honest = curve_of(values, 0.3, phases=dense, systematic=0.3)
    assert (quiet.high - quiet.low).max() < 2 * 0.3
    assert (honest.high - honest.low).min() > 3.9 * 0.3


def test_the_band_holds_curves_of_the_process():
    """Curves drawn with lengths between those of the prior; pointwise 95 % over 60 of them."""
    rng = np.random.default_rng(7)
    held = []
    for _ in range(60):
        length = rng.uniform(0.1, 0.3)
        places = np.concatenate([PHASES, FINE])
        apart = np.pi * (places[:, None] - places[None, :])
        likeness = np.exp(-2.0 * (np.sin(apart) / (2.0 * np.pi * length)) ** 2)
        drawn = multivariate_normal(cov=likeness + 1e-9 * np.eye(57), allow_singular=True).rvs(
            random_state=rng
        )
        curve = curve_of(drawn[:6] + 0.1 * rng.standard_normal(6), 0.1)
        held.append(((curve.low <= drawn[6:]) & (drawn[6:] <= curve.high)).mean())
    # Curves, not phases, are independent: standard error of their mean coverage.
    assert np.mean(held) >= 0.95 - 2.6 * np.std(held) / np.sqrt(60)


@pytest.mark.parametrize(
    ("phases", "values"),
    [(np.array([0.1]), np.array([1.0])), (PHASES[:5], np.ones(6)), (PHASES[::-1], np.ones(6))],
)
def test_what_makes_no_curve_is_refused(phases, values):
    with pytest.raises(ValueError, match="rising phases"):
        periodic_curve(
            phases, values, np.eye(values.size), systematic=np.zeros(values.size), at=FINE, sd=1.0
        )
