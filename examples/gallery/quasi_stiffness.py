"""
Is quasi-stiffness the stiffness?
=================================

Moment over angle in unperturbed gait needs no device. It is the stiffness only where muscles do
not change their activity, and nothing in the curve says where that is.
"""

import matplotlib.pyplot as plt
import numpy as np

from jointz.core.gait_phases import TIMING_POINTS
from jointz.reference.chapter4 import STIFFNESS_MEANS
from jointz.rig.sim.walking.knee_joint import impedance_curve, knee_angle
from jointz.stats import compare_quasi_stiffness, quasi_stiffness

# %%
# A knee with the published stiffness whose muscles shift its resting angle over the cycle:

gait_pct = np.linspace(0.0, 100.0, 201)
cycles = gait_pct / 100.0
stiffness = {name: STIFFNESS_MEANS[name].value for name in TIMING_POINTS}
angle = knee_angle(cycles)
rest = np.radians(12.0) * (1.0 - np.cos(2 * np.pi * (cycles - 0.1)))
moment = impedance_curve(stiffness, cycles) * (angle - rest)

quasi = quasi_stiffness(angle, moment, gait_pct=gait_pct)
print(quasi.summary())

# %%
comparison = compare_quasi_stiffness(quasi.values("slope"), stiffness)
print(comparison.summary())

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(7.6, 3.4))
quasi.plot(left)
comparison.plot(right)

# %%
# The joint's stiffness is known here, and the slope of moment over angle is something else at
# most points: muscles move the line. A test that does not reject shows nothing.
