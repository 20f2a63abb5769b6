"""
Trap 8: whose stiffness is it, the muscles' or gravity's?
=========================================================

A shank that hangs swings back by itself. What gravity adds to the apparent stiffness is about
0.15 N*m/rad for each kg of the person, which in swing is a third to a half of everything, and
every kg of a brace adds its own. In stance body weight on a bent knee works the other way.
"""

import matplotlib.pyplot as plt
import numpy as np

from jointz.core.gait_phases import TIMING_POINTS
from jointz.core.study import DeviceSpec, ParticipantSpec
from jointz.identify.walking.gravity import gravity_stiffness, hanging_masses
from jointz.reference.chapter4 import MASS, STIFFNESS_MEANS
from jointz.rig.sim.walking.knee_joint import knee_angle

person = ParticipantSpec(id="S01", mass_kg=MASS.value, height_m=1.70)
legs = {
    "leg": hanging_masses("knee", person, None),
    "leg and 1 kg of brace": hanging_masses("knee", person, DeviceSpec(mass_kg=1.0, centre_m=0.18)),
}

# %%
# Gravity at the middle of the window behind each timing point, beside the published apparent
# stiffness:

points = list(TIMING_POINTS)
middle = np.array([TIMING_POINTS[name] + 4.5 for name in points])
bend = knee_angle(middle / 100.0)
figure, axes = plt.subplots()
apparent = np.array([STIFFNESS_MEANS[name].value * MASS.value for name in points])
axes.bar(np.arange(6) - 0.27, apparent, 0.25, color="0.75", label="apparent, table 4.1")
for shift, (label, masses) in enumerate(legs.items()):
    found = [
        gravity_stiffness(masses, joint="knee", angle_rad=angle, gait_pct=at)
        for angle, at in zip(bend, middle, strict=True)
    ]
    values, sd = np.array([f.value for f in found]), np.array([f.sd for f in found])
    axes.bar(
        np.arange(6) + 0.27 * shift, values, 0.25, yerr=1.96 * sd, color=f"C{shift}", label=label
    )
    share = 100 * values / apparent
    print(f"{label}: {dict(zip(points, share.round().astype(int).tolist(), strict=True))} % of it")
axes.set_xticks(range(6), points)
axes.set_ylabel("Stiffness (N*m/rad)")
axes.legend()

# %%
# In early stance gravity is a small part of the whole; in swing it is a large one. The report
# gives the apparent value and, where masses and posture are known, a corrected one; body weight
# in stance is in neither.
