"""Process beside a session that estimates while it runs, which a package provides.

The entry point ``estimates`` of ``jointz.live`` is a function ``follow(settings, rig, number,
ended, questions)``: running an experiment knows no estimator. ``questions`` is a connection on
which it receives the questions of :mod:`jointz.rig.experiment.decisions` and sends a ``Decision``
for each.
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from multiprocessing.synchronize import Event as Ended
from typing import Final

from jointz.core.entry_points import registered
from jointz.rig.experiment.decisions import Decision
from jointz.rig.experiment.files.journal import Event
from jointz.rig.session.rigs.rig_settings import RigSettings
from jointz.rig.session.run_settings import RunSettings
from jointz.tasks.process_pool import spawn_context

BUILT_IN: Final = {"estimates": "jointz.rig.live_estimates.follow:follow"}
_PATIENCE_S: Final = 1.0


class ProcessAdvisor:
    """Hands questions to the process and takes its decisions; one that ended decides nothing."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def ask(self, question: Event) -> None:
        """Send a question."""
        with suppress(OSError):  # gone: the answer says so
            self._connection.send(question)

    def answer(self, *, wait: bool) -> Decision | None:
        """Return the decision, None while there is none."""
        try:
            if not wait and not self._connection.poll():
                return None
            decision: Decision = self._connection.recv()
        except (EOFError, OSError):
            return Decision(about={"problem": "the process that estimates has ended"})
        return decision


@contextmanager
def live_estimates(
    settings: RunSettings, rig: RigSettings, number: int
) -> Iterator[ProcessAdvisor | None]:
    """Estimate beside the session of a participant, if that is wanted."""
    if not settings.live:
        yield None
        return
    context = spawn_context()
    ended = context.Event()
    own, other = context.Pipe()
    args = (settings, rig, number, ended, other)
    process = context.Process(target=_follow, args=args, daemon=True)
    process.start()
    other.close()  # else nobody would notice that the process has ended
    try:
        yield ProcessAdvisor(own)
    finally:
        ended.set()
        own.close()
        process.join(_PATIENCE_S)
        process.terminate()  # an estimate that is under way has nobody to read it any more


def _follow(
    settings: RunSettings, rig: RigSettings, number: int, ended: Ended, questions: Connection
) -> None:
    registered("jointz.live", BUILT_IN)["estimates"].load()(settings, rig, number, ended, questions)
