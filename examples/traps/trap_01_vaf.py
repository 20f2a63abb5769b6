r"""
Trap 1: is a fit of 99 % right?
===============================

VAF says how much of a signal the fit follows. A wrong baseline or a late sensor bends angle and
torque into those of another joint, and the fit then follows that joint. So VAF cannot tell.

Two simulated people walk with the errors that ordinary instruments have. The same pulses are
analysed by the method bayesian and by the dissertation's.
"""

from dataclasses import replace
from tempfile import mkdtemp

import matplotlib.pyplot as plt
import numpy as np

import jointz
from jointz.demo.demo_study import truth_table
from jointz.rig.session.simulate_study import simulate_study

study = simulate_study(mkdtemp() + "/study", participants=2, seed=4)
analysis = jointz.analyze(study, resamples=50)

# %%
# Every estimate of either method, with its VAF and its true error. The method bayesian fits the
# angle and has the VAF of the angle, the dissertation's that of the torque: they are not compared
# with each other, each has a panel.

named = {"bayesian": analysis}
others = tuple(cell for cell in analysis.comparison if cell.method == "dissertation")
named["dissertation"] = replace(analysis, cells=others)
of = {"bayesian": "angle", "dissertation": "torque"}
figure, axes = plt.subplots(1, 2, figsize=(7.2, 3.4), sharey=True)
for panel, (method, made) in zip(axes, named.items(), strict=True):
    rows = truth_table(made, study)
    rows = rows[rows["parameter"] == "stiffness"].merge(
        made.to_frame().query("parameter == 'stiffness'")[
            ["participant", "timing_point", "vaf_pct"]
        ]
    )
    panel.scatter(rows["vaf_pct"], rows["error_pct"].abs(), color=f"C{list(of).index(method)}")
    panel.set(title=method, xlabel=f"VAF of the {of[method]} (%)", yscale="log")
    error = np.sqrt((rows["error_pct"] ** 2).mean())
    inside = 100 * rows["covered"].mean()
    print(
        f"{method}: VAF of the {of[method]} from {rows['vaf_pct'].min():.1f} to "
        f"{rows['vaf_pct'].max():.1f} %, RMS error of K {error:.0f} %, "
        f"intervals that hold the truth {inside:.0f} %"
    )
axes[0].set_ylabel("Error of the stiffness (%)")

# %%
# Fits above 98 % are wrong by a few per cent or by the whole value, and in neither panel does the
# VAF tell which. Look at the interval, and at what makes it wide, not at the VAF.
