"""Uncertainty that would remain if more were known."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.identify.walking.prior_draws import DOUBLET, simulated_person

from jointz.identify.walking.coupling import STRAP
from jointz.identify.walking.estimands import log_gradient, log_moments
from jointz.identify.walking.information import PULSES, remaining_sds
from jointz.identify.walking.posterior import LegPosterior, explain


@pytest.fixture(scope="module")
def posterior():
    """Of the likeliest hypothesis only, so that closed forms are exact."""
    model, priors, _ = simulated_person(0, shapes=(DOUBLET,), n_pulses=10, window_s=0.2)
    fits = explain(model, priors, STRAP.hypotheses[2:3])
    return LegPosterior(model, fits.fits, np.ones(1))


def test_nothing_known_makes_an_interval_wider(posterior):
    now, left = log_moments(posterior).sd, remaining_sds(posterior)

    assert set(left) == {
        "strap", "lag", "softening", "reflex", "friction", "gain", "inertia", PULSES,
    }  # fmt: skip
    for sds in left.values():
        assert np.all(sds <= now * (1.0 + 1e-9))
        assert np.any(sds < 0.999 * now)


def test_a_known_lag_is_a_lag_that_is_no_parameter(posterior):
    (fit,) = posterior.fits
    layout = posterior.model.layout
    known = [layout.shared(name) for name in ("sensor_delay_s", "sensor_lag_s")]
    free = np.setdiff1d(np.arange(layout.size), known)
    precision = np.linalg.inv(fit.covariance)
    _, gradient = log_gradient(posterior.model, fit)
    covariance = np.linalg.inv(precision[np.ix_(free, free)])
    expected = STRAP.error.sd_inflation * np.sqrt(
        np.diag(gradient[:, free] @ covariance @ gradient[:, free].T)
    )

    np.testing.assert_allclose(remaining_sds(posterior)["lag"], expected, rtol=1e-6)


def test_more_pulses_are_those_of_a_study_that_has_them(posterior):
    points = [
        replace(p, shapes=tuple(replace(s, n_pulses=20) for s in p.shapes))
        for p in posterior.model.points
    ]
    model = posterior.model.with_points(points)
    twice = LegPosterior(model, posterior.fits, np.ones(1))

    first, second = remaining_sds(posterior)[PULSES], remaining_sds(twice)[PULSES]
    assert np.all(second <= first * (1.0 + 1e-9))
    assert np.any(second < 0.99 * first)
