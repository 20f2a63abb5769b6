"""Second and third set of awkward files: reproducible files, and verdicts on folders."""

import tomllib
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from benchmarks.awkward_files.compare import Reading, Stretch, faults_of
from benchmarks.awkward_files.folder_judge import folder_faults, readings_of
from benchmarks.awkward_files.judge import VERDICTS, Draft, Question, judge_folder, verdict_of
from benchmarks.awkward_files.second_set import ITEMS
from benchmarks.awkward_files.study_edit import study_text
from benchmarks.awkward_files.third_set import ITEMS as THIRD_SET
from benchmarks.awkward_files.truth import (
    AwkwardFile,
    AwkwardFolder,
    FileTruth,
    FolderTruth,
    Part,
    People,
    Truth,
    Walk,
    part,
)

BINARY = (".xlsx", ".parquet", ".nc", ".c3d")
CATEGORIES = ("encoding", "delimiter", "clock", "header", "unit", "language", "sampling")


def _walk(phase: float = 0.0, *, pulses: bool = True) -> Walk:
    """Sixty seconds of motion with pulses every 4 s."""
    time = np.arange(30_000) / 500.0
    command = 17.0 * ((time % 4.0 > 1.5) & (time % 4.0 < 1.75) & pulses).astype(np.float64)
    contact = (time % 1.1 > 0.4).astype(np.float64)
    return Walk(time, 0.5 + 0.5 * np.sin(5.7 * time + phase), command * 0.9, command, contact)


def _people() -> People:
    return {
        (person, condition): _walk(0.7 * person, pulses=condition == "perturbed")
        for person in (1, 2)
        for condition in ("perturbed", "unperturbed")
    }


def _folder(name: str) -> AwkwardFolder:
    item = ITEMS[name]
    assert isinstance(item, AwkwardFolder)
    return item


def test_sets_hold_what_they_should() -> None:
    assert len(ITEMS) == 30
    assert sum(isinstance(item, AwkwardFolder) for item in ITEMS.values()) == 8
    assert sum("hopeless" in item.awkward for item in ITEMS.values()) == 4
    counts = Counter(item.awkward.split(":")[0] for item in THIRD_SET.values())
    assert counts == dict.fromkeys(CATEGORIES, 4) | {"hopeless": 2}
    assert sum(isinstance(item, AwkwardFolder) for item in THIRD_SET.values()) == 8


@pytest.mark.slow
@pytest.mark.parametrize(("items", "name"), [(s, n) for s in (ITEMS, THIRD_SET) for n in s])
def test_files_are_written_the_same_for_the_same_seed(
    tmp_path: Path, items: dict[str, AwkwardFile | AwkwardFolder], name: str
) -> None:
    item = items[name]
    for run in ("a", "b"):
        rng = np.random.default_rng(3)
        (tmp_path / run).mkdir()
        if isinstance(item, AwkwardFile):
            truth = item.write(_walk().at(500.0, 2.0, 40.0), tmp_path / run / name, rng)
            assert truth.hopeless == ("hopeless" in item.awkward)
        else:
            truths = item.write(_people(), tmp_path / run, rng)
            assert truths.hopeless == ("hopeless" in item.awkward)
            if items is THIRD_SET:
                written = {path.name for path in (tmp_path / run).rglob("*.*")}
                assert written >= set(truths.recordings)
                assert len({file.truth.participant for file in truths.recordings.values()}) == 2
            else:
                assert all((tmp_path / run / file).exists() for file in truths.recordings)
    for path in (tmp_path / "a").rglob("*.*"):
        if path.suffix not in BINARY:
            other = tmp_path / "b" / path.relative_to(tmp_path / "a")
            assert path.read_bytes() == other.read_bytes()


def _written_study(folder: Path) -> FolderTruth:
    """Write two recordings and a table of pulses, and a study that is right."""
    recordings, truths = [], {}
    for condition in ("perturbed", "unperturbed"):
        walk = _people()[1, condition].at(250.0, 2.0, 30.0)
        file = f"{condition}.csv"
        names = ("time", "angle", "torque", "contact")
        columns = np.c_[walk.clock, walk.angle, walk.torque, walk.contact]
        header = ",".join(names)
        np.savetxt(folder / file, columns, "%.9f", ",", header=header, comments="")
        recording = {"participant": "A1", "condition": condition, "file": file, "side": "left"}
        onsets: tuple[float, ...] = ()
        if condition == "perturbed":
            onsets = tuple(walk.clock[np.flatnonzero(np.diff(walk.command) > 0) + 1].tolist())
            rows = "".join(f"{onset:.4f},0.25,17\n" for onset in onsets)
            (folder / "pulses.csv").write_text("onset_s,duration_s,amplitude_nm\n" + rows)
            recording["perturbations"] = "pulses.csv"
        recordings.append(recording)
        truth = Truth((part(walk, omit=("command",)),), "A1", condition, onsets_s=onsets)
        truths[file] = FileTruth(truth, side="left")
    study = {"jointz": 1, "joint": "knee", "kind": "walking", "torque_acts_on": "joint"}
    study |= {"channels": {name: {"column": name} for name in names}}
    study |= {"participants": [{"id": "A1"}], "recordings": recordings}
    (folder / "study.toml").write_text(study_text(study))
    return FolderTruth(truths)


def _texts(folder: Path, truth: FolderTruth) -> list[str]:
    readings, error = readings_of(folder)
    assert error == ""
    return [str(fault) for fault in folder_faults(readings, truth)]


def test_a_study_that_is_right_has_no_faults_and_each_wrong_label_is_one(tmp_path: Path) -> None:
    truth = _written_study(tmp_path)
    assert _texts(tmp_path, truth) == []
    path = tmp_path / "study.toml"
    right = path.read_text()
    for old, new, fault in (
        ('side" = "left"', 'side" = "right"', "side: is 'right', not 'left'"),
        ('"A1"', '"A2"', "participant: is 'A2', not 'A1'"),
        ('"pulses.csv"', '"other.csv"', "pulses: 7 onsets, not those of the file"),
    ):
        rows = (tmp_path / "pulses.csv").read_text().replace("\n1", "\n2", 1)
        (tmp_path / "other.csv").write_text(rows)
        path.write_text(right.replace(old, new))
        assert any(text.endswith(fault) for text in _texts(tmp_path, truth)), (new, fault)


def test_a_recording_that_is_missing_or_too_many_is_a_fault(tmp_path: Path) -> None:
    truth = _written_study(tmp_path)
    first = dict(list(truth.recordings.items())[:1])
    assert _texts(tmp_path, FolderTruth(first)) == ["unperturbed.csv: taken for a recording"]
    more = truth.recordings | {"x.csv": first["perturbed.csv"]}
    assert _texts(tmp_path, FolderTruth(more)) == ["x.csv: not in the draft"]


def test_an_answer_to_a_question_about_the_second_recording_counts(tmp_path: Path) -> None:
    truth = _written_study(tmp_path)
    files = dict(truth.recordings)
    files["unperturbed.csv"] = FileTruth(files["unperturbed.csv"].truth, side="right")
    changed = FolderTruth(files)
    readings, _ = readings_of(tmp_path)
    faults = folder_faults(readings, changed)
    question = Question("recordings[1].side", "Which leg?", ("left", "right"))
    text = (tmp_path / "study.toml").read_text()
    draft = Draft((question,), study=tomllib.loads(text))
    verdict, sentence = verdict_of(draft, faults, changed, "", tmp_path)
    assert verdict == "question"
    assert "[right: right]" in sentence
    assert (tmp_path / "study.toml").read_text() == text
    assert verdict_of(Draft(study=tomllib.loads(text)), faults, changed, "", tmp_path)[0] == "wrong"


@pytest.mark.slow
def test_a_folder_has_a_verdict(tmp_path: Path) -> None:
    item = _folder("folder_24")
    truth = item.write(_people(), tmp_path, np.random.default_rng(3))
    row = judge_folder(item, truth, tmp_path)
    assert row.verdict in VERDICTS
    assert row.sentence


def test_a_number_that_marks_missing_values_is_a_fault_if_it_is_read() -> None:
    walk = _walk()
    angle = np.where(np.arange(walk.time.size) % 500 == 7, np.nan, walk.angle)
    values = {"time": walk.time, "torque": walk.torque, "command": walk.command}
    values["contact"] = walk.contact
    true = Part(values | {"angle": angle})
    marked = Reading((Stretch(values | {"angle": np.where(np.isnan(angle), 174.5, angle)}),))
    held = Reading((Stretch(values | {"angle": walk.angle}),))
    assert [fault.channel for fault in faults_of(marked, Truth((true,)))] == ["angle"]
    assert faults_of(held, Truth((true,))) == []
