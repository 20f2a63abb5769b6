"""Curves over the cycle from cells whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest

from jointz import phase_curve
from jointz.core.errors import DataError, EstimationError
from jointz.core.gait_phases import TIMING_POINTS
from jointz.identify.over_cycle.phase_curve import timing_points_of_phases
from jointz.results.estimates import CellEstimate, ParameterEstimate
from jointz.results.series.cycle_curve import MEAN
from jointz.results.study_analysis import StudyAnalysis
from jointz.stats.population import population_means

OFFSET_PCT = 5.6  # of the centre behind the onset, as in walking


def stiffness(pct):
    return 60.0 + 40.0 * np.cos(2.0 * np.pi * (pct - 10.0) / 100.0)


def cell(person, point, onset, value, *, sd=1.0, status="ok", systematic=0.0):
    parameter = ParameterEstimate(
        "stiffness", value if status == "ok" else None, None, None, status, unbounded=value
    )
    return CellEstimate(
        person,
        point,
        onset,
        (parameter,),
        99.0,
        5,
        0,
        "rigid",
        centre_gait_pct=(onset + OFFSET_PCT) % 100.0,
        budget={"stiffness": {"noise": sd, "gain": systematic}},
    )


def walker(person, *, points=TIMING_POINTS, scale=1.0, rng=None, sd=1.0):
    return [
        cell(
            person,
            name,
            onset,
            scale * stiffness(onset + OFFSET_PCT) + (0.0 if rng is None else sd * rng.normal()),
            sd=sd,
        )
        for name, onset in points.items()
    ]


def test_the_curve_passes_where_the_responses_tell_of_it():
    curve = phase_curve(StudyAnalysis(tuple(walker("S1", sd=0.05))), parameters=["stiffness"])
    band = curve.band("stiffness", "S1")
    phases = np.array(curve.gait_pct)
    for point in band.points:
        at = np.interp(point.gait_pct, phases, band.value)
        assert at == pytest.approx(stiffness(point.gait_pct), abs=0.5)


def test_the_band_holds_a_smooth_truth():
    rng = np.random.default_rng(3)
    held = []
    for _ in range(8):
        cells = walker("S1", rng=rng, sd=2.0)
        curve = phase_curve(StudyAnalysis(tuple(cells)), parameters=["stiffness"])
        band = curve.band("stiffness", "S1")
        true = stiffness(np.array(curve.gait_pct))
        held.append(np.mean((np.array(band.ci_low) <= true) & (true <= np.array(band.ci_high))))
    assert np.mean(held) > 0.9


def test_people_have_a_mean_with_an_interval_over_people():
    cells = [c for k in range(5) for c in walker(f"S{k}", scale=0.8 + 0.1 * k)]
    curve = phase_curve(StudyAnalysis(tuple(cells), population=population_means(cells)))
    mean, one = curve.band("stiffness"), curve.band("stiffness", "S2")
    assert mean.participant == MEAN
    assert max(mean.value) == pytest.approx(100.0, rel=0.05)
    # Between people of 16 % spread, Student's half width of five is 20 %.
    assert (mean.ci_high[16] - mean.ci_low[16]) > 2.0 * (one.ci_high[16] - one.ci_low[16])


def test_a_timing_point_about_the_heel_strike_of_some_is_one_point():
    """The centre of TSW is just before the heel strike of some people, just after of others."""
    cells = [
        c
        for k, shift in enumerate([0.6, 0.2, -1.0, -1.2])
        for c in walker(f"S{k}", points={**TIMING_POINTS, "TSW": 94.0 + shift})
    ]
    analysis = StudyAnalysis(tuple(cells), population=population_means(cells))
    mean = phase_curve(analysis, parameters=["stiffness"]).band("stiffness")
    assert [p.gait_pct for p in mean.points] == sorted(p.gait_pct for p in mean.points)
    last = next(p for p in mean.points if p.timing_point == "TSW")
    assert last.gait_pct == pytest.approx(99.25, abs=0.01)


def test_one_participant_can_be_asked_for():
    cells = [c for k in range(3) for c in walker(f"S{k}")]
    curve = phase_curve(StudyAnalysis(tuple(cells)), "S1")
    assert [band.participant for band in curve.bands] == ["S1"]
    one_side = StudyAnalysis(tuple(replace(c, side="left") for c in walker("S1")))
    assert phase_curve(one_side, "S1").bands[0].participant == "S1, left"
    with pytest.raises(DataError, match="S0; S1; S2"):
        phase_curve(StudyAnalysis(tuple(cells)), "S7")


def test_who_has_too_few_phases_has_no_curve_but_a_warning():
    few = walker("S2", points={"LRE": 7.0, "MST": 21.5})
    curve = phase_curve(StudyAnalysis((*walker("S1"), *few)), parameters=["stiffness"])
    assert [band.participant for band in curve.bands] == ["S1"]
    assert any("S2" in warning for warning in curve.warnings)
    with pytest.raises(EstimationError, match="4"):
        phase_curve(StudyAnalysis(tuple(few)))


def test_timing_points_are_made_of_measured_phases():
    rng = np.random.default_rng(0)
    phases = rng.uniform(0.0, 100.0, 300)
    points = timing_points_of_phases(np.append(phases, np.nan))
    assert len(points) == 20
    assert all(0.0 < at - 5.0 * k < 5.0 for k, at in enumerate(points.values()))
    # Two dense places and stray pulses: these go to the nearest.
    few = timing_points_of_phases(np.array([1.0] * 6 + [93.4, 93.6] * 4 + [50.0]))
    assert few == pytest.approx({"0-5 %": 1.0, "90-95 %": 93.5})


@pytest.mark.parametrize(
    ("phases", "options", "message"),
    [
        (np.array([1.0, 40.0]), {}, "5 pulses"),
        (np.arange(10.0), {"width_pct": 0.0}, "width_pct"),
    ],
)
def test_phases_without_groups_are_refused(phases, options, message):
    with pytest.raises(DataError, match=message):
        timing_points_of_phases(phases, **options)


def test_results_of_the_method_strapped_are_refused_with_what_to_do():
    cells = tuple(replace(c, method="strapped", budget={}) for c in walker("S01"))

    with pytest.raises(DataError, match=r"by the method strapped.*log_posteriors.*method rigid"):
        phase_curve(StudyAnalysis(cells=cells))
