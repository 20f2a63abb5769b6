"""
Does a known spring come back?
==============================

Before a joint, a spring: on the bench stiffness and inertia are known.
:func:`~jointz.identify.bench.full_record.fit_full_record` uses every sample of whole trials and
estimates by how much the torque record is late, and takes off what the device adds of its own;
:func:`~jointz.identify.bench.pulse_likelihood.fit_pulse` takes single pulses.
"""

import matplotlib.pyplot as plt
import numpy as np

from jointz.identify.bench.bench_records import BenchTrial
from jointz.identify.bench.full_record import Impedance, fit_full_record
from jointz.identify.bench.pulse_likelihood import fit_pulse
from jointz.rig.sim.walking.knee_joint import respond

K, B, J = 168.0, 0.5, 0.0364
# The device's own, measured beforehand; of the dissertation's, section 2.2.2.
DEVICE = Impedance(0.388, 0.163, 0.001, stiffness_sd=0.194, damping_sd=0.013, inertia_sd=2.65e-5)
RATE, LATE = 900.0, 2  # Hz; samples by which the torque record is late

# %%
# A slow sine with pulses of 7 N*m, encoder noise of 0.01 mrad, torque noise of 0.1 N*m, the
# torque two samples late:

rng = np.random.default_rng(18)
time = np.arange(round(12 * RATE)) / RATE
torque = 5.0 * np.sin(2 * np.pi * 1.4 * time)
onsets = np.arange(1.0, 11.0, 1.0)
for number, onset in enumerate(onsets):
    ramps = np.interp(time - onset, [0.0, 0.075, 0.175, 0.25], [0.0, 1.0, 1.0, 0.0], 0.0, 0.0)
    torque += 7.0 * (-1.0) ** number * ramps
both = K + DEVICE.stiffness, B + DEVICE.damping, J + DEVICE.inertia
angle, _ = respond(torque, *both, rate_hz=RATE)
angle = angle + 1e-5 * rng.standard_normal(angle.size)
recorded = np.roll(torque, LATE) + 0.1 * rng.standard_normal(torque.size)

trial = BenchTrial(time[10:], angle[10:], recorded[10:])
fit = fit_full_record([trial], friction=False, intrinsic=DEVICE)
print(fit.summary())

# %%
# The same pulses one by one; what the device adds stays in these:

lag = (LATE / RATE, 1e-4)
single = [
    fit_pulse(
        time[10:], angle[10:], recorded[10:], onset_s=onset, window_s=0.25, signal="raw", lag=lag
    )
    for onset in onsets
]

# %%
figure, axes = plt.subplots(1, 3, figsize=(7.6, 2.9))
for panel, (name, true) in zip(
    axes, {"stiffness": K, "damping": B, "inertia": J}.items(), strict=True
):
    for at, one in enumerate([*single, fit]):
        found = one.parameter(name)
        if found.value is not None:
            reach = [[found.value - found.ci_low], [found.ci_high - found.value]]
            panel.errorbar(
                at, found.value, reach, fmt="o", ms=3, color="C1" if one is fit else "C0"
            )
    panel.axhline(true, color="0.6", linewidth=0.8)
    panel.axhline(true + getattr(DEVICE, name), color="C0", linewidth=0.8, linestyle=":")
    panel.set(title=f"{name} ({fit.parameter(name).unit})", xlabel="Pulse; last: whole trial")

# %%
# The whole trial (orange) holds the spring (grey) although nobody told it the lag, and knows its
# stiffness and inertia best. Single pulses scatter about spring and device together (dotted), which
# differ most in the damping.
