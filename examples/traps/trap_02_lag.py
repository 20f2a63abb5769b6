r"""
Trap 2: what does a sensor that is late do?
===========================================

An angle that arrives late by T makes a joint with K, B, J look like another one: B reads about B
+ K T and J about J + B T. Lags of 4 to 12 ms are usual for a goniometer on soft tissue, and the
fit does not show them.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.signal import butter, sosfiltfilt

import jointz
from jointz.sim.joint import respond

TRUTH = {"stiffness": 120.0, "damping": 3.0, "inertia": 0.05}
RATE = 1000.0

# %%
# A random torque, slow beside the joint's own swing, moves it. The record of the angle is late by
# 0 to 12 ms.

rng = np.random.default_rng(2)
low_pass = butter(2, 2.0, fs=RATE, output="sos")
torque = 30.0 * sosfiltfilt(low_pass, rng.standard_normal(60_000))
angle, _ = respond(torque, *TRUTH.values(), rate_hz=RATE)

lags_ms = np.arange(0, 13, 2)
fits = [
    jointz.identify_joint(
        angle=angle[: angle.size - lag],
        torque=torque[lag:],
        rate_hz=RATE,
        estimator="least_squares",
    )
    for lag in lags_ms
]

# %%
# Each estimate in per cent of the truth, and what the rule of thumb says:

lag_s = lags_ms / 1000.0
rule = {
    "damping": TRUTH["damping"] + TRUTH["stiffness"] * lag_s,
    "inertia": TRUTH["inertia"] + TRUTH["damping"] * lag_s,
}
figure, axes = plt.subplots()
for number, (name, true) in enumerate(TRUTH.items()):
    values = np.array([fit.parameter(name).value for fit in fits])
    axes.plot(lags_ms, 100 * values / true, "o-", color=f"C{number}", label=name)
    if name in rule:
        axes.plot(lags_ms, 100 * rule[name] / true, ":", color=f"C{number}")
axes.axhline(100.0, color="0.6", linewidth=0.8)
axes.set(xlabel="Lag of the angle (ms)", ylabel="Estimate (% of the truth)")
axes.legend(title="dotted: B + K T, J + B T")
print(
    f"VAF at {lags_ms[0]} ms: {fits[0].vaf_pct:.2f} %, at {lags_ms[3]} ms: {fits[3].vaf_pct:.2f} %"
)

# %%
# A few milliseconds change damping and inertia by tens of per cent, near what the dotted rule
# says, and the fit stays what it was. Faster motion moves the error from the damping into the
# inertia; it never goes away. Measure the lag with its uncertainty (:func:`jointz.calibrate`) and
# put it under ``[calibration]``.
