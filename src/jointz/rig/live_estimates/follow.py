"""Process that estimates a participant again and again while the session runs."""

import json
import multiprocessing
import os
import signal
from contextlib import suppress
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.synchronize import Event as Ended
from pathlib import Path
from typing import Any, Final

from jointz.core.errors import JointzError, WriteError
from jointz.core.whole_file import whole_file
from jointz.identify.walking.posterior import LastFit
from jointz.rig.devices.interface import Rig
from jointz.rig.experiment.decisions import Decision
from jointz.rig.experiment.files.journal import Event
from jointz.rig.experiment.files.session_files import JOURNAL_FILE
from jointz.rig.live_estimates.decide import decide
from jointz.rig.live_estimates.live_estimate import LiveEstimate, estimate_so_far
from jointz.rig.session.live.live_tail import JournalTail
from jointz.rig.session.rigs.rig_settings import RigSettings, open_rig
from jointz.rig.session.run_settings import LIVE_FILE, RunSettings
from jointz.tasks.engine import on_one_thread

_PERIOD_S: Final = 1.0
#: Of the estimates for the page; those of decisions are full fits, which a replay can repeat.
_FULL_EVERY: Final = 10


def follow(
    settings: RunSettings, rig: RigSettings, number: int, ended: Ended, questions: Connection
) -> None:
    """Estimate after new pulses and for questions until the session has ended."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a Ctrl-C of the terminal is the session's
    if settings.clock == "real":
        _give_way()
    opened, parent = open_rig(rig, number), multiprocessing.parent_process()
    folder = settings.session_folder(opened.wearer.id)
    journal = JournalTail(folder / JOURNAL_FILE)
    live = settings.protocol.live
    last_fit = LastFit(full_every=_FULL_EVERY)
    # Under a virtual clock a session waits for its decisions, and nobody looks on in between.
    looked_on = settings.clock == "real" or live is None or not live.decides
    with suppress(EOFError, ConnectionError):  # the session has ended
        while not ended.is_set() and (parent is None or parent.is_alive()):
            question = questions.recv() if questions.poll(_PERIOD_S) else None
            if question is not None:
                questions.send(_answered(settings, opened, question, folder, ended))
            elif looked_on and _has_new_pulse(journal):
                _show(*_estimate(settings, opened, last_fit=last_fit), folder, ended)


def _give_way() -> None:
    """Run only while nobody else wants a core, and not on one that was given to the session."""
    with suppress(AttributeError, OSError):  # Linux only
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
        if others := set(range(os.cpu_count() or 1)) - os.sched_getaffinity(0):
            os.sched_setaffinity(0, others)


def _has_new_pulse(journal: JournalTail) -> bool:
    """Return whether a pulse was completed since the last look."""
    try:
        return any(event["event"] == "pulse_completed" for event in journal.poll())
    except JointzError:  # the page shows what is wrong with the session's files
        return False


def _answered(
    settings: RunSettings, rig: Rig, question: Event, folder: Path, ended: Ended
) -> Decision:
    """Return a decision; without an estimate the pulses come as planned."""
    estimate, problem = _estimate(settings, rig, question=question)
    _show(estimate, problem, folder, ended)
    live = settings.protocol.live
    if estimate is None or live is None:
        return Decision(about={"problem": problem})
    return decide(estimate, live, settings.protocol.wishes or {})


def _estimate(settings: RunSettings, rig: Rig, **how: Any) -> tuple[LiveEstimate | None, str]:
    """Return an estimate, or why there is none: the session goes on without."""
    try:
        return on_one_thread(partial(estimate_so_far, settings, rig, **how)), ""
    except JointzError as exc:
        return None, str(exc)
    except Exception as exc:  # noqa: BLE001 - shown to the operator; the session goes on without
        return None, f"the estimate failed ({type(exc).__name__}: {exc})"


def _show(estimate: LiveEstimate | None, problem: str, folder: Path, ended: Ended) -> None:
    """Write the newest estimate for the operator's page."""
    content: dict[str, Any] = {"problem": problem, **(estimate.to_dict() if estimate else {})}
    if not ended.is_set():  # the session's folder may be gone, or its study complete
        with suppress(WriteError), whole_file(folder / LIVE_FILE) as file:  # not forced to the disk
            file.write_text(json.dumps(content), encoding="utf-8")
