"""
What does the safety gate let through?
======================================

Every torque passes :class:`~jointz.rig.experiment.safety.SafetyGate` last, before the device. It
clamps what is asked for too much, and ends the trial for what is measured: a sensor that goes
blind, a posture, a speed. Here a scripted device misbehaves.
"""

import matplotlib.pyplot as plt
import numpy as np

from jointz.core.clock import VirtualClock
from jointz.rig.experiment.safety import SafetyGate
from jointz.rig.testing import Deviation, ScriptedActuator, ScriptedSensor, replay

RATE = 500.0
PERIOD_NS = round(1e9 / RATE)


def trial(script):
    """Return requested and sent torque over a second of pulses, and the gate."""
    clock = VirtualClock()
    knee = 0.3 + 0.2 * np.sin(2 * np.pi * np.arange(600) / RATE)
    actuator = ScriptedActuator(clock, angle=replay(knee.tolist(), RATE), script=script)
    goniometer = ScriptedSensor(clock, replay(knee.tolist(), RATE))
    described = actuator.describe()
    gate = SafetyGate(
        described.limits,
        control_period_s=1 / RATE,
        torque_per_ampere=described.torque_model.torque_per_ampere,
    )
    for device in (actuator, goniometer):
        device.configure()
        device.activate()
    requested, sent = [], []
    for tick in range(500):
        clock.wait_until_ns((tick + 1) * PERIOD_NS)
        samples, angles = actuator.read(), goniometer.read()
        wanted = 45.0 if 150 <= tick < 275 else 0.0  # the device allows 30 N*m
        torque = gate.check(
            wanted,
            samples[-1] if samples else None,
            angle=angles[-1].value,
            age_s=0.0,
            steady=True,
            pulse_active=wanted != 0.0,
        )
        if gate.tripped is None:
            actuator.command_torque(torque)
        requested.append(wanted)
        sent.append(torque)
    return np.array(requested), np.array(sent), gate


# %%
# All well; a motor that gets too hot in the middle of the pulse; an encoder that jumps:

cases = {
    "all well": [],
    "motor at 95 degrees": [Deviation("replace", 220, values={"temperature_c": 95.0})],
    "encoder jumps": [Deviation("replace", 180, values={"angle": 2.5})],
}
figure, axes = plt.subplots(3, 1, figsize=(6.0, 4.4), sharex=True, sharey=True)
for panel, (label, script) in zip(axes, cases.items(), strict=True):
    requested, sent, gate = trial(script)
    time = np.arange(sent.size) / RATE
    panel.plot(time, requested, color="0.7", label="asked for")
    panel.plot(time, sent, color="C0", label="sent")
    told = gate.tripped.meaning if gate.tripped else "clamped to the limit"
    panel.set_title(f"{label}: {told}", fontsize="small", loc="left")
    print(f"{label}: {gate.detail or told}")
axes[1].set_ylabel("Torque (N*m)")
axes[2].set_xlabel("Time (s)")
axes[0].legend(loc="upper right")

# %%
# Above its limit a request is clamped. A trip makes the torque zero in the same tick, and it stays
# there: trips latch.
