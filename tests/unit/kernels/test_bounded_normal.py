"""Intervals of a mean that cannot be negative (Feldman and Cousins 1998)."""

import numpy as np
import pytest
from scipy.stats import binom, norm

from jointz.kernels.bounded_normal import bounded_interval

#: Table X of the paper, 95 %: measured -> interval of the mean, with unit sd.
TABLE_95 = {
    -2.0: (0.00, 0.65),
    -1.0: (0.00, 1.14),
    0.0: (0.00, 1.96),
    0.5: (0.00, 2.46),
    1.0: (0.00, 2.96),
    1.5: (0.00, 3.46),
    1.8: (0.11, 3.76),
    2.0: (0.35, 3.96),
    2.5: (0.78, 4.46),
    3.0: (1.15, 4.96),
}
#: The same, 90 %.
TABLE_90 = {0.0: (0.00, 1.64), 1.0: (0.00, 2.64), 2.0: (0.58, 3.64), 3.0: (1.37, 4.64)}


@pytest.mark.parametrize(
    ("level", "measured", "printed"),
    [(0.95, x, ends) for x, ends in TABLE_95.items()]
    + [(0.90, x, ends) for x, ends in TABLE_90.items()],
)
def test_intervals_are_those_of_the_papers_table(level, measured, printed):
    # The paper's own steps are 0.01 in both.
    assert bounded_interval(measured, 1.0, level=level) == pytest.approx(printed, abs=0.011)


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
    assert np.abs(np.diff(ends, axis=0)).max() < 0.15  # no jump where the tables end
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
