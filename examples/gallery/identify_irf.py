"""
Look at a joint's answer to an impulse
======================================

The impulse response is the same information in time: how the joint moves behind a tap. It needs
no order of the model, and shows what a second-order model leaves out.
"""

import numpy as np
from scipy.signal import butter, sosfilt

import jointz
from jointz.rig.sim.walking.knee_joint import respond

RATE = 1000.0
rng = np.random.default_rng(3)
torque = 20.0 * sosfilt(butter(2, 30.0, fs=RATE, output="sos"), rng.standard_normal(60_000))
angle, _ = respond(torque, 80.0, 1.2, 0.03, rate_hz=RATE)
seen = angle + np.radians(0.02) * rng.standard_normal(angle.size)

fit = jointz.identify_joint(angle=seen, torque=torque, rate_hz=RATE, model="irf")
print(fit.summary())

# %%
fit.curve.table().iloc[::25]

# %%
axes = fit.plot()

# %%
# A damped swing that is over after a fifth of a second, with its band; the dashed curve is that
# of the fitted K, B and J.
