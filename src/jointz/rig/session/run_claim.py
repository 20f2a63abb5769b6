"""Lock of a study's folder: one run at a time, and only the run that began it."""

import hashlib
import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from jointz.core.errors import DataError, OutputError, WriteError
from jointz.core.provenance import now, software
from jointz.io.calibration_file import CalibrationFile
from jointz.rig.experiment.files import file_lock
from jointz.rig.experiment.files.whole_files import (
    append_whole,
    make_folder,
    open_to_append,
    read_object,
)
from jointz.rig.session.rigs.rig_settings import RigSettings
from jointz.rig.session.run_settings import SESSIONS, RunSettings

RUN_FILE, REPORT_FILE, STUDY_FILE = "run.json", "run_report.json", "study.toml"


@contextmanager
def claimed(
    settings: RunSettings,
    rig: RigSettings,
    count: int,
    *,
    resume: bool,
    check: Callable[[], None],
) -> Iterator[None]:
    """Create the study's folder, or check that the run in it is the same; lock it meanwhile."""
    study, file = settings.study, settings.study / RUN_FILE
    _see_that_it_is_free(study, resume=resume)
    was_there = study.exists()
    make_folder(study)
    try:
        fd = open_to_append(file)
    except OSError as exc:
        raise WriteError(str(file), exc, "Name a place that can be written.") from exc
    refused = False
    try:
        try:
            file_lock.hold(fd, file)
        except WriteError:  # no locks there; where another process holds it, the file is its own
            refused = True
            raise
        try:
            _enter(file, fd, _about(settings, rig, count), check)
        except BaseException:
            refused = True
            raise
        yield
    finally:
        os.close(fd)
        if refused:  # not earlier: Windows removes no file that is open
            _leave_as_found(file, folder_too=not was_there)


def _leave_as_found(file: Path, *, folder_too: bool) -> None:
    """Remove what was made for a run that is not begun."""
    study = file.parent
    if file.stat().st_size or (study / SESSIONS).exists():
        return
    file.unlink()
    if folder_too:
        study.rmdir()


def _enter(file: Path, fd: int, about: Mapping[str, Any], check: Callable[[], None]) -> None:
    """Write what the run is, or see that it is the one that is written there."""
    begun = os.fstat(fd).st_size > 0 or (file.parent / SESSIONS).exists()
    if begun:
        _see_that_it_is(about, file)
    check()
    if not begun:
        text = json.dumps({**about, "started": now(), "software": software()})
        try:
            append_whole(fd, text.encode(), file)
        except WriteError:
            os.ftruncate(fd, 0)
            raise


def _see_that_it_is_free(study: Path, *, resume: bool) -> None:
    """Refuse what is no place for a run, and no run to go on with."""
    try:
        if not study.exists() or (study.is_dir() and not any(study.iterdir())):
            return
        is_run = (study / RUN_FILE).is_file()
    except OSError as exc:
        raise WriteError(str(study), exc, "Name a place that can be written.") from exc
    if not resume:
        raise OutputError(
            f"{study}: exists and is kept. Name another folder, or resume the run in it: --resume, "
            "resume=True."
        )
    if not is_run:
        raise OutputError(f"{study}: holds no {RUN_FILE}: no run to go on with. Name another.")
    if (study / STUDY_FILE).exists() and not (study / REPORT_FILE).exists():
        raise OutputError(
            f"{study / STUDY_FILE}: not of this run, which is not complete yet and writes its own "
            "at the end. Move it away."
        )


def _about(settings: RunSettings, rig: RigSettings, count: int) -> dict[str, Any]:
    """Return what makes a run the same run."""
    # Without defaults: a key that a later version adds does not make it another protocol.
    protocol = settings.protocol.model_dump(mode="json", exclude_defaults=True)
    return {
        "protocol": settings.protocol.name,
        "protocol_sha256": _sha256(protocol),
        "calibration_sha256": _calibration_sha256(rig.known),
        "seed": rig.seed,
        "device": rig.device,
        "preset": rig.preset,
        "sensors": None if rig.sensors is None else list(rig.sensors),
        "clock": settings.clock,
        "participants": count,
    }


def _calibration_sha256(known: CalibrationFile | None) -> str | None:
    """Return None without one: runs of earlier versions say nothing of it."""
    if known is None:
        return None
    people = {name: one.model_dump(exclude_none=True) for name, one in known.participants.items()}
    return _sha256({"common": known.common.model_dump(exclude_none=True), "participants": people})


def _sha256(values: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()


def _see_that_it_is(about: Mapping[str, Any], file: Path) -> None:
    written = read_object(file)
    changed = [name for name, value in about.items() if written.get(name) != value]
    if changed:
        differences = "; ".join(
            f"{name} {written.get(name)!r}, now {about[name]!r}" for name in changed
        )
        raise DataError(
            f"{file.parent}: another run: {differences}. Give the arguments it was started with.",
            path=str(file),
        )
