"""
Test a curve without assuming normal residuals
==============================================

With ten people there are 1024 ways to flip the signs of their differences.
:func:`jointz.stats.sign_flip_max_t` looks at all of them: no smoothness, no normal distribution
is assumed.
"""

import matplotlib.pyplot as plt
import numpy as np

from jointz.stats import sign_flip_max_t, spm_paired_t

rng = np.random.default_rng(16)
phase = np.linspace(0.0, 1.0, 101)
waves = np.array([np.cos(2 * np.pi * k * phase + k) for k in range(8)])
change = 0.06 * np.exp(-(((phase - 0.3) / 0.08) ** 2))
without = rng.standard_t(3, (10, 8)) @ waves * 0.01
with_device = without + change + 0.006 * rng.standard_t(3, (10, 8)) @ waves

flips = sign_flip_max_t(with_device, without)
fields = spm_paired_t(with_device, without)
print(flips.summary())

# %%
figure, axes = plt.subplots()
axes.plot(100 * phase, flips.t, color="k")
for test, label, colour in ((flips, "sign flips", "C0"), (fields, "random field", "C1")):
    for side in (1, -1):
        axes.axhline(side * test.threshold, color=colour, label=label if side > 0 else None)
axes.set(xlabel="Gait cycle (%)", ylabel="t")
axes.legend()
print(f"threshold: {flips.threshold:.2f} by flips, {fields.threshold:.2f} by random fields")

# %%
# Both tests find the change at a third of the cycle. Their thresholds differ, because the
# residuals have heavy tails, which only one of them takes as they are.
