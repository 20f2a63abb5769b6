"""
Trap 12: what does a value at its bound say?
============================================

Stiffness is often fitted with K >= 0. Where the truth is near zero, half of all fits stand
exactly at the bound: a printed zero is then no measurement, an average over people is too high,
and an interval needs one side only.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.signal import butter, sosfiltfilt

import jointz

B, J = 1.0, 0.05
RATE = 1000.0
low_pass = butter(2, 5.0, fs=RATE, output="sos")
slow = butter(2, 1.0, fs=RATE, output="sos")


def fit(seed):
    """Fit a record of a joint without stiffness, its torque disturbed by a muscle."""
    rng = np.random.default_rng(seed)
    angle = np.radians(30.0) * sosfiltfilt(low_pass, rng.standard_normal(60_000))
    velocity = np.gradient(angle, 1 / RATE)
    muscle = 3.0 * sosfiltfilt(slow, rng.standard_normal(angle.size))
    torque = B * velocity + J * np.gradient(velocity, 1 / RATE) + muscle
    return jointz.identify_joint(
        angle=angle,
        torque=torque,
        rate_hz=RATE,
        input="angle",
        estimator="bounded_least_squares",
    ).parameter("stiffness")


# %%
# Sixty records of one minute of a joint whose stiffness is zero:

found = [fit(seed) for seed in range(60)]
free = np.array([one.unbounded for one in found])
values = np.maximum(free, 0.0)  # what a fit with a bound reads
held = free < 0.0

order = np.argsort(free)
figure, axes = plt.subplots()
for at, number in enumerate(order):
    one = found[number]
    colour = "C1" if held[number] else "C0"
    if one.ci_low is not None:
        axes.plot([at, at], [one.ci_low, one.ci_high], color=colour, linewidth=1.0)
axes.plot(free[order], ".", color="0.3", markersize=4, label="fit without bound")
axes.plot(
    np.flatnonzero(held[order]), values[order][held[order]], "o", color="C1", label="at bound"
)
axes.plot(
    np.flatnonzero(~held[order]), values[order][~held[order]], "o", color="C0", label="above it"
)
axes.axhline(0.0, color="0.6", linewidth=0.8)
axes.set(xlabel="Record", ylabel="Stiffness (N*m/rad)")
axes.legend()
print(f"at the bound: {held.sum()} of {held.size}")
print(f"mean of the bounded fits {values.mean():.2f}, without bound {free.mean():.2f} N*m/rad")
intervals = [(one.ci_low, one.ci_high) for one in found if one.ci_low is not None]
inside = np.mean([low <= 0.0 <= high for low, high in intervals])
print(f"{len(intervals)} intervals, of which {100 * inside:.0f} % hold the true zero")
print("called ok:", sum(one.status == "ok" for one in found), "of", len(found))

# %%
# Fits without bound scatter about zero on both sides; those with a bound pile up on it, and their
# mean is too high. jointz calls no stiffness ``ok`` whose interval reaches zero: it is ``at_bound``
# with a one-sided interval, or ``undecided``; ``details.csv`` has the value without bound.
