"""
From single people to the mean of people
========================================

One person is one observation. :func:`~jointz.stats.people_together.together` looks at all people as
one model: means have an interval over people, undecided people count by what their data say, and
correlations tell whether who is stiff is also damped.
"""

from tempfile import mkdtemp

import matplotlib.pyplot as plt

import jointz
from jointz.rig.session.simulate_study import simulate_study
from jointz.rig.sim.direct_walk import WalkPlan
from jointz.stats.people_likelihoods import PeopleResults
from jointz.stats.people_together import PopulationModel, together

study = simulate_study(mkdtemp() + "/study", participants=4, plan=WalkPlan(per_point=6), seed=14)
analysis = jointz.analyze(study, resamples=2)
results = PeopleResults(analysis.log_posteriors, analysis.cells)
people: PopulationModel | None = together(
    [results], ["stiffness", "damping", "inertia"], same_people=True
)
assert people is not None
people.correlations

# %%
points = list(analysis.settings["timing_points"])
figure, axes = plt.subplots()
for cell in analysis.cells:
    found = cell.parameter("stiffness")
    value = found.unbounded if found.value is None else found.value
    if value is not None:
        at = points.index(cell.timing_point) - 0.1
        axes.plot(at, value, "o", color="0.6", markersize=4)
for at, point in enumerate(points):
    mean = people.mean(0, (point, "stiffness"))
    if mean is not None and mean.decided:
        reach = [[mean.value - mean.ci_low], [mean.ci_high - mean.value]]
        axes.errorbar(at + 0.1, mean.value, reach, fmt="D", color="C1")
axes.set_xticks(range(len(points)), points)
axes.set_ylabel("Stiffness (N*m/rad); diamonds: mean over people")

# %%
# A mean that the data do not decide is missing. The interval of the mean is one over people: four
# of them say little, however many pulses each had.
