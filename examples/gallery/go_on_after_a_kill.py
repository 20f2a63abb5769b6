"""
Go on after a long analysis was killed
======================================

A :class:`~jointz.tasks.task_store.TaskStore` keeps every participant that is done. Analysed
again, with the same study and the same settings, only the others are estimated, and the numbers
are equal bit for bit. On more processes or machines
(:func:`~jointz.tasks.engine.open_engine`) the same holds.
"""

from pathlib import Path
from tempfile import mkdtemp
from time import perf_counter

import matplotlib.pyplot as plt

import jointz
from jointz.rig.session.simulate_study import simulate_study
from jointz.tasks.open_engine import open_engine
from jointz.tasks.task_store import TaskStore

folder = Path(mkdtemp())
study = simulate_study(folder / "study", participants=3, seed=21)
store = TaskStore(folder / "done")


class KilledError(Exception):
    """Somebody pulled the plug."""


def pull_the_plug(done, total, what):
    """Stop when two of three people are done."""
    print(f"{done} of {total}: {what}")
    if done == 2:
        raise KilledError


# %%
# The engine is this process: ``workers=2`` would start two others, from a script under ``if
# __name__ == "__main__":``. The first run ends after two people:

settings = {"method": "dissertation", "resamples": 200, "seed": 1}
seconds = {}
with open_engine(workers=1, tasks=3, needs="jointz.analysis.participant_jobs") as engine:
    start = perf_counter()
    try:
        jointz.analyze(study, engine=engine, store=store, progress=pull_the_plug, **settings)
    except KilledError:
        seconds["until it was killed"] = perf_counter() - start
    start = perf_counter()
    resumed = jointz.analyze(study, engine=engine, store=store, **settings)
    seconds["what was left"] = perf_counter() - start
    start = perf_counter()
    whole = jointz.analyze(study, engine=engine, **settings)
    seconds["all at once"] = perf_counter() - start
print("equal, bit for bit:", resumed.to_frame().equals(whole.to_frame()))

# %%
figure, axes = plt.subplots(figsize=(5.6, 2.4))
axes.barh(list(seconds), list(seconds.values()))
axes.invert_yaxis()
axes.set_xlabel("Time (s)")

# %%
# The second run takes the time of the people that were missing. ``jointz analyze`` keeps such a
# store by itself until its results are written.
