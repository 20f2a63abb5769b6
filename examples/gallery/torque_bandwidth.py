"""
Measure the bandwidth of a torque loop
======================================

The frequency at which a torque loop has lost 3 dB, with its interval, and what the record could
resolve.
"""

from tempfile import mkdtemp

import jointz
from jointz.io.recordings import read_recording

# %%
# The series-elastic exoskeleton of chapter II, output locked, commanded with noise, simulated for
# half a minute:

done = jointz.run("sea-bandwidth", out=mkdtemp() + "/bandwidth", seed=1)
study = jointz.open_study(done.study)
(record,) = read_recording(study, study.spec.recordings[0])
fit = jointz.identify_bandwidth(
    command=record["reference"].to_numpy(),
    torque=record["torque"].to_numpy(),
    time=record["time"].to_numpy(),
)
print(fit.summary())

# %%
axes = fit.plot()

# %%
# The gain falls through 3 dB at the marked frequency, far above the resolution. A window too
# short for the loop would be refused: :ref:`trap 13 <sphx_glr_traps_trap_13_resolution.py>`.
