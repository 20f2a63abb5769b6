"""
A job of your own, on any engine
================================

How well would a record of half a minute tell this joint? Simulate it many times and fit it. Such a
job is a list of :class:`~jointz.tasks.engine.Task`, each seeded from what it is;
:func:`~jointz.tasks.engine.done_in_turn` does them in this process, in several or on a cluster
(:func:`~jointz.tasks.engine.open_engine`), with the same numbers.
"""

from functools import partial

import matplotlib.pyplot as plt
import numpy as np
from scipy.signal import butter, sosfilt

import jointz
from jointz.rig.sim.walking.knee_joint import respond
from jointz.tasks.engine import Task, done_in_turn
from jointz.tasks.open_engine import open_engine

K, B, J = 60.0, 1.5, 0.05
RATE, SECONDS = 500.0, 30

# %%
# One simulated record, and what comes out; of a noise of the goniometer, and a seed:


def fitted(noise_deg, seed):
    """Return stiffness and the limits of its interval, N*m/rad."""
    rng = np.random.default_rng([seed, round(100 * noise_deg)])
    torque = rng.standard_normal(round(SECONDS * RATE))
    torque = 10.0 * sosfilt(butter(2, 10.0, fs=RATE, output="sos"), torque)
    angle, _ = respond(torque, K, B, J, rate_hz=RATE)
    seen = angle + np.radians(noise_deg) * rng.standard_normal(angle.size)
    found = jointz.identify_joint(angle=seen, torque=torque, rate_hz=RATE).parameter("stiffness")
    return found.value, found.ci_low, found.ci_high


# %%
# The job. ``workers=2`` would start two processes, from a script under ``if __name__ ==
# "__main__":``; ``needs`` is what a worker loads once.

noises = (0.1, 0.5, 2.0)
tasks = [
    Task(f"{noise} deg, seed {seed}", partial(fitted, noise, seed))
    for noise in noises
    for seed in range(12)
]
with open_engine(workers=1, tasks=len(tasks), needs="jointz.identify.record.joint") as engine:
    found = np.array([done.result() for done in done_in_turn(engine, tasks)])
found = found.reshape(len(noises), -1, 3)

# %%
figure, axes = plt.subplots()
for at, (noise, rows) in enumerate(zip(noises, found, strict=True)):
    x = at + np.linspace(-0.3, 0.3, len(rows))
    axes.vlines(x, rows[:, 1], rows[:, 2], color="C0", linewidth=1.2)
    axes.plot(x, rows[:, 0], "o", color="C0", markersize=3)
    held = np.sum((rows[:, 1] <= K) & (rows[:, 2] >= K))
    print(f"{noise} deg: SD of K {rows[:, 0].std(ddof=1):.2f}, {held} of {len(rows)} hold it")
axes.axhline(K, color="0.6", linewidth=0.8)
axes.set_xticks(range(len(noises)), [f"{noise} deg" for noise in noises])
axes.set(xlabel="Noise of the angle, SD", ylabel="Stiffness (N*m/rad)")

# %%
# Each line is one simulated record. The intervals are as wide as the estimates scatter, so one
# fit of a real record says as much about its own precision as the whole job does.
