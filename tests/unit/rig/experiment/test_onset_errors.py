"""Onsets against heel strikes, and the theory against independent strides."""

from math import isnan, sqrt

import numpy as np
import pandas as pd
import pytest

from jointz.gait.strides import find_strides
from jointz.rig.experiment.gait.onset_errors import onset_accuracy

NO_GAPS = np.empty((0, 2))
STRIDE_S = 1.1


def even(count=20):
    return find_strides(STRIDE_S * np.arange(count + 1), NO_GAPS)


def table(onsets_s, points):
    return pd.DataFrame({"onset_s": onsets_s, "timing_point": points})


def row_of(pulses, strides, **points):
    result = onset_accuracy(pulses, strides, timing_points=points, strides_in_mean=5)
    assert result["timing_point"].tolist() == list(points)
    return result.iloc[0]


def test_error_is_share_of_the_stride_minus_the_plan():
    onsets = STRIDE_S * (np.array([3, 5, 7]) + np.array([0.40, 0.42, 0.44]))
    row = row_of(table(onsets, "TST"), even(), TST=40.5)
    assert row["error_mean_pct"] == pytest.approx(1.5)
    assert row["error_sd_pct"] == pytest.approx(2.0)


@pytest.mark.parametrize(("share", "planned", "error"), [(0.02, 93.5, 8.5), (0.99, 1.0, -2.0)])
def test_a_pulse_on_the_other_side_of_the_strike_is_late_or_early_not_a_cycle_off(
    share, planned, error
):
    row = row_of(table(STRIDE_S * (np.array([3, 4]) + share), "P"), even(), P=planned)
    assert row["error_mean_pct"] == pytest.approx(error)


def test_points_are_kept_apart_and_one_without_pulses_has_no_numbers():
    pulses = table(STRIDE_S * np.array([3.07, 4.41, 5.07]), ["LRE", "TST", "LRE"])
    result = onset_accuracy(
        pulses, even(), timing_points={"LRE": 7.0, "TST": 40.5, "MSW": 81.0}, strides_in_mean=5
    )
    assert result["n"].tolist() == [2, 1, 0]
    assert result["error_mean_pct"].tolist()[:2] == pytest.approx([0.0, 0.5])
    assert isnan(result["error_sd_pct"][1])
    assert isnan(result["error_mean_pct"][2])


def test_pulses_outside_accepted_strides_do_not_count():
    strikes = np.array([0.0, 1.1, 2.2, 3.3, 5.5, 6.6])  # one strike was lost
    onsets = [-0.5, 1.5, 4.4, 9.0]
    row = row_of(table(onsets, "P"), find_strides(strikes, NO_GAPS), P=36.0)
    assert row["n"] == 1


def test_no_pulses_and_no_strides_are_no_error():
    row = row_of(table(np.array([]), []), even(), P=7.0)
    assert row["n"] == 0
    row = row_of(table([1.0], "P"), find_strides(np.array([0.0]), NO_GAPS), P=7.0)
    assert row["n"] == 0
    assert isnan(row["theory_sd_pct"])


@pytest.mark.parametrize(("in_mean", "planned"), [(1, 81.0), (5, 7.0), (20, 40.5)])
def test_the_theory_is_what_independent_strides_do(in_mean, planned):
    rng = np.random.default_rng(8)
    variation, count = 0.02, 12_000
    duration = STRIDE_S * (1.0 + variation * rng.standard_normal(count))
    strikes = np.concatenate([[0.0], np.cumsum(duration)])
    means = np.convolve(duration, np.full(in_mean, 1.0 / in_mean), mode="valid")[:-1]
    onsets = strikes[in_mean:-1] + planned / 100.0 * means
    row = onset_accuracy(
        table(onsets, "P"),
        find_strides(strikes, NO_GAPS),
        timing_points={"P": planned},
        strides_in_mean=in_mean,
    ).iloc[0]
    assert row["n"] == pytest.approx(count - in_mean, abs=2)
    assert row["theory_sd_pct"] == pytest.approx(
        planned * variation * sqrt(1.0 + 1.0 / in_mean), rel=0.03
    )
    # The SD of 12 000 draws is good to 0.65 %, a mean shared by n strides makes it less so.
    assert row["error_sd_pct"] == pytest.approx(row["theory_sd_pct"], rel=0.04)
    # Dividing by a stride that varies shifts the mean by p c^2.
    assert row["error_mean_pct"] == pytest.approx(planned * variation**2, abs=0.05)
