"""The device file: what it may say, and what is opened of it."""

import subprocess
import sys
import tomllib
from collections.abc import Iterator
from importlib.metadata import EntryPoint
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from jointz.core.clock import VirtualClock
from jointz.core.errors import DataError, DeviceError, DeviceFileError
from jointz.rig.devices.adc import Ads1115Sensor
from jointz.rig.devices.config import DeviceFile, LslSpec, device_file, open_devices
from jointz.rig.devices.dephy import DephyActPack
from jointz.rig.devices.drivers import (
    BUILT_IN,
    GROUP,
    Driver,
    DriverSettings,
    load_driver,
    registered_devices,
)
from jointz.rig.devices.interface import Lifecycle
from jointz.rig.devices.lsl import LslSensor

WHOLE = """
[actuator]
driver = "dephy"
port = "/dev/ttyACM0"
firmware = "12.0.0"
side = "left"
sample_rate_hz = 1000
zero_counts = 5120

[actuator.torque_model]
gear_ratio = 9
torque_constant = 0.14
viscous_friction = 0.05
coulomb_friction = 0.38
gear_friction = 0.09
rotor_inertia = 0.012

[actuator.limits]
torque_nm = 20
torque_rate_nm_s = 4000
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

[actuator.winding]
winding_limit_c = 100

[angle]
driver = "ads1115"
address = 0x48
gain_per_v = 0.62
offset_v = 1.65

[contact]
driver = "lsl"
stream = "Footswitch"
sample_rate_hz = 1000
kind = "voltage"

[calibration]
angle_lag_s = { value = 0.0065, sd = 0.0005 }
"""


def parsed(**changed: Any) -> dict[str, Any]:
    raw = tomllib.loads(WHOLE)
    for path, value in changed.items():
        *way, key = path.split("__")
        place = raw
        for part in way:
            place = place[part]
        place[key] = value
    return raw


def test_a_whole_file_opens_its_devices() -> None:
    file = device_file(parsed())
    devices = open_devices(file, clock=VirtualClock())
    assert isinstance(devices.actuator, DephyActPack)
    assert isinstance(devices.angle, Ads1115Sensor)
    assert isinstance(devices.contact, LslSensor)
    assert {device.state for device in devices.all()} == {Lifecycle.UNCONFIGURED}
    assert devices.actuator.describe().sample_rate_hz == 1000.0
    assert devices.angle.describe().channel == "angle"
    assert devices.contact.describe().kind == "voltage"
    assert file.calibration.angle_lag_s is not None
    assert file.calibration.angle_lag_s.sd == 0.0005


def test_all_problems_stand_in_one_message() -> None:
    raw = parsed(angle__adr=0x48, calibration__angle_lag={"value": 0.1}, goniometer={})
    del raw["actuator"]["port"]
    with pytest.raises(DeviceFileError, match=r"lab\.toml") as told:
        device_file(raw, where="lab.toml")
    places = {problem.split(":")[0] for problem in told.value.problems}
    assert places == {"actuator.port", "angle.adr", "calibration.angle_lag", "goniometer"}


@pytest.mark.parametrize(
    ("changed", "place"),
    [
        ({"actuator__sample_rate_hz": 250}, "actuator.sample_rate_hz"),
        ({"actuator__firmware": "9.1"}, "actuator.firmware"),
        ({"actuator__command_timeout_s": 5.0}, "actuator.command_timeout_s"),
        (
            {"actuator__torque_model__torque_constant": -0.14},
            "actuator.torque_model.torque_constant",
        ),
        ({"actuator__torque_model__bias": 0.5}, "actuator.torque_model.bias"),
        ({"actuator__winding__winding_limit_c": 60}, "actuator.winding.winding_derate_c"),
        ({"angle__sample_rate_hz": 1000}, "angle.sample_rate_hz"),
        ({"angle__full_scale_v": 5.0}, "angle.full_scale_v"),
        ({"angle__gain_per_v": 0}, "angle.gain_per_v"),
        ({"contact__gain": 0.0}, "contact.gain"),
        ({"angle": {"driver": "ads1115"}}, "angle.gain_per_v"),
        (
            {"contact": {"driver": "ads1115", "kind": "contact", "threshold_v": 0.5}},
            "contact.threshold_v",
        ),
        ({"contact": {"driver": "ads1115"}}, "contact.address"),  # the chip of [angle]
        ({"angle": {"driver": "ads1x15"}}, "angle.driver"),
        ({"actuator": {}}, "actuator.driver"),
        ({"actuator": 7}, "actuator"),
    ],
)
def test_each_problem_is_told_at_its_key(changed: dict[str, Any], place: str) -> None:
    with pytest.raises(DeviceFileError) as raised:
        device_file(parsed(**changed))
    assert [problem.split(":")[0] for problem in raised.value.problems] == [place]


def test_an_empty_file_is_refused() -> None:
    with pytest.raises(DataError, match="actuator"):
        device_file({})


def test_chips_on_two_buses_may_have_one_address() -> None:
    contact = {"driver": "ads1115", "bus": 3}
    assert isinstance(device_file(parsed(contact=contact)), DeviceFile)


# --- drivers of other packages -------------------------------------------------------------------


class LabSettings(DriverSettings):
    port: str


@pytest.fixture
def _lab_drivers(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Register the drivers of a lab's package by entry points."""
    module = ModuleType("lab")
    module.MOTOR = Driver(LabSettings, lambda *given, **named: (given, named))
    module.SENSOR = Driver(LabSettings, lambda *given, **named: (given, named))
    monkeypatch.setitem(sys.modules, "lab", module)
    names = {"actuator.lab": "lab:MOTOR", "sensor.lab": "lab:SENSOR", "sensor.lsl": "lab:SENSOR"}
    points = [EntryPoint(name, place, GROUP) for name, place in names.items()]
    monkeypatch.setattr("jointz.core.entry_points.entry_points", lambda **_group: points)
    registered_devices.cache_clear()
    yield
    registered_devices.cache_clear()


@pytest.mark.usefixtures("_lab_drivers")
def test_a_device_file_can_name_the_drivers_of_another_package() -> None:
    clock, section = VirtualClock(), {"driver": "lab", "port": "a"}
    devices = open_devices({"actuator": section, "contact": section}, clock=clock)
    settings = LabSettings(**section)
    assert devices.actuator == ((settings,), {"clock": clock, "before": None})
    assert devices.contact == ((settings, "contact"), {"clock": clock})
    assert device_file({"angle": section}).model_dump()["angle"] == section


@pytest.mark.usefixtures("_lab_drivers")
def test_another_package_cannot_replace_a_driver_and_its_keys_are_checked() -> None:
    with pytest.raises(DeviceFileError) as told:
        device_file(parsed(angle={"driver": "lab"}, contact={"driver": "none"}))
    assert told.value.problems == (
        "angle.port: missing; it is required.",
        "contact.driver: expected one of ads1115, lab, lsl, opensourceleg; got 'none'.",
    )
    assert load_driver("contact", "lsl").settings is LslSpec


def test_the_drivers_and_rigs_of_jointz_are_entry_points() -> None:
    file = Path(__file__).parents[4] / "pyproject.toml"
    project = tomllib.loads(file.read_text("utf-8"))["project"]
    assert project["entry-points"][GROUP] == dict(BUILT_IN)
    for name, place in BUILT_IN.items():
        opens = EntryPoint(name, place, GROUP).load()
        assert callable(opens.open if isinstance(opens, Driver) else opens)


@pytest.mark.parametrize("section", ["actuator", "angle", "contact"])
def test_a_driver_without_its_library_is_opened_and_says_so_when_configured(
    section: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for library in ("flexsea", "flexsea.device", "pylsl", "smbus2"):
        monkeypatch.setitem(sys.modules, library, None)
    device = getattr(open_devices(parsed(), clock=VirtualClock()), section)
    with pytest.raises(DeviceError, match=r"pip install \"jointz\["):
        device.configure()


def test_no_library_of_a_driver_is_imported_before_it_is_used() -> None:
    code = (
        "import sys, jointz.rig.devices.config, jointz.rig.devices.adc, jointz.rig.devices.dephy, "
        "jointz.rig.devices.lsl, jointz.rig.devices.lsl_outlets;"
        "print({'flexsea', 'pylsl', 'smbus2', 'opensourceleg'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


class TestMotionSensors:
    TEXT = """
[joint_encoder]
driver = "lsl"
stream = "device"
sample_rate_hz = 500

[shank_velocity]
driver = "lsl"
stream = "inertial"
index = 2
sample_rate_hz = 200

[thigh_velocity]
driver = "opensourceleg"
device = "jointz.rig.testing:Missing"
attribute = "vel_z"
sample_rate_hz = 200
"""

    def test_streams_become_sensors_of_their_channels_in_si_units(self) -> None:
        raw = tomllib.loads(self.TEXT.partition("[thigh")[0] + '[angle]\ndriver = "lsl"\n')
        raw["angle"] |= {"stream": "device", "index": 1, "sample_rate_hz": 500.0}
        devices = open_devices(raw, clock=VirtualClock())
        told = {name: device.describe() for name, device in devices.named().items()}
        assert {name: (one.channel, one.unit) for name, one in told.items()} == {
            "angle": ("angle", "rad"),
            "joint_encoder": ("joint_encoder", "rad"),
            "shank_velocity": ("shank_velocity", "rad/s"),
        }

    def test_an_inertial_sensor_of_opensourceleg_is_a_gyroscope_in_rad_per_s(self) -> None:
        settings: Any = load_driver("thigh_velocity", "opensourceleg").settings
        keys = settings.model_validate(tomllib.loads(self.TEXT)["thigh_velocity"])
        reading = keys.reading("thigh_velocity")
        assert (reading.attribute, reading.unit, reading.kind) == ("vel_z", "rad/s", "")

    def test_a_converter_needs_a_gain_and_a_chip_of_its_own(self) -> None:
        chip = {"driver": "ads1115"}
        with pytest.raises(DeviceFileError) as caught:
            device_file({"contact": chip, "shank_velocity": chip})
        assert "shank_velocity.gain_per_v: missing; rad/s per volt" in str(caught.value)
        assert "shank_velocity.address: expected another chip than [contact]" in str(caught.value)
