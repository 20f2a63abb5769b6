"""Damaged recordings of a study, made again from the logs of its sessions."""

import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from pydantic import ValidationError

from jointz.core.errors import DataError, TooLargeError
from jointz.core.protocols.protocol import Protocol
from jointz.core.protocols.protocol_models import ConditionSpec
from jointz.io.formats.netcdf_recording import read_recording, write_recording
from jointz.rig.experiment.files.journal import read_journal
from jointz.rig.experiment.files.session_files import JOURNAL_FILE, SESSION_FILE
from jointz.rig.experiment.files.whole_files import kept_beside, read_twice, write_whole
from jointz.rig.session.recordings_report import open_recordings
from jointz.rig.session.run_claim import RUN_FILE, STUDY_FILE
from jointz.rig.session.run_settings import SESSIONS, has_pulse_table, pulses_name, recording_name
from jointz.rig.session.session_check import missing_events
from jointz.rig.session.study_file import pulses_csv


def salvage_recordings(study: str | os.PathLike[str]) -> list[str]:
    """Make damaged recordings of a study again from the logs, less what is damaged there.

    The damaged files are kept beside.
    """
    root = _root(study)
    if not (root / STUDY_FILE).is_file():
        return []
    sentences = []
    for problem, file, session, condition, protocol in _damaged(root):
        _make_again(file, session, condition, protocol)
        sentences.append(f"{problem} It was made again from the session's logs.")
    return sentences


def salvage_advice(study: str | os.PathLike[str], message: str) -> str:
    """Return how to go on with a study that cannot be read, "" where nothing can be salvaged."""
    root = _root(study)
    if (root / RUN_FILE).is_file() and not (root / STUDY_FILE).is_file():
        return (
            "The run in it is not complete: jointz run with --resume goes on with it, with "
            "--salvage also where a file is damaged."
        )
    with suppress(TooLargeError):
        if not any(_damaged(root, message)):
            return ""
        return "The logs of the session are there: --salvage makes damaged recordings of them."
    return ""


def _root(study: str | os.PathLike[str]) -> Path:
    return Path(study) if Path(study).is_dir() else Path(study).parent


def _damaged(
    root: Path, message: str | None = None
) -> Iterator[tuple[str, Path, Path, ConditionSpec, Protocol]]:
    """Yield recordings (those a message names) that cannot be read: why, file and origin."""
    for session in sorted(path.parent for path in root.glob(f"{SESSIONS}/*/{JOURNAL_FILE}")):
        protocol = _protocol(session / SESSION_FILE)
        for condition in protocol.conditions:
            file = root / recording_name(session.name, condition.name)
            if message is not None and file.name not in message:
                continue
            problem = _problem(file)
            if problem:
                yield problem, file, session, condition, protocol


def _protocol(file: Path) -> Protocol:
    try:
        return Protocol.model_validate(read_twice(file)[0].get("protocol"))
    except ValidationError as exc:
        raise DataError(
            f"{file}: damaged, its protocol cannot be read. Restore it from a copy.",
            path=str(file),
        ) from exc


def _problem(file: Path) -> str:
    """Say why a recording cannot be read, "" where it can."""
    try:
        read_recording(file)
    except TooLargeError:  # intact, as far as can be told
        raise
    except DataError as exc:
        return str(exc)
    return ""


def _make_again(file: Path, session: Path, condition: ConditionSpec, protocol: Protocol) -> None:
    """Write a recording and its pulse table; what is there is kept beside where it differs."""
    events = read_journal(session / JOURNAL_FILE, salvage=True)
    events += missing_events(session, protocol, events)
    record = open_recordings(session, protocol, events, salvage=True).record(condition)
    if file.exists():
        kept_beside(file)
    write_recording(record.recording, file)
    if not has_pulse_table(protocol, condition):
        return
    table = file.with_name(pulses_name(session.name, condition.name))
    text = pulses_csv(record.pulses)
    if table.exists() and table.read_bytes() != text.encode():
        kept_beside(table)
    write_whole(table, text)
