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
from jointz.sim.presets import preset
from jointz.workflows.simulated_study import simulate_study

# %%
# A gain error: the same study, told that its torque is known to be too large by some per cent.

study = jointz.open_study(simulate_study(mkdtemp() + "/study", preset="clean", seed=6))


def stiffness(gain):
    """Return every timing point's stiffness if the torque had this gain, N*m/rad."""
    wrong = CalibrationSpec(torque_gain=Calibrated(value=gain, sd=0.0))
    spec = study.spec.model_copy(
        update={
            "participants": tuple(
                p.model_copy(update={"calibration": wrong}) for p in study.spec.participants
            )
        }
    )
    made = jointz.analyze(replace(study, spec=spec), method="dissertation", resamples=2)
    return np.array([cell.parameter("stiffness").unbounded for cell in made.cells])


gains = np.array([0.9, 0.95, 1.0, 1.05, 1.1])
found = np.array([stiffness(gain) for gain in gains])

# %%
# The friction of the simulated actuator at 17 N*m, as its data sheet would have it:

motor = preset("nominal").actuator
current = np.linspace(0.0, 25.0, 100) / (motor.gear_ratio * motor.torque_constant)
friction = motor.coulomb_friction + motor.gear_friction * current
drive = motor.gear_ratio * motor.torque_constant * current

figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 3.2))
left.plot(100 * (1 / gains - 1), 100 * (found / found[2] - 1), "o-", color="C0", alpha=0.6)
left.axline((0, 0), slope=1, color="0.5", linestyle=":")
left.set(xlabel="Error of the torque (%)", ylabel="Change of the stiffness (%)")
right.plot(drive, friction, color="C1")
at = np.interp(17.0, drive, friction)
right.plot(17.0, at, "o", color="C1")
right.annotate(f"{at:.1f} N*m\n= {100 * at / 17:.0f} % of 17 N*m", (17.0, at), (2.0, 2.3))
right.set(xlabel="Torque of the motor (N*m)", ylabel="Friction (N*m)")

# %%
# Left: all six timing points lie on the dotted line, one for one. Right: friction is a tenth of
# the pulse and changes sides with the velocity, so its model has to be measured too
# (``friction_gain``).
