"""
Trap 3: what would have happened without the pulse?
===================================================

The response to a pulse is what was measured minus what would have been. Taking the mean
unperturbed cycle of another condition for that leaves posture, drift and phase in the difference,
and they pass for an answer of the joint. The method rigid predicts each pulse's unperturbed
motion from its own past.

Strides differ here as those of people do. The instruments are perfect, or all but the goniometer,
which is 4 to 12 ms late.
"""

import json
from dataclasses import replace
from tempfile import mkdtemp

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import jointz
from jointz.session.simulate_study import simulate_study
from jointz.sim.presets import preset

usual = preset("nominal")
perfect = replace(preset("clean"), name="clean but for strides", gait=usual.gait)
slow = replace(
    perfect.goniometer,
    delay_s=usual.goniometer.delay_s,
    lag_range_s=usual.goniometer.lag_range_s,
)
rigs = {"no lag": perfect, "a lag": replace(perfect, name="late", goniometer=slow)}

# %%
# Two people under every baseline, everything else the same: the method rigid, and the
# dissertation's, which filters, fits by least squares and knows of no lag.


def errors(chosen):
    """Return one row an estimate of two people, with its error in per cent."""
    study = simulate_study(mkdtemp() + "/study", preset=chosen, participants=2, seed=3)
    written = json.loads((study / "ground_truth.json").read_text(encoding="utf-8"))
    found = []
    for person, truth in written["participants"].items():
        rows = jointz.specification_curve(
            study, participant=person, windows_s=(0.1,), cutoffs_hz=(20.0,), resamples=50
        ).to_frame()
        points = truth["perturbed"]["timing_points"]
        true = [points[r.timing_point][r.parameter] for r in rows.itertuples()]
        found.append(rows.assign(error=100 * (rows["value"] / true - 1)))
    return pd.concat(found)


tables = {name: errors(rig) for name, rig in rigs.items()}

# %%
names = {
    "unperturbed_mean": "mean cycle of\nanother condition",
    "matched_strides": "strides of the\nsame recording",
    "predicted": "predicted from\nthe pulse's past",
}
panels = {
    "method rigid, no lag": [
        (label, tables["no lag"].query("inertia_model == 'pooled' and baseline == @key"))
        for key, label in names.items()
    ],
    "dissertation's estimator": [
        (
            f"{short},\n{lag}",
            table.query("method == 'dissertation' and baseline == @key"),
        )
        for lag, table in tables.items()
        for key, short in (("unperturbed_mean", "mean cycle"), ("matched_strides", "same record"))
    ],
}
figure, axes = plt.subplots(1, 2, figsize=(9.6, 3.8))
for panel, (title, bars) in zip(axes, panels.items(), strict=True):
    for at, (label, table) in enumerate(bars):
        told = []
        for shift, (name, rows) in enumerate(table.groupby("parameter", sort=False)):
            size = np.sqrt((rows["error"] ** 2).mean())
            bar = panel.bar(at + 0.25 * (shift - 1), size, 0.23, color=f"C{shift}")
            panel.bar_label(bar, fmt="%.0f", padding=2, fontsize="small")
            bar.set_label(name if at == 0 else "_")
            told.append(f"{name} {size:.0f} % ({rows['error'].isna().sum()} undecided)")
        print(f"{title}, {' '.join(label.split())}: {', '.join(told)}")
    panel.set_xticks(range(len(bars)), [label for label, _ in bars], fontsize="small")
    panel.set_title(title, fontsize="small")
axes[0].set_ylabel("RMS error (% of the truth)")
axes[0].legend()

# %%
# Left: with the mean cycle of another condition even the method rigid is wrong where it
# decides, and does not decide all; baselines made of the same recording leave little. Right: for
# an estimator that knows of no lag the better baseline removes most of the error as long as there
# is none. Where the goniometer is late, stiffness and inertia stay about as wrong as they were.
# Both have to be seen to: :ref:`trap 2 <traps>`.
