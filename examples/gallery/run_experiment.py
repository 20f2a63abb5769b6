"""
Run an experiment in simulation
===============================

:func:`jointz.run` is the experiment itself: the loop, the estimate of the gait phase, the plan,
the safety gate and the logs, here with a simulated person. The same call drives a device. How
near to its timing point does a pulse fire?
"""

from tempfile import mkdtemp

import matplotlib.pyplot as plt

import jointz
from jointz.core.protocols.protocol import Protocol
from jointz.io.log_reader import read_log
from jointz.io.protocols import load_protocol

# %%
# A protocol is a file. Here the built-in one with five pulses a timing point instead of fifty:

content = load_protocol("walking").model_dump()
content["conditions"] = [c for c in content["conditions"] if c["name"] != "no_device"]
content["conditions"][-1]["perturbations"]["count_per_point"] = 5
protocol = Protocol.model_validate(content)

done = jointz.run(protocol, out=mkdtemp() + "/study", participants=1, seed=2)
print(sorted(path.name for path in done.study.iterdir()))

# %%
# Every tick of the loop is in the logs, which survive a crash: nothing of them is torn here.

for file in sorted(done.study.glob("sessions/*/logs/*.jzlog")):
    log = read_log(file)
    print(log.header["condition"], len(log.records), "ticks;", log.torn_bytes, "bytes torn off")

# %%
# Where the pulses fired, in % of the gait cycle, and how far the strides alone scatter them:

columns = ["timing_point", "planned_pct", "completed", "error_mean_pct", "error_sd_pct"]
done.to_frame()[[*columns, "theory_sd_pct"]].round(2)

# %%
study = jointz.open_study(done.study)
analysis = jointz.analyze(study, method="matched_strides", resamples=2)
pulses = analysis.pulses_frame()
figure, axes = plt.subplots()
planned = study.spec.perturbations.timing_points
for name, at in planned.items():
    measured = pulses.loc[pulses["timing_point"] == name, "measured_pct"]
    axes.plot(measured - at, [name] * len(measured), "o", color="C0", alpha=0.6)
axes.axvline(0.0, color="0.6", linewidth=0.8)
axes.set_xlabel("Measured minus planned onset (% of the gait cycle)")

# %%
# The later in the cycle, the wider the scatter: the phase is the time since the last heel strike
# over the mean of the strides before, and nobody walks like a clock.
