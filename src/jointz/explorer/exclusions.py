"""The user's ``exclusions.csv``: reading it, and adding lines to it."""

import csv
import io
import shutil
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Literal

from jointz.analysis.pulse_traces import is_about
from jointz.core import provenance
from jointz.core.errors import DataError, WriteError
from jointz.core.events import PulseRecord
from jointz.core.grouping import by_key
from jointz.core.study import Study, UserExclusion, name_problem
from jointz.core.whole_file import whole_file
from jointz.io.study_reader import open_study

Action = Literal["exclude", "restore"]

FILE = "exclusions.csv"
_COLUMNS = ("participant", "recording", "onset_s", "action", "reason", "time")
_LONGEST_REASON = 300
_TODO = "Make room, or ask for permission to write in the study."
_ONE_AT_A_TIME = threading.Lock()


def excluded(study: Study, pulses: Iterable[PulseRecord]) -> list[bool]:
    """Return whether the user excluded each pulse; the last line about it counts."""
    by_file = by_key(((x.participant, x.recording), x) for x in reversed(study.user_exclusions))
    last = (
        next((x for x in by_file.get((p.participant, p.recording), ()) if is_about(x, p)), None)
        for p in pulses
    )
    return [line is not None and line.action == "exclude" for line in last]


def is_excluded(study: Study, pulse: PulseRecord) -> bool:
    """Return whether the user excluded a pulse."""
    return excluded(study, [pulse])[0]


def last_line(study: Study, pulse: PulseRecord) -> UserExclusion | None:
    """Return the last line of ``exclusions.csv`` about a pulse, None if there is none."""
    about = [line for line in study.user_exclusions if is_about(line, pulse)]
    return about[-1] if about else None


def decide(study: Study, pulse: PulseRecord, action: Action, *, reason: str) -> Study:
    """Exclude or restore a pulse in the study's own file.

    The new line comes last, in the columns of the file; all other bytes stay. Pages wait for each
    other, and the file is written whole or not at all.
    """
    reason = _checked_reason(reason, action)
    with _locked(study.root):
        current = open_study(study.root)  # refuses a file without the needed columns
        if current.sha256 != study.sha256:  # one person's numbers would be of another study
            raise DataError(
                f"{study.root}: study.toml was changed since it was opened; nothing was written. "
                "Analyse the study again, and open the new results.",
                path=str(study.root),
            )
        if is_excluded(current, pulse) == (action == "exclude"):
            return current
        _append(study.root / FILE, _line(pulse, action, reason))
        return open_study(study.root)


def _checked_reason(reason: str, action: Action) -> str:
    words = " ".join("".join(c if c.isprintable() else " " for c in reason).split())
    if action == "exclude" and not words:
        raise DataError("reason: missing. State why the pulse is excluded; the study keeps it.")
    if len(words) > _LONGEST_REASON:
        raise DataError(
            f"reason: expected at most {_LONGEST_REASON} letters, got {len(words)}. Shorten it."
        )
    if problem := name_problem(words):
        raise DataError(f"reason: {problem}. Write it in other words.")
    return words


def _line(pulse: PulseRecord, action: Action, reason: str) -> dict[str, str]:
    values = (pulse.participant, pulse.recording, repr(float(pulse.onset_s)), action, reason)
    return dict(zip(_COLUMNS, (*values, provenance.now()), strict=True))


@contextmanager
def _locked(root: Path) -> Iterator[None]:
    """Keep other pages out, of this process and of others; no lock file is left behind."""
    with _ONE_AT_A_TIME:
        try:
            import fcntl
            import os
        except ImportError:  # Windows: only pages of one process wait for each other
            yield
            return
        try:
            fd = os.open(root, os.O_RDONLY)
        except OSError as exc:
            raise WriteError(str(root / FILE), exc, _TODO) from exc
        try:
            with suppress(OSError):  # network file systems lock no folders: as on Windows then
                fcntl.flock(fd, fcntl.LOCK_EX)  # released when the process closes it or ends
            yield
        finally:
            os.close(fd)


def _append(file: Path, line: dict[str, str]) -> None:
    file = file.resolve()  # a link stays a link
    try:
        content = file.read_bytes() if file.exists() else b""
    except OSError as exc:
        raise WriteError(str(file), exc, _TODO) from exc
    header = _header(content)
    ending = next((end for end in ("\r\n", "\n", "\r") if end.encode() in content), "\n")
    text = io.StringIO()
    writer = csv.writer(text, lineterminator=ending)
    if not content:
        writer.writerow(header)
    elif not content.endswith((b"\n", b"\r")):
        text.write(ending)
    writer.writerow([line.get(column, "") for column in header])
    with whole_file(file, _TODO) as partial:
        partial.write_bytes(content + text.getvalue().encode("utf-8"))
        if content:
            shutil.copymode(file, partial)


def _header(content: bytes) -> list[str]:
    """Return the columns of the file, the usual ones if it is empty."""
    if not content:
        return list(_COLUMNS)
    # Blank lines before the header are skipped, as pandas does.
    text = io.StringIO(content.decode("utf-8-sig"), newline=None)
    lines = (row for row in csv.reader(text) if row)
    return next(lines)
