"""Process beside a session that estimates while it runs, which a package provides.

The entry point ``estimates`` of ``jointz.live`` is a function ``follow(settings, rig, number,
ended)``: running an experiment knows no estimator.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.synchronize import Event as Ended
from typing import Final

from jointz.core.entry_points import registered
from jointz.rig.session.rigs.rig_settings import RigSettings
from jointz.rig.session.run_settings import RunSettings
from jointz.tasks.process_pool import spawn_context

BUILT_IN: Final = {"estimates": "jointz.rig.live_estimates.follow:follow"}
_PATIENCE_S: Final = 1.0


@contextmanager
def live_estimates(settings: RunSettings, rig: RigSettings, number: int) -> Iterator[None]:
    """Estimate beside the session of a participant, if that is wanted."""
    if not settings.live:
        yield
        return
    context = spawn_context()
    ended = context.Event()
    process = context.Process(target=_follow, args=(settings, rig, number, ended), daemon=True)
    process.start()
    try:
        yield
    finally:
        ended.set()
        process.join(_PATIENCE_S)
        process.terminate()  # an estimate that is under way has nobody to read it any more


def _follow(settings: RunSettings, rig: RigSettings, number: int, ended: Ended) -> None:
    registered("jointz.live", BUILT_IN)["estimates"].load()(settings, rig, number, ended)
