"""What the page says of methods, of what stands behind the estimates, and of expected errors."""

import re
from dataclasses import replace

import pytest
from tests.unit.analysis.studies import LAGS_S, bayesian_analysis, study_record
from tests.unit.report.pages import Page

from jointz.analysis.page.certificate_section import certificate_section
from jointz.analysis.page.figure_files import draw_figures
from jointz.analysis.page.method_differences import differences_section
from jointz.analysis.page.report_page import render_report
from jointz.results.certificate_result import (
    Certificate,
    ComparedStatistic,
    VirtualEstimate,
    expected_errors,
)


def test_the_lead_holds_the_root_mean_square_difference(recommended):
    lead = differences_section(recommended)["lead"]
    off = []
    others = {(c.participant, c.timing_point): c for c in recommended.comparison}
    for cell in recommended.cells:
        mine = cell.parameter("stiffness").value
        other = others[cell.participant, cell.timing_point].parameter("stiffness").value
        off += [(other / mine - 1.0) ** 2] if mine else []
    rms = 100.0 * (sum(off) / len(off)) ** 0.5
    assert re.search(rf"by {rms:.0f}\s%\sin K", lead)


def test_every_timing_point_has_its_difference_and_what_the_lag_alone_would_do(recommended):
    rows = differences_section(recommended)["rows"]
    assert [r["name"] for r in rows] == ["LRE", "MST", "TST", "PSW", "ISW", "MSW"]
    for row in rows:
        assert [set(c) for c in row["cells"]] == [{"whole", "lag"}] * 3
        assert row["cells"][2]["lag"].startswith("+")  # a late angle reads as inertia
    assert rows[0]["apart"] == "1.1"  # 0.02 rad, as the fixture has it


def test_a_lag_that_is_calibrated_away_sets_nothing_apart(recommended):
    people = [{"id": person, "calibration": {"angle_lag_s": {"value": lag_s, "sd": 1e-4}}}
              for person, lag_s in LAGS_S.items()]  # fmt: skip
    known = replace(recommended, provenance={"study": study_record(participants=people)})
    for row in differences_section(known)["rows"]:
        assert row["cells"][0]["lag"] == "0 %"


def test_the_calibration_of_a_perturbed_recording_comes_before_that_of_the_study(recommended):
    def recording(condition, person):
        lag = {"angle_lag_s": {"value": LAGS_S[person], "sd": 1e-4}}
        file = f"{person}.csv"
        return {"participant": person, "file": file, "condition": condition, "calibration": lag}

    for condition, apart in (("perturbed", False), ("unperturbed", True)):
        held = [recording(condition, person) for person in LAGS_S]
        known = replace(recommended, provenance={"study": study_record(recordings=held)})
        lags = {row["cells"][0]["lag"] for row in differences_section(known)["rows"]}
        assert (lags == {"0 %"}) is not apart


def test_estimates_at_the_bound_are_counted(recommended):
    first = recommended.comparison[0]
    bound = replace(first.parameters[0], value=0.0, status="at_bound")
    cells = (replace(first, parameters=(bound, *first.parameters[1:])), *recommended.comparison[1:])
    one = replace(recommended, comparison=cells)
    assert differences_section(one)["rows"][0]["bound"] == "1 K"


def test_without_both_methods_there_is_no_comparison(recommended, walking, bench):
    assert differences_section(replace(recommended, comparison=())) is None
    assert differences_section(walking) is None  # stored by an earlier version
    assert differences_section(bayesian_analysis(coupling="strap")) is None
    assert differences_section(bench) is None


def test_the_page_shows_both_sections_and_is_well_formed(recommended):
    page = Page(render_report(recommended, draw_figures(recommended), title="Knee"))
    assert page.open == []
    assert len(page.ids) == len(set(page.ids))
    outside = {"methods.txt", "methods.tex"}  # files beside the report
    assert {link[1:] for link in set(page.links) - outside} <= set(page.ids)


@pytest.fixture
def certificate():
    rows = [
        VirtualEstimate(
            f"V{k}", point, name, 1.0, 1.0 + off, 1.0 + off - 0.2, 1.0 + off + 0.2, "ok"
        )
        for k, off in enumerate((-0.1, 0.1, -0.1, 0.1), start=1)
        for point in ("LRE", "MSW")
        for name in ("stiffness", "damping", "inertia")
    ]
    alike = (ComparedStatistic("misfit", 1.0, 1.0, 0.5, 2.0),)
    return Certificate("rigid", expected_errors(rows), tuple(rows), 4, alike)


def test_the_certificate_says_if_it_cannot_promise(certificate):
    unlike = (ComparedStatistic("misfit", 5.0, 1.0, 0.5, 2.0),)
    section = certificate_section(replace(certificate, comparisons=unlike))
    assert "cannot be promised" in section["sentence"]
    assert "does not explain" in section["sentence"]
    assert "Simulated people had errors of 10 % in K" in section["sentence"]


def test_the_certificate_says_what_error_to_expect(certificate):
    section = certificate_section(certificate)
    assert "errors of 10 % in K, 10 % in B, 10 % in J" in section["sentence"]
    assert [row["name"] for row in section["rows"]] == ["all points", "LRE", "MSW"]
    assert section["rows"][1]["cells"][0]["more"] == "mean +0.0, coverage 100 %, undecided 0 %"
    assert certificate_section(None) is None


def test_errors_of_what_is_nearly_nothing_are_told_in_si_units_only(certificate):
    rows = [
        replace(e, truth=0.01, value=0.51, ci_low=0.0, ci_high=1.0)
        if (e.parameter, e.timing_point) == ("stiffness", "MSW")
        else e
        for e in certificate.estimates
    ]
    section = certificate_section(replace(certificate, errors=expected_errors(rows)))

    assert "10 % in K" in section["sentence"]
    assert section["rows"][2]["cells"][0] == {
        "rmse": "0.5 N·m/rad", "more": "coverage 100 %, undecided 0 %",
    }  # fmt: skip
    small = [e for e in rows if e.timing_point == "MSW"]
    alone = certificate_section(replace(certificate, errors=expected_errors(small)))
    assert "errors of 0.5 N·m/rad in K, 10 % in B, 10 % in J" in alone["sentence"]


def test_a_parameter_that_is_seldom_decided_has_no_coverage(certificate):
    decided = (("V1", "LRE"), ("V2", "LRE"))
    rows = [
        replace(e, value=None, ci_low=None, ci_high=None, status="undecided")
        if e.parameter == "inertia" and (e.participant, e.timing_point) not in decided
        else e
        for e in certificate.estimates
    ]
    section = certificate_section(replace(certificate, errors=expected_errors(rows)))
    assert "10 % in J" not in section["sentence"]
    assert "75 %" in section["sentence"]
    assert "coverage" not in section["rows"][0]["cells"][2]["more"]


def test_published_inertias_are_called_smaller_than_a_leg(recommended, bench):
    said = "the published values are a tenth of these"
    assert said in render_report(recommended, {}, title="x")
    assert said not in render_report(bench, {}, title="x")
