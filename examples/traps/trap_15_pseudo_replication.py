"""
Trap 15: what is n?
===================

Ten people with fifty pulses each are ten observations of people, not five hundred. Pulses,
strides and bootstrap resamples of one person are alike because they are of one person; taken as
independent they make p small where there is nothing.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from scipy.stats import f_oneway

from jointz.reference.chapter4 import participant_table
from jointz.stats import mixed_model

PEOPLE, POINTS, PULSES = 10, 6, 20

# %%
# Studies without any difference between timing points: everyone has a level of their own at each,
# and pulses scatter about it.


def study(seed):
    """Return one row a pulse."""
    rng = np.random.default_rng(seed)
    person, point, _ = np.indices((PEOPLE, POINTS, PULSES)).reshape(3, -1)
    own = (
        1.0 + 0.25 * rng.standard_normal((PEOPLE, 1)) + 0.2 * rng.standard_normal((PEOPLE, POINTS))
    )
    value = own[person, point] + 0.2 * rng.standard_normal(person.size)
    return pd.DataFrame({"person": person, "point": point, "stiffness": value})


wrong, right = [], []
for seed in range(200):
    rows = study(seed)
    wrong.append(f_oneway(*(group["stiffness"] for _, group in rows.groupby("point"))).pvalue)
    means = rows.groupby(["person", "point"], as_index=False)["stiffness"].mean()
    fit = mixed_model(means, response="stiffness", within="point", participant="person")
    right.append(fit.f_test.p)

figure, axes = plt.subplots()
bins = np.linspace(0, 1, 21)
for values, label in ((wrong, "one row a pulse"), (right, "one row a person")):
    axes.hist(values, bins, density=True, histtype="step", linewidth=1.5, label=label)
axes.axhline(1.0, color="0.6", linewidth=0.8)
axes.set(xlabel="p, nothing to find", ylabel="Density", yscale="symlog")
axes.legend()
print(f"p < 0.05 with a row a pulse: {100 * np.mean(np.array(wrong) < 0.05):.0f} % of studies")
print(f"p < 0.05 with a row a person: {100 * np.mean(np.array(right) < 0.05):.0f} % of studies")

# %%
# The published table has one value a person and timing point. Its tests:

for parameter in ("stiffness_per_mass", "damping_per_mass", "inertia"):
    fit = mixed_model(
        participant_table(), response=parameter, within="timing_point", participant="participant"
    )
    test = fit.f_test
    print(f"{parameter}: F({test.df_num:.0f}, {test.df_den:.0f}) = {test.F:.3f}, p = {test.p:.2g}")

# %%
# With nothing to find p should be as often near 1 as near 0, and is, with a row a person. With a
# row a pulse nearly all of it is below 0.05. :func:`jointz.stats.mixed_model` refuses replicates
# unless ``nested=True`` says what they are.
