"""
Trap 9: is 20 degrees still small?
==================================

Stiffness is a slope at a posture. A pulse of 17 N*m turns a knee in swing by 20 degrees within
100 ms, and a joint that softens with displacement then answers with less than its slope at rest.
An estimate belongs to its displacement.
"""

import matplotlib.pyplot as plt
import numpy as np

import jointz
from jointz.rig.sim.walking.knee_joint import respond

K, B, J = 60.0, 1.8, 0.05
SOFTENING = 0.6  # rad: where the stiffness has halved
RATE = 1000.0


def pulses(size_nm, softening):
    """Return torque and angle of 20 pulses both ways on a joint that softens."""
    torque = np.zeros(30_000)
    for number in range(20):
        torque[500 + 1400 * number :][:250] = size_nm * (-1.0) ** number
    stiffness = np.full(torque.size, K)
    for _ in range(60):  # K follows the angle that it makes
        angle, _ = respond(torque, stiffness, B, J, rate_hz=RATE)
        stiffness = 0.7 * stiffness + 0.3 * K / (1.0 + (angle / softening) ** 2)
    return torque, angle


# %%
# Four sizes on a joint that softens and on one that does not:

sizes = np.array([3.0, 6.0, 12.0, 17.0])
figure, axes = plt.subplots()
for label, softening in {"linear joint": 1e6, "softens: half of K at 34 deg": SOFTENING}.items():
    shown, values = [], []
    for size in sizes:
        torque, angle = pulses(size, softening)
        fit = jointz.identify_joint(angle=angle, torque=torque, rate_hz=RATE)
        found = fit.parameter("stiffness")  # undecided where one stiffness does not hold
        values.append(found.unbounded if found.value is None else found.value)
        shown.append(np.degrees(np.abs(angle).max()))
    axes.plot(shown, values, "o-", label=label)
    print(label, "- K at the smallest and the largest pulse:", np.round([values[0], values[-1]], 1))
axes.axhline(K, color="0.6", linewidth=0.8)
axes.set(xlabel="Largest displacement (deg)", ylabel="Stiffness found (N*m/rad)", ylim=(0, None))
axes.legend()

# %%
# The linear joint has one stiffness; the other has one for each size of pulse. Two sizes in both
# directions tell them apart, which is why ``displacement_rad`` stands beside every estimate in
# ``details.csv``.
