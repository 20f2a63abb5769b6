"""
Trap 7: is the inertia one constant?
====================================

Shank and foot turn about the knee with 0.4 kg m2; with a hip that gives way the knee feels less
of it, and in stance, when the chain is closed, something else again. A method must not assume one
inertia, and where it is large, stiffness can hardly be estimated from 100 ms.
"""

import json
from dataclasses import replace
from tempfile import mkdtemp

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import jointz
from jointz.core.gait_phases import TIMING_POINTS
from jointz.rig.session.simulate_study import simulate_study
from jointz.rig.sim.direct_walk import WalkPlan
from jointz.rig.sim.people import draw_person
from jointz.rig.sim.presets import JointSettings, preset
from jointz.rig.sim.walking.impedance_curves import impedance_over_cycle
from jointz.rig.sim.walking.knee_joint import respond

person = draw_person(1, seed=7)
varies = replace(
    preset("nominal"), name="varying inertia", joint=JointSettings(inertia_variation=0.3)
)

# %%
# The inertia that a knee feels over the cycle: the printed one, with 30 % of variation, and that
# of a leg of two links on a hip.

cycles = np.linspace(0.0, 1.0, 201)
curves = {
    "constant (nominal)": preset("nominal"),
    "varying by 30 %": varies,
    "two-link leg (anthropometric)": preset("anthropometric"),
}
inertia = {name: impedance_over_cycle(person, p, cycles)[2] for name, p in curves.items()}

# %%
# The second walks. The method ``matched_strides`` fits every timing point by itself; ``bayesian``
# pools them: every point has its own inertia, drawn towards the others as far as the data allow.

study = simulate_study(
    mkdtemp() + "/study",
    preset=varies,
    participants=[person],
    plan=WalkPlan(per_point=20),
    lag_sd_s=0.0005,
)
written = json.loads((study / "ground_truth.json").read_text(encoding="utf-8"))
truth = written["participants"][person.id]["perturbed"]["timing_points"]
METHODS = ("matched_strides", "bayesian")
table = pd.concat(
    [jointz.analyze(study, method=m, resamples=200).to_frame() for m in METHODS]
).query("parameter in ('stiffness', 'damping', 'inertia')")
true = [truth[r.timing_point][r.parameter] for r in table.itertuples()]
table = table.assign(
    error=100 * (table["value"] / true - 1),
    held=(table["ci_low"] <= true) & (table["ci_high"] >= true),
).dropna(subset="value")
for method, rows in table.groupby("method", sort=False):
    told = {
        name: f"{np.sqrt((r['error'] ** 2).mean()):.0f} % ({r['held'].sum()} of {len(r)} hold it)"
        for name, r in rows.groupby("parameter", sort=False)
    }
    print(f"{method} RMS error:", ", ".join(f"{n} {words}" for n, words in told.items()))

# %%
# How far would the knee move more in the window behind a pulse of 17 N*m if its stiffness were
# 10 % less? What cannot be seen in the angle no method finds:

sizes = np.linspace(0.02, 0.45, 30)


def seen(inertia_kg_m2, window_s):
    """Return the RMS change of the angle, degrees."""
    torque = np.full(round(1000 * window_s), 17.0)
    moved = [respond(torque, k, 1.8, inertia_kg_m2, rate_hz=1000.0)[0] for k in (60.0, 54.0)]
    return np.degrees(np.sqrt(np.mean((moved[1] - moved[0]) ** 2)))


heavy = simulate_study(
    mkdtemp() + "/heavy", participants=[replace(person, inertia=0.35)], lag_sd_s=0.0005
)
cells = jointz.analyze(heavy, resamples=2).cells
decided = sum(cell.parameter("stiffness").value is not None for cell in cells)
print(f"walking with 0.35 kg m2: stiffness decided at {decided} of {len(cells)} timing points")

# %%
figure, axes = plt.subplots(2, 2, figsize=(7.6, 6.0))
for number, (label, curve) in enumerate(inertia.items()):
    axes[0, 0].plot(100 * cycles, curve, color=f"C{number}", label=label)
axes[0, 0].set(xlabel="Gait cycle (%)", ylabel="Inertia (kg m$^2$)", ylim=(0, None))
axes[0, 0].legend(fontsize="small")
axes[0, 1].plot(100 * cycles, inertia["varying by 30 %"], color="C1")
for row in table.query("parameter == 'inertia' and method == 'bayesian'").itertuples():
    reach = [[row.value - row.ci_low], [row.ci_high - row.value]]
    axes[0, 1].errorbar(TIMING_POINTS[row.timing_point] + 2.3, row.value, reach, fmt="ko", ms=3)
axes[0, 1].set(xlabel="Gait cycle (%)", ylim=(0, None))
axes[0, 1].set_title("bayesian: estimates with intervals", fontsize="small")
points = list(TIMING_POINTS)
for number, method in enumerate(METHODS):
    rows = table.query("parameter == 'stiffness' and method == @method")
    at = [points.index(name) + 0.35 * (number - 0.5) for name in rows["timing_point"]]
    axes[1, 0].bar(at, rows["error"], 0.33, color=("C3", "k")[number], label=method)
axes[1, 0].axhline(0.0, color="0.6", linewidth=0.8)
axes[1, 0].set_xticks(range(len(points)), points)
axes[1, 0].set_ylabel("Error of the stiffness (%)")
axes[1, 0].legend(fontsize="small")
for window_s in (0.1, 0.2):
    change = [seen(size, window_s) for size in sizes]
    axes[1, 1].plot(sizes, change, label=f"in {1000 * window_s:.0f} ms")
axes[1, 1].axvspan(0.1, 0.43, color="0.93")
axes[1, 1].set(
    xlabel="Inertia (kg m$^2$); grey: a real leg", ylabel="10 % of K moves (deg)", ylim=(0, None)
)
axes[1, 1].legend(fontsize="small")

# %%
# Above: the estimates of ``bayesian`` follow the curve that varies; no single value would fit them.
# Below left: pooling takes a fifth or more off the RMS errors of the points by themselves. Below
# right: with the inertia of a real leg, what a tenth of the stiffness does within 100 ms drowns in
# what strides differ by, and the stiffness is ``undecided``.
