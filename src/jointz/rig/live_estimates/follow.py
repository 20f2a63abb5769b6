"""Process that estimates a participant again and again while the session runs."""

import json
import multiprocessing
import os
import signal
from contextlib import suppress
from functools import partial
from multiprocessing.synchronize import Event as Ended
from typing import Any, Final

from jointz.core.errors import JointzError
from jointz.core.whole_file import whole_file
from jointz.rig.devices.interface import Rig
from jointz.rig.experiment.files.session_files import JOURNAL_FILE
from jointz.rig.live_estimates.live_estimate import estimate_so_far
from jointz.rig.session.live.live_tail import JournalTail
from jointz.rig.session.rigs.rig_settings import RigSettings, open_rig
from jointz.rig.session.run_settings import LIVE_FILE, RunSettings
from jointz.tasks.engine import on_one_thread

_PERIOD_S: Final = 1.0


def follow(settings: RunSettings, rig: RigSettings, number: int, ended: Ended) -> None:
    """Estimate after new pulses until the session has ended, and write the newest estimate."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a Ctrl-C of the terminal is the session's
    _give_way()
    opened, parent = open_rig(rig, number), multiprocessing.parent_process()
    folder = settings.session_folder(opened.wearer.id)
    journal = JournalTail(folder / JOURNAL_FILE)
    while not ended.wait(_PERIOD_S) and (parent is None or parent.is_alive()):
        if _has_new_pulse(journal):
            content = _content(settings, opened)
            if not ended.is_set():  # the session's folder may be gone, or its study complete
                with whole_file(folder / LIVE_FILE) as partial:  # not forced to the disk
                    partial.write_text(json.dumps(content), encoding="utf-8")


def _give_way() -> None:
    """Run only while nobody else wants a core: the control loop goes first."""
    with suppress(AttributeError, OSError):  # Linux only
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))


def _has_new_pulse(journal: JournalTail) -> bool:
    """Return whether a pulse was completed since the last look."""
    try:
        return any(event["event"] == "pulse_completed" for event in journal.poll())
    except JointzError:  # the page shows what is wrong with the session's files
        return False


def _content(settings: RunSettings, rig: Rig) -> dict[str, Any]:
    """Return an estimate, or why there is none: the session goes on without."""
    try:
        estimate = on_one_thread(partial(estimate_so_far, settings, rig))
        return {"problem": "", **estimate.to_dict()}
    except JointzError as exc:
        return {"problem": str(exc)}
    except Exception as exc:  # noqa: BLE001 - shown to the operator; nothing else depends on it
        return {"problem": f"the estimate failed ({type(exc).__name__}: {exc})"}
