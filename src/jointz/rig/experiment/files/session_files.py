"""The files of a session's folder: what was planned, of whom, and where the records are."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jointz.core.errors import DataError
from jointz.rig.experiment.files.whole_files import is_written, read_twice, write_twice

JOURNAL_FILE = "journal.jsonl"
#: Where the operator's page leaves its commands, while there is one.
CONTROL_FILE = "control"
SESSION_FILE, PLAN_FILE = "session.json", "plan.json"


def log_path(folder: Path, condition: str, segment: int) -> Path:
    """Return where the log of a stretch is kept."""
    return folder / "logs" / f"{condition}-{segment}.jzlog"


def has_content(log: Path) -> bool:
    """Return whether a log exists with a whole header: a power cut may leave none."""
    if not log.exists():
        return False
    with log.open("rb") as stream:
        return stream.readline().endswith(b"\n")


def keep_plan(folder: Path, plan: Mapping[str, Sequence[Mapping[str, Any]]]) -> str:
    """Write the plan down, or see that the one that stands there is the same.

    Returns which of its two copies is damaged, "" where none is.
    """
    file = folder / PLAN_FILE
    written, damage = _written_or_new(file, plan)
    if written != json.loads(json.dumps(plan)):
        raise DataError(
            f"{file}: altered, it is not the plan of this protocol and seed. Restore it from a "
            "copy, or go on with the jointz that wrote it.",
            path=str(file),
        )
    return damage


def keep_description(folder: Path, about: Mapping[str, Any]) -> str:
    """Write down what the session is of, or see that the one there is of the same wearer.

    Returns which of its two copies is damaged, "" where none is.
    """
    file = folder / SESSION_FILE
    written, damage = _written_or_new(file, about)
    wearer, now = written.get("wearer"), json.loads(json.dumps(about["wearer"]))
    if wearer != now:
        raise DataError(
            f"{file}: of another wearer: {wearer}, now {now}. Give the arguments the run was "
            "started with.",
            path=str(file),
        )
    return damage


def _written_or_new(file: Path, content: Mapping[str, Any]) -> tuple[dict[str, Any], str]:
    """Return what a file holds, written now if it is new, and which of its copies is damaged."""
    if not is_written(file):
        write_twice(file, json.dumps(content, indent=1))
    return read_twice(file)
