"""Unpredictability of simulated strides: none without variation, more with more of it."""

from math import radians

from benchmarks.unpredictability import simulated_walk, unpredictability

from jointz.rig.sim.presets import GaitSettings, preset


def errors(settings, number=0):
    return unpredictability(simulated_walk(settings, number, source="made"))


def test_strides_that_are_all_the_same_are_predicted():
    result = errors(preset("clean").gait)
    assert result["strides"] > 40
    assert result["linear_150ms_deg"] < 0.05
    assert result["matched_150ms_deg"] < 0.05


def test_error_grows_with_time_and_with_the_change_of_shape():
    small = errors(GaitSettings(shape_harmonics=6, shape_sd_rad=radians(0.5)))
    large = errors(GaitSettings(shape_harmonics=6, shape_sd_rad=radians(1.4)))
    for result in (small, large):
        assert result["linear_50ms_deg"] < result["linear_100ms_deg"] < result["linear_150ms_deg"]
    assert large["linear_100ms_deg"] > 1.3 * small["linear_100ms_deg"]


def test_linear_prediction_is_better_than_the_mean_stride():
    result = errors(preset("nominal").gait)
    assert result["linear_100ms_deg"] < result["matched_100ms_deg"]
