"""
Trap 7: is the inertia one constant?
====================================

Shank and foot turn about the knee with 0.4 kg m2; with a hip that gives way the knee feels less
of it, and in stance, when the chain is closed, something else again. A fit that forces one
inertia on all timing points puts what varies into stiffness and damping.
"""

from dataclasses import replace
from tempfile import mkdtemp

import matplotlib.pyplot as plt
import numpy as np

import jointz
from jointz.core.gait_phases import TIMING_POINTS
from jointz.sim.curves import impedance_over_cycle
from jointz.sim.people import draw_person
from jointz.sim.presets import JointSettings, preset
from jointz.workflows.simulated_study import simulate_study

person = draw_person(0, seed=7)
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
figure, (left, right) = plt.subplots(1, 2, figsize=(7.6, 3.6))
for number, (label, chosen) in enumerate(curves.items()):
    inertia = impedance_over_cycle(person, chosen, cycles)[2]
    left.plot(100 * cycles, inertia, color=f"C{number}", label=label)
    if number < 2:
        right.plot(100 * cycles, inertia, color=f"C{number}")

# %%
# What the recommended method makes of the second: it lets every timing point have its own, drawn
# towards the others, and weighs that against a constant one.

study = simulate_study(mkdtemp() + "/study", preset=varies, participants=[person], lag_sd_s=0.0005)
analysis = jointz.analyze(study, resamples=2)
for cell in analysis.cells:
    inertia = cell.parameter("inertia")
    if inertia.value is not None:
        reach = [[inertia.value - inertia.ci_low], [inertia.ci_high - inertia.value]]
        right.errorbar(TIMING_POINTS[cell.timing_point] + 2.3, inertia.value, reach, fmt="ko", ms=3)
for panel in (left, right):
    panel.set(xlabel="Gait cycle (%)", ylabel="Inertia (kg m$^2$)", ylim=(0, None))
left.legend(fontsize="small")
right.set_title("estimates with intervals", fontsize="small")
print(f"probability that the inertia is one: {analysis.models[0].constant_inertia_probability:.2f}")

# %%
# Right, the points follow the curve that varies: no single value would fit them. ``models.csv``
# says how likely a constant inertia is, and ``details.csv`` what its being free costs in width.
