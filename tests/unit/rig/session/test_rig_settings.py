"""What of a protocol reaches the simulated rig."""

import pytest

from jointz.io.protocols import load_protocol
from jointz.rig.session.rigs.rig_settings import open_rig, rig_settings


def test_the_speed_of_the_treadmill_reaches_the_person():
    protocol = load_protocol("walking")
    gait = protocol.gait.model_copy(update={"speed_m_s": 0.6})
    slower = protocol.model_copy(update={"gait": gait})

    rigs = [open_rig(rig_settings(p, "sim", "clean", 1), 0) for p in (protocol, slower)]
    usual, slow = (rig.motion("EWP", 0).next().duration_s for rig in rigs)

    assert [rig.speed_m_s for rig in rigs] == [1.2, 0.6]
    assert slow / usual == pytest.approx(2.0**0.5)
    assert usual == rigs[0].person.stride_time_s


def test_sensors_of_the_protocol_are_simulated_unless_others_are_chosen():
    planned = load_protocol("walking").model_copy(update={"sensors": ("goniometer", "encoder")})

    assert rig_settings(planned, "sim", None, 1).sensors == ("goniometer", "encoder")
    assert rig_settings(planned, "sim", None, 1, ["goniometer"]).sensors == ("goniometer",)
