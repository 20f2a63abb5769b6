"""One value a person out of sessions and sides."""

import numpy as np
import pytest

from jointz.results.estimates import CellEstimate, ParameterEstimate
from jointz.results.person_estimates import person_cells
from jointz.results.statistics.pooled_estimates import estimate_without_priors


def cell(side, *estimates, budget=None, covariance=None, effects=None):
    return CellEstimate(
        "S01", "LRE", 7.0, estimates, 97.0, 10, 1, "any",
        side=side, budget=budget or {}, covariance=covariance, prior_effects=effects or {},
    )  # fmt: skip


def estimate(value, half, status="ok", unbounded=None):
    ends = (None, None) if value is None else (value - half, value + half)
    return ParameterEstimate("stiffness", value, *ends, status, unbounded=unbounded or value)


def test_a_persons_average_has_the_mean_of_values_and_variances():
    left = cell("left", estimate(40.0, 4.0), budget={"stiffness": {"noise": 3.0, "lag": 1.0}},
                covariance=((4.0, 0.0, 0.0),) * 3, effects={"stiffness": (-2.0, 8.0)})  # fmt: skip
    right = cell("right", estimate(50.0, 6.0), budget={"stiffness": {"noise": 4.0, "lag": 1.0}},
                 covariance=((6.0, 0.0, 0.0),) * 3, effects={"stiffness": (-1.0, 2.0)})  # fmt: skip
    (mean,) = person_cells([left, right])
    (k,) = mean.parameters
    assert (k.value, k.unbounded, k.ci_low, k.ci_high, k.status) == (45.0, 45.0, 40.0, 50.0, "ok")
    assert mean.budget["stiffness"] == pytest.approx({"noise": np.sqrt(12.5), "lag": 1.0})
    assert mean.covariance[0][0] == 5.0
    data = [estimate_without_priors(c, "stiffness") for c in (left, right, mean)]
    assert data[2].value == np.mean([data[0].value, data[1].value]) == 46.5
    assert data[2].sd ** 2 == pytest.approx(np.mean([data[0].sd ** 2, data[1].sd ** 2]))
    assert (mean.label, mean.n_used, mean.n_excluded) == ("S01", 20, 2)


@pytest.mark.parametrize(
    ("budget", "value", "unbounded", "status"),
    [({"stiffness": {"noise": 3.0}}, None, 45.0, "undecided"), ({}, 40.0, 40.0, "ok")],
)
def test_an_undecided_side_counts_where_its_error_is_known(budget, value, unbounded, status):
    undecided = estimate(None, 0.0, "undecided", 50.0)
    cells = [
        cell("left", estimate(40.0, 4.0), budget=budget),
        cell("right", undecided, budget=budget),
    ]
    ((k,),) = [c.parameters for c in person_cells(cells)]
    assert (k.value, k.unbounded, k.status) == (value, unbounded, status)


def test_a_person_measured_once_stays_as_it_is():
    alone = cell("left", estimate(40.0, 4.0))
    assert person_cells([alone])[0] is alone


def test_a_parameter_that_only_one_side_has_is_kept():
    onset = ParameterEstimate("stiffness_onset", 70.0, 60.0, 80.0, "ok", unbounded=70.0)
    whole = {"stiffness": {"noise": 3.0}}
    left = cell("left", estimate(40.0, 4.0), budget=whole, effects={"stiffness": (-2.0, 8.0)})
    right = cell("right", estimate(50.0, 4.0), onset,
                 budget=whole | {"stiffness_onset": {"noise": 5.0}})  # fmt: skip

    for cells in ([left, right], [right, left]):
        (mean,) = person_cells(cells)
        assert [p.name for p in mean.parameters] == ["stiffness", "stiffness_onset"]
        assert [p.value for p in mean.parameters] == [45.0, 70.0]
        assert mean.budget["stiffness_onset"] == {"noise": 5.0}
        assert mean.prior_effects == {"stiffness": (-1.0, 4.0)}
