"""Curves over the cycle as a result: found by name, tabulated, drawn."""

import pytest

from jointz.results.series.cycle_curve import MEAN, CurvePoint, ParameterBand, PhaseCurve


def band(participant, parameter="stiffness", *, decided=True):
    points = (CurvePoint("LRE", 10.0, 90.0, 80.0, 100.0, decided),)
    return ParameterBand(
        participant,
        parameter,
        (90.0, 40.0, 90.0),
        (80.0, 20.0, 80.0),
        (100.0, 60.0, 100.0),
        "logarithmic",
        15.0,
        points,
    )


def curve(*bands, warnings=()):
    return PhaseCurve((0.0, 50.0, 100.0), bands, 0.95, "process", {"window_s": 0.1}, warnings)


def test_a_curve_is_found_by_parameter_and_person():
    both = curve(band("S1"), band(MEAN))
    assert both.band("stiffness") is both.bands[1]
    assert both.band("stiffness", "S1") is both.bands[0]
    with pytest.raises(KeyError, match="stiffness of S1"):
        both.band("damping", "S1")


def test_tables_have_a_row_a_phase_and_a_row_an_estimate():
    both = curve(band("S1"), band("S1", "damping"))
    table, points = both.to_frame(), both.points_frame()
    assert table.shape == (6, 8)
    assert list(table["unit"].unique()) == ["N*m/rad", "N*m*s/rad"]
    assert list(points["gait_pct"]) == [10.0, 10.0]


def test_the_text_says_where_a_curve_is_low_and_high():
    text = curve(band("S1"), warnings=("S2 is missing",)).summary()
    assert "40 (at 50 %) to 90 N*m/rad (at 0 %)" in text
    assert "Note: S2 is missing" in text


def test_a_parameter_without_a_curve_draws_an_empty_figure():
    axes = curve(band("S1")).plot(parameter="damping")
    assert axes.lines == [] or len(axes.lines) == 0
