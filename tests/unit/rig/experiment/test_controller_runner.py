"""The runner of a controller: fades, parameters and their journal, torque that is no number."""

from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest

from jointz.core.protocols.protocol_models import ControllerSpec
from jointz.rig.experiment.controller_runner import FADE_IN_S, ControllerRunner, RunnerSettings
from jointz.rig.experiment.controllers import ControlParameter
from jointz.rig.experiment.files.journal import Journal, read_journal

PERIOD_S = 0.002
FADE_S = 0.05
LARGEST_NM = 30.0
FADE_TICKS = round(FADE_S / PERIOD_S)
RISE_TICKS = round(FADE_IN_S / PERIOD_S)


class Spring:
    """Five N*m times its share; keeps what it was told."""

    parameters: ClassVar = {
        "share": ControlParameter(1.0, 0.0, 2.0, 0.5, "1"),
        "stiffness": ControlParameter(10.0, 5.0, 50.0, 1e6, "N*m/rad"),
    }

    def __init__(self):
        self.states, self.values = [], []
        self.answer = lambda values: 5.0 * values["share"]

    def torque(self, state, values):
        self.states.append(state)
        self.values.append(dict(values))
        return self.answer(values)

    def describe(self):
        return {"torque_nm": 5.0}


class Bench:
    def __init__(self, folder, angle_gain=1.0):
        self.file, self.controller, self.slot = folder / "journal.jsonl", Spring(), -1
        self.journal = Journal(self.file)
        self.watch = SimpleNamespace(phase_pct=12.0, strides=SimpleNamespace(strides=4))
        self.runner = ControllerRunner(
            "impedance",
            2,
            ControllerSpec(name="spring", settings={"share": 1.0}),
            self.controller,
            journal=self.journal,
            settings=RunnerSettings(round(PERIOD_S * 1e9), FADE_S, 0.1, angle_gain),
        )

    def ticks(self, count, **more):
        return np.array([self.tick(**more) for _ in range(count)])

    def tick(self, *, steady=True, clamped_nm=None):
        self.slot += 1
        return self.runner.torque(
            self.slot,
            self.slot * 2_000_000,
            self.watch,
            angle=0.5,
            velocity=-1.0,
            contact=1.0,
            steady=steady,
            clamped_nm=clamped_nm,
        )

    def events(self, kind=""):
        return [e for e in read_journal(self.file) if not kind or e["event"] == kind]


@pytest.fixture
def bench(tmp_path):
    made = Bench(tmp_path)
    with made.journal:
        yield made


def test_torque_fades_in_within_a_second_of_steady_gait(bench):
    torque = bench.ticks(RISE_TICKS + 10)
    assert torque[0] == pytest.approx(5.0 / RISE_TICKS)
    np.testing.assert_allclose(np.diff(torque[:RISE_TICKS]), 5.0 / RISE_TICKS)
    np.testing.assert_allclose(torque[RISE_TICKS - 1 :], 5.0)


def test_torque_fades_out_within_the_gates_time_and_the_controller_is_not_called(bench):
    bench.ticks(RISE_TICKS)
    calls = len(bench.controller.states)
    torque = bench.ticks(FADE_TICKS + 5, steady=False)
    assert (np.diff(torque) <= 0.0).all()
    assert torque[0] < 5.0
    assert torque[FADE_TICKS - 2] > 0.0
    assert not torque[FADE_TICKS - 1 :].any()
    assert not bench.runner.fading
    assert len(bench.controller.states) == calls


@pytest.mark.parametrize("sent_nm", [-LARGEST_NM, 3.0])
@pytest.mark.parametrize("before", [RISE_TICKS, RISE_TICKS // 4])
def test_torque_that_the_gate_clamped_fades_from_what_was_sent(bench, before, sent_nm):
    bench.controller.answer = lambda _: -1000.0
    bench.ticks(before)
    torque = bench.ticks(FADE_TICKS, steady=False, clamped_nm=sent_nm)
    assert 0.0 < torque[0] / sent_nm < 1.0
    assert (np.diff(np.abs(torque)) <= 0.0).all()
    assert torque[-1] == 0.0


def test_a_change_during_a_pause_comes_at_its_rate_afterwards(bench):
    bench.ticks(RISE_TICKS)
    bench.runner.pause(on=True)
    assert bench.runner.set_parameter("share", 2.0) == ""
    bench.ticks(round(5.0 / PERIOD_S))
    bench.runner.pause(on=False)
    torque = bench.ticks(RISE_TICKS + 1)
    assert torque[-1] <= 5.0 * (1.0 + 0.5 * FADE_IN_S) + 0.1


def test_angle_is_that_of_the_joint(tmp_path):
    made = Bench(tmp_path, angle_gain=1.25)
    with made.journal:
        made.ticks(3)
    assert made.controller.states[-1].angle == pytest.approx(0.4 / 1.25)
    assert made.events("controller")[0]["angle_zero_rad"] == 0.1


def test_a_text_is_no_torque(bench):
    bench.controller.answer = lambda _: "3"
    assert np.isnan(bench.tick())
    assert "TypeError" in bench.runner.failure


def test_before_steady_gait_there_is_no_torque_and_no_call(bench):
    assert not bench.ticks(50, steady=False).any()
    assert not bench.controller.states
    assert not bench.runner.fading


def test_a_pause_fades_and_going_on_fades_in_again(bench):
    bench.ticks(RISE_TICKS)
    bench.runner.pause(on=True)
    assert bench.tick() < 5.0
    assert bench.runner.fading
    assert not bench.ticks(FADE_TICKS)[-1]
    bench.runner.pause(on=False)
    assert bench.tick() == pytest.approx(5.0 / RISE_TICKS)
    assert not bench.runner.fading


def test_the_controller_is_told_the_calibrated_angle_and_a_phase_within_the_cycle(bench):
    bench.tick()
    bench.watch.phase_pct = 104.0  # the next heel strike is late
    bench.tick()
    first, second = bench.controller.states
    assert first == (0.0, 12.0, pytest.approx(0.4), -1.0, 1.0, 4)
    assert (second.time_s, second.phase_pct) == (PERIOD_S, 100.0)


@pytest.mark.parametrize("torque", [float("nan"), float("inf"), -float("inf")])
def test_torque_that_is_no_number_stays_none_at_any_gain(bench, torque):
    bench.controller.answer = lambda _: torque
    assert not np.isfinite(bench.tick())
    assert not bench.runner.failure


@pytest.mark.parametrize("answer", [lambda _: 1 / 0, lambda _: None, lambda values: values["gain"]])
def test_what_a_controller_raises_is_a_request_without_a_number(bench, answer):
    bench.controller.answer = answer
    assert np.isnan(bench.tick())
    bench.runner.write_failure()
    (event,) = bench.events("controller_failed")
    assert (event["name"], event["slot"], event["condition"]) == ("spring", 0, "impedance")
    assert event["reason"] == bench.runner.failure != ""


def test_a_parameter_moves_at_its_rate_and_back_by_undo(bench):
    bench.ticks(10)
    assert bench.runner.set_parameter("share", 2.0) == ""
    shares = [bench.ticks(1) is not None and bench.controller.values[-1]["share"] for _ in range(5)]
    np.testing.assert_allclose(np.diff(shares), 0.5 * PERIOD_S)
    bench.ticks(1200)
    assert bench.controller.values[-1]["share"] == 2.0
    assert bench.runner.set_parameter("stiffness", 20) == ""
    assert bench.runner.set_parameter("share", 0.5) == ""
    assert [bench.runner.undo(), bench.runner.undo(), bench.runner.undo()] == ["", "", ""]
    assert bench.runner.undo() == "no change to undo"
    bench.ticks(1200)
    assert bench.controller.values[-1] == {"share": 1.0, "stiffness": 10.0}
    changed = [(e["name"], e["before"], e["after"]) for e in bench.events("parameter_changed")]
    assert changed == [("share", 1.0, 2.0), ("stiffness", 10.0, 20.0), ("share", 2.0, 0.5)]
    undone = [(e["name"], e["before"], e["after"]) for e in bench.events("parameter_undone")]
    assert undone == [("share", 0.5, 2.0), ("stiffness", 20.0, 10.0), ("share", 2.0, 1.0)]
    assert bench.events("parameter_changed")[0]["slot"] == 10  # it holds from then on


@pytest.mark.parametrize(
    ("name", "value", "why"),
    [
        ("gain", 1.0, "'gain' is no parameter of spring; it has share, stiffness"),
        ("share", float("nan"), "share: expected a finite number, got nan"),
        ("share", float("inf"), "share: expected a finite number, got inf"),
        ("stiffness", 4.0, "stiffness: expected 5 to 50 N*m/rad, got 4"),
        ("share", 1.0, "share is 1 already"),
    ],
)
def test_a_change_that_is_refused_says_why_and_changes_nothing(bench, name, value, why):
    assert bench.runner.set_parameter(name, value) == why
    bench.ticks(2)
    assert bench.controller.values[-1] == {"share": 1.0, "stiffness": 10.0}
    assert not bench.events("parameter_changed")
    assert bench.runner.undo() == "no change to undo"


def test_a_controller_cannot_change_its_parameters(bench):
    def greedy(values):
        values["share"] = 100.0

    bench.controller.answer = greedy
    assert np.isnan(bench.tick())
    assert "TypeError" in bench.runner.failure


def test_the_journal_says_what_ran_at_the_beginning_of_a_stretch(bench):
    (event,) = bench.events()
    assert event["event"] == "controller"
    assert (event["condition"], event["segment"], event["name"]) == ("impedance", 2, "spring")
    assert event["spec"] == {"name": "spring", "profile": None, "settings": {"share": 1.0}}
    assert event["description"] == {"torque_nm": 5.0}
    assert event["values"] == "as declared"
    share = {"value": 1.0, "low": 0.0, "high": 2.0, "rate_per_s": 0.5, "unit": "1"}
    assert event["parameters"]["share"] == share
