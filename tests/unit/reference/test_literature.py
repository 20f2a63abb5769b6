"""What the text states of other devices and studies, against the other chapters."""

import pytest

from jointz.core.gait_phases import TIMING_POINTS, phase_name
from jointz.reference import chapter2, chapter3, chapter4
from jointz.reference.literature import (
    COMPARISONS,
    SAGITTAL_STIFFNESS_ERRORS,
    SECOND_ORDER_VAF,
    STUDIES,
    stated_stiffness_range,
)


def test_the_seven_studies_are_there_with_citation_and_source():
    assert set(STUDIES) == {"rouse", "tucker", "lee", "ficanha", "kooij", "pfeifer", "sartori"}
    assert all(s.citations and s.source and s.conditions for s in STUDIES.values())


def test_every_printed_error_of_another_device_belongs_to_a_study_or_the_range():
    owned = [error for study in STUDIES.values() for error in study.errors]
    printed = [*chapter2.OTHER_DEVICES, *chapter3.OTHER_DEVICES]
    assert sorted(map(repr, [*owned, SAGITTAL_STIFFNESS_ERRORS])) == sorted(map(repr, printed))


def test_chapters_3_and_4_give_the_same_window_and_fit_of_others():
    assert STUDIES["kooij"].window.value == chapter3.OTHER_WINDOW.value == 275.0
    assert STUDIES["tucker"].vaf.value == chapter3.OTHER_VAF.value == 72.0
    fits = {p.value for p in SECOND_ORDER_VAF.values()}
    assert fits == {chapter3.SECOND_ORDER_VAF.value}


def test_comparisons_name_known_studies_and_timing_points():
    for said in COMPARISONS:
        assert said.study in STUDIES
        assert set(said.timing_points) <= set(TIMING_POINTS)
        assert said.words
        assert (said.factor_low is None) == (said.factor_high is None)
    assert len({(c.study, c.quantity, c.timing_points) for c in COMPARISONS}) == len(COMPARISONS)


def test_tuckers_points_of_swing_lie_in_initial_swing():
    places = [62.0 + share * 38.0 for share in (0.2, 0.3)]
    assert [phase_name(place) for place in places] == ["ISW", "ISW"]
    assert {c.timing_points for c in COMPARISONS if c.study == "tucker"} == {("ISW",)}


def test_a_factor_in_words_gives_a_range():
    low, high = stated_stiffness_range("pfeifer", "ISW")
    mean = chapter4.STIFFNESS_MEANS["ISW"].value
    assert (low, high) == pytest.approx((2 * mean, 3 * mean))
    assert stated_stiffness_range("pfeifer", "TST") is None
    assert stated_stiffness_range("kooij", "ISW") is None


def test_an_unknown_study_or_timing_point_is_refused():
    with pytest.raises(KeyError, match="expected one of rouse"):
        stated_stiffness_range("winter", "ISW")
    with pytest.raises(KeyError):
        stated_stiffness_range("pfeifer", "XYZ")
