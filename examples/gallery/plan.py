"""
How many pulses, and which sensors, decide K and B?
===================================================

:func:`jointz.plan` answers before anybody is measured: it takes the half-width of the 95 % interval
of every estimate from the model that will analyse the responses.
"""

from tempfile import mkdtemp

import jointz
from jointz.io.protocols import load_protocol
from jointz.planning.page import write_plan
from jointz.planning.plan_study import plan_recorded
from jointz.rig.session.simulate_study import simulate_study
from jointz.rig.sim.direct_walk import WalkPlan

plan = jointz.plan("walking_doublets", minutes=20)
print(plan.summary())

# %%
# Half of the 95 % interval, % of the value: of a typical leg, in 80 of 100 legs, and with any
# number of pulses.
columns = ["timing_point", "parameter", "pulses", "half_width_pct", "assured_pct", "endless_pct"]
plan.to_frame()[columns].round(0)

# %%
# More pulses and more sensors, median over timing points:
for measure in plan.measures:
    halves = (measure.stiffness_pct, measure.damping_pct, measure.inertia_pct)
    print(f"{measure.what:28} K {halves[0]:3.0f} %  B {halves[1]:3.0f} %  J {halves[2]:3.0f} %")

# %%
# The folder has a page, a table and the protocol file that :func:`jointz.run` takes.
page = write_plan(plan, mkdtemp() + "/plan")
print(*sorted(path.name for path in page.parent.glob("[!.]*")), sep="\n")

# %%
# Afterwards, :func:`~jointz.planning.plan_study.plan_recorded` says what a study could see. This
# one has a single participant, with eight pulses at one timing point:
pulses = load_protocol("walking_doublets").shapes
walk = WalkPlan(per_point={"MST": 8}, pulses=pulses, timing_points={"MST": 21.5})
folder = mkdtemp()
study = simulate_study(folder + "/study", preset="realistic", plan=walk)
jointz.analyze(study, resamples=2).save(folder + "/results")
seen = plan_recorded(folder + "/results")
for estimate in seen.estimates:
    reached = seen.reached[estimate.parameter].get("MST")
    told = "undecided" if reached is None else f"{reached:.0f} %"
    print(f"{estimate.parameter}: expected {estimate.half_width_pct:.0f} %, reached {told}")

# %%
axes = plan.plot()

# %%
# Dot: typical leg. Bar: from any number of pulses to what 80 of 100 legs do not exceed. Values
# above the dotted line will be undecided.
