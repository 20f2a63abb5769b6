"""
Stiffness at every phase from a torque that never stops
=======================================================

Instead of pulses, a small random torque all the time. Strides then play the part of repetitions:
:func:`jointz.identify_time_varying` estimates impulse response, stiffness, damping and inertia at
each phase of the cycle.
"""

import numpy as np
from scipy.signal import butter, sosfilt

import jointz
from jointz.rig.sim.walking.knee_joint import knee_angle, respond

RATE, STRIDE_S, STRIDES = 500.0, 1.1, 150

# %%
# 150 strides of a knee whose stiffness goes from 30 to 150 N*m/rad and back, a random torque of 3
# N*m:

time = np.arange(round(STRIDES * STRIDE_S * RATE)) / RATE
cycles = time / STRIDE_S
true = 90.0 + 60.0 * np.cos(2 * np.pi * cycles)
rng = np.random.default_rng(13)
torque = sosfilt(butter(1, 20.0, fs=RATE, output="sos"), rng.choice([-3.0, 3.0], time.size))
deviation, _ = respond(torque, true, 1.0, 0.05, rate_hz=RATE)
angle = knee_angle(cycles) + deviation + np.radians(0.02) * rng.standard_normal(time.size)

fit = jointz.identify_time_varying(
    angle=angle,
    torque=torque,
    rate_hz=RATE,
    heel_strikes=np.arange(STRIDES) * STRIDE_S,
    n_phases=40,
    resamples=200,
)
print(fit.summary())

# %%
axes = fit.plot()
axes.plot(100 * cycles[:550], true[:550], "k:", label="truth")

# %%
# The curve follows the dotted truth; where that bends it is a little high at the minimum and a
# little low at the maximum, because a segment averages over a tenth of the cycle.
