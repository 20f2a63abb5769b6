"""
Trap 11: may trials be stacked?
===============================

A bootstrap draws trials, and each draw is fitted. Fitting all samples of the drawn trials at
once, instead of their average, brings the noise of every single trial into the regressors: the
estimate shrinks, and the interval is narrow about the wrong value. And no bootstrap over trials
sees an error that all trials share.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.signal import butter, sosfiltfilt

from jointz.rig.sim.walking.knee_joint import respond

K, B, J = 30.0, 1.5, 0.05
RATE, TRIALS, STUDIES = 500.0, 30, 40
low_pass = butter(2, 20.0, fs=RATE, output="sos")
inside = slice(100, 150)  # 100 ms from the onset

torque = np.zeros(300)
torque[100:225] = 17.0
true_angle, _ = respond(torque, K, B, J, rate_hz=RATE)


def recorded(rng):
    """Return regressors (trial, sample, 3) and torque of trials: strides differ by a slow sway."""
    time = np.arange(torque.size) / RATE
    phase = 2 * np.pi * (1.5 * time + rng.random((TRIALS, 1)))
    sway = np.radians(4.0) * rng.standard_normal((TRIALS, 1)) * np.sin(phase)
    angle = sosfiltfilt(low_pass, true_angle + sway, axis=-1)
    velocity = np.gradient(angle, 1 / RATE, axis=-1)
    motion = np.stack([angle, velocity, np.gradient(velocity, 1 / RATE, axis=-1)], axis=-1)
    return motion[:, inside], sosfiltfilt(low_pass, torque)[inside]


def interval(motion, pull, rng, *, stacked):
    """Return a 95 % percentile interval of K over resampled trials."""
    found = []
    for _ in range(200):
        drawn = motion[rng.integers(0, TRIALS, TRIALS)]
        if stacked:
            x, y = drawn.reshape(-1, 3), np.tile(pull, TRIALS)
        else:
            x, y = drawn.mean(axis=0), pull
        found.append(np.linalg.lstsq(x, y, rcond=None)[0][0])
    return np.percentile(found, [2.5, 97.5])


# %%
# Forty studies of thirty trials each; every line is one interval of K.

figure, axes = plt.subplots(1, 2, figsize=(7.2, 3.4), sharex=True, sharey=True)
for panel, stacked in zip(axes, (True, False), strict=True):
    held = 0
    for number in range(STUDIES):
        rng = np.random.default_rng(number)
        motion, pull = recorded(rng)
        low, high = interval(motion, pull, rng, stacked=stacked)
        held += low <= K <= high
        panel.plot([low, high], [number, number], color="C0" if low <= K <= high else "C3")
    panel.axvline(K, color="0.5", linewidth=0.8)
    label = "all samples stacked" if stacked else "average of the trials"
    panel.set(title=f"{label}: {100 * held / STUDIES:.0f} % hold K", xlabel="K (N*m/rad)")
axes[0].set_ylabel("Study")

# %%
# Left, most intervals miss the truth, and all on the same side; right, they hold it about as
# often as they should. jointz fits the average of each resample.
