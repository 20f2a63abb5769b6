"""Descriptive statistics by hand."""

import pytest

from jointz.core.events import GapRecord, PulseRecord, StrideRecord
from jointz.results.estimates import CellEstimate
from jointz.stats.description import onset_accuracy, stride_summary, vaf_summary


def pulse(measured, *, point="LRE", target=7.0):
    return PulseRecord("S1", "p.csv", 1.0, 0.25, 17.0, point, target, measured)


def test_onset_accuracy_is_told_on_the_circle_in_the_order_of_the_cycle():
    pulses = [
        pulse(82.0, point="MSW", target=81.0),
        pulse(99.0, point="ICO", target=1.0),
        pulse(2.0, point="ICO", target=1.0),
        pulse(None),
        pulse(50.0, point="trial", target=None),
    ]
    first, missing, second = onset_accuracy(pulses)

    assert (first["timing_point"], first["n"]) == ("ICO", 2)
    assert first["mean_pct"] == pytest.approx(0.5)
    assert first["sd_pct"] == pytest.approx(3.0 / 2**0.5)
    assert second == {
        "timing_point": "MSW", "target_pct": 81.0, "n": 1, "n_missing": 0, "mean_pct": 82.0,
        "sd_pct": None,
    }  # fmt: skip
    assert missing == {
        "timing_point": "LRE", "target_pct": 7.0, "n": 0, "n_missing": 1, "mean_pct": None,
        "sd_pct": None,
    }  # fmt: skip


def test_strides_are_counted_by_recording_with_its_gaps():
    strides = [
        StrideRecord("S1", "a.csv", "perturbed", 0.0, 1.0),
        StrideRecord("S1", "a.csv", "perturbed", 1.0, 1.2),
        StrideRecord("S1", "a.csv", "perturbed", 2.2, 5.0, "missing_strike"),
        StrideRecord("S1", "b.csv", "unperturbed", 0.0, 5.0, "missing_strike"),
    ]
    gaps = [
        GapRecord("S1", "a.csv", 0.5, 0.03),
        GapRecord("S1", "a.csv", 0.9, 0.137),
        GapRecord("S2", "a.csv", 0.9, 9.0),
    ]
    a, b = stride_summary(strides, gaps)

    assert (a["n_accepted"], a["n_rejected"], a["n_strikes"]) == (2, 1, 4)
    assert a["mean_s"] == pytest.approx(1.1)
    assert a["sd_s"] == pytest.approx(0.2 / 2**0.5)
    assert (a["n_gaps"], a["longest_gap_s"]) == (2, 0.137)
    assert (b["n_accepted"], b["mean_s"], b["sd_s"]) == (0, None, None)
    assert (b["n_gaps"], b["longest_gap_s"]) == (0, 0.0)


def test_vaf_is_summed_up_over_cells_that_have_one():
    def cell(vaf):
        return CellEstimate("S1", "LRE", 7.0, (), vaf, 5, 0, "dissertation")

    found = vaf_summary([cell(90.0), cell(None), cell(99.0), cell(96.0)])
    assert found["mean_pct"] == pytest.approx(95.0)
    assert found["median_pct"] == 96.0
    assert found["sd_pct"] == pytest.approx(21.0**0.5)
    assert vaf_summary([cell(90.0)])["sd_pct"] is None
    assert vaf_summary([]) == {"mean_pct": None, "sd_pct": None, "median_pct": None}
