"""
From single people to the mean of people
========================================

One person is one observation. :func:`~jointz.stats.partial_pooling.pool_people` gives the mean
over people with an interval over people, and everyone's own value given the others.
"""

from tempfile import mkdtemp

import matplotlib.pyplot as plt

import jointz
from jointz.session.simulate_study import simulate_study
from jointz.sim.direct_walk import WalkPlan
from jointz.stats.partial_pooling import pool_people

study = simulate_study(mkdtemp() + "/study", participants=4, plan=WalkPlan(per_point=6), seed=14)
analysis = jointz.analyze(study, resamples=2)
people = pool_people(analysis.cells)
analysis.population_frame().query("parameter == 'stiffness_per_mass'").round(3)

# %%
points = list(analysis.settings["timing_points"])
figure, axes = plt.subplots()
for shift, (cells, colour, label) in enumerate(
    ((analysis.cells, "0.6", "each alone"), (people.cells, "C0", "given the others"))
):
    for cell in cells:
        found = cell.parameter("stiffness_per_mass")
        value = found.unbounded if found.value is None else found.value
        if value is not None:
            at = points.index(cell.timing_point) + 0.22 * shift - 0.22
            axes.plot(at, value, "o", color=colour, markersize=4, label=label)
            label = "_"
for row in people.population:
    if row.parameter == "stiffness_per_mass" and row.value is not None:
        at = points.index(row.timing_point) + 0.22
        reach = [[row.value - row.ci_low], [row.ci_high - row.value]]
        axes.errorbar(at, row.value, reach, fmt="D", color="C1", label="_" if at > 1 else "mean")
axes.set_xticks(range(len(points)), points)
axes.set_ylabel("Stiffness per mass (N*m/rad/kg)")
axes.legend()

# %%
# A mean that the data do not decide is missing. Where a person is known well the two values are the
# same; where not, the own value is drawn towards the others. The interval of the mean is one over
# people: four of them say little, however many pulses each had.
