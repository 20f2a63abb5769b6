"""What is said of the columns of logs that are known."""

import numpy as np

from jointz.core.acquisition import Signal
from jointz.io.text.vendor_logs import with_vendor_units


def test_a_log_of_opensourceleg_says_that_its_units_may_be_others():
    names = ("knee.output_position", "knee.motor_current", "fz")
    found, whose = with_vendor_units([Signal(name, np.zeros(2)) for name in names])

    assert whose == "opensourceleg"
    assert [signal.unit for signal in found] == ["rad", "mA", ""]
    assert found[0].description.endswith("a release with osl.units may have logged in those")
    assert found[2].description == ""


def test_a_log_of_an_actpack_says_nothing_of_the_kind():
    names = ("state_time", "mot_ang", "mot_cur")
    found, _ = with_vendor_units([Signal(name, np.zeros(2)) for name in names])

    assert "osl.units" not in found[2].description
