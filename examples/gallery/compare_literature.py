"""
How do estimates compare with the literature?
=============================================

``jointz.reference`` holds the published numbers, each with its source, and what the dissertation
says of other people's. A number that the text gives in words only stays a range in words.
"""

import matplotlib.pyplot as plt
import numpy as np

from jointz.comparison.compare import compare_results
from jointz.core.gait_phases import TIMING_POINTS
from jointz.reference import row_mean
from jointz.reference.chapter4 import STIFFNESS, implied_quasi_stiffness
from jointz.reference.literature import COMPARISONS, stated_stiffness_range

# %%
# The published table, compared over its timing points:

published = compare_results(["published"])
published.to_frame().query("parameter == 'stiffness_per_mass'").head(6).round(3)

# %%
# What the text says of others:

for said in COMPARISONS[:4]:
    where = ", ".join(said.timing_points)
    print(f"{said.study}: {said.quantity} {said.relation} at {where}: '{said.words}'")

# %%
figure, axes = plt.subplots()
points = list(TIMING_POINTS)
for at, name in enumerate(points):
    values = [cell.value for cell in STIFFNESS[name].values()]
    axes.plot(np.full(len(values), at), values, ".", color="0.7")
    axes.plot(at, row_mean(STIFFNESS[name]), "o", color="C0")
    axes.plot(at, implied_quasi_stiffness()[name], "x", color="C3")
    stated = stated_stiffness_range("pfeifer", name)
    if stated is not None:
        axes.plot([at + 0.15] * 2, stated, color="C1", linewidth=3)
axes.set_xticks(range(len(points)), points)
axes.set_ylabel("Stiffness per mass (N*m/rad/kg)")
axes.plot([], [], "o", color="C0", label="mean of table 4.1")
axes.plot([], [], "x", color="C3", label="quasi-stiffness implied by the text")
axes.plot([], [], color="C1", linewidth=3, label="'two or three times' (Pfeifer)")
axes.legend()

# %%
# People differ more than means suggest, and what is said of other studies reaches from 'similar'
# to a factor of three. Quasi-stiffness goes below zero where no spring can.
