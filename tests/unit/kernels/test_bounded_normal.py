"""Intervals of a mean that cannot be negative (Feldman and Cousins 1998)."""

import numpy as np
import pytest
from scipy.stats import binom, norm

from jointz.kernels.bounded_normal import bounded_interval

LEVELS = (0.68, 0.90, 0.95, 0.99)


def slow_acceptance(mean: float, level: float) -> tuple[float, float]:
    """Return the measurements accepted: cells of a grid in order of the ratio, until the level."""
    grid = np.arange(-8.0, mean + 8.0, 0.002)
    ratio = norm.logpdf(grid - mean) - norm.logpdf(grid - np.maximum(grid, 0.0))
    order = np.argsort(-ratio, kind="stable")
    content = np.cumsum(norm.pdf(grid[order] - mean) * 0.002)
    kept = grid[order[: np.searchsorted(content, level) + 1]]
    return float(kept.min()), float(kept.max())


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("measured", [-1.5, -0.4, 0.0, 0.9, 1.7, 2.2, 3.1, 5.0])
def test_ends_are_the_means_that_a_slow_construction_accepts_last(level, measured):
    low, high = bounded_interval(measured, 1.0, level=level)
    margin = 0.02
    assert slow_acceptance(high - margin, level)[0] < measured
    assert slow_acceptance(high + margin, level)[0] > measured
    if low > margin:
        assert slow_acceptance(low + margin, level)[1] > measured
        assert slow_acceptance(low - margin, level)[1] < measured
    else:
        assert slow_acceptance(2 * margin, level)[1] > measured


@pytest.mark.parametrize(
    ("level", "measured", "printed"),
    [
        # Feldman and Cousins 1998, table X.
        (0.95, 0.0, (0.00, 1.96)),
        (0.95, 1.0, (0.00, 2.96)),
        (0.95, 3.0, (1.15, 4.96)),
        (0.90, 0.0, (0.00, 1.64)),
        (0.90, 2.0, (0.58, 3.64)),
        (0.90, 3.0, (1.37, 4.64)),
        (0.99, 0.0, (0.00, 2.58)),
    ],
)
def test_intervals_are_those_of_the_papers_table(level, measured, printed):
    assert bounded_interval(measured, 1.0, level=level) == pytest.approx(printed, abs=0.011)


@pytest.mark.parametrize("measured", [7.9, 9.0, 10.3, 11.0, 12.5, 12.9, 13.1, 40.0])
def test_far_from_the_bound_the_interval_is_the_plain_one(measured):
    assert bounded_interval(measured, 1.0) == pytest.approx(
        (measured - 1.96, measured + 1.96), abs=1e-4
    )


@pytest.mark.parametrize("mean", [0.0, 0.05, 0.3, 1.0, 1.64, 1.97, 2.5, 4.0, 9.0, 11.5, 14.0])
def test_the_claimed_level_is_kept_for_every_mean(mean):
    measured = mean + np.linspace(-6.0, 6.0, 24_001)
    chance = norm.pdf(measured - mean) * (measured[1] - measured[0])
    held = [low <= mean <= high for low, high in (bounded_interval(x, 1.0) for x in measured[::8])]
    coverage = float(chance[::8][held].sum() * 8.0)
    # At zero the construction covers more: measurements below -2 are taken to be -2.
    assert coverage > 0.9485
    assert coverage < 0.9515 or mean < 0.66


def test_random_measurements_are_covered_as_often_as_claimed():
    rng = np.random.default_rng(11)
    means, sd = np.array([0.0, 0.7, 2.0, 6.0]), 3.0
    for mean in means * sd:
        ends = np.array([bounded_interval(x, sd) for x in mean + sd * rng.standard_normal(2000)])
        held = int(((ends[:, 0] <= mean) & (mean <= ends[:, 1])).sum())
        low, high = binom.interval(0.999, 2000, 0.95)
        assert held >= low
        assert held <= high or mean == 0.0


def test_an_interval_has_a_width_however_low_the_measurement():
    widths = [np.ptp(bounded_interval(x, 2.0)) for x in (-50.0, -4.0, -1.0, 0.0, 3.0)]
    assert min(widths) > 2.0 * 0.6
    assert np.all(np.diff(widths) >= 0.0)


def test_ends_rise_with_the_measurement_and_join_the_plain_interval_far_from_the_bound():
    measured = np.linspace(-3.0, 16.0, 400)
    ends = np.array([bounded_interval(x, 1.0) for x in measured])
    assert np.all(np.diff(ends, axis=0) >= 0.0)
    # No jump where the tables end. The lower end leaves the bound steeply: 0.3 within 0.2.
    assert np.abs(np.diff(ends[:, 1])).max() < 0.06
    assert np.abs(np.diff(ends[measured > 3.0], axis=0)).max() < 0.06
    assert ends[-1] == pytest.approx(measured[-1] + np.array([-1.96, 1.96]), abs=1e-3)


@pytest.mark.parametrize("scale", [1e-3, 7.0, 1e6])
def test_the_interval_scales_with_the_unit(scale):
    plain = np.array(bounded_interval(1.9, 1.0))
    assert bounded_interval(1.9 * scale, scale) == pytest.approx(plain * scale)


@pytest.mark.parametrize(
    ("sd", "level"), [(0.0, 0.95), (-1.0, 0.95), (np.nan, 0.95), (1.0, 0.0), (1.0, 1.0)]
)
def test_an_error_without_size_is_refused(sd, level):
    with pytest.raises(ValueError, match="sd > 0 and 0 < level < 1"):
        bounded_interval(1.0, sd, level=level)
