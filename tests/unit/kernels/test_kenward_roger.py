"""Kenward and Roger's test: exact where it must be, and as its formulas say elsewhere."""

import numpy as np
import pytest

from jointz.kernels.statistics.kenward_roger import (
    kenward_roger_test,
)
from jointz.kernels.statistics.mixed_model_components import fit_random_intercept


def complete(seed, people=6, levels=4, person_sd=2.0):
    rng = np.random.default_rng(seed)
    # People evenly apart: their variance is above 0.
    table = person_sd * np.arange(people)[:, None] + rng.standard_normal((people, levels))
    person, level = np.indices(table.shape).reshape(2, -1)
    X = (level[:, None] == np.arange(levels)).astype(float)
    X[:, 0] = 1.0
    return table, X, table.ravel(), person


def test_contrasts_that_depend_on_each_other_are_refused():
    _, X, y, person = complete(7)
    fit = fit_random_intercept(X, y, person)

    with pytest.raises(ValueError, match="do not depend on each other"):
        kenward_roger_test(fit, np.array([[0.0, 1, -1, 0], [0, 0, 1, -1], [0, 1, 0, -1]]))
