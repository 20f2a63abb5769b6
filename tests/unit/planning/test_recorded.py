"""What a recorded study could see, and a plan with a pilot."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import jointz
from jointz.analysis.planned_half_widths import reached_half_widths
from jointz.analysis.saved_analysis import load
from jointz.core.errors import DataError
from jointz.core.protocols.pulse_models import DoubletPulse
from jointz.identify.walking.coupling import RIGID, STRAP
from jointz.planning.plan_study import plan_recorded
from jointz.planning.predicted_estimates import typical_leg
from jointz.planning.schedule import schedule_of_protocol
from jointz.rig.session.simulate_study import simulate_study
from jointz.rig.sim.direct_walk import WalkPlan

PULSE = DoubletPulse(
    name="short",
    kind="doublet",
    amplitudes_nm=(10.0, 17.0),
    durations_s=(0.040, 0.022),
    direction="both",
)
WALK = WalkPlan(
    per_point={"MST": 8}, pulses=(PULSE,), timing_points={"MST": 21.5}, gap_strides=(3, 4)
)


@pytest.fixture(scope="module")
def study(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("recorded")
    sensors = ("goniometer", "encoder")
    made = simulate_study(
        folder / "study", preset="realistic", plan=WALK, unperturbed_strides=40, sensors=sensors
    )
    with (made / "study.toml").open("a") as file:
        file.write("\n[planned_half_width_pct.inertia]\nMST = 21.0\n")
    return made


@pytest.fixture(scope="module")
def results(study) -> Path:
    folder = study.parent / "results"
    jointz.analyze(study, resamples=2).save(folder, figures=False)
    return folder


@pytest.fixture(scope="module")
def seen(results):
    return plan_recorded(results)


def test_reached_half_widths_are_those_of_the_analysis(seen, results):
    analysis = load(results)

    assert seen.reached == reached_half_widths(analysis.cells)
    assert "MST" in seen.reached["inertia"]
    # A person may be better or worse than a typical leg, but not by a factor of three.
    typical = seen.estimate("MST", "inertia").half_width_pct
    assert 1.0 / 3.0 < seen.reached["inertia"]["MST"] / typical < 3.0


def test_an_analysis_states_what_was_planned_beside_what_it_reached(results):
    (row,) = load(results).statistics["planned_half_widths"]

    assert (row["parameter"], row["timing_point"], row["planned_pct"]) == ("inertia", "MST", 21.0)
    assert row["reached_pct"] == reached_half_widths(load(results).cells)["inertia"]["MST"]
    page = (results / "report.html").read_text(encoding="utf-8")
    assert "Planned and reached intervals" in page
    assert f"21 %, {row['reached_pct']:.0f} %" in page


def test_a_recorded_study_is_seen_as_it_was(seen):
    assert seen.recorded
    assert seen.protocol_text == ""
    assert {e.pulses for e in seen.estimates} == {8}
    assert seen.timing_points == ("MST",)
    assert seen.estimates[0].gait_pct == pytest.approx(21.5, abs=1.0)
    assert seen.sensors == ("goniometer", "encoder")
    assert sorted(abs(size) for course in seen.courses for size in course.amplitudes_nm) == (
        pytest.approx([10.0, 10.0, 17.0, 17.0])
    )
    assert [s.name for s in seen.shapes if s.chosen] == ["as recorded"]
    assert "unperturbed strides of 1 person of study" in seen.walking
    assert seen.provenance["study"] == "study"


def test_results_of_another_method_are_refused(results, study):
    analysis = load(results)
    other = study.parent / "other"
    cells = tuple(replace(cell, method="rigid") for cell in analysis.cells)
    replace(analysis, cells=cells, settings={**analysis.settings, "method": "rigid"}).save(
        other, figures=False
    )

    with pytest.raises(DataError, match=r"method bayesian, got rigid.*jointz analyze"):
        plan_recorded(other)


def test_a_missing_study_is_named_with_its_option(results, study, tmp_path, monkeypatch):
    load(results).save(tmp_path / "moved", figures=False)

    with pytest.raises(DataError, match=r"not beside the results.*--study-folder"):
        plan_recorded(tmp_path / "moved")
    opened = []

    def lab(found, *_):
        opened.append(found.root)
        raise DataError("far enough")

    monkeypatch.setattr("jointz.planning.plan_study.lab_of_study", lab)
    with pytest.raises(DataError, match="far enough"):
        plan_recorded(tmp_path / "moved", study=study)
    assert opened == [study]


def test_results_that_are_none_are_refused(tmp_path):
    with pytest.raises(DataError, match="none"):
        plan_recorded(tmp_path / "none")


# --- pilot ---------------------------------------------------------------------------------------


def test_a_pilot_brings_its_sensors_and_walking(doublets, study):
    plan = jointz.plan(doublets, pilot=study)

    assert plan.sensors == ("goniometer", "encoder")
    assert plan.walking == "40 unperturbed strides of 1 person of study"
    assert plan.provenance["pilot"] == "study"
    assert len(plan.provenance["pilot_sha256"]) == 64
    assert all(np.isfinite(e.half_width_pct) for e in plan.estimates)
    assert plan.refused == ()


def changed(study, tmp_path, *replaced):
    """Return a copy of a study with another ``study.toml``."""
    text = (study / "study.toml").read_text()
    for old, new in replaced:
        assert old in text
        text = text.replace(old, new)
    for file in study.iterdir():
        if file.is_file():
            (tmp_path / file.name).symlink_to(file)
    (tmp_path / "study.toml").unlink()
    (tmp_path / "study.toml").write_text(text)
    return tmp_path


def test_a_rigid_pilot_lets_expect_narrower_intervals(bare_plan, doublets, study, tmp_path):
    rigid = changed(study, tmp_path, ('coupling = "strap"', 'coupling = "rigid"'))

    firm, soft = (bare_plan(doublets, pilot=pilot) for pilot in (rigid, study))

    assert firm.pulses == soft.pulses
    assert any('coupling = "rigid"' in note for note in firm.notes)
    # J is that of an unknown body, and not of this mass and height.
    for ours, theirs in zip(firm.estimates[:2], soft.estimates[:2], strict=True):
        assert ours.half_width_pct < theirs.half_width_pct
        assert ours.endless_pct < theirs.endless_pct


def test_a_rigid_device_may_hold_one_torque(small_protocol, lab):
    hold = {"name": "hold", "kind": "trapezoid", "amplitudes_nm": (8.0,), "hold_s": 0.25}
    spec = small_protocol(pulses=[hold])
    strapped, counts = lab(spec), {"MST": 200.0}
    design = schedule_of_protocol(spec).design

    soft, firm = (
        typical_leg(replace(strapped, coupling=coupling), design).estimates(counts)
        for coupling in (STRAP, RIGID)
    )

    assert firm.decided[:2].all()
    assert not soft.decided[:2].any()


def test_a_pilot_of_another_joint_is_refused(doublets, study, tmp_path):
    ankle = changed(study, tmp_path, ('joint = "knee"', 'joint = "ankle"'))

    with pytest.raises(DataError, match=r"pilot: expected walking of the knee, got .* the ankle"):
        jointz.plan(doublets, pilot=ankle)


def test_a_pilot_with_too_few_unperturbed_strides_is_refused(doublets, tmp_path):
    walk = WalkPlan(per_point={"MST": 1}, timing_points={"MST": 21.5}, tail_strides=1)
    short = simulate_study(tmp_path / "short", preset="realistic", plan=walk, unperturbed_strides=8)

    with pytest.raises(DataError, match=r"pilot: .* unperturbed strides.*three to five minutes"):
        jointz.plan(doublets, pilot=short)


def test_a_pilot_that_is_none_is_refused(doublets, tmp_path):
    with pytest.raises(DataError, match="none"):
        jointz.plan(doublets, pilot=tmp_path / "none")
