"""The verdict on one file: draft a study file, read it unedited, compare with the truth.

Verdicts: ``right`` (all channels equal the truth), ``question`` (jointz asks about what is open
in the file), ``unclear`` (refused or incomplete without naming it), ``wrong`` (a number is not
the truth, and nothing asks about it).
"""

import json
import os
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.awkward_files.compare import Fault, Reading, faults_of
from benchmarks.awkward_files.folder_judge import (
    angle_zero_rad,
    folder_faults,
    message_of,
    number,
    reading_of,
    readings_of,
)
from benchmarks.awkward_files.study_edit import answered, study_text
from benchmarks.awkward_files.truth import AwkwardFile, AwkwardFolder, FolderTruth, Truth

import jointz

VERDICTS = ("right", "question", "unclear", "wrong")
REFUSED = 100  # more faults than any reading has
Study = dict[str, Any]
Answers = dict[int, Any]  # by the number of the question


@dataclass(frozen=True, slots=True)
class Question:
    """A question of the draft: the key it is about, its text, and the values it offers."""

    about: str
    text: str
    answers: tuple[Any, ...] = ()

    @property
    def said(self) -> str:
        return f"{self.about}: {self.text}" if self.about else self.text


@dataclass(frozen=True, slots=True)
class Draft:
    """What ``jointz inspect`` says of a file; `study` is None if there is no study file."""

    questions: tuple[Question, ...] = ()
    obstacles: tuple[str, ...] = ()
    error: str = ""
    study: Study | None = None


@dataclass(frozen=True, slots=True)
class Row:
    """A line of the table."""

    name: str
    awkward: str
    verdict: str
    sentence: str
    label_faults: tuple[str, ...] = ()


def judge(file: AwkwardFile, truth: Truth, folder: Path) -> Row:
    """Return the verdict on a file that lies alone in a folder."""
    draft = inspect(folder / file.name)
    reading = read(folder) if draft.study is not None else Reading(error=draft.error)
    faults = faults_of(reading, truth)
    statement = _named(draft, [reading.error], truth, [file.name])
    verdict, sentence = verdict_of(draft, faults, truth, statement, folder)
    return Row(file.name, file.awkward, verdict, sentence, _label_faults(reading, truth))


def judge_folder(item: AwkwardFolder, truth: FolderTruth, folder: Path) -> Row:
    """Return the verdict on a folder; wrong labels of its recordings are faults."""
    draft = inspect(folder)
    readings, error = readings_of(folder) if draft.study is not None else ({}, draft.error)
    if error:
        faults = [Fault("", f"refused: {error}", is_number=False)]
    else:
        faults = folder_faults(readings, truth)
    errors = [error, *(reading.error for of_file in readings.values() for reading in of_file)]
    names = [path.name for path in sorted(folder.iterdir(), key=lambda p: -len(p.name))]
    statement = _named(draft, errors, truth, names)
    verdict, sentence = verdict_of(draft, faults, truth, statement, folder)
    return Row(item.name, item.awkward, verdict, sentence)


def inspect(path: Path) -> Draft:
    """Run ``jointz inspect`` on a file or a folder and return what it says."""
    inside = path.name if path.is_dir() else ""
    study = path.parent / inside / "study.toml"
    arguments = ["inspect", path.name, "--toml", str(Path(inside, study.name)), "--json"]
    done = subprocess.run(
        [sys.executable, "-m", "jointz", *arguments], cwd=path.parent, capture_output=True,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"}, encoding="utf-8", check=False,
    )  # fmt: skip
    try:
        said = json.loads(done.stdout)
    except json.JSONDecodeError:
        said = {}
    if done.returncode not in (0, 1) or not study.exists():
        message = said.get("message") or said.get("error") or done.stderr or done.stdout
        return Draft(error=_without_paths(str(message), path.parent))
    questions = tuple(
        Question(str(q.get("about", "")), str(q.get("text", "")), _values(q.get("answers")))
        for q in said.get("questions", ())
    )
    obstacles = tuple(map(str, said.get("obstacles", ())))
    try:
        return Draft(questions, obstacles, study=tomllib.loads(study.read_text("utf-8")))
    except tomllib.TOMLDecodeError as error:
        return Draft(questions, obstacles, error=f"The draft is no TOML: {error}")


def _values(answers: Any) -> tuple[Any, ...]:
    return tuple(a.get("value") if isinstance(a, dict) else a for a in answers or ())


def read(folder: Path) -> Reading:
    """Return the first recording of a study, or the message of its refusal."""
    try:
        recording = jointz.open_study(folder).recordings[0]
        study = tomllib.loads((folder / "study.toml").read_text("utf-8"))
    except Exception as error:  # noqa: BLE001 - a crash is a verdict, not the end of the table
        return Reading(error=message_of(error, folder))
    return reading_of(recording, folder, angle_zero_rad(study, 0))


def _without_paths(text: str, folder: Path) -> str:
    """Return a message on one line without the scratch folder, whose name is no statement."""
    return " ".join(text.replace(f"{folder}{os.sep}", "").split())


def verdict_of(
    draft: Draft, faults: list[Fault], truth: Truth | FolderTruth, statement: str, folder: Path
) -> tuple[str, str]:
    """Return the verdict and its reason; `statement` names what is open, or is empty."""
    if not faults:
        if truth.hopeless:
            if statement:
                return "question", statement
            return "unclear", "The draft happens to be right, but asks nothing."
        return "right", "All channels equal the truth."
    listed = "; ".join(str(fault) for fault in faults)
    answer = _right_answer(draft, truth, folder)
    if answer:
        return "question", answer
    if any(fault.is_number for fault in faults):
        if statement and not truth.answerable:
            return "question", statement
        doubts = f" Asked without a right answer: {statement}" if statement else ""
        return "wrong", f"{listed}.{doubts}"
    if statement:
        return "question", statement
    return "unclear", " ".join([*draft.obstacles, f"{listed.rstrip('.')}."])


def _named(draft: Draft, errors: list[str], truth: Truth | FolderTruth, files: list[str]) -> str:
    """Return the first sentence that names what is open; names of files do not count."""
    for question in draft.questions:
        if any(question.about.startswith(key[1:]) for key in truth.open if key[0] == "@"):
            return question.said
    texts = [question.text for question in draft.questions]
    words = [key.lower().split("&") for key in truth.open if key[0] != "@"]
    for sentence in [*texts, *draft.obstacles, draft.error, *errors]:
        text = sentence.lower()
        for file in files:
            text = text.replace(file.lower(), "")
        if any(all(word in text for word in key) for key in words):
            return sentence
    return ""


def _right_answer(draft: Draft, truth: Truth | FolderTruth, folder: Path) -> str:
    """Return the questions and answers that make the reading right, if there are any."""
    if draft.study is None:
        return ""
    path = folder / "study.toml"
    unedited = path.read_bytes()
    firsts = {i: q.answers[0] for i, q in enumerate(draft.questions) if q.answers}
    try:
        for start in ({}, firsts):
            chosen = _best_answers(draft, truth, folder, start)
            if chosen is not None:
                said = ((draft.questions[i].said, value) for i, value in chosen.items())
                return " ".join(f"{text} [right: {value}]" for text, value in said)
    finally:
        path.write_bytes(unedited)
    return ""


def _best_answers(
    draft: Draft, truth: Truth | FolderTruth, folder: Path, start: Answers
) -> Answers | None:
    """Change one answer after the other where it removes faults; None if faults remain."""
    chosen = start
    fewest = _n_faults(draft, truth, folder, chosen)
    for i, question in enumerate(draft.questions):
        for value in question.answers:
            n = _n_faults(draft, truth, folder, chosen | {i: value})
            if n < fewest:
                chosen, fewest = chosen | {i: value}, n
    return chosen if fewest == 0 else None


def _n_faults(draft: Draft, truth: Truth | FolderTruth, folder: Path, answers: Answers) -> int:
    study = draft.study or {}
    try:
        for i, value in answers.items():
            study = answered(study, draft.questions[i].about, value)
    except (AttributeError, IndexError, KeyError, TypeError, ValueError):
        return REFUSED  # the question is about no key of a study file
    (folder / "study.toml").write_text(study_text(study), "utf-8")
    if isinstance(truth, FolderTruth):
        return _n_folder_faults(truth, folder)
    reading = read(folder)
    return len(faults_of(reading, truth)) if reading.stretches else REFUSED


def _n_folder_faults(truth: FolderTruth, folder: Path) -> int:
    readings, error = readings_of(folder)
    if error:
        return REFUSED * len(truth.recordings)
    refused = sum(not r.stretches for of_file in readings.values() for r in of_file)
    return len(folder_faults(readings, truth)) + REFUSED * refused


def _label_faults(reading: Reading, truth: Truth) -> tuple[str, ...]:
    if not reading.stretches:
        return ()
    first = reading.stretches[0]
    faults = []
    if truth.participant and number(first.participant) != number(truth.participant):
        faults.append(f"participant is {first.participant!r}, not {truth.participant!r}")
    if truth.condition and first.condition != truth.condition:
        faults.append(f"condition is {first.condition!r}, not {truth.condition!r}")
    return tuple(faults)
