"""
Analyse csv files as they are
=============================

Degrees, a comma as decimal, semicolons, header lines, the torque of the device: nothing has to be
exported again. A ``study.toml`` beside the files says what the columns are.
"""

from dataclasses import replace
from pathlib import Path
from tempfile import mkdtemp

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import jointz
from jointz.core.errors import StudyError
from jointz.rig.devices.interface import Stretch
from jointz.rig.sim.direct_walk import QUICK_GRID, WALKING_PULSE, WalkPlan, walk_directly
from jointz.rig.sim.people import draw_person
from jointz.rig.sim.presets import preset
from jointz.rig.sim.rig import SimulatedRig

# %%
# Two recordings as a lab has them, with a torque cell between strap and leg: neither friction nor
# the rotor of the motor is in what it shows. It shows what the joint does to the device, so its
# sign is the other way round.

folder = Path(mkdtemp())
motor = replace(
    preset("nominal").actuator,
    coulomb_friction=0.0,
    gear_friction=0.0,
    rotor_inertia=0.0,
    friction_error_sd=0.0,
)
lab = replace(preset("nominal"), name="torque cell", actuator=motor)
rig = SimulatedRig(draw_person(0, seed=5), lab, grid=QUICK_GRID)
for name, pulses in (("normal", 0), ("pulses", 8)):
    walk = walk_directly(rig, name, plan=WalkPlan(per_point=pulses, warm_up_strides=50))
    torque = motor.gear_ratio * motor.torque_constant * walk.channels["current"]
    table = pd.DataFrame(
        {
            "Zeit": walk.time_s,
            "Knie [Grad]": np.degrees(walk.channels["angle"]),
            "Moment": -torque,
            "Soll": walk.channels["command"],
            "Ferse": walk.channels["contact"],
        }
    )
    head = f"Labor 3\nProband S01\nBedingung {name}\n"
    text = table.to_csv(sep=";", decimal=",", index=False, float_format="%.6g")
    (folder / f"S01_{name}.csv").write_text(head + text, encoding="utf-8")
print((folder / "S01_pulses.csv").read_text(encoding="utf-8")[:160])

# %%
# The study file, with a slip: the third column is called something else.

study_toml = """
jointz = 1
joint = "knee"
kind = "walking"
coupling = "rigid"                  # of these simulated people; leave it out for cuffs on skin
positive = "flexion"
torque_acts_on = "device"
files = { delimiter = ";", decimal = ",", skip_rows = 3 }
channels.time = { column = "Zeit", unit = "s" }
channels.angle = { column = "Knie [Grad]", unit = "deg" }
channels.torque = { column = "Drehmoment", unit = "N*m" }
channels.command = { column = "Soll", unit = "N*m" }
channels.contact = { column = "Ferse" }

[[participants]]
id = "S01"
mass_kg = 71.0

[[recordings]]
participant = "S01"
condition = "unperturbed"
file = "S01_normal.csv"

[[recordings]]
participant = "S01"
condition = "perturbed"
file = "S01_pulses.csv"
"""
(folder / "study.toml").write_text(study_toml, encoding="utf-8")
try:
    jointz.open_study(folder)
except StudyError as problem:
    print(problem)

# %%
# The message names file, key and what there is. Corrected:

(folder / "study.toml").write_text(study_toml.replace("Drehmoment", "Moment"), encoding="utf-8")
analysis = jointz.analyze(folder, resamples=100)
print(analysis.summary())

# %%
# The simulation knows what was in the knee while the pulses were:

true = rig.truth(
    "pulses",
    worn=True,
    stretches=[Stretch(0, 0.0, walk.end_s)],
    pulses=walk.pulses,
    shapes={"": WALKING_PULSE},
)["timing_points"]
rows = analysis.to_frame().query("parameter == 'stiffness'").reset_index(drop=True)
figure, axes = plt.subplots()
reach = [rows["value"] - rows["ci_low"], rows["ci_high"] - rows["value"]]
axes.errorbar(rows.index, rows["value"], reach, fmt="o", label="estimate")
known = np.array([true[point]["stiffness"] for point in rows["timing_point"]])
axes.plot(rows.index, known, "k_", markersize=14, label="truth")
axes.set_xticks(rows.index, rows["timing_point"])
axes.set_ylabel("Stiffness (N*m/rad)")
axes.legend()
held = (rows["ci_low"] <= known) & (known <= rows["ci_high"])
print(f"decided: {rows['value'].count()} of {len(rows)}; held by their intervals: {held.sum()}")

# %%
# One file alone is read without a study, any column under the name of its channel:

layout = {"delimiter": ";", "decimal": ",", "skip_rows": 3}
knee = jointz.read(folder / "S01_pulses.csv", files=layout, time="Zeit:s", angle="Knie [Grad]:deg")
print(knee)

# %%
# Pulses were read off the commanded torque, heel strikes off the switch, and the sign was turned:
# intervals hold the truth, and a point that eight pulses do not decide has none. A torque made of
# the motor current alone would have friction and rotor in it: :ref:`trap 6 <traps>`.
