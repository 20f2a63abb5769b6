"""Why estimates are undecided, and what would decide them."""

import re
from dataclasses import replace

import numpy as np
import pytest

from jointz.analysis.page.details_tables import models_frame
from jointz.analysis.page.first_page import first_page
from jointz.analysis.page.next_measures import instrument_shares, next_measures
from jointz.analysis.page.report_page import render_report
from jointz.analysis.page.uncertainty_section import grouped, relative_sds, uncertainty_section
from jointz.core.codes import Doubt
from jointz.results.estimates import CellEstimate, ParameterEstimate
from jointz.results.log_posterior import LogPosterior
from jointz.results.study_analysis import StudyAnalysis
from jointz.results.unlikely_parameter import UnlikelyParameter

NAMES = ("stiffness", "damping", "inertia")
POINTS = ("LRE", "MST", "TST")
#: Sds of the logarithms whose half-intervals are 100, 41 and 10 % of the value.
WIDE, FAIR, NARROW = np.arcsinh([1.0, 0.41, 0.1]) / 1.959963984540054


def estimate(name, value, *, limits=(0.5, 2.0), status="undecided"):
    low, high = (None, None) if limits is None else (value * limits[0], value * limits[1])
    number = value if status == "ok" else None
    return ParameterEstimate(name, number, low, high, status, unbounded=value)


def cell(point, *, k, limits=(0.5, 2.0), parts=None):
    parameters = (
        estimate("stiffness", 40.0, limits=limits, status="undecided" if k != NARROW else "ok"),
        estimate("damping", 1.0, status="ok"),
        estimate("inertia", 0.2, status="ok"),
    )
    return CellEstimate(
        participant="S01", timing_point=point, onset_gait_pct=10.0, parameters=parameters,
        vaf_pct=99.0, n_used=20, n_excluded=0, method="bayesian",
        through_instruments={"stiffness": parts or {"lag": 0.0, "pulses": 0.0}},
    )  # fmt: skip


def analysis(cells, sds, *, doubts=(), unlikely=(), coupling="strap"):
    variances = np.concatenate([np.square(sds), np.full(6, NARROW**2)])
    posterior = LogPosterior(
        participant="S01",
        parameters=tuple(n for n in NAMES for _ in POINTS),
        timing_points=POINTS * 3,
        mean=np.zeros(9), covariance=np.diag(variances),
        prior_mean=np.zeros(9), prior_covariance=np.eye(9), doubts=tuple(doubts),
        unlikely=tuple(unlikely),
    )  # fmt: skip
    settings = {"method": "bayesian", "coupling": coupling, "kind": "walking", "joint": "knee"}
    return StudyAnalysis(cells=tuple(cells), log_posteriors=(posterior,), settings=settings)


def plain(row):
    """Texts without spaces that do not break."""
    return {name: text.replace("\N{NO-BREAK SPACE}", " ") for name, text in row.items()}


def test_the_best_measurement_stands_first_with_what_it_would_leave():
    left = {"lag": FAIR, "pulses": 0.8 * WIDE, "gain": WIDE}
    parts = {n: 40.0 * np.sqrt(WIDE**2 - sd**2) for n, sd in left.items()}
    cells = [cell("LRE", k=WIDE, parts=parts), *(cell(p, k=NARROW) for p in POINTS[1:])]

    section = uncertainty_section(analysis(cells, (WIDE, NARROW, NARROW)))

    row = plain(section["undecided"][0])
    assert (row["value"], row["unit"]) == ("40.0", "N·m/rad, ± 100 %")
    lag, pulses = row["remedy"].split("; ")
    assert lag.startswith("measure the lag of the angle behind the torque (angle_lag_s")
    assert lag.endswith(": ± 41 %")
    assert pulses.startswith("record twice as many pulses: ± 7")


def test_sources_that_hardly_help_are_not_sold_as_a_remedy():
    cells = [cell("LRE", k=WIDE), *(cell(p, k=NARROW) for p in POINTS[1:])]

    (row,) = uncertainty_section(analysis(cells, (WIDE, NARROW, NARROW)))["undecided"]

    assert row["remedy"].startswith("no single measurement helps by more than a tenth; the best: ")


def test_a_narrow_interval_among_wide_ones_says_so():
    cells = [cell(p, k=k) for p, k in zip(POINTS, (FAIR, WIDE, WIDE), strict=True)]

    rows = uncertainty_section(analysis(cells, (FAIR, WIDE, WIDE)))["undecided"]

    assert "the median over the participant's timing points is ± 100 %" in plain(rows[0])["why"]
    assert rows[1]["why"] == "half of the interval exceeds 50 % of the value"


def test_a_doubt_is_the_reason_where_there_are_no_limits():
    cells = [cell(p, k=FAIR, limits=None) for p in POINTS]
    doubts = (Doubt.INSTRUMENTS_UNLIKELY.value,)

    late = UnlikelyParameter("sensor_delay_s", 0.03, 0.003, 0.0006, 0.014, 2.9)
    made = analysis(cells, (FAIR,) * 3, doubts=doubts, unlikely=[late])

    rows = uncertainty_section(made)["undecided"]

    why = "sensor_delay_s is 0.03, expected 0.003 (0.0006 to 0.014): 2.9 SDs off"
    assert {row["why"] for row in rows} == {f"{Doubt.INSTRUMENTS_UNLIKELY.meaning}; {why}"}
    remedy = "measure the lag anew (jointz calibrate) and enter it under [calibration]"
    assert {row["remedy"] for row in rows} == {remedy}
    (row,) = models_frame(made).to_dict("records")
    assert row["remedy"] == remedy
    assert (row["doubts"], row["parameter"], row["sds"]) == (*doubts, "sensor_delay_s", 2.9)
    assert StudyAnalysis.from_dict(made.to_dict()).log_posteriors[0].unlikely == (late,)
    assert f"Most frequent reason (3 of 3): S01: {why}." in first_page(made)["said"][0]
    assert next_measures(made)[0] == (f"M{remedy[1:]} (3 undecided values).")


def test_rows_of_one_reason_and_remedy_become_one_that_says_where():
    rows = uncertainty_section(analysis([cell(p, k=WIDE) for p in POINTS], (WIDE,) * 3))

    (row,) = grouped(rows["undecided"])

    assert (row["where"], row["value"]) == ("S01 LRE, MST, TST", "3 values")


def test_the_first_page_names_the_measure_that_decides_most():
    parts = {"lag": 40.0 * np.sqrt(WIDE**2 - FAIR**2), "pulses": 1.0}
    made = analysis([cell(p, k=WIDE, parts=parts) for p in POINTS], (WIDE,) * 3)

    sentences = next_measures(made)

    assert sentences == [
        "Measure the lag of the angle behind the torque (angle_lag_s under [calibration]): "
        "this alone would make 3 of 3 undecided values available."
    ]


def test_the_instruments_share_of_the_variance_is_named_largest_first():
    parts = {"lag": 0.5 * 40.0 * NARROW, "strap": 0.7 * 40.0 * NARROW, "pulses": 1.0}
    made = analysis([cell(p, k=NARROW, parts=parts) for p in POINTS], (NARROW,) * 3)
    only_k = tuple(replace(c, parameters=c.parameters[:1]) for c in made.cells)

    text = instrument_shares(replace(made, cells=only_k))

    # Half-widths are those of a logarithm: slightly more than in proportion to the sd.
    assert re.search(r": strap and tissue (49|50) %, lag of the angle (25|26) %\.", text)


def test_a_rigid_coupling_has_no_strap_to_measure():
    parts = {"strap": 0.7 * 40.0 * NARROW, "pulses": 1.0}
    made = analysis(
        [cell(p, k=NARROW, parts=parts) for p in POINTS], (NARROW,) * 3, coupling="rigid"
    )

    only_k = tuple(replace(c, parameters=c.parameters[:1]) for c in made.cells)
    text = instrument_shares(replace(made, cells=only_k))

    assert "strap" not in text
    assert "mount of the goniometer" in text


def test_a_rigid_coupling_adds_no_error_of_the_model_to_damping():
    posterior = {
        coupling: relative_sds(analysis([], (FAIR,) * 3, coupling=coupling))
        for coupling in ("strap", "rigid")
    }
    damping = ("S01", "damping", "LRE")

    assert posterior["rigid"][damping] == pytest.approx(NARROW)
    assert posterior["strap"][damping] == pytest.approx(np.hypot(NARROW, 0.08))


@pytest.mark.parametrize("known", [True, False])
def test_the_report_has_the_section_and_older_results_do_not_need_it(known):
    cells = [cell(p, k=WIDE) for p in POINTS]
    made = analysis(cells, (WIDE,) * 3)
    if not known:  # as written before
        made = replace(made, cells=tuple(replace(c, through_instruments={}) for c in cells))

    page = render_report(made, {}, title="t")

    assert ('id="undecided"' in page) is known
    assert ("half of its 95 % interval in % of it" in page) is known


def test_the_most_frequent_reason_is_counted_over_people():
    doubts = (Doubt.RESPONSES_UNLIKE_SIZE.value,)
    cells = [
        replace(cell(p, k=FAIR, limits=None), participant=who)
        for who in ("S01", "S02")
        for p in POINTS
    ]
    wide = [replace(cell(p, k=WIDE), participant="S03") for p in POINTS]
    (one,) = analysis(cells[:3], (FAIR,) * 3, doubts=doubts).log_posteriors
    (other,) = analysis(wide, (WIDE,) * 3).log_posteriors
    people = (one, replace(one, participant="S02"), replace(other, participant="S03"))
    made = replace(analysis(cells, (FAIR,) * 3), cells=(*cells, *wide), log_posteriors=people)

    reason = "the responses do not grow with the recorded torque of the pulses"
    assert f"Most frequent reason (6 of 9): {reason}." in first_page(made)["said"][0]
    assert "(6 undecided values)" in next_measures(made)[0]


def test_pulses_that_hold_one_torque_are_the_reason_only_where_no_other_doubt_withholds():
    doubts = (Doubt.HELD_TORQUE.value, Doubt.INERTIA_UNLIKE_BODY.value)
    made = analysis([cell(p, k=FAIR, limits=None) for p in POINTS], (FAIR,) * 3, doubts=doubts)

    rows = uncertainty_section(made)["undecided"]

    assert {row["why"] for row in rows} == {Doubt.INERTIA_UNLIKE_BODY.meaning}
    assert all("mass_kg" in row["remedy"] and "doublets" not in row["remedy"] for row in rows)
