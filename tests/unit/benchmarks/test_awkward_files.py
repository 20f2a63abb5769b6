"""Awkward files: they are reproducible, and their verdicts come from the truth."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from benchmarks.awkward_files.compare import Fault, Reading, Stretch, faults_of
from benchmarks.awkward_files.judge import VERDICTS, Draft, Question, judge, read, verdict_of
from benchmarks.awkward_files.make import FILES, make, recorded_walk
from benchmarks.awkward_files.study_edit import answered, study_text
from benchmarks.awkward_files.truth import Truth, Walk, part

NAMES = ("VP01_gestoert.csv", "S22_EWP.mat", "S27_perturbed_raw.csv")


def _walk(**changed: float) -> Walk:
    """A second of motion; each change multiplies a channel."""
    time = np.arange(500) / 500.0
    signals = {"time": time, "angle": np.sin(6 * time), "torque": np.cos(9 * time)}
    signals |= {"command": (time > 0.5) * 17.0, "contact": (time % 0.4 > 0.2) * 1.0}
    return Walk(**{name: values * changed.get(name, 1.0) for name, values in signals.items()})


def _faults(walk: Walk) -> list[str]:
    values = {name: getattr(walk, name) for name in ("angle", "torque", "command", "contact")}
    reading = Reading((Stretch({"time": walk.time + 12.0} | values),))
    return [fault.channel for fault in faults_of(reading, Truth((part(_walk()),)))]


@pytest.mark.slow
def test_three_files_have_a_verdict(tmp_path: Path) -> None:
    for name, truth in make(tmp_path, NAMES).items():
        row = judge(FILES[name], truth, tmp_path / name.replace(".", "_"))
        assert row.verdict in VERDICTS
        assert row.sentence


@pytest.mark.slow
def test_files_are_the_same_for_the_same_seed(tmp_path: Path) -> None:
    assert len(FILES) == 30
    names = (*NAMES, "S16_pert.csv", "P13_perturbed.lvm")
    for folder in ("a", "b"):
        make(tmp_path / folder, names)
    for path in (tmp_path / "a").rglob("*.*"):
        assert path.read_bytes() == (tmp_path / "b" / path.relative_to(tmp_path / "a")).read_bytes()


@pytest.mark.slow
def test_the_walk_is_the_same_for_the_same_seed() -> None:
    again = recorded_walk.__wrapped__(7)
    np.testing.assert_array_equal(again.angle, recorded_walk(7).angle)
    np.testing.assert_array_equal(again.torque, recorded_walk(7).torque)


def test_offset_of_the_clock_is_no_fault_but_its_unit_is() -> None:
    assert _faults(_walk()) == []
    assert _faults(_walk(time=1e3)) == ["time"]


def test_wrong_sign_and_wrong_unit_are_faults() -> None:
    assert _faults(_walk(angle=-1.0, torque=1e3)) == ["angle", "torque"]
    assert _faults(_walk(contact=-1.0)) == ["contact"]


def test_answers_change_the_key_that_they_are_about() -> None:
    study = {"channels": {"angle": {"column": "a"}}, "recordings": [{"file": "x.csv"}]}
    assert answered(study, "torque_acts_on", "device")["torque_acts_on"] == "device"
    assert answered(study, "channels.angle", "b")["channels"]["angle"] == {"column": "b"}
    assert answered(study, "channels.angle.unit", "deg")["channels"]["angle"]["unit"] == "deg"
    for about in ("recordings.side", "recordings[0].side"):
        changed = answered(study, about, "left")
        assert changed["recordings"] == [{"file": "x.csv", "side": "left"}]
        assert tomllib.loads(study_text(changed)) == changed
    assert "side" not in study["recordings"][0]


def test_question_without_a_right_answer_excuses_a_wrong_number_only_if_none_can_be_right() -> None:
    number, refused = [Fault("torque", "100")], [Fault("", "refused", is_number=False)]
    for answerable, hopeless, faults, statement, expected in (
        (True, False, number, "Which unit?", "wrong"),
        (False, True, number, "Which unit?", "question"),
        (False, True, number, "", "wrong"),
        (True, False, refused, "Which unit?", "question"),
        (True, False, refused, "", "unclear"),
        (True, False, [], "", "right"),
        (True, True, [], "", "unclear"),
    ):
        truth = Truth((), answerable=answerable, hopeless=hopeless)
        assert verdict_of(Draft(), faults, truth, statement, Path())[0] == expected


def test_two_answers_that_make_the_reading_right_are_a_question(tmp_path: Path) -> None:
    walk = _walk()
    columns = np.c_[walk.time, np.degrees(-walk.angle), walk.torque, walk.command, walk.contact]
    names = ["time", "angle", "torque", "command", "contact"]
    np.savetxt(tmp_path / "x.csv", columns, "%.9f", ",", header=",".join(names), comments="")
    study = {"jointz": 1, "joint": "knee", "kind": "walking", "torque_acts_on": "device"}
    study["channels"] = {name: {"column": name} for name in names}
    study["channels"]["angle"]["unit"] = "deg"
    study["participants"] = [{"id": "A"}]
    study["recordings"] = [{"participant": "A", "condition": "perturbed", "file": "x.csv"}]
    (tmp_path / "study.toml").write_text(study_text(study))
    truth = Truth((part(walk),))
    faults = faults_of(read(tmp_path), truth)
    assert [fault.channel for fault in faults] == ["angle", "torque"]
    sign = Question("channels.angle.positive", "Which direction?", ("flexion", "extension"))
    for answers, expected in ((("device", "joint"), "question"), (("device",), "wrong")):
        draft = Draft((sign, Question("torque_acts_on", "Which side?", answers)), study=study)
        assert verdict_of(draft, faults, truth, "", tmp_path)[0] == expected
