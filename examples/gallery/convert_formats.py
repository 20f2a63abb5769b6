"""
Take a recording into another format
====================================

:func:`~jointz.conversion.convert.convert` (``jointz convert``) writes any file that jointz reads as
text or netCDF. A format that cannot hold everything is refused, with what it cannot hold;
``lossy=True`` leaves that out and says so.
"""

from pathlib import Path
from tempfile import mkdtemp

import matplotlib.pyplot as plt
import numpy as np

from jointz.conversion.convert import convert
from jointz.core.errors import DataError
from jointz.core.recording import build_recording
from jointz.io.formats.netcdf_recording import write_recording
from jointz.io.formats.registry import read_acquisition
from jointz.rig.sim.walking.knee_joint import knee_angle

# %%
# Ten seconds of a knee, on a clock that is not quite even, with two samples that are missing:

folder = Path(mkdtemp())
rng = np.random.default_rng(24)
time = np.arange(5000) * 0.002 + 2e-6 * rng.standard_normal(5000)
angle = knee_angle(time / 1.1) + 1e-4 * rng.standard_normal(time.size)
angle[1000:1002] = np.nan
recording = build_recording(
    time,
    {"angle": angle, "torque": 17.0 * ((time % 3.3) > 3.05)},
    participant="S01",
    joint="knee",
    positive="flexion",
)
source = folder / "S01.nc"
write_recording(recording, source)

# %%
# Into a MATLAB file, which is only read, and into two text tables. What a format has no place for
# is named before anything is written; here it is left out, after a look at what it is:

targets = {}
try:
    convert(source, folder / "S01.mat")
except DataError as problem:
    print(f"refused: {problem}\n")
for suffix in (".csv", ".tsv"):
    target = folder / f"S01{suffix}"
    try:
        made = convert(source, target)
    except DataError as problem:
        print(f"refused: {problem}\n")
        made = convert(source, target, lossy=True)
    targets[suffix] = target
    print(made.summary().replace(str(folder), "..."), "\n")

# %%
# Read again, sample by sample. A sample that was missing is missing:

figure, axes = plt.subplots(figsize=(6.4, 3.0))
for number, (suffix, target) in enumerate(targets.items()):
    (group,) = read_acquisition(target).groups
    signals = {signal.name.split(" [")[0]: signal.values for signal in group.signals}
    same = {
        name: np.array_equal(signals[name], recording[name].to_numpy(), equal_nan=True)
        for name in ("angle", "torque")
    }
    clock = np.array_equal(group.times_s(), time)
    print(f"{suffix}: equal bit for bit: clock {clock}, {same}")
    shown = slice(900, 1100)
    axes.plot(time[shown], signals["angle"][shown] + 0.1 * number, label=suffix)
axes.set(xlabel="Time (s)", ylabel="Angle (rad), one above the other")
axes.legend()

# %%
# All samples and stamps come back as they were, the gap as a gap; what differs is what stands
# beside them. Nothing is interpolated, filtered, turned or put into another unit on the way.
