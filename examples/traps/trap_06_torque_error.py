"""
Trap 6: how well is the torque known?
=====================================

Whatever the torque is wrong by, stiffness and inertia are wrong by: one per cent for one per
cent. A torque that is computed from the motor current needs a friction model, and friction turns
its sign with the velocity, so a wrong one is not even a constant gain.
"""

from dataclasses import replace
from tempfile import mkdtemp

import matplotlib.pyplot as plt
import numpy as np

import jointz
from jointz.core.study import Calibrated, CalibrationSpec
from jointz.rig.session.simulate_study import simulate_study
from jointz.rig.sim.presets import preset

# %%
# One study with perfect instruments, analysed as if something else were known of its torque:

study = jointz.open_study(simulate_study(mkdtemp() + "/study", preset="clean", seed=6))
NAMES = ("stiffness", "damping", "inertia")


def estimates(**known):
    """Return K, B and J (rows) at every timing point if the torque had these gains."""
    wrong = CalibrationSpec(**{n: Calibrated(value=v, sd=0.0) for n, v in known.items()})
    people = [p.model_copy(update={"calibration": wrong}) for p in study.spec.participants]
    spec = study.spec.model_copy(update={"participants": tuple(people)})
    made = jointz.analyze(replace(study, spec=spec), method="dissertation", resamples=2)
    return np.array([[cell.parameter(n).unbounded for cell in made.cells] for n in NAMES])


right = estimates()

# %%
# Its torque is too large or too small by some per cent:

gains = np.array([0.9, 1.1])
by_gain = np.array([100 * (estimates(torque_gain=gain) / right - 1) for gain in gains])

# %%
# Its friction is 30 % smaller or larger than the data sheet of the device says:

frictions = np.array([0.7, 1.3])
by_friction = np.array([100 * (estimates(friction_gain=share) / right - 1) for share in frictions])
motor = preset("clean").actuator
current = 17.0 / (motor.gear_ratio * motor.torque_constant)
friction = motor.coulomb_friction + motor.gear_friction * current
print(f"friction at 17 N*m: {friction:.1f} N*m, {100 * friction / 17.0:.0f} % of the pulse")
for name, changes in zip(NAMES, np.abs(by_friction).mean(axis=0), strict=True):
    print(f"30 % of it: {name} {changes.mean():.1f} % (up to {changes.max():.1f} %)")

# %%
figure, (left, middle) = plt.subplots(1, 2, figsize=(7.2, 3.4))
left.plot(100 * (1 / gains - 1), by_gain[:, 0], "o", color="C0", alpha=0.6)
left.axline((0, 0), slope=1, color="0.5", linestyle=":")
left.set(xlabel="Error of the torque (%)", ylabel="Change of the stiffness (%)")
for number, name in enumerate(NAMES):
    shift = 4.0 * (number - 1)
    for row, share in zip(by_friction, frictions, strict=True):
        at = np.full(row.shape[1], 100 * (share - 1) + shift)
        label = name if share > 1.0 else None
        middle.plot(at, row[number], "o", color=f"C{number}", alpha=0.6, label=label)
middle.axhline(0.0, color="0.6", linewidth=0.8)
middle.set(xlabel="Error of the friction model (%)", ylabel="Change of the estimate (%)")
middle.legend()

# %%
# Left: all six timing points lie near the dotted line, one for one; not on it, because the friction
# that is taken off does not grow with the gain. Right: friction is a tenth of the pulse and changes
# sides with the velocity; a third of it moves every parameter, the damping most, and at some timing
# points up and at others down. Its model has to be measured too (``friction_gain``).
