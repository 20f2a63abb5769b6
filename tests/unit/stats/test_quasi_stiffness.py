"""Quasi-stiffness: closed forms, Winter's mean stride, and the published p-value."""

from math import radians

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from jointz.core.errors import DataError
from jointz.core.gait_phases import PHASES, TIMING_POINTS
from jointz.reference import chapter4, row_mean
from jointz.results.statistics.quasi_stiffness_fit import QuasiStiffnessDoubt
from jointz.stats.quasi_stiffness_slopes import compare_quasi_stiffness, quasi_stiffness

GAIT_PCT = np.linspace(0.0, 100.0, 101)
#: Rises and falls over the cycle; the timing points lie on its slopes, but for MST, near its top.
ANGLE = 0.5 + 0.4 * np.sin(2 * np.pi * GAIT_PCT / 100.0)


def published_stiffness():
    return {point: row_mean(row) for point, row in chapter4.STIFFNESS.items()}


@pytest.fixture
def winter(real_data):
    table = pd.read_csv(real_data / "winter_normal" / "winter_normal_tidy.csv")
    return {
        "angle": np.radians(table["knee_angle_deg"].to_numpy()),
        "moment": table["knee_moment_Nm_per_kg"].to_numpy(),
        "gait_pct": table["gait_percent"].to_numpy(),
    }


# --- slopes and secant ---------------------------------------------------------------------------


def test_a_spring_with_an_offset_has_its_stiffness_as_slope_but_not_as_secant():
    found = quasi_stiffness(ANGLE, 2.5 * (ANGLE - 0.1), moment_unit="N*m")

    assert found.unit == "N*m/rad"
    for point, onset in TIMING_POINTS.items():
        angle = np.interp(onset, GAIT_PCT, ANGLE)
        assert found.estimate(point).value == pytest.approx(2.5, rel=1e-12)
        assert found.estimate(point, "local_slope").value == pytest.approx(2.5, rel=1e-12)
        secant = found.estimate(point, "secant").value
        assert secant == pytest.approx(2.5 * (angle - 0.1) / angle, rel=1e-12)


def test_a_slope_is_the_regression_over_the_phase():
    rng = np.random.default_rng(4)
    moment = ANGLE + 0.2 * rng.standard_normal(ANGLE.size)
    found = quasi_stiffness(ANGLE, moment)

    for point in TIMING_POINTS:
        start, end = PHASES[point]
        nodes = np.arange(start, end + 0.125, 0.25)
        line = stats.linregress(
            np.interp(nodes, GAIT_PCT, ANGLE), np.interp(nodes, GAIT_PCT, moment)
        )
        estimate = found.estimate(point)
        assert estimate.value == pytest.approx(line.slope, rel=1e-10)
        assert estimate.r_squared == pytest.approx(line.rvalue**2, rel=1e-9)
        assert (estimate.start_gait_pct, estimate.end_gait_pct) == (start, end)


def test_kilograms_scale_every_measure():
    moment = 40.0 + 100.0 * ANGLE
    whole = quasi_stiffness(ANGLE, moment, moment_unit="N*m")
    per_mass = quasi_stiffness(ANGLE, moment / 80.0)

    assert per_mass.unit == "N*m/rad/kg"
    for measure in ("slope", "secant"):
        scaled = {point: 80.0 * value for point, value in per_mass.values(measure).items()}
        assert whole.values(measure) == pytest.approx(scaled, rel=1e-12)


# --- doubts --------------------------------------------------------------------------------------


TURNING = 0.2 + 0.3 * np.abs(GAIT_PCT - 40.5) / 50.0
NARROW = 0.2 + radians(0.9) * GAIT_PCT / 10.0  # 0.9 deg over 10 %
STRAIGHT = 0.1 + GAIT_PCT / 100.0
WAVE = np.cos(2 * np.pi * (GAIT_PCT - 40.5) / 19.0)
NEAR_ZERO = radians(0.5) + (GAIT_PCT - 7.0) / 50.0


@pytest.mark.parametrize(
    ("angle", "moment", "point", "measure", "doubts"),
    [
        (TURNING, TURNING, "TST", "slope", (QuasiStiffnessDoubt.ANGLE_TURNS,)),
        (TURNING, TURNING, "PSW", "slope", ()),
        (NARROW, NARROW, "LRE", "slope", (QuasiStiffnessDoubt.SMALL_RANGE,)),
        (NARROW, NARROW, "MST", "slope", ()),
        (STRAIGHT, WAVE, "TST", "slope", (QuasiStiffnessDoubt.NOT_A_LINE,)),
        (NEAR_ZERO, NEAR_ZERO, "LRE", "secant", (QuasiStiffnessDoubt.SMALL_ANGLE,)),
    ],
)
def test_a_measure_that_may_mislead_is_marked(angle, moment, point, measure, doubts):
    estimate = quasi_stiffness(angle, moment).estimate(point, measure)

    assert estimate.doubts == doubts
    assert estimate.status == ("ill_conditioned" if doubts else "ok")


@pytest.mark.parametrize("offset", [0.0, 0.2])
def test_several_strides_in_one_curve_are_refused(offset):
    two_people = np.concatenate([ANGLE, ANGLE, ANGLE, ANGLE + offset, 0.9 * ANGLE, ANGLE + offset])
    with pytest.raises(DataError, match="the angle repeats 6 times"):
        quasi_stiffness(two_people, two_people)
    with pytest.raises(DataError, match="Several strides or people in one table"):
        quasi_stiffness(two_people, two_people, gait_pct=np.tile(GAIT_PCT, 6))
    ramp = np.linspace(0.0, 1.0, 303)
    assert quasi_stiffness(ramp, ramp).estimate("LRE").value == pytest.approx(1.0)
    twice = np.tile(ANGLE[::2], 2)  # one stride of two alike halves, whose phases say so
    assert quasi_stiffness(twice, twice, gait_pct=np.linspace(0, 100, twice.size)).estimates


def test_an_angle_that_rests_has_no_slope_and_no_secant_at_zero():
    angle = np.where(GAIT_PCT < 60, 0.0, 0.4)
    found = quasi_stiffness(angle, np.ones_like(angle))

    for measure in ("slope", "local_slope", "secant"):
        estimate = found.estimate("LRE", measure)
        assert (estimate.value, estimate.status) == (None, "undecided")
        assert estimate.doubts == (QuasiStiffnessDoubt.NO_RANGE,)
    assert "LRE" not in found.values("secant")


def test_two_nodes_make_no_slope():
    found = quasi_stiffness(ANGLE[::2], ANGLE[::2], timing_points={"ICO": 1.0, "LRE": 7.0})

    assert found.estimate("ICO").doubts == (QuasiStiffnessDoubt.TOO_FEW_NODES,)
    assert found.estimate("ICO").value is None
    assert found.estimate("ICO", "local_slope").start_gait_pct == 0.0  # cut at the cycle's end
    assert found.estimate("LRE").status == "ok"


# --- Winter's mean stride ------------------------------------------------------------------------


@pytest.mark.real_data
def test_slopes_of_winters_knee_are_known_and_doubted_at_its_smallest_flexion_only(winter):
    found = quasi_stiffness(**winter)
    known = {"LRE": 3.6, "MST": 3.8, "TST": 1.35, "PSW": 0.38, "ISW": -0.22, "MSW": 0.18}

    for point, value in known.items():
        half_digit = 0.05 if point in ("LRE", "MST") else 0.005
        assert abs(found.values()[point] - value) <= half_digit
    marked = found.to_frame().query("status != 'ok'")
    assert marked["timing_point"].tolist() == ["TST", "TST"]
    assert set(marked["measure"]) == {"slope", "local_slope"}


# --- the published comparison --------------------------------------------------------------------


def test_the_printed_p_comes_back_from_the_printed_differences():
    found = compare_quasi_stiffness(chapter4.implied_quasi_stiffness(), published_stiffness())

    assert round(found.p, 4) == chapter4.QUASI_STIFFNESS_P.value == 0.3374
    assert round(found.statistic, 3) == -1.020
    assert round(found.df, 2) == 8.06
    assert found.n == 6
    for point in found.points:
        printed = chapter4.QUASI_STIFFNESS_DIFFERENCES[point.timing_point].value
        assert point.difference_pct == pytest.approx(printed, rel=1e-12)


@pytest.mark.parametrize("n", [2, 6])
def test_the_interval_is_welchs_as_in_scipy(n):
    q, k = np.random.default_rng(5).normal(1.0, 2.0, (2, n))
    names = [f"P{i}" for i in range(n)]
    found = compare_quasi_stiffness(
        dict(zip(names, q, strict=True)), dict(zip(names, k, strict=True)), alpha=0.1
    )
    test = stats.ttest_ind(q, k, equal_var=False)
    interval = test.confidence_interval(0.9)
    assert (found.p, found.df) == pytest.approx((test.pvalue, test.df), rel=1e-10)
    assert (found.ci_low, found.ci_high) == pytest.approx((interval.low, interval.high), rel=1e-9)


def test_a_stiffness_of_zero_has_no_percentage():
    found = compare_quasi_stiffness({"A": 1.0, "B": 2.0}, {"A": 0.0, "B": 1.0})

    assert found.points[0].difference_pct is None
    assert found.points[1].difference_pct == 100.0


# --- bad input -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"angle": np.degrees(ANGLE)}, "degrees"),
        ({"angle": ANGLE[:-1]}, "length"),
        ({"moment": np.where(GAIT_PCT == 30.0, np.nan, ANGLE)}, "node 30"),
        ({"gait_pct": GAIT_PCT[::-1]}, "gait_pct"),
        ({"gait_pct": GAIT_PCT / 100.0}, "1 %"),
        ({"timing_points": {"LRE": 107.0}}, "100 %"),
        ({"timing_points": {}}, "timing"),
        ({"window_pct": 0.0}, "window_pct"),
        ({"moment_unit": "lbf*in"}, "moment"),
    ],
)
def test_a_curve_that_cannot_be_used_is_refused_with_advice(change, message):
    call = {"angle": ANGLE, "moment": ANGLE} | change
    with pytest.raises(DataError, match=message):
        quasi_stiffness(**call)


@pytest.mark.parametrize(
    ("quasi", "stiffness", "alpha", "message"),
    [
        ({"A": 1.0, "B": 2.0}, {"A": 1.0, "C": 2.0}, 0.05, "timing points"),
        ({"A": 1.0}, {"A": 2.0}, 0.05, "at least 2"),
        ({"A": 1.0, "B": float("nan")}, {"A": 1.0, "B": 2.0}, 0.05, "finite"),
        ({"A": 1.0, "B": 1.0}, {"A": 2.0, "B": 2.0}, 0.05, "vary"),
        ({"A": 1.0, "B": 2.0}, {"A": 1.0, "B": 3.0}, 5.0, "alpha"),
    ],
)
def test_a_comparison_that_cannot_be_made_is_refused(quasi, stiffness, alpha, message):
    with pytest.raises(DataError, match=message):
        compare_quasi_stiffness(quasi, stiffness, alpha=alpha)
