"""
Is my driver a device?
======================

A driver of your own is tested against the same contract as ours:
:class:`jointz.rig.testing.ActuatorContract` and :class:`jointz.rig.testing.SensorContract` hold
what a device must do, first of all that it goes to zero torque without commands.
"""

import matplotlib.pyplot as plt
import numpy as np

from jointz.core.clock import VirtualClock
from jointz.rig.testing import (
    ActuatorContract,
    ScriptedActuator,
    ScriptedSensor,
    SensorContract,
    Signal,
)

# %%
# In your tests this is all there is to write; pytest finds the inherited tests.


class TestMyActuator(ActuatorContract):
    """The scripted actuator stands for your driver here."""

    def make_clock(self):
        """Return the clock that the driver runs on."""
        return VirtualClock()

    def make(self, clock):
        """Return the device, not yet configured."""
        return ScriptedActuator(clock)

    def disconnect(self, device):
        """Pull the plug."""
        device.disconnect()


def still(_time_s):
    """Return an angle that does not change, rad."""
    return 0.2


quiet: Signal = still


class TestMySensor(SensorContract):
    """The same for a sensor."""

    def make_clock(self):
        """Return the clock that the driver runs on."""
        return VirtualClock()

    def make(self, clock):
        """Return the device, not yet configured."""
        return ScriptedSensor(clock, quiet)

    def disconnect(self, device):
        """Pull the plug."""
        device.disconnect()


# %%
# Without pytest, one after the other:

for contract in (TestMyActuator(), TestMySensor()):
    tests = [name for name in dir(contract) if name.startswith("test_")]
    for name in tests:
        getattr(contract, name)()
    print(type(contract).__name__, "passes", len(tests), "tests")

# %%
# What the first of them asks for, drawn: commands stop after 0.2 s.

clock = VirtualClock()
device = ScriptedActuator(clock)
device.configure()
device.activate()
time_s, current = [], []
for tick in range(250):
    if tick < 100:
        device.command_torque(9.0)
    clock.wait_until_ns((tick + 1) * 2_000_000)
    for sample in device.read():
        time_s.append(sample.host_time_ns / 1e9)
        current.append(sample.current)
figure, axes = plt.subplots(figsize=(5.6, 2.6))
axes.plot(time_s, current)
axes.axvline(0.2, color="0.6", linewidth=0.8)
axes.set(xlabel="Time (s)", ylabel="Current (A)", ylim=(0, None))
print(f"zero {1e3 * (time_s[np.flatnonzero(current)[-1]] - 0.2):.0f} ms behind the last command")

# %%
# The current stays for as long as the command timeout, then goes to zero by itself.
