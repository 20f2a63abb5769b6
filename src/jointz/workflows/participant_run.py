"""One participant of an experiment, or one load of a bench: session, recordings, report."""

import json
import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from jointz.core.clock import RealClock, VirtualClock
from jointz.core.errors import DataError, OutputError
from jointz.devices.interface import Rig
from jointz.experiment.session import Operator, Progress, Session, SessionPlan
from jointz.workflows.bench_report import write_bench
from jointz.workflows.run_settings import RunSettings
from jointz.workflows.walking_report import write_walking

REPORT_FILE = "report.json"


def run_participant(
    rig: Rig, settings: RunSettings, *, operator: Operator, progress: Progress
) -> dict[str, Any]:
    """Run what is left of a participant's session and write the recordings.

    Parameters
    ----------
    rig : Rig
        The participant and the devices.
    settings : RunSettings
        What to do and where to write.
    operator : Operator
        Asked before every condition.
    progress : callable
        Told after every accepted stride.

    Returns
    -------
    dict
        The participant's part of the report: ``onsets``, ``gaps``, ``timing``,
        ``aborted`` (pulses that the study leaves out), ``torque_model`` of the
        actuator and ``truth`` (of a simulated rig).

    Raises
    ------
    DeviceError
        When a device failed or the safety gate tripped.
    OutputError
        When the disk does not take the records.
    KeyboardInterrupt
        When the operator stopped the session.
    """
    _check_id(rig.wearer.id)
    folder = settings.session_folder(rig.wearer.id)
    report_file = folder / REPORT_FILE
    if report_file.exists():
        return dict(json.loads(report_file.read_text(encoding="utf-8")))
    session = Session(
        SessionPlan(settings.protocol, settings.seed, folder),
        rig,
        clocks=VirtualClock if settings.clock == "fast" else RealClock,
        operator=operator,
        progress=progress,
        real_time=settings.clock == "real",
    )
    try:
        with _stopped_by_ctrl_c(session):
            session.run()
        write = write_bench if settings.protocol.kind == "bench" else write_walking
        report = write(rig, settings, folder)
        partial = report_file.with_suffix(".partial")
        partial.write_text(json.dumps(report), encoding="utf-8")
        os.replace(partial, report_file)
    except OSError as exc:
        raise OutputError(
            f"{exc.filename or folder}: cannot be written ({exc.strerror or exc}). Make room, then "
            "go on with --resume."
        ) from exc
    return report


def _check_id(wearer: str) -> None:
    """Refuse an id that files cannot have, or that a study would take for a variable."""
    if not wearer or wearer.startswith(".") or any(c in wearer for c in '/\\$:*?"<>|\0'):
        raise DataError(
            f"participant {wearer!r}: expected a name that files can have, without / \\ $ : * ? "
            '" < > | and no dot in front. Have the rig give another.'
        )


@contextmanager
def _stopped_by_ctrl_c(session: Session) -> Iterator[None]:
    """Let the first Ctrl-C end the session gently and the second at once."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(number: int, frame: FrameType | None) -> None:
        del number, frame
        signal.signal(signal.SIGINT, signal.default_int_handler)
        session.request_stop()

    before = signal.signal(signal.SIGINT, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
