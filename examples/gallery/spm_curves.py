"""
Do two conditions differ anywhere along the cycle?
==================================================

Two mean curves a person. :func:`jointz.stats.spm_paired_t` tests the whole curve at once by
random field theory, :func:`jointz.stats.spm_unpaired_t` does so for two groups of people.
"""

import matplotlib.pyplot as plt
import numpy as np

from jointz.rig.sim.walking.knee_joint import knee_angle
from jointz.stats import spm_paired_t, spm_unpaired_t

# %%
# Ten people with and without a device that adds three degrees of flexion in swing:

rng = np.random.default_rng(15)
phase = np.linspace(0.0, 1.0, 101)


def people(n):
    """Return mean knee curves of people, rad."""
    waves = np.array([np.sin(2 * np.pi * (k * phase + rng.random())) for k in range(5)])
    return knee_angle(phase) + np.radians(2.5) * rng.standard_normal((n, 5)) @ waves


without = people(10)
change = np.radians(3.0) * np.exp(-(((phase - 0.7) / 0.06) ** 2))
waves = np.array([np.cos(2 * np.pi * k * phase) for k in range(4)])
with_device = without + change + np.radians(0.8) * rng.standard_normal((10, 4)) @ waves

test = spm_paired_t(with_device, without, equivalence_margin=np.radians(2.0))
print(test.summary())
others = spm_unpaired_t(with_device, people(10))
print(others.summary())

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(7.6, 3.2), sharey=True)
test.plot(left)
left.set_title("same people")
others.plot(right)
right.set_title("other people")

# %%
# In the same people the change in swing stands out of its band; between two groups the
# differences of people hide it. Outside the shading "no difference" is not shown either, unless
# the band stays inside the margin.
