"""The exact test of a variance between groups and the interval of its ratio."""

import numpy as np
import pytest

from jointz.kernels.statistics.mixed_model_groups import group_variance


def complete(seed, people=6, levels=4, sd=1.0):
    rng = np.random.default_rng(seed)
    person, level = np.indices((people, levels)).reshape(2, -1)
    y = sd * rng.standard_normal(people)[person] + rng.standard_normal(person.size) + level
    return (level[:, None] == np.arange(levels)).astype(float), y, person


def test_no_variance_between_groups_has_an_interval_from_0():
    X, y, person = complete(5)
    rest = y - np.repeat(y.reshape(6, 4).mean(axis=1), 4)

    made = group_variance(X, rest, person)

    assert (made.ratio_low, made.ratio_high) == (0, 0)
    assert made.test.p == pytest.approx(1)


@pytest.mark.parametrize(
    ("rows", "df"), [(slice(0, 4), "0 degrees.*and 0"), (slice(0, None, 5), "and 0 inside")]
)
def test_groups_that_cannot_be_told_apart_are_refused(rows, df):
    X, y, person = complete(6)
    X = X[rows][:, X[rows].any(axis=0)]

    with pytest.raises(ValueError, match=df):
        group_variance(X, y[rows], person[rows])


def test_groups_that_are_alike_to_rounding_are_refused():
    X, _, person = complete(7)
    alike = np.tile([0.1, 0.2, 0.7, 1.1], 6)
    for values in (alike, alike + 1e6, alike + 3.3 * person):
        with pytest.raises(ValueError, match="vary inside the groups, none does"):
            group_variance(X, values, person)
