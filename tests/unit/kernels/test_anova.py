"""One-way analysis of variance against scipy and Holm's correction by hand."""

import numpy as np
import pytest
from scipy import stats

from jointz.kernels.statistics.anova import holm, one_way_anova


@pytest.mark.parametrize("sizes", [(28, 28), (3, 11), (5, 6, 9), (1, 2)])
def test_it_is_scipys_f_for_balanced_groups_and_others(sizes):
    rng = np.random.default_rng(len(sizes))
    groups = [170 + k * 0.4 + rng.standard_normal(n) for k, n in enumerate(sizes)]
    labels = np.repeat(np.arange(len(sizes)), sizes)

    found = one_way_anova(np.concatenate(groups), labels)

    expected = stats.f_oneway(*groups)
    assert found.statistic == pytest.approx(expected.statistic, rel=1e-9)
    assert found.p == pytest.approx(expected.pvalue, rel=1e-9)
    assert (found.df_num, found.df_den) == (len(sizes) - 1, sum(sizes) - len(sizes))


@pytest.mark.parametrize(
    ("response", "group"),
    [
        ([1.0, 2.0], [1, 1, 2]),
        ([1.0, np.nan, 2.0], [1, 1, 2]),
        ([1.0, 2.0, 3.0], [1, 1, 1]),
        ([0.1 + 0.2, 0.3, 0.3], [1, 1, 2]),
    ],
)
def test_what_has_no_f_is_refused(response, group):
    with pytest.raises(ValueError, match="one_way_anova"):
        one_way_anova(np.array(response), np.array(group))


@pytest.mark.parametrize("p", [[0.1, 1.1], [np.nan], [-0.1], [[0.1]]])
def test_holm_wants_probabilities(p):
    with pytest.raises(ValueError, match="probabilities"):
        holm(np.array(p))
