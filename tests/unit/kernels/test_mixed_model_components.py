"""Random intercepts of participants and cells against dense likelihoods and closed form."""

import numpy as np
import pytest

from jointz.kernels.statistics.mixed_model_components import (
    cell_blocks,
    fit_components,
    likelihood_ratio,
)


def layout(seed, *, people=5, levels=3, cell_sd=1.0, person_sd=1.0, most=4, drop=0.2):
    rng = np.random.default_rng(seed)
    keep = rng.random((people, levels)) >= drop
    keep[0] = True
    rows = rng.integers(1, most + 1, (people, levels)) * keep
    person = np.repeat(np.repeat(np.arange(people), levels), rows.ravel())
    level = np.repeat(np.tile(np.arange(levels), people), rows.ravel())
    person = np.unique(person, return_inverse=True)[1]
    cell = np.unique(person * levels + level, return_inverse=True)[1]
    y = person_sd * rng.standard_normal(people)[person] + rng.standard_normal(person.size)
    y += cell_sd * rng.standard_normal(cell.max() + 1)[cell]
    X = (level[:, None] == np.arange(levels)).astype(float)
    X[:, 0] = 1.0
    return X, y, person, cell


def test_a_variance_at_0_gains_no_likelihood():
    for seed in range(30):
        X, y, person, cell = layout(seed, person_sd=0.0, cell_sd=0.0)
        blocks = cell_blocks(X, y, person, cell=cell)
        fit = fit_components(blocks)
        for component in (0, 1):
            gain = likelihood_ratio(blocks, fit, component)
            assert (gain == 0) == (fit.variances[component] == 0)


def test_cells_of_two_people_or_of_two_levels_are_refused():
    X, y, person, cell = layout(3)
    with pytest.raises(ValueError, match="cells of one participant and one set of fixed effects"):
        cell_blocks(X, y, person, cell=np.zeros_like(cell))
    with pytest.raises(ValueError, match="cells of one participant"):
        cell_blocks(X, y, np.zeros_like(person), cell=X[:, 1].astype(int) * 0)
