"""
Look at a joint frequency by frequency
======================================

The frequency response asks for no model: torque over angle at each frequency, with a band and the
coherence. K, B and J come out of it only where the joint is of second order.
"""

import numpy as np
from scipy.signal import butter, sosfilt

import jointz
from jointz.rig.sim.walking.knee_joint import respond

RATE = 1000.0
rng = np.random.default_rng(2)
torque = 20.0 * sosfilt(butter(2, 30.0, fs=RATE, output="sos"), rng.standard_normal(60_000))
angle, _ = respond(torque, 80.0, 1.2, 0.03, rate_hz=RATE)
seen = angle + np.radians(0.05) * rng.standard_normal(angle.size)

fit = jointz.identify_joint(angle=seen, torque=torque, rate_hz=RATE, model="frf")
print(fit.summary())

# %%
# The curve as a table, for a figure of your own:

fit.response.table().iloc[::40].round(3)

# %%
axes = fit.plot()

# %%
# Gain is flat at the stiffness, dips at the resonance and rises with the inertia; the line of
# second order runs through the points inside the band in which the coherence lets them be
# trusted.
