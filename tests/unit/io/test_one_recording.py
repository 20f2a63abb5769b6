"""One recording from a file, as it is and as channels in SI."""

import numpy as np
import pytest

import jointz
from jointz.core.errors import DataError, UnitError


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "ankle.csv"
    path.write_text("t (ms),pos [deg],note,tau\n0,0,a,1\n500,90,b,2\n1000,180,c,4\n")
    return path


def test_every_signal_is_read_under_its_own_name_and_unit(file):
    recording = jointz.read(file)
    assert recording["time"].values.tolist() == [0.0, 0.5, 1.0]
    assert recording["pos [deg]"].values.tolist() == [0.0, 90.0, 180.0]
    assert recording["pos [deg]"].attrs["units"] == "deg"
    assert recording["note"].values.tolist() == ["a", "b", "c"]


def test_channels_are_named_and_converted_to_si(file):
    recording = jointz.read(file, time="t (ms):ms", angle="pos [deg]:deg", torque="tau")
    np.testing.assert_allclose(recording["angle"], [0.0, np.pi / 2, np.pi])
    assert recording["angle"].attrs["units"] == "rad"
    assert recording["time"].values.tolist() == [0.0, 0.5, 1.0]
    assert "note" not in recording


@pytest.mark.parametrize(
    ("channels", "error", "message"),
    [
        ({"angle": "knee:deg"}, DataError, "knee"),
        ({"angle": "pos [deg]:kg"}, UnitError, "kg"),
        ({"knee": "pos [deg]"}, DataError, "expected channels out of .*angle"),
    ],
)
def test_what_cannot_be_read_is_named(file, channels, error, message):
    with pytest.raises(error, match=message):
        jointz.read(file, **channels)


def test_one_of_several_groups_has_to_be_named(tmp_path):
    from jointz.core.acquisition import Acquisition, Signal, SignalGroup
    from jointz.io.formats.registry import write_acquisition

    path = tmp_path / "walk.nc"
    groups = (
        SignalGroup("points", (Signal("knee", np.arange(3.0), "deg"),), rate_hz=100.0),
        SignalGroup("analogs", (Signal("force", np.arange(6.0), "N"),), rate_hz=200.0),
    )
    write_acquisition(Acquisition(groups), path)
    with pytest.raises(DataError, match="points, analogs"):
        jointz.read(path)
    forces = jointz.read(path, group="analogs")
    assert forces["force"].attrs["units"] == "N"
    assert forces["time"].values[-1] == pytest.approx(5 / 200.0)


def test_a_contact_is_read_without_a_unit(tmp_path):
    file = tmp_path / "walk.csv"
    file.write_text("t,foot [V]\n0,0\n0.01,3.3\n")
    recording = jointz.read(file, time="t", contact="foot [V]")
    assert recording["contact"].values.tolist() == [0.0, 3.3]
