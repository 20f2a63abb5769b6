"""
A controller's profile of a measured knee
=========================================

:func:`jointz.impedance_profile` turns an analysis into stiffness, damping and equilibrium angle
over the gait cycle, with intervals. A controller follows it; C, MATLAB and the Open-Source Leg read
it.
"""

from pathlib import Path
from tempfile import mkdtemp

import numpy as np

import jointz
from jointz.control.design import design_joint
from jointz.control.motor import read_motor
from jointz.control.profile_file import read_profile, write_profile
from jointz.control.rendering.actuators import read_actuator
from jointz.control.rendering.check import check_rendering
from jointz.control.writers import export_profile
from jointz.rig.session.simulate_study import simulate_study
from jointz.rig.sim.direct_walk import WalkPlan

# %%
# A simulated person, whose rig measures the internal moment of the knee, too:

folder = Path(mkdtemp())
study = simulate_study(folder / "study", plan=WalkPlan(per_point=30), lag_sd_s=0.0005, seed=3)
profile = jointz.impedance_profile(jointz.analyze(study, resamples=2), "S01")
print(profile.summary())

# %%
profile.plot()

# %%
# Along the mean stride its torque is the knee's moment; a knee that is 3 degrees (0.05 rad) more
# flexed is pushed back:

along = profile.torque(profile.gait_pct, profile.angle, profile.velocity)
flexed = profile.torque(profile.gait_pct, profile.angle + 0.05, profile.velocity)
print(np.abs(along - profile.moment).max().round(9), (flexed - along)[::20].round(1))

# %%
# The file gives every bit back; what was edited is refused.

file = write_profile(profile, folder / "S01.json")
assert read_profile(file) == profile
print(export_profile(profile, folder / "knee.h").read_text()[:300])

# %%
# Whoever was not measured can have the published knee, scaled to the body mass:

print(jointz.impedance_profile(mass_kg=80.0).summary())

# %%
# Whether an actuator can act so: delay, friction and torque decide, here of the dissertation's
# series-elastic one.

check = check_rendering(profile, read_actuator("sea"))
print(check.summary())

# %%
check.plot()

# %%
# What a prosthetic knee must be able to do for it, the best passive springs, and a motor of
# :func:`jointz.control.motor.read_motor` with its gear:

motor = folder / "motor.toml"
motor.write_text("""
resistance_ohm = 0.3
supply_v = 48.0
peak_current_a = 30.0
continuous_current_a = 10.0

[torque_model]
gear_ratio = 1
torque_constant = 0.1
rotor_inertia = 1e-4
""")
design = design_joint({"walking": profile}, motor=read_motor(motor))
print(design.summary())

# %%
design.plot()
