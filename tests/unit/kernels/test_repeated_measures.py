"""Repeated-measures analysis of variance: what it refuses."""

import numpy as np
import pytest

from jointz.kernels.statistics.repeated_measures import repeated_measures_anova


@pytest.mark.parametrize("values", [np.ones((3, 3)), np.ones((1, 4)), np.full((3, 3), np.nan)])
def test_a_table_without_error_or_with_gaps_is_refused(values):
    with pytest.raises(ValueError, match="repeated_measures_anova"):
        repeated_measures_anova(values)
