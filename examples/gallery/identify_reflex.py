"""
Part the stretch reflex from the joint
======================================

A muscle that is stretched answers some 40 ms later. :func:`jointz.identify_joint` with
``model="reflex"`` fits that path beside the intrinsic one, with its delay, its threshold and what
each path explains.
"""

import numpy as np
from scipy.signal import butter, lfilter, sosfilt

import jointz

RATE = 1000.0
rng = np.random.default_rng(4)
low_pass = butter(2, 10.0, fs=RATE, output="sos")
angle = np.radians(20.0) * sosfilt(low_pass, rng.standard_normal(60_000))
velocity = np.gradient(angle, 1 / RATE)

# %%
# An ankle of 60 N*m/rad; it answers stretches in one direction, 40 ms late, through a slow
# muscle:

passive = 60.0 * angle + 1.0 * velocity + 0.015 * np.gradient(velocity, 1 / RATE)
stretch = np.maximum(np.roll(velocity, 40), 0.0)
answer = 6.0 * lfilter(*butter(2, 4.0, fs=RATE), stretch)
torque = passive + answer + 0.1 * rng.standard_normal(angle.size)

fit = jointz.identify_joint(angle=angle, torque=torque, rate_hz=RATE, input="angle", model="reflex")
print(fit.summary())

# %%
axes = fit.plot()

# %%
# The two paths beside the measured torque. Delay and stiffness are those that went in; one joint
# without a reflex would have read the stiffness that the summary names.
