"""Intervals of a mean that cannot be negative (Feldman and Cousins 1998)."""

import numpy as np
import pytest
from scipy.stats import norm

from jointz.identify.walking.decisions import bounded_interval


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


@pytest.mark.parametrize("mean", [0.0, 0.3, 1.64, 2.5, 9.0, 14.0])
def test_the_claimed_level_is_kept_for_every_mean(mean):
    measured = mean + np.linspace(-6.0, 6.0, 24_001)
    chance = norm.pdf(measured - mean) * (measured[1] - measured[0])
    held = [low <= mean <= high for low, high in (bounded_interval(x, 1.0) for x in measured[::8])]
    coverage = float(chance[::8][held].sum() * 8.0)
    # At zero the construction covers more: measurements below -2 are taken to be -2.
    assert coverage > 0.9485
    assert coverage < 0.9515 or mean < 0.66


def test_ends_rise_with_the_measurement_and_join_the_plain_interval_far_from_the_bound():
    measured = np.linspace(-3.0, 16.0, 400)
    ends = np.array([bounded_interval(x, 1.0) for x in measured])
    assert np.all(np.diff(ends, axis=0) >= 0.0)
    # No jump where the tables end. The lower end leaves the bound steeply: 0.3 within 0.2.
    assert np.abs(np.diff(ends[:, 1])).max() < 0.06
    assert np.abs(np.diff(ends[measured > 3.0], axis=0)).max() < 0.06
    assert ends[-1] == pytest.approx(measured[-1] + np.array([-1.96, 1.96]), abs=1e-3)


@pytest.mark.parametrize(
    ("sd", "level"), [(0.0, 0.95), (-1.0, 0.95), (np.nan, 0.95), (1.0, 0.0), (1.0, 1.0)]
)
def test_an_error_without_size_is_refused(sd, level):
    with pytest.raises(ValueError, match="sd > 0 and 0 < level < 1"):
        bounded_interval(1.0, sd, level=level)
