"""What a cell says before anything was refused."""

import pytest

from jointz.results.estimates import CellEstimate, ParameterEstimate
from jointz.results.statistics.pooled_estimates import has_budget, unbounded_estimate

STIFFNESS = ParameterEstimate("stiffness", None, None, None, "undecided", unbounded=-4.0)
PER_KG = ParameterEstimate("stiffness_per_mass", None, None, None, "undecided", unbounded=-0.05)


def cell(parameters, budget):
    return CellEstimate("S1", "LRE", 7.0, tuple(parameters), 99.0, 5, 0, "rigid", budget=budget)


def test_an_undecided_cell_has_value_and_errors():
    decided = cell([STIFFNESS], {"stiffness": {"noise": 3.0, "lag": 4.0, "gain": 12.0}})
    estimate = unbounded_estimate(decided, "stiffness")
    assert has_budget(decided)
    assert (estimate.value, estimate.noise_sd) == (-4.0, 3.0)
    assert estimate.systematic_sd == pytest.approx(12.649110640673518)
    assert estimate.sd == pytest.approx(13.0)


def test_errors_per_kg_are_those_of_the_whole_over_the_mass():
    decided = cell([STIFFNESS, PER_KG], {"stiffness": {"noise": 8.0}})
    assert unbounded_estimate(decided, "stiffness_per_mass").sd == pytest.approx(0.1)


def test_without_an_estimate_or_errors_there_is_nothing():
    empty = ParameterEstimate("stiffness", None, None, None, "failed:no_pulses")
    assert unbounded_estimate(cell([empty], {"stiffness": {"noise": 1.0}}), "stiffness") is None
    assert unbounded_estimate(cell([STIFFNESS], {}), "stiffness") is None
    assert unbounded_estimate(cell([], {"stiffness": {"noise": 1.0}}), "stiffness") is None
    assert not has_budget(cell([STIFFNESS], {}))
