"""
Test a curve without assuming normal residuals
==============================================

With ten people there are 1024 ways to flip the signs of their differences.
:func:`jointz.stats.sign_flip_max_t` looks at all of them: neither smoothness nor a normal
distribution is assumed, only that a person's difference is as likely one way as the other where
there is nothing to find.
"""

import matplotlib.pyplot as plt
import numpy as np

from jointz.stats import sign_flip_max_t, spm_paired_t

rng = np.random.default_rng(16)
phase = np.linspace(0.0, 1.0, 101)
waves = np.array([np.cos(2 * np.pi * k * phase + k) for k in range(8)])


def heavy_tails():
    """Return the residuals of ten people, now and then a large one."""
    return 0.01 * rng.standard_t(3, (10, 8)) @ waves


def normal():
    """Return normal residuals of the same variance."""
    return 0.01 * np.sqrt(3.0) * rng.standard_normal((10, 8)) @ waves


change = 0.06 * np.exp(-(((phase - 0.3) / 0.08) ** 2))
without = heavy_tails()
with_device = without + change + 0.6 * heavy_tails()

flips = sign_flip_max_t(with_device, without)
fields = spm_paired_t(with_device, without)
print(flips.summary())

# %%
# Two hundred studies of each kind in which nothing changes: how high are the thresholds, and how
# often is one passed all the same?

thresholds = {}
for kind in (normal, heavy_tails):
    made = {"sign flips": [], "random field": []}
    for _ in range(200):
        before = kind()
        after = before + 0.6 * kind()
        made["sign flips"].append(sign_flip_max_t(after, before))
        made["random field"].append(spm_paired_t(after, before))
    for label, tests in made.items():
        thresholds[kind.__name__, label] = [test.threshold for test in tests]
        alarms = np.mean([np.abs(test.t).max() > test.threshold for test in tests])
        print(
            f"{kind.__name__.replace('_', ' ')}, {label}: mean threshold "
            f"{np.mean(thresholds[kind.__name__, label]):.2f}, passed in {100 * alarms:.1f} %"
        )

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(8.4, 3.4), width_ratios=(3, 2))
left.plot(100 * phase, flips.t, color="k")
for test, label, colour in ((flips, "sign flips", "C0"), (fields, "random field", "C1")):
    for side in (1, -1):
        left.axhline(side * test.threshold, color=colour, label=label if side > 0 else None)
left.set(xlabel="Gait cycle (%)", ylabel="t")
left.legend()
right.boxplot(
    list(thresholds.values()),
    tick_labels=[f"{kind.split('_')[0]}\n{label.split()[1]}" for kind, label in thresholds],
    showfliers=False,
)
right.set_ylabel("Threshold")

# %%
# Left: both tests find the change at a third of the cycle. Right: that of the flips is the lower
# threshold with normal residuals, too, and is lower still with heavy tails, which random fields do
# not see. Neither passes in more than 5 % of studies in which nothing changes, the fields in fewer.
