"""The printed numbers of chapter III against each other: every audit note is recomputed."""

import pytest

from jointz.reference import chapter3


def test_mean_vaf_of_the_pilot_is_that_of_its_two_people():
    vaf = chapter3.PILOT_VAF
    assert vaf["mean"].value == pytest.approx((vaf["1"].value + vaf["2"].value) / 2, abs=0.05)
