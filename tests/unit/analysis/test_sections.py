"""What the page says of methods, of what stands behind the estimates, and of expected errors."""

import re
from dataclasses import replace

import pytest
from tests.unit.report.pages import Page, words

from jointz.analysis.page.certificate_section import certificate_section
from jointz.analysis.page.figure_files import draw_figures
from jointz.analysis.page.method_differences import differences_section
from jointz.analysis.page.report_page import render_report
from jointz.analysis.page.uncertainty_section import uncertainty_section
from jointz.results.certificate_result import Certificate, VirtualEstimate, expected_errors


def reasons(analysis):
    return dict(differences_section(analysis)["reasons"])


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
    people = [{"id": m.participant, "calibration": {"angle_lag_s": {"value": m.lag_s, "sd": 1e-4}}}
              for m in recommended.models]  # fmt: skip
    known = replace(recommended, provenance={"study": {"participants": people}})
    assert "does not cause a difference here" in reasons(known)["Lag."]
    assert "treats them as simultaneous" in reasons(recommended)["Lag."]
    for row in differences_section(known)["rows"]:
        assert row["cells"][0]["lag"] == "0 %"


def test_the_calibration_of_a_perturbed_recording_comes_before_that_of_the_study(recommended):
    def recording(condition, model):
        lag = {"angle_lag_s": {"value": model.lag_s, "sd": 1e-4}}
        return {"participant": model.participant, "condition": condition, "calibration": lag}

    for condition, apart in (("perturbed", False), ("unperturbed", True)):
        held = [recording(condition, m) for m in recommended.models]
        known = replace(recommended, provenance={"study": {"recordings": held}})
        assert ("does not cause a difference here" in reasons(known)["Lag."]) is not apart


def test_estimates_at_the_bound_are_counted(recommended):
    assert "(none is at zero)" in reasons(recommended)["Bounds."]
    first = recommended.comparison[0]
    bound = replace(first.parameters[0], value=0.0, status="at_bound")
    cells = (replace(first, parameters=(bound, *first.parameters[1:])), *recommended.comparison[1:])
    one = replace(recommended, comparison=cells)
    assert "1 estimate is at zero" in reasons(one)["Bounds."]
    assert differences_section(one)["rows"][0]["bound"] == "1 K"


def test_without_both_methods_there_is_no_comparison(recommended, walking, bench):
    assert differences_section(replace(recommended, comparison=())) is None
    assert differences_section(walking) is None  # no models: stored by an earlier version
    assert differences_section(bench) is None


def test_what_is_undecided_names_its_largest_source_and_what_would_decide_it(recommended):
    cells = list(recommended.cells)
    k = next(i for i, c in enumerate(cells) if c.parameter("stiffness").status == "undecided")
    value = cells[k].parameter("stiffness").unbounded
    budget = {**cells[k].budget, "stiffness": {"lag": 0.4 * value, "noise": 0.1 * value}}
    cells[k] = replace(cells[k], budget=budget)
    (row,) = uncertainty_section(replace(recommended, cells=tuple(cells)))["undecided"]
    assert (row["participant"], row["name"], row["parameter"]) == ("S01", "ISW", "Stiffness")
    assert row["why"] == "lag and resonance of the sensor (94 %)"
    assert "angle_lag_s" in row["remedy"]
    assert "±" in row["value"]


@pytest.mark.parametrize(("part", "told"), [(0.8, True), (0.1, False)])
def test_what_a_measured_lag_would_decide_says_so_before_pulses(recommended, part, told):
    cell = recommended.cells[0]
    open_ = replace(
        cell.parameter("inertia"), value=None, ci_low=None, ci_high=None, status="undecided"
    )
    changed = replace(
        cell,
        parameters=tuple(open_ if p.name == "inertia" else p for p in cell.parameters),
        budget={**cell.budget, "inertia": {"noise": 0.01}},
        through_instruments={"inertia": {"lag": 0.01 * part, "friction": 0.0}},
    )
    (row,) = uncertainty_section(replace(recommended, cells=(changed,)))["undecided"]
    assert row["why"].startswith("strides that differ")
    assert ("uncertainty of the lag" in row["why"]) is told
    assert row["remedy"].startswith("a measured lag") is told
    assert ("which would leave ± 0.0060; then more or larger pulses" in row["remedy"]) is told
    assert "more or larger pulses" in row["remedy"]


def test_what_was_withheld_for_a_steep_change_is_not_told_to_be_too_wide(recommended):
    cell = recommended.cells[0]
    withheld = replace(
        cell.parameter("stiffness"),
        value=None, ci_low=None, ci_high=None, status="undecided", unbounded=50.0,
    )  # fmt: skip
    changed = replace(
        cell,
        parameters=tuple(withheld if p.name == "stiffness" else p for p in cell.parameters),
        budget={**cell.budget, "stiffness": {"noise": 2.0}},
        through_instruments={"stiffness": {"lag": 1.8}},
    )
    person = replace(recommended.models[0], participant=cell.participant)
    steep = replace(person, doubts=("steep_change",))
    for model, told in ((person, False), (steep, True)):
        given = replace(recommended, cells=(changed,), models=(model,))
        (row,) = uncertainty_section(given)["undecided"]
        assert ("change steeply" in row["why"]) is told
        assert ("angle_lag_s" in row["remedy"]) is not told


def test_the_page_shows_both_sections_and_is_well_formed(recommended):
    page = Page(render_report(recommended, draw_figures(recommended), title="Knee"))
    text = words(page)
    assert page.open == []
    assert len(page.ids) == len(set(page.ids))
    assert {link[1:] for link in page.links} <= set(page.ids)
    for told in ("Why they differ", "VAF is not accuracy.", "What would decide it",
                 "Error budget", "Models of joint and sensor"):  # fmt: skip
        assert told in text
    assert "Window, motion, gravity and unbounded values of all 18 timing points" in text


@pytest.fixture
def certificate():
    rows = [
        VirtualEstimate(who, r, point, name, 1.0, 1.0 + off, 1.0 + off - 0.2, 1.0 + off + 0.2, "ok")
        for who in ("S01", "S02")
        for r, off in enumerate((-0.1, 0.1))
        for point in ("LRE", "MSW")
        for name in ("stiffness", "damping", "inertia")
    ]
    return Certificate("recommended", expected_errors(rows), tuple(rows), 2, 2)


def test_the_certificate_says_what_error_to_expect(certificate):
    section = certificate_section(certificate)
    assert section["sentence"] == (
        "In this study expect errors of 10 % in K, 10 % in B, 10 % in J (root mean square), and "
        "intervals that contain the truth in 100 %, 100 %, 100 % of cases."
    )
    assert [row["name"] for row in section["rows"]] == ["all points", "LRE", "MSW"]
    assert section["rows"][1]["cells"][0]["more"] == "mean +0.0, coverage 100 %, undecided 0 %"
    assert "the unperturbed strides of 2 participants (2 times each)" in section["note"]


def test_what_was_given_and_who_was_left_out_of_the_certificate_is_told(certificate):
    told = replace(
        certificate,
        injected={"stiffness": "found", "lag_s": "0.011"},
        left_out={"S03": "no unperturbed strides"},
    )
    note = certificate_section(told)["note"]
    assert "fixed values: lag in s 0.011." in note
    assert note.endswith("S03 was left out: no unperturbed strides.")


def test_errors_of_what_is_nearly_nothing_are_told_in_si_units_only(certificate):
    rows = [
        replace(e, truth=0.01, value=0.51, ci_low=0.0, ci_high=1.0)
        if (e.parameter, e.timing_point) == ("stiffness", "MSW")
        else e
        for e in certificate.estimates
    ]
    section = certificate_section(replace(certificate, errors=expected_errors(rows)))

    assert "10 % in K" in section["sentence"]
    assert "Errors are in SI units only for K at 1 timing point (MSW)" in section["note"]
    assert section["rows"][2]["cells"][0] == {
        "rmse": "0.5 N·m/rad", "more": "coverage 100 %, undecided 0 %",
    }  # fmt: skip
    small = [e for e in rows if e.timing_point == "MSW"]
    alone = certificate_section(replace(certificate, errors=expected_errors(small)))
    assert "errors of 0.5 N·m/rad in K, 10 % in B, 10 % in J" in alone["sentence"]


def undecided_section(certificate, which):
    """Return the section if the estimates that are chosen are undecided."""
    rows = [
        replace(e, value=None, ci_low=None, ci_high=None, status="undecided") if which(e) else e
        for e in certificate.estimates
    ]
    return certificate_section(replace(certificate, errors=expected_errors(rows)))


def test_a_certificate_that_decides_nothing_says_so(certificate):
    section = undecided_section(certificate, lambda _: True)
    assert "Expect no usable estimate" in section["sentence"]
    assert certificate_section(None) is None


def test_a_parameter_that_is_seldom_or_never_decided_has_no_coverage(certificate):
    section = undecided_section(
        certificate,
        lambda e: e.parameter == "inertia" and (e.participant, e.timing_point) != ("S01", "LRE"),
    )
    assert section["sentence"] == (
        "In this study expect errors of 10 % in K, 10 % in B (root mean square), and intervals "
        "that contain the truth in 100 %, 100 % of cases. J: undecided in 75 % of the injections."
    )
    assert "coverage" not in section["rows"][0]["cells"][2]["more"]
    never = undecided_section(certificate, lambda e: e.parameter == "inertia")
    assert never["sentence"].endswith("J cannot be decided here.")
