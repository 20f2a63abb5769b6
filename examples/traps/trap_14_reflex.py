"""
Trap 14: is that stiffness or a reflex?
=======================================

About 40 ms after a stretch the muscle answers, and a model without reflex calls the answer
stiffness and damping. A record with random stretches in both directions tells the two apart,
because the reflex comes late and answers one direction only.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.signal import butter, lfilter, sosfilt

import jointz

K, B, J = 60.0, 1.0, 0.015
RATE = 1000.0
DELAY = 40  # samples of 1 ms


def record(gain, seed=14):
    """Return angle and torque of an ankle with a stretch reflex of this gain."""
    rng = np.random.default_rng(seed)
    angle = (
        np.radians(4.0)
        * sosfilt(butter(2, 10.0, fs=RATE, output="sos"), rng.standard_normal(60_000))
        * 5.0
    )
    velocity = np.gradient(angle, 1 / RATE)
    passive = K * angle + B * velocity + J * np.gradient(velocity, 1 / RATE)
    stretch = np.maximum(np.roll(velocity, DELAY), 0.0)
    answer = gain * lfilter(*butter(2, 4.0, fs=RATE), stretch)
    return angle, passive + answer + 0.1 * rng.standard_normal(angle.size)


# %%
# The stiffness that both models find, the stronger the reflex:

gains = np.array([0.0, 3.0, 6.0, 9.0])
found = {"kbj": [], "reflex": []}
for gain in gains:
    angle, torque = record(gain)
    for model, values in found.items():
        fit = jointz.identify_joint(
            angle=angle, torque=torque, rate_hz=RATE, input="angle", model=model
        )
        values.append(fit.parameter("stiffness").value)
        if gain == gains[-1]:
            print(fit.summary(), "\n")

figure, axes = plt.subplots()
for model, label in {"kbj": "one joint", "reflex": "joint and reflex"}.items():
    axes.plot(gains, found[model], "o-", label=label)
axes.axhline(K, color="0.6", linewidth=0.8)
axes.set(xlabel="Reflex gain (N*m*s/rad)", ylabel="Stiffness found (N*m/rad)")
axes.legend()

# %%
# Without a reflex both models agree. The stronger it is, the further the stiffness of the simple
# model is from the grey line, and the other stays on it. Pulses of one direction and one size
# cannot do this: there the answer is ``undecided``.
