"""
Trap 5: how are velocity and acceleration made?
===============================================

Inertia lives in the second derivative. Differences of a quantised angle are mostly noise, and
noise in a regressor shrinks its coefficient; a filter on one side only delays or damps one signal
against the other. The same zero-phase filter on both, before differentiating, is harmless.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.signal import butter, sosfiltfilt

from jointz.rig.sim.walking.knee_joint import respond

K, B, J = 50.0, 1.5, 0.05
RATE = 1000.0
low_pass = butter(2, 20.0, fs=RATE, output="sos")  # both ways: fourth order

rng = np.random.default_rng(5)
torque = 60.0 * sosfiltfilt(butter(2, 15.0, fs=RATE, output="sos"), rng.standard_normal(30_000))
angle, _ = respond(torque, K, B, J, rate_hz=RATE)
step = np.radians(0.1)
seen = step * np.round((angle + np.radians(0.02) * rng.standard_normal(angle.size)) / step)


def fitted(angle, torque):
    """Return K, B, J by least squares of torque on angle and its differences."""
    velocity = np.gradient(angle, 1 / RATE)
    motion = np.column_stack([angle, velocity, np.gradient(velocity, 1 / RATE)])
    inside = slice(200, -200)
    return np.linalg.lstsq(motion[inside], torque[inside], rcond=None)[0]


def smooth(signal):
    """Return the signal without what lies above 20 Hz, without phase."""
    return sosfiltfilt(low_pass, signal)


# %%
# The same record, four ways to treat it:

ways = {
    "raw differences": fitted(seen, torque),
    "only the angle filtered": fitted(smooth(seen), torque),
    "only the torque filtered": fitted(seen, smooth(torque)),
    "both filtered alike": fitted(smooth(seen), smooth(torque)),
}
figure, axes = plt.subplots()
for at, found in enumerate(ways.values()):
    for shift, (name, true) in enumerate({"K": K, "B": B, "J": J}.items()):
        axes.bar(
            at + 0.25 * (shift - 1),
            100 * (found[shift] / true - 1),
            0.23,
            color=f"C{shift}",
            label=name if at == 0 else None,
        )
axes.axhline(0.0, color="0.6", linewidth=0.8)
axes.set_xticks(range(len(ways)), [label.replace(" filtered", "\nfiltered") for label in ways])
axes.set_ylabel("Error (%)")
axes.legend()
for label, found in ways.items():
    print(f"{label:26s} K {found[0]:5.1f}  B {found[1]:5.2f}  J {found[2]:7.4f}")

# %%
# Raw differences leave next to nothing of the inertia. One filtered side biases stiffness and
# inertia; the same filter on both leaves the model exact, because a linear model holds for
# filtered signals too. :func:`jointz.identify_joint` does the last.
