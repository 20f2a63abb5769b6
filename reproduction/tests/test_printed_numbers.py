"""The printed numbers against each other: every audit note is recomputed."""

import numpy as np
import pytest
from reproduction import printed_numbers
from reproduction.literature import STUDIES

from jointz.reference import chapter4

TABLES = {"stiffness": printed_numbers.STIFFNESS_ERRORS, "inertia": printed_numbers.INERTIA_ERRORS}


def means(row):
    return np.array([row[t].value for t in printed_numbers.TRAJECTORIES])


def test_shares_of_significant_anovas_follow_from_the_exceptions():
    pairs = len(printed_numbers.CASES) * len(printed_numbers.TRAJECTORIES)
    missing = {key: len(found) for key, found in printed_numbers.ANOVA_NOT_SIGNIFICANT.items()}
    shares = printed_numbers.SIGNIFICANT_SHARES
    for effect in ("type", "direction"):
        without = missing["stiffness", effect] + missing["inertia", effect]
        assert shares[effect].value == 100 * (1 - without / (2 * pairs))
    total = 100 * (1 - sum(missing.values()) / (4 * pairs))
    assert total == 91.25
    assert int(total) == shares["all"].value


def test_underestimates_by_trajectory_follow_from_the_tables():
    for response, table in TABLES.items():
        over_loads = np.mean([means(row) for row in table.values()], axis=0)
        share = 100 * (over_loads < 0).mean()
        assert share == printed_numbers.UNDERESTIMATED_BY_TRAJECTORY[response].value


@pytest.mark.parametrize("response", TABLES)
def test_better_at_higher_values_holds_but_for_the_named_trajectory(response):
    low, high = (np.abs(means(row)) for row in TABLES[response].values())
    worse = np.array(printed_numbers.TRAJECTORIES)[high >= low]
    assert "".join(worse) == printed_numbers.HIGHER_IS_BETTER_EXCEPT[response]


def test_the_pilots_mean_vaf_and_that_of_others_are_consistent():
    vaf = printed_numbers.PILOT_VAF
    assert vaf["mean"].value == pytest.approx((vaf["1"].value + vaf["2"].value) / 2, abs=0.05)
    assert STUDIES["tucker"].vaf.value == printed_numbers.OTHER_VAF.value


@pytest.mark.parametrize("name", printed_numbers.RANGES)
def test_ranges_are_largest_and_smallest_mean_but_for_the_noted_one(name):
    high, low = printed_numbers.RANGES[name]
    means = [cell.value for cell in chapter4.MEANS[name].values()]
    assert high.value == max(means)
    assert (low.value == min(means)) == (low.note == "")
