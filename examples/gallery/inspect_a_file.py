"""
What is in this file?
=====================

Somebody sends a table without a word about it. :func:`~jointz.inspection.inspect_file.inspect_file`
says what each column seems to be, in which unit, on which clock, what stands in the way, and
proposes a ``study.toml`` with every guess marked. On the command line it is ``jointz inspect``.
"""

from pathlib import Path
from tempfile import mkdtemp

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from jointz.inspection.inspect_file import inspect_file
from jointz.rig.sim.direct_walk import QUICK_GRID, WalkPlan, walk_directly
from jointz.rig.sim.people import draw_person
from jointz.rig.sim.presets import preset
from jointz.rig.sim.rig import SimulatedRig

# %%
# The file, of a logger that lost a second of its record:

folder = Path(mkdtemp())
rig = SimulatedRig(draw_person(0, seed=23), preset("nominal"), grid=QUICK_GRID)
walk = walk_directly(rig, "pulses", plan=WalkPlan(per_point=2, warm_up_strides=10))
columns = {
    "t": np.rint(1000.0 * walk.time_s),
    "knee angle [deg]": np.degrees(walk.channels["angle"]),
    "motor current [A]": walk.channels["current"],
    "T_cmd": walk.channels["command"],
    "heel": walk.channels["contact"],
    "trigger": np.arange(walk.time_s.size) % 2,
}
table = pd.DataFrame(columns)
table = table[(table["t"] < 12_000.0) | (table["t"] >= 13_000.0)]
file = folder / "S01_pulses.csv"
table.to_csv(file, index=False, float_format="%.6g")
print(file.read_text(encoding="utf-8")[:150])

# %%
# What it is taken for, and how sure that is:

found = inspect_file(file)
found.to_frame()

# %%
print(found.summary())

# %%
# The proposal. Nothing in it is done in silence: what has to be known by people, signs above all,
# is marked.

print(found.toml)

# %%
seen = [channel for channel in found.channels if channel.channel not in ("", "time")]
figure, axes = plt.subplots(len(seen), 1, figsize=(6.4, 1.2 * len(seen)), sharex=True)
shown = (
    table[table["t"].between(9_000.0, 15_000.0)]
    .set_index("t")
    .reindex(np.arange(9_000.0, 15_000.0, 2.0))
)
for panel, channel in zip(axes, seen, strict=True):
    panel.plot(shown.index / 1000.0, shown[channel.column], linewidth=0.8)
    panel.set_title(f"{channel.column}: {channel.channel}", fontsize="small", loc="left")
axes[-1].set_xlabel("Time (s)")

# %%
# What the columns are taken for. The second that was lost is named with its place, a column that
# means nothing is left out, and what the numbers cannot say stays marked for those who know.
