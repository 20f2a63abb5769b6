"""
Stiffness over the whole gait cycle from pulses
===============================================

Pulses at ten phases instead of six, and :func:`jointz.phase_curve` draws stiffness and damping
between them, with a band that is narrow where pulses fell and wide where none did.
"""

from dataclasses import replace
from tempfile import mkdtemp

import numpy as np

import jointz
from jointz.identify.over_cycle.phase_curve import timing_points_of_phases
from jointz.rig.session.simulate_study import simulate_study
from jointz.rig.sim.direct_walk import WalkPlan
from jointz.rig.sim.people import draw_person
from jointz.rig.sim.presets import JointSettings, preset
from jointz.rig.sim.walking.impedance_curves import impedance_over_cycle

# %%
# A plan may spread its pulses over the cycle; phases that were measured become timing points:

phases = np.repeat(np.arange(3.0, 98.0, 9.5), 6)
points = timing_points_of_phases(phases, width_pct=5.0, fewest=3)
print(points)

# %%
person = draw_person(0, seed=12)
smooth = replace(preset("nominal"), name="smooth", joint=JointSettings(smooth=True))
study = simulate_study(
    mkdtemp() + "/study",
    preset=smooth,
    participants=[person],
    plan=WalkPlan(per_point=8, timing_points=points),
    lag_sd_s=0.0005,
)
curve = jointz.phase_curve(jointz.analyze(study, resamples=2), person.id)
print(curve.summary())

# %%
axes = curve.plot(parameter="stiffness")
cycles = np.linspace(0.0, 1.0, 201)
axes.plot(100 * cycles, impedance_over_cycle(person, smooth, cycles)[0], "k:", label="truth")
axes.legend()

# %%
# The band holds the dotted truth over nearly all of the cycle; it is widest between the points
# and where the curve turns.
