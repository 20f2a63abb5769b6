"""Calibrations as files: ``calibration.toml``, and entries put into a ``study.toml``."""

import os
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

from pydantic import Field, ValidationError

from jointz.core.checked_model import CheckedModel
from jointz.core.errors import DataError, StudyError, WriteError
from jointz.core.study import CalibrationSpec, Name, SchemaVersion
from jointz.core.whole_file import whole_file
from jointz.io.small_files import file_content, parse_toml
from jointz.io.toml_problems import shape_problems
from jointz.io.toml_text import Statement, statements, written_table, written_text

_PARTICIPANTS_HEADER = re.compile(r"\[\[\s*participants\s*\]\]")
_CALIBRATION_KEY = re.compile(r"calibration\s*=\s*(?=\{)")
#: The same table written in a way that is left to its author.
_OTHER_WAYS = re.compile(r"""(\[\s*participants\s*\.\s*)?["']?calibration["']?\s*[.=\]]""")
_HEAD = "# Written by jointz calibrate; jointz run --calibration takes it into a study.\n"
_KEPT = "before-calibration"


class _Person(CheckedModel):
    id: Name
    calibration: CalibrationSpec


class _File(CheckedModel):
    jointz_calibration: SchemaVersion = 1
    calibration: CalibrationSpec = CalibrationSpec()
    participants: tuple[_Person, ...] = Field(default=(), strict=False)


@dataclass(frozen=True, slots=True)
class CalibrationFile:
    """Content of a calibration file."""

    common: CalibrationSpec  # entries for all participants
    participants: Mapping[str, CalibrationSpec]  # participant -> entries of their own

    def of(self, participant: str) -> CalibrationSpec:
        """Return what is known for a participant: their own entries over those for everybody."""
        return self.common.overridden_by(self.participants.get(participant))


def read_calibration(path: str | os.PathLike[str]) -> CalibrationFile:
    """Read a calibration file."""
    absent = f"{path}: no such file. Give a file that jointz calibrate --out wrote."
    return _checked(os.fspath(path), file_content(path, absent=absent))


def _checked(where: str, text: bytes) -> CalibrationFile:
    raw = parse_toml(where, text, error=StudyError)
    try:
        content = _File.model_validate(raw)
    except ValidationError as exc:
        raise StudyError(where, shape_problems(exc, _File, raw)) from exc
    ids = [person.id for person in content.participants]
    twice = sorted({i for i in ids if ids.count(i) > 1})
    if twice:
        raise StudyError(where, [f"participants: {', '.join(twice)} is named more than once."])
    return CalibrationFile(content.calibration, {p.id: p.calibration for p in content.participants})


def calibration_toml(calibrations: Mapping[str, CalibrationSpec], *, earlier: str = "") -> str:
    """Return the text of a calibration file."""
    text = earlier or f"{_HEAD}jointz_calibration = 1\n"
    participants = _checked("calibration file", text.encode()).participants
    newline = _newline(text)
    for participant in calibrations:
        if participant not in participants:
            lines = ["", "[[participants]]", f"id = {written_text(participant)}"]
            lines += ["calibration = {}", ""]
            text += ("" if text.endswith("\n") else newline) + newline.join(lines)
    return into_study(text, calibrations)


def into_study(text: str, calibrations: Mapping[str, CalibrationSpec]) -> str:
    """Return the text of a ``study.toml`` with entries of its participants' calibrations put in."""
    raw = parse_toml("study.toml", text.encode(), error=StudyError)
    entries = {
        name: calibration for name, calibration in calibrations.items() if _entries(calibration)
    }
    people = _people(raw)
    problems = _missing(entries, people)
    blocks = _blocks(text)
    if len(blocks) != len(people):
        problems.append(
            f"participants: expected each of the {len(people)} as a table [[participants]] of its "
            f"own, found {len(blocks)}. Write them so, or put the entries in by hand."
        )
    if problems:
        raise StudyError("study.toml", problems)
    edits = []
    for person, block in zip(people, blocks, strict=True):
        name = str(person["id"])
        if name in entries:
            edits.append(_edit(text, block, _merged(person, entries[name]), name))
    changed = text
    for start, end, new in sorted(edits, reverse=True):
        changed = changed[:start] + new + changed[end:]
    _check(changed, raw, entries)
    return changed


def write_into_study(folder: Path, calibrations: Mapping[str, CalibrationSpec]) -> Path:
    """Put entries into the ``study.toml`` of a folder, whole or not at all."""
    file = folder / "study.toml"
    before = file_text(file)
    after = into_study(before, calibrations)
    backup = _kept(file, before)
    write_text(file, after)
    return backup


def file_text(file: Path) -> str:
    """Return what a text file holds, its ends of lines as they are."""
    try:
        absent = f"{file}: no such file; expected a text file in UTF-8."
        return file_content(file, absent=absent).decode("utf-8")
    except UnicodeDecodeError as exc:
        raise DataError(
            f"{file}: expected a text file in UTF-8 ({exc}). Give a file that can be read.",
            path=str(file),
        ) from exc


def write_text(file: Path, text: str) -> None:
    """Write a text file whole or not at all, its ends of lines as they are."""
    with whole_file(file, "Name a place that can be written.") as partial:
        partial.write_bytes(text.encode("utf-8"))


def _kept(file: Path, text: str) -> Path:
    """Write down what a file held, under a name that nothing has."""
    numbered = (f"-{number}" if number > 1 else "" for number in count(1))
    for backup in (file.with_name(f"{file.name}.{_KEPT}{number}") for number in numbered):
        try:
            with backup.open("xb") as stream:
                stream.write(text.encode("utf-8"))
        except FileExistsError:
            continue
        except OSError as exc:
            raise WriteError(str(backup), exc, "Make the study's folder writable.") from exc
        break
    return backup


# --- the text ----------------------------------------------------------------------------------


def _people(raw: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    people = raw.get("participants", [])
    fine = isinstance(people, list) and all(isinstance(p, Mapping) and "id" in p for p in people)
    return people if fine else []


def _missing(entries: Mapping[str, Any], people: Sequence[Mapping[str, Any]]) -> list[str]:
    ids = [str(person["id"]) for person in people]
    return [
        f"participants: '{name}' was calibrated but is not there; found {', '.join(ids) or 'none'}."
        for name in entries
        if name not in ids
    ]


def _blocks(text: str) -> list[list[Statement]]:
    """Return the statements of every ``[[participants]]``, with sub-tables behind it."""
    blocks: list[list[Statement]] = []
    inside = False
    for statement in statements(text):
        if _PARTICIPANTS_HEADER.fullmatch(statement.text):
            blocks.append([])
            inside = True
        elif statement.is_header:
            inside = inside and bool(_OTHER_WAYS.match(statement.text))
        if inside:
            blocks[-1].append(statement)
    return blocks


def _edit(
    text: str, block: Sequence[Statement], entries: Mapping[str, Any], name: str
) -> tuple[int, int, str]:
    """Return which part of the text gives way to what."""
    written = f"calibration = {written_table(entries)}"
    for statement in block:
        key = _CALIBRATION_KEY.match(statement.text)
        if key:
            return statement.start, statement.end, written
        if _OTHER_WAYS.match(statement.text):
            raise StudyError(
                "study.toml",
                [
                    f"participants '{name}': its calibration is written as '{statement.text}'; "
                    "expected one line 'calibration = { ... }'. Write it so, or put the entries "
                    "in by hand."
                ],
            )
    last = block[-1]
    line_end = text.find("\n", last.end)
    newline = _newline(text)
    if line_end < 0:
        return len(text), len(text), newline + written
    return line_end + 1, line_end + 1, written + newline


def _merged(person: Mapping[str, Any], calibration: CalibrationSpec) -> dict[str, Any]:
    return {**person.get("calibration", {}), **_entries(calibration)}


def _entries(calibration: CalibrationSpec) -> dict[str, Any]:
    return calibration.model_dump(exclude_none=True)


def _newline(text: str) -> str:
    return "\r\n" if "\r\n" in text else "\n"


def _check(text: str, before: Mapping[str, Any], entries: Mapping[str, CalibrationSpec]) -> None:
    """Refuse an edit after which the file says anything else than before and the entries."""
    expected = {
        **before,
        "participants": [
            {**person, "calibration": _merged(person, entries[str(person["id"])])}
            if str(person["id"]) in entries
            else person
            for person in _people(before)
        ],
    }
    try:
        same = tomllib.loads(text.removeprefix("\ufeff")) == expected
    except tomllib.TOMLDecodeError:
        same = False
    if not same:
        raise StudyError(
            "study.toml",
            ["the entries cannot be put in without changing something else. Do it by hand."],
        )
