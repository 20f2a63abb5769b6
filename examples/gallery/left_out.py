"""
See what was left out, and leave out more
=========================================

Nothing is dropped in silence. Gaps, missing heel strikes and lone pulses exclude what they touch,
each with a code; ``exclusions.csv`` in the study holds what you decide yourself.
"""

from tempfile import mkdtemp

import matplotlib.pyplot as plt
import numpy as np

import jointz
from jointz.io.formats.netcdf_recording import read_recording, write_recording
from jointz.rig.session.simulate_study import simulate_study

study = simulate_study(mkdtemp() + "/study", seed=17)

# %%
# The goniometer was unplugged for two seconds, twice, and one pulse was odd:

file = study / "S01_perturbed.nc"
record = read_recording(file).load()
time = record["time"].to_numpy()
angle = record["angle"].to_numpy().copy()
for start in (60.0, 140.0):
    angle[(time > start) & (time < start + 2.0)] = np.nan
write_recording(record.assign(angle=("time", angle, record["angle"].attrs)), file)

onset_s = np.loadtxt(study / "S01_perturbed_pulses.csv", delimiter=",", skiprows=1, usecols=0)[20]
(study / "exclusions.csv").write_text(
    "participant,recording,onset_s,action,reason,time\n"
    f"S01,S01_perturbed.nc,{onset_s:.3f},exclude,stumbled,2026-01-05T10:00:00Z\n"
)
analysis = jointz.analyze(study, resamples=50)
print(analysis.summary().splitlines()[0])
excluded = analysis.excluded_frame()
excluded.head(8)

# %%
figure, axes = plt.subplots(figsize=(6.4, 2.6))
pulses = analysis.pulses_frame()
for used, rows in pulses.assign(out=pulses["code"].fillna("").ne("")).groupby("out"):
    label, colour = ("left out", "C3") if used else ("used", "C0")
    axes.plot(rows["onset_s"], rows["timing_point"], "|", markersize=14, color=colour, label=label)
axes.set_xlabel("Time (s)")
axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
print(excluded["code"].value_counts().to_string())

# %%
# Red pulses are those that a gap touches and the one that was taken out by hand; every one of
# them has a row with its reason.
