"""Repeated-measures analysis of variance against explicit sums, and paired t against scipy."""

import numpy as np
import pytest

from jointz.kernels.statistics.repeated_measures import paired_t_test, repeated_measures_anova


@pytest.mark.parametrize("values", [np.ones((3, 3)), np.ones((1, 4)), np.full((3, 3), np.nan)])
def test_a_table_without_error_or_with_gaps_is_refused(values):
    with pytest.raises(ValueError, match="repeated_measures_anova"):
        repeated_measures_anova(values)


@pytest.mark.parametrize("second", [[1.0], [0.0, 1.0, 2.0], [np.nan, 1.0, 2.0]])
def test_differences_without_spread_are_refused(second):
    with pytest.raises(ValueError, match="paired_t_test: expected"):
        paired_t_test(np.arange(len(second)) + 1.0, np.array(second))
