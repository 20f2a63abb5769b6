"""
Where does the uncertainty come from?
=====================================

An interval of the method rigid is made of named parts: strides that differ, lag, friction,
gains. If most of it is the lag, more pulses do not help, measuring the lag does.
"""

from tempfile import mkdtemp

import matplotlib.pyplot as plt

import jointz
from jointz.analysis.page.budget_figure import source_name
from jointz.analysis.page.details_tables import details_frame, variance_shares
from jointz.session.simulate_study import simulate_study
from jointz.sim.direct_walk import WalkPlan

# %%
# One person with instruments that are not good (preset ``hard``), analysed without and with a
# measured lag:

plan = WalkPlan(per_point=20)
shares = {}
for label, lag_sd_s in {"lag unknown": None, "lag known to 0.5 ms": 0.0005}.items():
    study = simulate_study(
        mkdtemp() + "/study", preset="hard", plan=plan, lag_sd_s=lag_sd_s, seed=10
    )
    analysis = jointz.analyze(study, resamples=2)
    cell = next(c for c in analysis.cells if c.timing_point == "LRE")
    shares[label] = variance_shares(cell, "damping")
    print(label)
    print(
        details_frame(analysis)
        .query("parameter == 'damping'")[["timing_point", "value", "sd"]]
        .round(3)
    )

# %%
figure, axes = plt.subplots(figsize=(6.4, 2.8))
names = sorted(
    {n for s in shares.values() for n in s}, key=lambda n: -shares["lag unknown"].get(n, 0)
)
for row, parts in enumerate(shares.values()):
    left = 0.0
    for number, name in enumerate(names):
        part = 100 * parts.get(name, 0.0)
        shown = source_name(name) if row == 0 and part > 1 else None
        axes.barh(row, part, left=left, color=f"C{number % 10}", label=shown)
        left += part
axes.set_yticks(range(len(shares)), list(shares))
axes.set_xlabel("Share of the variance of the damping at loading response (%)")
axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.35), ncols=2, fontsize="small")

# %%
# Unmeasured, the lag is among the largest parts; measured to half a millisecond it is a small
# one, and most of what is left would become smaller with more pulses.
