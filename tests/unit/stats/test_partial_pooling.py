"""Participants together, from cells with budgets."""

import numpy as np
import pytest

from jointz.kernels.statistics.pooling_posterior import partial_pooling
from jointz.results.estimates import CellEstimate, ParameterEstimate
from jointz.stats.partial_pooling import pool_people


def cell(
    person, value, sd, *, point="LRE", name="stiffness", status="ok", gain=0.0, mass=None,
    effects=(0.0, 0.0),
):  # fmt: skip
    stands = status in ("ok", "at_bound")
    ends = (max(value, 0.0), value - 2 * sd, value + 2 * sd) if stands else (None,) * 3
    parameters = [ParameterEstimate(name, *ends, status, unbounded=value)]
    if mass is not None:
        per = value / mass
        parameters.append(
            ParameterEstimate(f"{name}_per_mass", per, None, None, status, unbounded=per)
        )
    budget = {name: {"noise": sd, "gain": gain * value}}
    return CellEstimate(
        person, point, 7.0, tuple(parameters), 99.0, 5, 0, "rigid", budget=budget,
        prior_effects={name: effects},
    )  # fmt: skip


def failed(person):
    parameter = ParameterEstimate("stiffness", None, None, None, "failed:no_pulses")
    return CellEstimate(person, "LRE", None, (parameter,), None, 0, 3, "rigid")


def test_mean_and_people_are_those_of_the_kernel():
    values, sds = np.array([56.0, 60.0, 66.0]), np.array([3.0, 8.0, 5.0])
    pooled = pool_people(
        [cell(f"S{i}", v, s) for i, (v, s) in enumerate(zip(values, sds, strict=True))]
    )
    kernel = partial_pooling(values[None], sds[None])
    (mean,) = pooled.population

    assert (mean.value, mean.ci_low, mean.ci_high, mean.sd) == pytest.approx(
        (kernel.mean[0], kernel.mean_low[0], kernel.mean_high[0], kernel.spread[0])
    )
    assert (mean.method, mean.n_participants, mean.status) == ("rigid_pooled", 3, "ok")
    for i, own in enumerate(pooled.cells):
        assert own.method == "rigid_pooled"
        assert own.parameters[0].value == pytest.approx(kernel.value[0, i])
        assert own.parameters[0].ci_low == pytest.approx(kernel.low[0, i])


def test_undecided_cells_count_with_what_they_say():
    decided = [cell(f"S{i}", 60.0 + i, 2.0) for i in range(3)]
    undecided = cell("S9", 20.0, 25.0, status="undecided")
    (without,) = pool_people(decided).population
    both = pool_people([*decided, undecided])
    assert both.population[0].n_participants == 4
    assert both.population[0].value != pytest.approx(without.value, abs=1e-6)
    # What the others say decides what its own data did not.
    own = both.cells[-1].parameters[0]
    assert own.status == "ok"
    assert 20.0 < own.value < 63.0


def test_a_failed_cell_stays_failed_and_counts_nowhere():
    pooled = pool_people([cell("S1", 50.0, 2.0), cell("S2", 60.0, 2.0), failed("S3")])
    assert pooled.population[0].n_participants == 2
    assert pooled.cells[2].parameters[0].status == "failed:no_pulses"


def test_inertia_is_pooled_in_its_logarithm():
    values = np.array([0.04, 0.05, 0.055, 0.06, 0.08])
    cells = [cell(f"S{i}", v, 0.002, name="inertia") for i, v in enumerate(values)]
    (mean,) = pool_people(cells).population
    assert mean.value == pytest.approx(np.exp(np.log(values).mean()), rel=0.01)
    assert mean.ci_low > 0.0
    # An inertia below zero, as after a device's is taken out, has no logarithm.
    (linear,) = pool_people(
        [*cells, *cells, *cells, cell("S9", -0.001, 0.002, name="inertia")]
    ).population
    assert linear.value is not None


def test_a_value_at_the_bound_stays_a_limit_and_a_vague_one_is_refused():
    values = [20.0, 25.0, 30.0, 35.0, 40.0, 22.0, 28.0, 38.0]
    people = [cell(f"S{i}", v, 4.0) for i, v in enumerate(values)]
    limit = cell("S8", -3.0, 4.0, status="at_bound")
    own = pool_people([*people, limit]).cells[-1].parameters[0]
    assert (own.status, own.ci_low) == ("at_bound", 0.0)
    assert own.ci_high > 0.0
    refused = pool_people([*people, cell("S8", -3.0, 4.0, status="undecided")]).cells[-1]
    assert refused.parameters[0].value is None
    assert refused.parameters[0].unbounded is not None


def posterior(person, measured, sd, *, prior=(60.0, 20.0)):
    """Return a cell as its estimator makes it: what was measured, drawn towards a prior."""
    precision = 1.0 / sd**2 + 1.0 / prior[1] ** 2
    value = (measured / sd**2 + prior[0] / prior[1] ** 2) / precision
    effects = (value - measured, sd**2 - 1.0 / precision)
    return cell(person, value, precision**-0.5, effects=effects)


def test_the_prior_of_each_person_does_not_enter_the_mean():
    rng = np.random.default_rng(0)
    measured = 150.0 + 15.0 * rng.standard_normal(10)
    (drawn,) = pool_people([posterior(f"S{i}", m, 15.0) for i, m in enumerate(measured)]).population
    (alone,) = pool_people([cell(f"S{i}", m, 15.0) for i, m in enumerate(measured)]).population
    assert (drawn.value, drawn.ci_low, drawn.ci_high) == pytest.approx(
        (alone.value, alone.ci_low, alone.ci_high)
    )
    assert drawn.ci_low < 150.0 < drawn.ci_high


def test_people_whose_data_decide_nothing_have_no_mean_however_many_they_are():
    rng = np.random.default_rng(0)
    people = [posterior(f"S{i}", m, 80.0) for i, m in enumerate(rng.normal(150.0, 80.0, 100))]
    pooled = pool_people(people)
    (mean,) = pooled.population
    assert (mean.status, mean.value, mean.sd, mean.ci_low) == ("undecided", None, None, None)
    assert mean.n_participants == 100
    assert [c.parameters for c in pooled.cells] == [c.parameters for c in people]


def test_a_mean_is_undecided_where_its_interval_reaches_further_than_half_of_it():
    far = [cell(f"S{i}", v, 1.0) for i, v in enumerate([10.0, 30.0, 80.0])]
    (mean,) = pool_people(far).population
    assert (mean.status, mean.value, mean.ci_high) == ("undecided", None, None)


def test_values_per_kg_have_errors_per_kg():
    masses = (60.0, 70.0, 80.0)
    cells = [cell(f"S{i}", 60.0 + i, 6.0, mass=m, gain=0.02) for i, m in enumerate(masses)]
    per = np.array([c.parameters[1].unbounded for c in cells])
    sds = np.array([np.hypot(6.0, 0.02 * (60.0 + i)) / m for i, m in enumerate(masses)])
    kernel = partial_pooling(per[None], sds[None])
    mean = next(m for m in pool_people(cells).population if m.parameter == "stiffness_per_mass")
    assert (mean.value, mean.ci_high) == pytest.approx((kernel.mean[0], kernel.mean_high[0]))
    assert mean.unit == "N*m/rad/kg"


def test_timing_points_are_pooled_each_by_itself():
    cells = [cell(f"S{i}", v, 3.0) for i, v in enumerate([56.0, 60.0, 66.0])]
    other = [cell(f"S{i}", v, 3.0, point="MST") for i, v in enumerate([25.0, 26.0, 29.0])]
    alone = pool_people(cells).population[0]
    both = pool_people([*cells, *other]).population
    assert [m.timing_point for m in both] == ["LRE", "MST"]
    assert both[0].value == pytest.approx(alone.value)


def test_one_person_is_no_population():
    pooled = pool_people([cell("S1", 50.0, 2.0)])
    (mean,) = pooled.population
    assert mean.status == "failed:too_few_participants"
    assert (mean.value, mean.sd, mean.ci_low, mean.ci_high) == (None,) * 4
    assert pooled.cells[0].parameters[0].value == 50.0
