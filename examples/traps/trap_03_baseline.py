"""
Trap 3: what would have happened without the pulse?
===================================================

The response to a pulse is what was measured minus what would have been. Taking the mean
unperturbed cycle of another condition for that leaves posture, drift and phase in the difference,
and they pass for an answer of the joint. The recommended method predicts each pulse's unperturbed
motion from its own past.

Here the instruments are perfect. Only the strides differ, as those of people do.
"""

from dataclasses import replace
from tempfile import mkdtemp

import matplotlib.pyplot as plt
import numpy as np

import jointz
from jointz.sim.presets import preset
from jointz.workflows.demo import truth_table
from jointz.workflows.simulated_study import simulate_study

perfect = replace(preset("clean"), name="clean but for strides", gait=preset("nominal").gait)
study = simulate_study(mkdtemp() + "/study", preset=perfect, participants=2, seed=3)

# %%
# The same pulses, three baselines:

methods = {
    "mean cycle of\nanother condition": "dissertation",
    "strides of the\nsame recording": "matched_strides",
    "predicted from\nthe pulse's past": "recommended",
}
figure, axes = plt.subplots()
for at, method in enumerate(methods.values()):
    table = truth_table(jointz.analyze(study, method=method, resamples=2), study)
    for shift, (name, rows) in enumerate(table.groupby("parameter", sort=False)):
        error = np.sqrt((rows["error_pct"] ** 2).mean())
        bar = axes.bar(at + 0.25 * (shift - 1), error, 0.23, color=f"C{shift}")
        axes.bar_label(bar, fmt="%.0f", padding=2)
        bar.set_label(name if at == 0 else "_")
axes.set_xticks(range(len(methods)), list(methods))
axes.set_ylabel("RMS error (% of the truth)")
axes.legend()

# %%
# With perfect instruments the mean cycle of another condition alone makes large errors. A baseline
# made of the pulse's own past leaves a small part of them.
