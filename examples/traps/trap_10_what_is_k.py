"""
Trap 10: which moment does an estimate belong to?
=================================================

Over 100 ms the stiffness changes, and an estimate is one number. A fit listens to early samples
for the inertia, to later ones for damping, and for stiffness most to those about the middle. The
value belongs to the centre of that weight, not to the onset: that of the stiffness about half a
window behind it.
"""

import matplotlib.pyplot as plt
import numpy as np

from jointz.core.gait_phases import TIMING_POINTS
from jointz.rig.devices.interface import Stretch
from jointz.rig.sim.direct_walk import WALKING_PULSE, WalkPlan, walk_directly
from jointz.rig.sim.rig import simulated_rig
from jointz.rig.sim.walking.impedance_curves import impedance_over_cycle
from jointz.rig.sim.walking.knee_joint import respond

K, B, J = 60.0, 2.0, 0.06
RATE = 2000.0

# %%
# A torque of 17 N*m for 100 ms. Change K (B, J) for 5 ms only, at one moment after the other, and
# look how much the angle in the window moves: that is how much this moment counts.

torque = np.full(201, 17.0)
base, _ = respond(torque, K, B, J, rate_hz=RATE)
whole = {
    name: respond(torque, *changed, rate_hz=RATE)[0] - base
    for name, changed in {
        "stiffness": (1.01 * K, B, J),
        "damping": (K, 1.01 * B, J),
        "inertia": (K, B, 1.01 * J),
    }.items()
}
starts = np.arange(0, 200, 5)
figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 3.2))
for number, name in enumerate(whole):
    weights = []
    for start in starts:
        values = [np.full(torque.size, value) for value in (K, B, J)]
        values[number][start : start + 10] *= 1.01
        part = respond(torque, *values, rate_hz=RATE)[0] - base
        weights.append(part @ whole[name] / (whole[name] @ whole[name]))
    weights = np.array(weights)
    times = 1e3 * (starts + 5) / RATE
    left.plot(times, weights / weights.sum(), label=name)
    print(f"centre of {name}: {times @ weights / weights.sum():.0f} ms behind the onset")
left.axhline(0.0, color="0.6", linewidth=0.8)
left.set(xlabel="Time from the onset (ms)", ylabel="Weight")
left.legend()

# %%
# The curve of a simulated person, and the truth that an estimate at each timing point is compared
# with:

rig = simulated_rig(0, seed=10)
walk = walk_directly(rig, "perturbed", plan=WalkPlan(per_point=2))
truth = rig.truth(
    "perturbed",
    worn=True,
    stretches=[Stretch(0, 0.0, walk.end_s)],
    pulses=walk.pulses,
    shapes={"": WALKING_PULSE},
)
cycles = np.linspace(0.0, 1.0, 401)
right.plot(100 * cycles, impedance_over_cycle(rig.person, rig.preset, cycles)[0], color="0.5")
for name, onset in TIMING_POINTS.items():
    here = truth["timing_points"][name]
    right.plot([onset], [here["stiffness"]], "x", color="C3")
    right.plot([onset + here["stiffness_centre_pct"]], [here["stiffness"]], "o", color="C0", ms=4)
right.set(xlabel="Gait cycle (%)", ylabel="Stiffness (N*m/rad)")

# %%
# Left: a change of the inertia late in the window moves nothing. Right: the truth drawn at the
# onset (crosses) and at its centre (dots), where it belongs. ``centre_gait_pct`` stands with
# every estimate.
