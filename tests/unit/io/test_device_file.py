"""A device.toml is read as it is, or refused with what is wrong with it."""

import re
from pathlib import Path

import pytest

from jointz.core.errors import DataError, DeviceFileError
from jointz.io.protocols import load_protocol
from jointz.rig.devices.config import DeviceFile, device_file
from jointz.rig.session.rigs.hardware_rig import read_device_file, read_hardware


def test_a_file_is_read_and_fits_its_model(tmp_path):
    path = tmp_path / "device.toml"
    path.write_text('\ufeff[angle]\ndriver = "lsl"\nstream = "Gonio"\nsample_rate_hz = 500\n')
    raw = read_device_file(path)
    assert raw == {"angle": {"driver": "lsl", "stream": "Gonio", "sample_rate_hz": 500}}
    assert device_file(raw).angle.stream == "Gonio"


@pytest.mark.parametrize("content", [b"[angle", b"\xff\xfe", b"a = 99999999999999999999"])
def test_what_is_no_toml_is_told(tmp_path, content):
    path = tmp_path / "device.toml"
    path.write_bytes(content)
    with pytest.raises(DeviceFileError, match=r"device\.toml: 1 problem"):
        read_device_file(path)


@pytest.mark.parametrize("name", ["none.toml", "", "\0", "x" * 300])
def test_a_file_that_is_not_there_is_named(tmp_path, name):
    with pytest.raises(DataError, match="no such file"):
        read_device_file(str(tmp_path / name))


def test_the_example_of_the_documentation_is_enough_to_walk(tmp_path):
    page = (Path(__file__).parents[3] / "docs" / "devices.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```toml\n(.*?)```", page, flags=re.DOTALL)
    path = tmp_path / "device.toml"
    path.write_text(example)
    file = device_file(read_device_file(path))
    # Sensors that walking does not need.
    more = {"joint_encoder", "shank_velocity", "thigh_velocity"}
    assert file.model_fields_set == set(DeviceFile.model_fields) - more
    hardware = read_hardware(path, load_protocol("walking"))
    assert [one.id for one in hardware.wearers] == ["P07"]
