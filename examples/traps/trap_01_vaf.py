r"""
Trap 1: is a fit of 99 % right?
===============================

VAF says how much of the torque the fit follows. A wrong baseline or a late sensor bends angle and
torque into those of another joint, and the fit then follows that joint. So VAF cannot tell.

Two simulated people walk with the errors that ordinary instruments have. The same pulses are
analysed by the recommended method and by the dissertation's.
"""

from dataclasses import replace
from tempfile import mkdtemp

import matplotlib.pyplot as plt
import numpy as np

import jointz
from jointz.workflows.demo import truth_table
from jointz.workflows.simulated_study import simulate_study

study = simulate_study(mkdtemp() + "/study", participants=2, seed=4)
analysis = jointz.analyze(study, resamples=50)

# %%
# Every estimate of either method, with its VAF and its true error:

named = {"recommended": analysis}
others = tuple(cell for cell in analysis.comparison if cell.method == "dissertation")
named["dissertation"] = replace(analysis, cells=others)
figure, axes = plt.subplots()
for method, made in named.items():
    rows = truth_table(made, study)
    rows = rows[rows["parameter"] == "stiffness"].merge(
        made.to_frame().query("parameter == 'stiffness'")[
            ["participant", "timing_point", "vaf_pct"]
        ]
    )
    axes.scatter(rows["vaf_pct"], rows["error_pct"].abs(), label=method)
    error = np.sqrt((rows["error_pct"] ** 2).mean())
    inside = 100 * rows["covered"].mean()
    print(
        f"{method}: mean VAF {rows['vaf_pct'].mean():.1f} %, RMS error of K {error:.0f} %, "
        f"intervals that hold the truth {inside:.0f} %"
    )
axes.set(xlabel="VAF (%)", ylabel="Error of the stiffness (%)", yscale="log")
axes.legend()

# %%
# Nearly all fits lie far to the right, near 100 %, and their errors still range from a few per
# cent to more than the value itself. Look at the interval, and at what makes it wide, not at the
# VAF.
