"""Decisions during a session: asked, put into effect, written down, kept by a resumed session."""

import json
import shutil
from collections import Counter
from importlib.resources import files
from types import SimpleNamespace

import numpy as np
import pytest

import jointz
from jointz.core.errors import ProtocolError
from jointz.core.protocols.protocol import Protocol
from jointz.core.protocols.protocol_models import LiveSpec, PerturbationPlan
from jointz.io.log_reader import read_log
from jointz.io.protocols import load_protocol
from jointz.rig.experiment.decisions import (
    STRIDES_TO_DECIDE,
    Decision,
    Decisions,
    DecisionSettings,
    PulseHistory,
)
from jointz.rig.experiment.files.journal import read_journal
from jointz.rig.experiment.files.whole_files import read_twice
from jointz.rig.experiment.plan import PlannedPulse
from jointz.rig.experiment.pulse_runner import PulseRunner
from jointz.rig.experiment.scheduler import Scheduler
from jointz.rig.live_estimates.decide import decide
from jointz.rig.live_estimates.live_estimate import LiveEstimate, LiveValue, estimate_so_far
from jointz.rig.session.live.live_progress import SessionProgress
from jointz.rig.session.participant_run import run_participant
from jointz.rig.session.rigs.rig_settings import open_rig, rig_settings
from jointz.rig.session.run import NoOperator
from jointz.rig.session.run_settings import RunSettings

POINTS = {"LRE": 7.0, "ISW": 68.5}


def protocol(*, may=("steer", "stop"), wish=45.0, shams=0.0, count=64):
    """Return walking with doublets at two timing points, and live estimates that decide."""
    raw = load_protocol("walking_doublets").model_dump(exclude_unset=True, mode="json")
    perturbed = raw["conditions"][-1]
    perturbed["perturbations"] |= {
        "timing_points": POINTS,
        "count_per_point": count,
        "gap_strides": [2, 3],
        "sham_share": shams,
    }
    live = {"may": list(may), "planned_half_width_pct": wish, "every_pulses": 8}
    return Protocol.model_validate(raw | {"conditions": [perturbed], "live": live})


class Advisor:
    """Answers every question alike, and remembers them."""

    def __init__(self, decision):
        self.decision, self.questions = decision, []

    def ask(self, question):
        self.questions.append(question)

    def answer(self, *, wait):
        assert wait
        return self.decision


def run(spec, folder, advisor):
    """Run a session with an advisor and return its journal."""
    settings = RunSettings(spec, 3, "fast", folder)
    rig = open_rig(rig_settings(spec, "sim", "nominal", 3, None), 0)
    run_participant(rig, settings, operator=NoOperator(), progress=lambda *_: None, advisor=advisor)
    return read_journal(settings.session_folder("S01") / "journal.jsonl")


def decided(events):
    return [event for event in events if event["event"] == "decided"]


def ended(events):
    """Return the numbers of the pulses that were completed or withdrawn, in order."""
    return sorted(
        event["pulse"]
        for event in events
        if event["event"] in ("pulse_completed", "pulse_withdrawn")
    )


def plan_of(folder):
    return read_twice(folder / "sessions/S01/plan.json")[0]


def fired(folder):
    """Return the numbers of the pulses that the logs hold, in order."""
    numbers = []
    for log in sorted((folder / "sessions/S01/logs").iterdir()):
        pulse = read_log(log).records["pulse"].astype(int)
        numbers += pulse[(np.diff(pulse, prepend=0) != 0) & (pulse > 0)].tolist()
    return numbers


@pytest.fixture(scope="module")
def steered(tmp_path_factory):
    folder = tmp_path_factory.mktemp("steered")
    advisor = Advisor(Decision(shares={"LRE": 0.75, "ISW": 0.25}))
    return folder, advisor, run(protocol(shams=0.2), folder, advisor)


def test_a_question_names_its_stride_and_the_decision_a_later_one(steered):
    _, advisor, events = steered
    asked = [event for event in events if event["event"] == "decision_asked"]
    assert [question["number"] for question in advisor.questions] == list(range(1, len(asked) + 1))
    done = [event["slot"] for event in events if event["event"] == "pulse_completed"]
    assert sum(slot <= asked[0]["slot"] for slot in done) >= LiveSpec().fewest_pulses
    for question, decision in zip(asked, decided(events), strict=False):
        assert decision["number"] == question["number"]
        assert decision["stride"] == question["stride"] + STRIDES_TO_DECIDE


def test_steered_pulses_keep_number_gap_shams_and_shapes(steered):
    folder, _, events = steered
    plan = plan_of(folder)["perturbed"]
    changed = {pulse["number"]: pulse for e in decided(events) for pulse in e["pulses"]}
    assert changed
    by_number = {pulse["number"]: pulse for pulse in plan}
    variants = {(p["shape"], p["amplitude_nm"]) for p in plan}
    for number, pulse in changed.items():
        assert pulse["gait_pct"] == POINTS[pulse["timing_point"]]
        assert pulse["gap_strides"] == by_number[number]["gap_strides"]
        assert (pulse["shape"], pulse["amplitude_nm"]) in variants
        assert (pulse["amplitude_nm"] == 0.0) == (by_number[number]["amplitude_nm"] == 0.0)
    assert ended(events) == sorted(by_number)


def test_steered_pulses_go_where_they_are_wanted(steered):
    folder, _, events = steered
    first = decided(events)[0]
    points = Counter(pulse["timing_point"] for pulse in first["pulses"])
    assert points["LRE"] > points["ISW"]
    table = (folder / "S01_perturbed_pulses.csv").read_text()
    assert table.count("LRE") > table.count("ISW")


def test_a_resumed_session_keeps_what_was_decided(steered, tmp_path):
    folder, _, events = steered
    first = decided(events)[0]
    # The session as a kill left it three pulses after the decision.
    cut = [e["slot"] for e in events if e["event"] == "pulse_completed"]
    last = [slot for slot in cut if slot > first["slot"]][2]
    session = tmp_path / "sessions/S01"
    (session / "logs").mkdir(parents=True)
    before = folder / "sessions/S01"
    for name in ("plan.json", "session.json"):
        (session / name).write_bytes((before / name).read_bytes())
    log = "logs/perturbed-0.jzlog"
    content, records = (before / log).read_bytes(), read_log(before / log).records
    size = read_log(before / log).header["record_bytes"]
    kept = int(np.searchsorted(records["slot"], last, side="right"))
    (session / log).write_bytes(content[: len(content) - (records.size - kept) * size])
    lines = (before / "journal.jsonl").read_text().splitlines(keepends=True)
    written = [x for x, e in zip(lines, events, strict=True) if e.get("slot", 0) <= last]
    (session / "journal.jsonl").write_text("".join(written))

    again = run(protocol(shams=0.2), tmp_path, Advisor(Decision()))

    assert decided(again)[0] == first
    changed = {pulse["number"]: pulse["timing_point"] for pulse in first["pulses"]}
    plan = SessionProgress(plan_of(folder))
    for event in again:
        plan.take(event)
    of_plan = {pulse["number"]: pulse["timing_point"] for pulse in plan.trial("perturbed").planned}
    assert {number: of_plan[number] for number in changed} == changed
    assert ended(again) == sorted(of_plan)


def test_a_decision_that_stops_ends_the_pulses_and_the_trial(tmp_path):
    spec = protocol()
    events = run(spec, tmp_path, Advisor(Decision(stop=True, about={"n_pulses": 40})))

    (decision,) = decided(events)
    assert decision["stop"]
    assert decision["n_pulses"] == 40
    later = [e for e in events if e["event"] == "pulse_started" and e["slot"] > decision["slot"]]
    assert not later
    assert events[-1]["event"] == "condition_completed"
    assert len(fired(tmp_path)) < spec.conditions[0].perturbations.total
    report = json.loads((tmp_path / "sessions/S01/report.json").read_text())
    assert report["decisions"][0]["stopped"]
    # Taken up again, nothing is left to do.
    (tmp_path / "sessions/S01/report.json").unlink()
    assert run(spec, tmp_path, Advisor(Decision())) == events


def test_without_an_advisor_pulses_come_as_planned(tmp_path):
    run(protocol(), tmp_path / "a", None)
    plain = protocol().model_copy(update={"live": None})
    run(plain, tmp_path / "b", None)
    log = "sessions/S01/logs/perturbed-0.jzlog"
    assert (tmp_path / "a" / log).read_bytes() == (tmp_path / "b" / log).read_bytes()


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    """A run that an estimate stopped."""
    study = tmp_path_factory.mktemp("stopped") / "study"
    spec = protocol(may=("stop",), wish=60.0)
    made = jointz.run(spec, out=study, participants=1, seed=3, progress=False)
    return spec, study, made


def test_estimates_stop_a_session_where_all_wishes_hold(stopped):
    _, study, made = stopped
    (row,) = made.report.decisions
    assert row["stopped"]
    assert row["completed"] < row["planned"]
    assert "ended before the plan" in made.report.summary()
    analysis = jointz.analyze(study, resamples=2, progress=False)
    assert f"after {row['completed']} of {row['planned']} pulses" in analysis.changes_text


def test_the_same_records_give_the_same_decision(stopped):
    spec, study, _ = stopped
    settings = RunSettings(spec, 3, "fast", study)
    rig = open_rig(rig_settings(spec, "sim", None, 3, None), 0)
    events = read_journal(study / "sessions/S01/journal.jsonl")
    question = next(event for event in events if event["event"] == "decision_asked")
    written = decided(events)[0]

    again = decide(estimate_so_far(settings, rig, question=question), spec.live, spec.wishes)

    assert again.stop == written["stop"]
    assert again.about["values"] == written["values"]


def value(now, least, *, wish=25.0, n=20, point="LRE"):
    return LiveValue(point, "stiffness", now, least, wish, n)


def decision_of(*values, may=("steer", "stop")):
    wishes = {"stiffness": {value.timing_point: 25.0 for value in values}}
    return decide(LiveEstimate(40, 0.1, values, ()), LiveSpec(may=may), wishes)


def test_it_stops_only_where_every_wish_holds_with_enough_pulses():
    other = value(20.0, 5.0, point="ISW")
    assert decision_of(value(24.0, 5.0), other).stop
    assert not decision_of(value(26.0, 5.0), other).stop
    assert not decision_of(value(24.0, 5.0, n=19), other).stop
    assert not decision_of(value(None, None), other).stop
    assert not decision_of(value(24.0, 5.0), other, may=("steer",)).stop


def test_a_wish_without_an_estimate_does_not_hold():
    estimate = LiveEstimate(40, 0.1, (value(20.0, 5.0),), ())
    wishes = {"stiffness": {"LRE": 25.0, "ISW": 25.0}}
    assert not decide(estimate, LiveSpec(may="stop"), wishes).stop


def test_a_damaged_line_of_a_decision_leaves_its_pulses_what_they_were(steered, tmp_path):
    folder, _, events = steered
    shutil.copytree(folder, tmp_path / "s")
    session = tmp_path / "s/sessions/S01"
    lines = (session / "journal.jsonl").read_bytes().splitlines(keepends=True)
    place = next(i for i, event in enumerate(events) if event["event"] == "decided")
    lines[place] = lines[place].replace(b'"number": ', b'"numbeR": ', 1)
    (session / "journal.jsonl").write_bytes(b"".join(lines))
    (session / "report.json").unlink()
    table = "S01_perturbed_pulses.csv"
    before = (tmp_path / "s" / table).read_text()
    settings = RunSettings(protocol(shams=0.2), 3, "fast", tmp_path / "s", salvage=True)
    rig = open_rig(rig_settings(settings.protocol, "sim", "nominal", 3, None), 0)
    run_participant(rig, settings, operator=NoOperator(), progress=lambda *_: None)
    assert (tmp_path / "s" / table).read_text() == before


def test_a_pulse_that_is_broken_off_after_the_end_does_not_come_back():
    question = {"condition": "x", "segment": 0, "slot": 0, "stride": 1, "number": 1, "n_done": 40}
    plan = PerturbationPlan(
        timing_points={"LRE": 90.0}, count_per_point=40, gap_strides=(1, 1), warm_up_strides=0
    )
    pulse = load_protocol("walking").shapes[0]
    planned = PlannedPulse(1, "LRE", 90.0, 10.0, 1)
    settings = DecisionSettings(
        LiveSpec(may="stop"), Advisor(None), True, np.random.default_rng, PulseHistory(), ()
    )
    decisions = Decisions(settings, {"LRE": 90.0})
    written = []
    journal = SimpleNamespace(write=lambda event, **_: written.append(event))
    runner = PulseRunner(
        "x", 0, (pulse,), Scheduler([planned] * 2, plan), journal=journal, period_ns=2_000_000,
        decisions=decisions,
    )  # fmt: skip
    runner.active = planned
    runner._put_into_effect(decisions, question, Decision(stop=True), stride=21)
    runner.abort("gait not steady")
    runner.active = None
    assert written == ["decided", "pulse_aborted"]
    assert runner.done


def test_pulses_go_to_wide_points_but_not_to_wishes_out_of_reach():
    wide, narrow = value(40.0, 10.0), value(20.0, 5.0, point="ISW")
    shares = decision_of(wide, narrow).shares
    assert shares["LRE"] == pytest.approx(0.875)
    assert shares["ISW"] == pytest.approx(0.125)
    assert decision_of(value(40.0, 26.0), narrow).shares == {}
    assert decision_of(wide, narrow, may=("stop",)).shares == {}


@pytest.mark.parametrize(
    ("changes", "place"),
    [
        ({"may": ["stop"], "planned_half_width_pct": None}, "live.planned_half_width_pct"),
        ({"may": ["stop"], "fewest_pulses": 19}, "live.fewest_pulses"),
        ({"may": ["stop"], "fewest_pulses": 49}, "live.fewest_pulses"),
        ({"may": ["run"]}, "live.may"),
    ],
)
def test_a_protocol_that_cannot_decide_is_refused(changes, place, tmp_path):
    live = {"may": ["show"], "planned_half_width_pct": 25.0} | changes
    text = "\n".join(
        f"{key} = {json.dumps(value)}" for key, value in live.items() if value is not None
    )
    file = tmp_path / "p.toml"
    jointz_text = load_text("walking_doublets")
    file.write_text(jointz_text.replace("[rates]", f"[live]\n{text}\n\n[rates]"))
    with pytest.raises(ProtocolError, match=place.replace(".", r"\.")):
        load_protocol(file)


def load_text(name):
    return (files("jointz.io") / "protocols_builtin" / f"{name}.toml").read_text()
