"""The protocol file of a plan, and what becomes of it in a study."""

import tomllib
from pathlib import Path

import pytest

import jointz
from jointz.analysis.page.report_page import planned_section
from jointz.analysis.planned_half_widths import planned_beside_reached, reached_half_widths
from jointz.analysis.printed_analysis import print_analysis
from jointz.io.protocols import load_protocol
from jointz.planning.predicted_responses import Design
from jointz.planning.protocol_file import protocol_text
from jointz.results.estimates import CellEstimate, ParameterEstimate
from jointz.results.study_analysis import StudyAnalysis

pytestmark = pytest.mark.usefixtures("bare_plan")
NAMES = ("stiffness", "damping", "inertia")


def loaded(text, tmp_path):
    file = tmp_path / "planned.toml"
    file.write_text(text)
    return load_protocol(file)


def perturbed(protocol):
    return [c for c in protocol.conditions if c.perturbations is not None]


def assert_is_the_plan(protocol, plan):
    """Counts, window, people and expected half-widths are those of the plan."""
    counts = {e.timing_point: e.pulses for e in plan.estimates}
    (condition,) = perturbed(protocol)
    own = condition.perturbations.count_per_point
    assert (own if isinstance(own, dict) else dict.fromkeys(counts, own)) == counts
    assert protocol.window_s == plan.window_s
    assert protocol.participants == plan.participants
    assert protocol.planned_half_width_pct == {
        name: {p: round(plan.estimate(p, name).half_width_pct, 1) for p in plan.timing_points}
        for name in NAMES
    }
    assert [tuple(p.sizes_nm) for p in protocol.shapes] == [c.amplitudes_nm for c in plan.courses]
    assert protocol.sensors == plan.sensors


def test_the_file_is_read_as_planned(made, doublets, tmp_path):
    protocol = loaded(made.protocol_text, tmp_path)

    assert_is_the_plan(protocol, made)
    assert protocol.name == "walking_doublets-planned"
    plan, own = perturbed(protocol)[0].perturbations, perturbed(doublets)[0].perturbations
    assert plan.timing_points == own.timing_points
    assert plan.gap_strides == own.gap_strides
    assert protocol.rates == doublets.rates
    assert [c.name for c in protocol.conditions] == [c.name for c in doublets.conditions]


def test_a_protocol_with_one_pulse_is_planned(small_protocol, tmp_path):
    plan = jointz.plan(small_protocol("walking"))

    protocol = loaded(plan.protocol_text, tmp_path)

    assert protocol.pulse is None
    assert_is_the_plan(protocol, plan)


def test_timing_points_have_numbers_of_their_own(small_protocol, tmp_path):
    spec = small_protocol(points={"MST": 21.5, "ISW": 68.5})
    text = protocol_text(
        spec,
        Design("own", spec.shapes, 0.15),
        {"MST": 16, "ISW": 32},
        participants=3,
        half_width_pct={"stiffness": {"MST": 30.1}},
        displacement_rad=0.3,
        sensors=["goniometer"],
    )

    (condition,) = perturbed(loaded(text, tmp_path))

    assert condition.name == "perturbed"
    assert condition.perturbations.count_per_point == {"MST": 16, "ISW": 32}
    assert condition.perturbations.timing_points == {"MST": 21.5, "ISW": 68.5}


def test_a_planned_protocol_can_be_planned_again(small_protocol, tmp_path):
    points = {"MST": 21.5, "ISW": 68.5}
    spec = small_protocol(points=points, per_point={"MST": 16, "ISW": 32})

    plan = jointz.plan(spec)

    assert {e.timing_point: e.pulses for e in plan.estimates} == {"MST": 16, "ISW": 32}
    assert_is_the_plan(loaded(plan.protocol_text, tmp_path), plan)


def test_a_run_of_the_file_states_the_plan_in_its_study(made, tmp_path):
    text = made.protocol_text.replace("strides = 60", "strides = 6")
    text = text.replace("count_per_point = 48", "count_per_point = 8")
    text = text.replace("gap_strides = [3, 7]", "gap_strides = [3, 3]")
    file = tmp_path / "short.toml"
    file.write_text(text.replace("participants = 10", "participants = 1"))

    run = jointz.run(file, out=tmp_path / "study", seed=1)

    content = tomllib.loads((run.study / "study.toml").read_text())
    planned = load_protocol(file).planned_half_width_pct
    assert content["planned_half_width_pct"] == planned
    assert jointz.open_study(run.study).spec.planned_half_width_pct == planned


# --- planned beside reached ----------------------------------------------------------------------


def cell(person, point, half_pct, *, value=50.0, status="ok"):
    """Return a cell whose K has a half-width, None if undecided."""
    if half_pct is None:
        stiffness = ParameterEstimate("stiffness", None, 10.0, 90.0, "undecided")
    else:
        reach = half_pct / 100.0 * value
        stiffness = ParameterEstimate("stiffness", value, value - reach, value + reach, status)
    return CellEstimate(person, point, 21.5, (stiffness,), 95.0, 10, 0, "strapped", "predicted")


def test_reached_is_the_median_and_undecided_people_count_as_wide():
    cells = [cell("S01", "MST", 20.0), cell("S02", "MST", 30.0), cell("S03", "MST", None)]
    cells += [cell("S01", "ISW", 25.0), cell("S02", "ISW", None), cell("S03", "ISW", None)]

    found = reached_half_widths(cells)

    assert found == {"stiffness": {"MST": pytest.approx(30.0)}}


def test_planned_stands_beside_reached():
    planned = {"stiffness": {"MST": 22.0, "ISW": 25.0}, "damping": {"MST": 30.0}}

    rows = planned_beside_reached(planned, [cell("S01", "MST", 20.0), cell("S01", "ISW", None)])

    assert [tuple(row.values()) for row in rows] == [
        ("stiffness", "MST", 22.0, pytest.approx(20.0)),
        ("stiffness", "ISW", 25.0, None),
        ("damping", "MST", 30.0, None),
    ]


def test_without_a_plan_nothing_stands_there():
    assert planned_beside_reached(None, [cell("S01", "MST", 20.0)]) == []
    assert planned_section({}) is None


def test_the_report_shows_planned_and_reached_by_timing_point():
    planned = {"stiffness": {"MST": 22.4, "ISW": 25.0}, "inertia": {"ISW": 9.6}}
    rows = planned_beside_reached(planned, [cell("S01", "MST", 20.4), cell("S01", "ISW", None)])

    section = planned_section({"planned_half_widths": rows})

    assert [row["cells"][0] for row in section] == ["22 %, 20 %", "25 %, undecided"]
    assert [len(row["cells"]) for row in section] == [3, 3]  # as the heads of the table
    assert section[1]["cells"][2] == "10 %, undecided"
    assert "%" not in section[0]["cells"][2] + section[0]["cells"][1]


def test_the_terminal_shows_the_medians(capsys):
    cells = (cell("S01", "MST", 20.4),)
    rows = planned_beside_reached({"stiffness": {"MST": 22.4}, "damping": {"MST": 30.0}}, cells)
    analysis = StudyAnalysis(cells, statistics={"planned_half_widths": rows})

    print_analysis(analysis, Path("report.html"))

    assert "medians: K 22 %, 20 %; B 30 %, undecided." in capsys.readouterr().out
