"""What the text states of other devices and studies, against the other chapters."""

import pytest

from jointz.reference import chapter4
from jointz.reference.literature import (
    stated_stiffness_range,
)


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
