"""The printed numbers of chapter II against each other: every audit note is recomputed."""

import numpy as np
import pytest

from jointz.reference import chapter2

TABLES = {"stiffness": chapter2.STIFFNESS_ERRORS, "inertia": chapter2.INERTIA_ERRORS}


def means(row):
    return np.array([row[t].value for t in chapter2.TRAJECTORIES])


def test_shares_of_significant_anovas_follow_from_the_exceptions():
    pairs = len(chapter2.CASES) * len(chapter2.TRAJECTORIES)
    missing = {key: len(found) for key, found in chapter2.ANOVA_NOT_SIGNIFICANT.items()}
    shares = chapter2.SIGNIFICANT_SHARES
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
        assert share == chapter2.UNDERESTIMATED_BY_TRAJECTORY[response].value


@pytest.mark.parametrize("response", TABLES)
def test_better_at_higher_values_holds_but_for_the_named_trajectory(response):
    low, high = (np.abs(means(row)) for row in TABLES[response].values())
    worse = np.array(chapter2.TRAJECTORIES)[high >= low]
    assert "".join(worse) == chapter2.HIGHER_IS_BETTER_EXCEPT[response]
