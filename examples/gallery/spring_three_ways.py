"""
Check a bench in three ways
===========================

A slow pull, a dither and pulses added to a moving reference must find the same stiffness. Where
they do not, friction, a late record or the alignment of runs is at work.
"""

import matplotlib.pyplot as plt
import numpy as np

import jointz
from jointz.rig.sim.walking.knee_joint import respond

K, B, J = 146.39, 0.6, 0.02
RATE = 500.0
rng = np.random.default_rng(19)
time = np.arange(30_000) / RATE


def noisy(torque):
    """Return a torque record with the noise of a sensor."""
    return torque + 0.3 * rng.standard_normal(torque.size)


# %%
# A slow sine of torque, and the same with a dither of 5 Hz:

slow_torque = 10.0 * np.sin(2 * np.pi * 0.1 * time)
slow_angle, _ = respond(slow_torque, K, B, J, rate_hz=RATE)
static = jointz.identify_static_stiffness(
    angle=slow_angle, torque=noisy(slow_torque), rate_hz=RATE, cutoff_hz=2.2
)
dither_torque = slow_torque + 3.0 * np.sin(2 * np.pi * 5.0 * time)
dither_angle, _ = respond(dither_torque, K, B, J, rate_hz=RATE)
dither = jointz.identify_dither_stiffness(
    angle=dither_angle, torque=noisy(dither_torque), rate_hz=RATE, frequency_hz=5.0, inertia=J
)

# %%
# Two runs along one reference, the second with pulses; what the pulses add is the load's:

reference = np.radians(20.0) * np.sin(2 * np.pi * 0.7 * time)
command = np.zeros(time.size)
for number, start in enumerate(range(500, 28_000, 1500)):
    command[start : start + 125] = 7.0 * (-1.0) ** number
drive = np.gradient(np.gradient(reference, 1 / RATE), 1 / RATE) * J + K * reference
added, _ = respond(command, K, B, J, rate_hz=RATE)


def run(extra_angle, extra_torque):
    """Return one run as channels."""
    return {
        "time": time,
        "reference": reference,
        "angle": reference + extra_angle,
        "torque": noisy(drive + extra_torque),
        "command": extra_torque,
    }


nothing = np.zeros(time.size)
paired = jointz.identify_paired_runs([(run(nothing, nothing), run(added, command))], cutoff_hz=60.0)
print(static.summary(), dither.summary(), paired.summary(), sep="\n")

# %%
figure, axes = plt.subplots(figsize=(5.6, 2.4))
for at, fit in enumerate((static, dither, paired)):
    found = fit.parameter("stiffness")
    reach = [[found.value - found.ci_low], [found.ci_high - found.value]]
    axes.errorbar(found.value, at, xerr=reach, fmt="o", color="C0")
axes.set_yticks(range(3), ["slow pull", "dither", "pulses"])
axes.axvline(K, color="0.6", linewidth=0.8)
axes.set(xlabel="Stiffness (N*m/rad)", ylim=(-0.5, 2.5))

# %%
# On a bench without friction the three agree about the grey line, each with its own precision.
