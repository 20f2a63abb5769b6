"""Posterior mode of responses made with known joints by another integrator."""

from dataclasses import replace

import numpy as np
import pytest

from jointz.identify.rigid.response_model import (
    Hypothesis,
    Priors,
    ResponseModel,
    response_to_kick,
)

PERIOD_S, WINDOW_S, LAG_S = 0.002, 0.1, 0.008
N = 56
TIME_S = np.arange(N) * PERIOD_S
KNOWN = Priors(lag_s=(LAG_S, 0.0005))
JOINTS = ((60.0, 2.5), (35.0, 3.0), (90.0, 1.8))
INERTIA = 0.06


@pytest.fixture(scope="module")
def responses(walkers, noisy_responses):
    """Return a maker of noisy average responses of the three joints."""

    def make(*, inertias=(INERTIA,) * 3, slope=0.0, **more):
        pairs = zip(JOINTS, inertias, strict=True)
        return noisy_responses(*(walkers.Joint(K, B, J, slope) for (K, B), J in pairs), **more)

    return make


def fitted(cells, hypothesis=None, priors=KNOWN):
    model = ResponseModel(cells, priors, hypothesis or Hypothesis(0.01, 0.02), window_s=WINDOW_S)
    return model.fit(model.start(inertia=0.1))


def values_of(posterior, n=3):
    points = np.array([posterior.point(i) for i in range(n)])
    return points[:, 0], points[:, 2], np.exp(posterior.shared[0] + points[:, 4])


def test_responses_almost_without_noise_give_the_joints_back(responses):
    K, B, J = values_of(fitted(responses(sd_rad=2e-5)))
    assert pytest.approx([60.0, 35.0, 90.0], rel=0.01) == K
    assert pytest.approx([2.5, 3.0, 1.8], rel=0.01) == B
    assert pytest.approx(INERTIA, rel=0.01) == J


def test_an_unknown_lag_is_found_where_noise_is_small(responses):
    posterior = fitted(responses(sd_rad=2e-5, lag_s=0.013), priors=Priors())
    assert posterior.late_s == pytest.approx(0.013, abs=3e-4)


def test_inertias_of_each_point_are_found_where_they_may_differ(responses):
    cells = responses(sd_rad=2e-5, inertias=(0.05, 0.07, 0.06))
    _, _, J = values_of(fitted(cells, Hypothesis(0.35, 0.02)))
    assert pytest.approx([0.05, 0.07, 0.06], rel=0.02) == J


def test_a_slope_of_stiffness_is_found_about_the_middle_of_its_weight(responses):
    cells = responses(sd_rad=3e-4, slope=150.0)
    posterior = fitted(cells, Hypothesis(0.01, 0.3))
    middle_s = posterior.middle_s[:, 0]
    assert np.all((middle_s > 0.04) & (middle_s < 0.08))
    expected = np.array([60.0, 35.0, 90.0]) + 150.0 * middle_s
    sd = np.sqrt(np.diag(posterior.covariance)[:-7:5])
    assert np.all(np.abs(posterior.values[:-7:5] - expected) < 2.5 * sd)
    assert np.all(sd < 0.25 * expected)


def test_the_search_ends_in_the_same_place_from_light_and_heavy_legs(responses):
    model = ResponseModel(responses(), KNOWN, Hypothesis(0.01, 0.02), window_s=WINDOW_S)
    ends = [model.fit(model.start(inertia=j)) for j in (0.03, 0.1, 0.3)]
    sds = np.sqrt(np.diag(ends[0].covariance))
    for other in ends[1:]:
        assert np.abs(other.values - ends[0].values).max() < 1e3
        assert np.all(np.abs(other.values - ends[0].values) < 0.1 * sds + 1e-12)


def test_covariance_is_the_scatter_over_noise(responses):
    fits = [fitted(responses(seed=seed)) for seed in range(30)]
    found = np.array([np.concatenate(values_of(f)[:2]) for f in fits])
    claimed = np.sqrt(np.mean([np.diag(f.covariance) for f in fits], axis=0))
    places = [0, 5, 10, 2, 7, 12]
    scatter = found.std(axis=0)
    # The covariance counts what the prior leaves open of lag and drift, which no noise moves.
    assert np.all(scatter < 1.4 * claimed[places])
    bread = np.sqrt(np.mean([np.diag(f.bread) for f in fits], axis=0))[places]
    assert np.all(scatter < 1.4 * bread)
    assert np.all(scatter > 0.3 * claimed[places])


def test_gains_move_the_mode_as_a_change_of_the_angle_does(responses):
    cells = responses(sd_rad=2e-4)
    before = fitted(cells)
    change = 2e-5 * np.sin(TIME_S / 0.02)
    moved = [*cells]
    moved[1] = replace(cells[1], angle=cells[1].angle + change)
    shift = fitted(moved).values - before.values
    sds = np.sqrt(np.diag(before.covariance))
    assert shift / sds == pytest.approx((before.gains[1] @ change) / sds, abs=0.02)


def test_misfit_is_chi_square_distributed(responses):
    def misfit(cells):
        off = [c.angle - f for c, f in zip(cells, fitted(cells).fitted, strict=True)]
        return sum(r @ c.weights() @ r for r, c in zip(off, cells, strict=True))

    misfits = np.array([misfit(responses(seed=seed)) for seed in range(30)])
    free = 3 * N
    # A few parameters take their share of the degrees of freedom.
    assert free - 20 < misfits.mean() < free + 3.0 * np.sqrt(2.0 * free / 30)


def test_a_kick_is_answered_as_by_the_shown_joint(responses):
    posterior = fitted(responses(sd_rad=2e-5))
    kick = response_to_kick(posterior, 0, period_s=PERIOD_S, n=N)
    # Linear: kicks of the torque at every sample add up to the fitted angle.
    torque = responses(sd_rad=2e-5)[0].torque[0]
    summed = np.convolve(kick, torque)[:N]
    assert summed == pytest.approx(posterior.fitted[0], abs=0.01 * posterior.fitted[0].max())
