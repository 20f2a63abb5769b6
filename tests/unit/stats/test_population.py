"""Means over people by hand."""

from dataclasses import replace

import numpy as np
import pytest

from jointz.results.estimates import CellEstimate, ParameterEstimate
from jointz.results.log_posterior import LogPosterior
from jointz.stats.population import population_means


def cell(person, value, *, point="LRE", status="ok", onset=7.0, name="stiffness"):
    parameter = ParameterEstimate(name, value, None, None, status)
    return CellEstimate(person, point, onset, (parameter,), 99.0, 5, 0, "dissertation")


def test_the_interval_is_students_over_people():
    cells = [cell(f"S{i}", v) for i, v in enumerate([20.0, 22.0, 27.0])]
    (mean,) = population_means(cells)

    assert mean.value == pytest.approx(23.0)
    assert mean.sd == pytest.approx(np.sqrt(13.0))
    half = 4.302652729911275 * np.sqrt(13.0 / 3)  # t of 2 degrees of freedom, from tables
    assert (mean.ci_low, mean.ci_high) == pytest.approx((23.0 - half, 23.0 + half))
    assert (mean.n_participants, mean.status, mean.unit) == (3, "ok", "N*m/rad")
    assert mean.ci_level == 0.95


def test_values_at_the_bound_count_and_failed_ones_do_not():
    cells = [
        *(cell(f"S{i}", 4.0) for i in range(5, 13)),
        cell("S1", 0.0, status="at_bound"),
        cell("S2", 4.0),
        cell("S3", None, status="failed:no_pulses", onset=None),
        cell("S4", None, status="undecided"),
    ]
    (mean,) = population_means(cells)
    assert (mean.value, mean.n_participants) == (pytest.approx(3.6), 10)


@pytest.mark.parametrize(("middle", "status"), [(4.9, "undecided"), (5.1, "ok")])
def test_a_mean_is_undecided_where_its_interval_reaches_further_than_half_of_it(middle, status):
    values = (middle - 1.0, middle, middle + 1.0)  # half an interval: 4.303 / sqrt(3) = 2.484
    (mean,) = population_means([cell(f"S{i}", v) for i, v in enumerate(values)])
    assert (mean.status, mean.n_participants) == (status, 3)
    if status == "undecided":
        assert (mean.value, mean.sd, mean.ci_low, mean.ci_high) == (None,) * 4


@pytest.mark.parametrize("values", [[5.0, 5.1], [5.0], []])
def test_fewer_than_three_people_are_no_population(values):
    cells = [cell(f"S{i}", v) for i, v in enumerate(values)]
    cells.append(cell("S9", None, status="failed:no_pulses"))
    (mean,) = population_means(cells)

    assert mean.status == "failed:too_few_participants"
    assert (mean.value, mean.sd, mean.ci_low, mean.ci_high) == (None,) * 4
    assert mean.n_participants == len(values)


def test_means_of_posteriors_stand_in_the_rows_of_their_cells_undecided_people_included():
    rng, prior = np.random.default_rng(1), np.log([60.0])
    logs = {f"S{k}": np.log(20.0) + 0.1 * rng.standard_normal(1) for k in range(6)}
    posteriors = [
        LogPosterior(s, ("stiffness",), ("LRE",), m, np.eye(1) * 0.01, prior, np.eye(1))
        for s, m in logs.items()
    ]
    cells = [replace(cell(s, None, status="undecided"), method="strapped") for s in logs]
    (mean,) = population_means(cells, posteriors)

    assert (mean.status, mean.n_participants, mean.method) == ("ok", 6, "strapped")
    assert mean.ci_low < 20.0 < mean.ci_high
    assert mean.value == pytest.approx(20.0, rel=0.1)


def test_every_point_and_parameter_has_its_own_mean_in_their_order():
    cells = [
        cell(person, value, point=point, name=name)
        for point, name, value in [("TST", "damping", 1.0), ("LRE", "stiffness", 9.0)]
        for person in ("S1", "S2", "S3")
    ]
    means = population_means(cells)
    assert [(m.timing_point, m.parameter, m.value) for m in means] == [
        ("TST", "damping", 1.0),
        ("LRE", "stiffness", 9.0),
    ]


def test_onsets_are_averaged_on_the_circle():
    (mean,) = population_means([cell("S1", 2.0, onset=99.0), cell("S2", 2.0, onset=3.0)])
    assert mean.onset_gait_pct == pytest.approx(1.0)
    (bench,) = population_means([cell("S1", 1.0, onset=None), cell("S2", 2.0, onset=None)])
    assert bench.onset_gait_pct is None
