"""
Where does the uncertainty come from?
=====================================

An interval of the method bayesian has many sources: strides that differ, lag, friction, gains. If
most of it is the lag, more pulses do not help, measuring the lag does.
"""

from tempfile import mkdtemp

import matplotlib.pyplot as plt
import numpy as np

import jointz
from jointz.rig.session.simulate_study import simulate_study
from jointz.rig.sim.direct_walk import WalkPlan

# %%
# One person with instruments that are not good (preset ``hard``), analysed without and with a
# measured lag. For each source, ``through_instruments`` states which part of the SD would vanish
# if that source were known, or with twice as many ``pulses``:

plan = WalkPlan(per_point=20)
parts = {}
for label, lag_sd_s in {"lag unknown": None, "lag known to 0.5 ms": 0.0005}.items():
    study = simulate_study(
        mkdtemp() + "/study", preset="hard", plan=plan, lag_sd_s=lag_sd_s, seed=10
    )
    cells = jointz.analyze(study, resamples=2).cells
    cell = next(c for c in cells if c.timing_point == "PSW")
    damping = cell.parameter("damping")
    parts[label] = {
        source: 100 * sd / damping.unbounded
        for source, sd in cell.through_instruments["damping"].items()
    }
    print(f"{label}: B {damping.unbounded:.2f} N*m*s/rad, {damping.status}")

# %%
figure, axes = plt.subplots(figsize=(6.4, 2.8))
names = [name for name in parts["lag unknown"] if max(p[name] for p in parts.values()) > 0.5]
for shift, (label, sds) in enumerate(parts.items()):
    axes.bar(
        np.arange(len(names)) + 0.4 * (shift - 0.5), [sds[n] for n in names], 0.38, label=label
    )
axes.set_xticks(range(len(names)), names)
axes.set_ylabel("Part of the SD of B (%)")
axes.legend()

# %%
# With the lag unknown, lag and inertia are hard to tell apart, and the damping at pre-swing is
# undecided. With a measured lag it has a value, and lag, inertia and pulses matter alike. The parts
# overlap: they do not add up.
