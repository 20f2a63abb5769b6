"""One participant's inertia unlike the others'."""

import pytest

from jointz.analysis.study_statistics import inertias_out_of_line
from jointz.results.estimates import CellEstimate, ParameterEstimate


def cells(inertias, *, relative_sd=0.05):
    found = []
    for k, value in enumerate(inertias):
        for point in ("LRE", "MST", "TST"):
            reach = 1.96 * relative_sd * value
            p = ParameterEstimate("inertia", value, value - reach, value + reach, "ok")
            found.append(CellEstimate(f"S{k:02d}", point, 10.0, (p,), 99.0, 5, 0, "rigid"))
    return found


USUAL = (0.05, 0.055, 0.06, 0.052, 0.066, 0.048)


def test_people_who_differ_as_people_do_are_in_line():
    assert inertias_out_of_line(cells(USUAL)) == {}


@pytest.mark.parametrize("factor", [0.3, 57.3])
def test_an_inertia_several_times_that_of_the_others_is_told_with_its_ratio(factor):
    found = inertias_out_of_line(cells((*USUAL, 0.055 * factor)))
    assert list(found) == ["S06"]
    assert found["S06"] == pytest.approx(factor, rel=0.1)


def test_a_value_that_is_hardly_known_is_not_out_of_line():
    there = cells(USUAL)
    unsure = cells((0.14,), relative_sd=0.4)
    named = [CellEstimate("S99", *[getattr(c, n) for n in c.__slots__[1:8]]) for c in unsure]
    assert inertias_out_of_line([*there, *named]) == {}


def test_among_fewer_than_five_nobody_is_out_of_line():
    assert inertias_out_of_line(cells((0.05, 0.05, 0.05, 5.0))) == {}


def test_cells_without_an_inertia_do_not_count():
    none = ParameterEstimate("inertia", None, None, None, "undecided", unbounded=3.0)
    empty = CellEstimate("S99", "LRE", 10.0, (none,), 99.0, 5, 0, "rigid")
    assert inertias_out_of_line([*cells(USUAL), empty]) == {}
