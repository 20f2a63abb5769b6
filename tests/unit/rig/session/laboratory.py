"""A device file, and simulated devices that are opened in place of those that it names."""

from contextlib import nullcontext
from dataclasses import replace

import pytest

from jointz.core.clock import VirtualClock
from jointz.rig.sim.rig import simulated_rig

ACTUATOR = """
[actuator]
driver = "dephy"
port = "/dev/ttyACM0"
firmware = "12.0.0"
side = "left"
torque_model = { gear_ratio = 9, torque_constant = 0.14 }
[actuator.limits]
torque_nm = 20
torque_rate_nm_s = 1e5
current_a = 18
angle_min_rad = -0.2
angle_max_rad = 1.8
velocity_rad_s = 12
temperature_c = 100
sensor_age_s = 0.02
pulse_count = 400
pulse_duty = 0.3
consecutive_overruns = 5
fade_s = 0.05
"""
ANGLE = """
[angle]
driver = "lsl"
stream = "Goniometer"
sample_rate_hz = 500
"""
CONTACT = """
[contact]
driver = "ads1115"
kind = "contact"
"""


class Laboratory:
    """Opens the devices and keeps everything that it opened."""

    def __init__(self):
        self.opened, self.switch = [], lambda made: made

    def open_devices(self, file, *, clock, before=None):
        """Open simulated devices."""
        del before
        rig, worn = simulated_rig(0, preset="nominal", seed=2), file.actuator is not None
        devices = rig.open("lab", worn=worn, segment=len(self.opened), clock=clock)
        devices = replace(devices, contact=self.switch(devices.contact))
        self.opened.append(devices)
        return devices


@pytest.fixture
def laboratory(monkeypatch):
    """Simulated devices are opened where real ones are named, and time flies."""
    made = Laboratory()
    monkeypatch.setattr("jointz.rig.session.rigs.hardware_rig.open_devices", made.open_devices)
    for home in ("run", "participant_run"):
        monkeypatch.setattr(f"jointz.rig.session.{home}.RealClock", VirtualClock)
    monkeypatch.setattr("jointz.rig.experiment.session.undisturbed", nullcontext)
    return made
