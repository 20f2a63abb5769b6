"""One participant of an experiment, or one load of a bench: session, recordings, report."""

import json
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

from jointz.core.clock import RealClock, VirtualClock
from jointz.core.errors import DataError
from jointz.core.stop_signals import STOP_SIGNALS, acknowledge_stop
from jointz.rig.devices.interface import Rig
from jointz.rig.experiment.decisions import Advisor
from jointz.rig.experiment.files.journal import read_journal, salvaged_texts
from jointz.rig.experiment.files.session_files import JOURNAL_FILE
from jointz.rig.experiment.files.whole_files import read_object, write_whole
from jointz.rig.experiment.session import Operator, Progress, Session, SessionPlan
from jointz.rig.session.recordings_report import write_recordings
from jointz.rig.session.run_settings import RunSettings
from jointz.rig.session.session_check import write_down_losses

REPORT_FILE = "report.json"


def run_participant(
    rig: Rig,
    settings: RunSettings,
    *,
    operator: Operator,
    progress: Progress,
    advisor: Advisor | None = None,
) -> dict[str, Any]:
    """Run what is left of a participant's session and write the recordings."""
    check_id(rig.wearer.id)
    folder = settings.session_folder(rig.wearer.id)
    report_file = folder / REPORT_FILE
    if report_file.exists():
        return _written_report(report_file)
    session = Session(
        SessionPlan(settings.protocol, settings.seed, folder),
        rig,
        clocks=VirtualClock if settings.clock == "fast" else RealClock,
        operator=operator,
        progress=progress,
        real_time=settings.clock == "real",
        attended=settings.attended,
        advisor=advisor,
    )
    with _stopped_by_signals(session):
        write_down_losses(folder, settings.protocol, salvage=settings.salvage)
        session.run()
    report = write_recordings(rig, settings, folder)
    # As of today: a device file may say something else when the last participant is measured.
    report["calibration"] = rig.calibration.model_dump(exclude_none=True)
    texts = salvaged_texts(read_journal(folder / JOURNAL_FILE))
    report["salvaged"] = [f"{rig.wearer.id}: {text}" for text in texts]
    write_whole(report_file, json.dumps(report))
    return report


def _written_report(file: Path) -> dict[str, Any]:
    remedy = "Delete it: it is made again from the logs."
    report = read_object(file, otherwise=remedy)
    missing = sorted({"onsets", "gaps", "timing", "aborted", "truth"} - set(report))
    if missing:
        raise DataError(f"{file}: damaged, without {', '.join(missing)}. {remedy}", path=str(file))
    return report


def check_id(wearer: str) -> None:
    """Refuse an id that files cannot have, or that a study would take for a variable."""
    if not wearer or wearer.startswith(".") or any(c in wearer for c in '/\\$:*?"<>|\0'):
        raise DataError(
            f"participant {wearer!r}: expected a name that files can have, without / \\ $ : * ? "
            '" < > | and no dot in front. Have the rig give another.'
        )


@contextmanager
def _stopped_by_signals(session: Session) -> Iterator[None]:
    """Let Ctrl-C, a batch system and a closed terminal end the session gently.

    A second Ctrl-C ends it at once. What is ignored stays ignored: ``nohup`` is meant.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(number: int, frame: FrameType | None) -> None:
        handler = before[signal.Signals(number)]
        if number == signal.SIGINT:
            signal.signal(number, handler)
        try:
            session.request_stop()
        except KeyboardInterrupt:  # no trial runs: as it is outside of sessions
            pass
        else:
            acknowledge_stop()
            return
        if not callable(handler):
            raise KeyboardInterrupt
        handler(number, frame)  # no longer inside of except: it asks whether one is dealt with

    before = {number: signal.getsignal(number) for number in STOP_SIGNALS}
    for number, handler in before.items():
        if handler != signal.SIG_IGN:
            signal.signal(number, stop)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
