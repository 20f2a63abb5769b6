"""Hypotheses about joint and sensor, weighted."""

import numpy as np
import pytest

from jointz.identify.rigid.response_model import Priors
from jointz.identify.rigid.response_posterior import (
    CONSTANT_INERTIA_SD,
    compare_sensors,
    estimate_responses,
    inertia_evidence,
)
from jointz.results.estimates import FIT_SOURCES

WINDOW_S = 0.1
KNOWN = Priors(lag_s=(0.008, 0.0005))


@pytest.fixture(scope="module")
def made(walkers, noisy_responses):
    """Return a maker of responses of three joints with given inertias."""

    def make(*inertias, **more):
        joints = [walkers.Joint(60.0 - 10.0 * k, 2.5, J) for k, J in enumerate(inertias)]
        return noisy_responses(*joints, **more)

    return make


def estimated(cells, priors=KNOWN):
    sensors = compare_sensors(cells, priors, window_s=WINDOW_S)
    return estimate_responses(cells, priors, window_s=WINDOW_S, sensors=sensors)


@pytest.fixture(scope="module")
def alike(made):
    return estimated(made(0.06, 0.06, 0.06))


def test_one_inertia_is_believed_where_it_is_one_and_not_where_it_varies(made, alike):
    varied = estimated(made(0.04, 0.06, 0.09))
    assert alike.probability(inertia_sd=CONSTANT_INERTIA_SD) > 0.4
    assert varied.probability(inertia_sd=CONSTANT_INERTIA_SD) < 1e-3


def test_three_points_make_no_curve(alike):
    assert alike.probability(follows_curve=True) == 0.0


def test_sources_of_variance_are_named_and_none_is_negative(alike):
    for moments in (alike.stiffness(0), alike.damping(1), alike.log_inertia(2), alike.lag_s()):
        assert set(moments.sources) == set(FIT_SOURCES)
        assert min(moments.sources.values()) > -1e-12
        assert moments.variance == pytest.approx(sum(moments.sources.values()))


def test_variance_of_a_mixture_is_that_within_and_between(alike):
    means = np.array([p.point(0)[0] for p in alike.posteriors])
    within = np.array([p.covariance[0, 0] for p in alike.posteriors])
    mean = alike.weights @ means
    expected = alike.weights @ within + alike.weights @ (means - mean) ** 2
    assert alike.stiffness(0).mean == pytest.approx(mean)
    assert alike.stiffness(0).variance == pytest.approx(expected)


def test_a_lag_that_nobody_knows_widens_everything(made, alike):
    loose = estimated(made(0.06, 0.06, 0.06), Priors())
    assert loose.log_inertia(0).variance > 1.5 * alike.log_inertia(0).variance
    assert loose.stiffness(0).variance > alike.stiffness(0).variance
    assert loose.lag_s().variance > 2.0 * alike.lag_s().variance


def test_estimates_lie_within_their_errors(made):
    offs = []
    for seed in range(5):
        found = estimated(made(0.06, 0.06, 0.06, seed=seed))
        for i in range(3):
            k, j = found.stiffness(i), found.log_inertia(i)
            offs.append((k.mean - (60.0 - 10.0 * i)) / np.sqrt(k.variance))
            offs.append((j.mean - np.log(0.06)) / np.sqrt(j.variance))
    assert np.sqrt(np.mean(np.square(offs))) < 1.4
    assert np.abs(offs).max() < 3.3


def test_an_earlier_look_changes_where_searches_begin_not_where_they_end(made, alike):
    cells = made(0.06, 0.06, 0.06)
    first = compare_sensors(cells, KNOWN, window_s=WINDOW_S)
    again = compare_sensors(cells, KNOWN, window_s=WINDOW_S, earlier=first)
    likelier = [max(s, key=lambda p: p.log_evidence) for s in (first, again)]
    assert likelier[1].point(0)[0] == pytest.approx(likelier[0].point(0)[0], rel=0.02)
    assert likelier[1].hypothesis == likelier[0].hypothesis


def test_the_evidence_is_for_the_lag_that_is_true(made):
    cells = made(0.06, 0.06, 0.06, sd_rad=3e-4)
    logs = {}
    for lag_s in (0.008, 0.018):
        known = Priors(lag_s=(lag_s, 0.0005))
        best = estimated(cells, known).best
        logs[lag_s] = inertia_evidence(cells, known, window_s=WINDOW_S, start=best)
        logs["unknown"] = inertia_evidence(cells, Priors(), window_s=WINDOW_S, start=best)
    assert logs[0.018] + 5.0 < logs["unknown"] < logs[0.008]
