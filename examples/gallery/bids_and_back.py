"""
A study as Motion-BIDS, and back
================================

BIDS is how neuroscience shares data, Motion-BIDS its part for motion.
:func:`~jointz.conversion.bids_study.write_bids` (``jointz convert study bids --to bids``) writes a
study so, and :func:`~jointz.io.bids.bids_read.read_bids` reads such folders, of others too.
"""

from pathlib import Path
from tempfile import mkdtemp

import matplotlib.pyplot as plt
import numpy as np

import jointz
from jointz.conversion.bids_study import write_bids
from jointz.io.bids.bids_read import read_bids
from jointz.io.recordings import read_recording
from jointz.rig.session.simulate_study import simulate_study
from jointz.rig.sim.direct_walk import WalkPlan

folder = Path(mkdtemp())
study = simulate_study(
    folder / "study", plan=WalkPlan(per_point=3), unperturbed_strides=20, seed=25
)
made = write_bids(study, folder / "bids")
print(made.summary().replace(str(folder), "..."))

# %%
# What stands there now. Motion-BIDS has no type for a torque, so it is ``MISC``, and the sidecar
# says so in words:

for file in sorted((folder / "bids").rglob("*")):
    if file.is_file():
        print(file.relative_to(folder))
(channels,) = (folder / "bids").rglob("sub-S01*acq-perturbed_channels.tsv")
print(channels.read_text(encoding="utf-8"))

# %%
# Back again, each recording beside what the study reads from its own file:

opened = jointz.open_study(study)
content = read_bids(folder / "bids")
figure, axes = plt.subplots(len(content), 1, figsize=(7.2, 3.2), sharex=True, sharey=True)
for panel, entry in zip(axes, opened.spec.recordings, strict=True):
    (recording,) = read_recording(opened, entry)
    name = f"sub-{entry.participant}_task-walking_tracksys-knee_acq-{entry.condition}"
    (group,) = content[name].groups
    back = {signal.name: signal.values for signal in group.signals}
    same = [n for n in recording.data_vars if np.array_equal(back[n], recording[n], equal_nan=True)]
    clock = np.array_equal(group.times_s(), recording["time"])
    pulses = [event.time_s for event in content[name].events]
    print(f"{name}: clock {clock}; equal bit for bit: {', '.join(same)}; {len(pulses)} pulses")
    panel.plot(group.times_s(), np.degrees(back["angle"]), linewidth=0.8)
    panel.plot(pulses, np.full(len(pulses), 90.0), "v", color="C3", markersize=4)
    panel.set_title(f"{entry.participant}, {entry.condition}", fontsize="small", loc="left")
axes[-1].set(xlabel="Time (s)", xlim=(10.0, 40.0))
figure.supylabel("Angle (deg)", fontsize="medium")

# %%
# Samples and clock come back bit for bit, and the pulses (red) stand in the events. Authors and a
# licence a study does not know: add them to ``dataset_description.json`` before you share.
