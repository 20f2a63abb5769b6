"""The user's own ``exclusions.csv``: a line more, and none of the others lost."""

import csv
import io
import shutil
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Literal

from jointz.core import provenance
from jointz.core.errors import DataError, WriteError
from jointz.core.events import PulseRecord
from jointz.core.study import Study, UserExclusion, name_problem
from jointz.core.whole_file import whole_file
from jointz.identify.preparation.sources import SAME_TIME_S
from jointz.io.study_reader import open_study

Action = Literal["exclude", "restore"]

FILE = "exclusions.csv"
_COLUMNS = ("participant", "recording", "onset_s", "action", "reason", "time")
_LONGEST_REASON = 300
_TODO = "Make room, or ask for permission to write in the study."
_ONE_AT_A_TIME = threading.Lock()


def excluded(study: Study, pulses: Iterable[PulseRecord]) -> list[bool]:
    """Tell which pulses the user left out; the last line about each counts."""
    by_file: dict[tuple[str, str], list[UserExclusion]] = {}
    for line in reversed(study.user_exclusions):
        by_file.setdefault((line.participant, line.recording), []).append(line)
    last = (
        next((x for x in by_file.get((p.participant, p.recording), ()) if is_about(x, p)), None)
        for p in pulses
    )
    return [line is not None and line.action == "exclude" for line in last]


def is_excluded(study: Study, pulse: PulseRecord) -> bool:
    """Tell whether the user left a pulse out; the last line about it counts."""
    return excluded(study, [pulse])[0]


def last_line(study: Study, pulse: PulseRecord) -> UserExclusion | None:
    """Return the line of ``exclusions.csv`` that decides about a pulse, None without one."""
    about = [line for line in study.user_exclusions if is_about(line, pulse)]
    return about[-1] if about else None


def is_about(line: UserExclusion, pulse: PulseRecord) -> bool:
    """Tell whether a line of ``exclusions.csv`` means a pulse."""
    same = (line.participant, line.recording) == (pulse.participant, pulse.recording)
    return same and abs(line.onset_s - pulse.onset_s) < SAME_TIME_S


def decide(study: Study, pulse: PulseRecord, action: Action, *, reason: str) -> Study:
    """Exclude or restore a pulse in the study's own file.

    Bytes that are there stay as they are; the line comes last, in the columns that the file has.
    Pages wait for each other; the file is there whole or not at all.
    """
    words = _checked_reason(reason, action)
    with _alone(study.root):
        current = open_study(study.root)  # refuses a file that nobody could add to
        if current.sha256 != study.sha256:  # or one person's numbers would be of another study
            raise DataError(
                f"{study.root}: study.toml was changed since it was opened; nothing was written. "
                "Analyse the study again, and open the results anew.",
                path=str(study.root),
            )
        if is_excluded(current, pulse) == (action == "exclude"):
            return current
        _append(study.root / FILE, _line(pulse, action, words))
        return open_study(study.root)


def _checked_reason(reason: str, action: Action) -> str:
    words = " ".join("".join(c if c.isprintable() else " " for c in reason).split())
    if action == "exclude" and not words:
        raise DataError("reason: missing. Say why the pulse is left out; it goes into the study.")
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
def _alone(root: Path) -> Iterator[None]:
    """Keep other pages out, of this process and of others; leaves nothing behind."""
    with _ONE_AT_A_TIME:
        try:
            import fcntl
            import os
        except ImportError:  # Windows: pages of one process wait for each other, others do not
            yield
            return
        try:
            fd = os.open(root, os.O_RDONLY)
        except OSError as exc:
            raise WriteError(str(root / FILE), exc, _TODO) from exc
        try:
            with suppress(OSError):  # network file systems lock no folders: as on Windows then
                fcntl.flock(fd, fcntl.LOCK_EX)  # let go when closed, or the process is gone
            yield
        finally:
            os.close(fd)


def _append(file: Path, line: dict[str, str]) -> None:
    file = file.resolve()  # one that is linked stays linked
    try:
        there = file.read_bytes() if file.exists() else b""
    except OSError as exc:
        raise WriteError(str(file), exc, _TODO) from exc
    header = _header(there)
    ending = next((one for one in ("\r\n", "\n", "\r") if one.encode() in there), "\n")
    text = io.StringIO()
    writer = csv.writer(text, lineterminator=ending)
    if not there:
        writer.writerow(header)
    elif not there.endswith((b"\n", b"\r")):
        text.write(ending)
    writer.writerow([line.get(column, "") for column in header])
    with whole_file(file, _TODO) as partial:
        partial.write_bytes(there + text.getvalue().encode("utf-8"))
        if there:
            shutil.copymode(file, partial)


def _header(there: bytes) -> list[str]:
    """Return the columns of the file, the usual ones where there is none."""
    if not there:
        return list(_COLUMNS)
    # Blank lines before the header are none to pandas, which reads the file.
    text = io.StringIO(there.decode("utf-8-sig"), newline=None)
    lines = (row for row in csv.reader(text) if row)
    return next(lines)
