"""
Fit stiffness, damping and inertia to one record
================================================

One continuous record of torque and angle, no pulses, no strides: :func:`jointz.identify_joint`
fits torque = K angle + B velocity + J acceleration and says how well each is known.
"""

import numpy as np
from scipy.signal import butter, sosfilt

import jointz
from jointz.rig.sim.walking.knee_joint import respond

RATE = 1000.0

# %%
# A joint of 60 N*m/rad, 1.5 N*m*s/rad and 0.05 kg*m^2 under a minute of random torque, with noise
# on both sensors:

rng = np.random.default_rng(1)
torque = 20.0 * sosfilt(butter(2, 20.0, fs=RATE, output="sos"), rng.standard_normal(60_000))
angle, _ = respond(torque, 60.0, 1.5, 0.05, rate_hz=RATE)
fit = jointz.identify_joint(
    angle=angle + np.radians(0.05) * rng.standard_normal(angle.size),
    torque=torque + 0.1 * rng.standard_normal(torque.size),
    rate_hz=RATE,
)
print(fit.summary())

# %%
# The result is a frozen object: a table, a dictionary to save, a figure.

fit.to_frame()

# %%
axes = fit.plot()

# %%
# Measured and simulated angle lie on each other, and all three intervals hold the truth. That the
# fit is good is no proof: see :ref:`the traps <traps>`.
