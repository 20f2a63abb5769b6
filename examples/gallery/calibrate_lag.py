"""
Measure the lag of a goniometer
===============================

On a rigid hinge goniometer and encoder turn together, so whatever lies between them is the
instrument's. :func:`jointz.calibrate` finds lag and gain with a standard deviation and writes
them to a file. In the study's ``[calibration]`` every method honours them.
"""

from pathlib import Path
from tempfile import mkdtemp

import jointz

folder = Path(mkdtemp())
done = jointz.run("calibration-hinge", out=folder / "hinge", participants=2, seed=5)
found = jointz.calibrate(done.study, step="hinge", out=folder / "calibration.toml")
print(found.summary())

# %%
# What was written, ready for ``[calibration]``:

print((folder / "calibration.toml").read_text())

# %%
found.to_frame().round(5)

# %%
axes = found.plot()

# %%
# Points are measured, lines are the encoder behind the lag and gain that were found. A minute of
# swinging by hand gives the lag to a small part of a millisecond; on the body expect two or
# three.
