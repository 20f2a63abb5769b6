"""
From a study to an estimate with an interval
============================================

Two simulated people walk with a pulse of torque now and then. :func:`jointz.open_study` reads
what was recorded, :func:`jointz.analyze` estimates, and because they are simulated the truth can
be set beside it.
"""

from tempfile import mkdtemp

import matplotlib.pyplot as plt

import jointz
from jointz.demo.demo_study import truth_table
from jointz.rig.session.simulate_study import simulate_study

folder = simulate_study(mkdtemp() + "/study", participants=2, seed=1)
print((folder / "study.toml").read_text().split("\n\n")[0])

# %%
# The folder is like one of your own: recordings, and a ``study.toml`` that says what the columns
# mean.

study = jointz.open_study(folder)
analysis = jointz.analyze(study, resamples=100, seed=1)
print(analysis.summary())

# %%
# One row an estimate:

table = analysis.to_frame()
table.query("parameter == 'stiffness'")[
    ["participant", "timing_point", "value", "ci_low", "ci_high", "vaf_pct", "n_used", "status"]
].round(1)

# %%
# An analysis can be kept as a folder with tables, figures and a report, and loaded again:

analysis.save(folder.with_name("results"))
assert jointz.load(folder.with_name("results")).to_frame().equals(table)
analysis.plot()

# %%
# Beside the truth, which no analysis reads:

truth = truth_table(analysis, folder).query("parameter == 'stiffness'")
figure, axes = plt.subplots()
for shift, (person, rows) in enumerate(truth.groupby("participant")):
    at = [
        list(analysis.settings["timing_points"]).index(p) + 0.2 * shift
        for p in rows["timing_point"]
    ]
    reach = [rows["estimate"] - rows["ci_low"], rows["ci_high"] - rows["estimate"]]
    axes.errorbar(at, rows["estimate"], reach, fmt="o", color=f"C{shift}", label=person)
    axes.plot(at, rows["truth"], "k_", markersize=12, label="_" if shift else "truth")
axes.set_xticks(range(6), list(analysis.settings["timing_points"]))
axes.set_ylabel("Stiffness (N*m/rad)")
axes.legend()
print(f"intervals that hold the truth: {truth['covered'].sum()} of {len(truth)}")

# %%
# Stiffness is high where the leg takes the load and low in swing. Most intervals hold the black
# line. They are wide: each point has ten pulses only, and nobody measured the gains and the lag.
# What each adds is in :ref:`the error budget <sphx_glr_gallery_error_budget.py>`.
