"""What the methods section says of calibration: what holds, what is carried, what was done."""

from dataclasses import replace

import pytest

from jointz.analysis.paper.methods_text import methods_text


def calibrated(analysis, study=None, *, person=None, method="recommended", **more):
    cells = tuple(replace(c, method=method) for c in analysis.cells)
    content = {
        "channels": {"current": {}}, "calibration": study or {},
        "participants": [{"id": "S01", "calibration": person or {}}],
        "recordings": [{"participant": "S01", "file": "a", "condition": "perturbed"}], **more,
    }  # fmt: skip
    settings = {**analysis.settings, "method": method}
    return methods_text(
        replace(analysis, cells=cells, settings=settings, provenance={"study": content})
    )


def test_an_entry_that_all_participants_override_is_not_told(recommended):
    own = {"torque_gain": {"value": 1.1, "sd": 0.02}}
    text = calibrated(recommended, {"torque_gain": {"value": 0.9, "sd": 0.02}}, person=own)
    assert "gain of the torque 1.100 ± 0.020." in text
    assert "0.900" not in text


@pytest.mark.parametrize("method", ["recommended", "dissertation"])
def test_what_is_not_carried_into_the_intervals_is_told_so(recommended, method):
    entries = {
        "friction_gain": {"value": 1.0, "sd": 0.1},
        "tissue_hz": {"value": 30.0, "sd": 3.0},
        "angle_zero_rad": {"value": 0.0, "sd": 0.02},
    }
    text = calibrated(recommended, entries, method=method)
    carried, _, not_carried = text.partition("the SD not included in the intervals")
    assert "zero of the angle 0.0 ± 1.1 degrees" in not_carried
    friction = "actual over stated friction of the actuator 1.00 ± 0.10"
    assert friction in (carried if method == "recommended" else not_carried)
    assert ("resonance of the soft tissue" in text) == (method == "recommended")


def test_what_was_done_with_the_calibration_is_told(recommended):
    entries = {
        "angle_gain": {"value": 1.0, "sd": 0.1},
        "angle_lag_s": {"value": 0.005, "sd": 0.001},
        "intrinsic_inertia": {"value": 0.01, "sd": 0.001},
    }
    fitted = calibrated(recommended, entries)
    assert "The signals were divided by their gains." in fitted
    assert "The calibrated lag was a prior of the fit." in fitted
    assert "as far as the motion of its motor was recorded; the rest was subtracted" in fitted
    shifted = calibrated(recommended, entries, method="dissertation")
    assert "The calibrated lag was corrected by a shift." in shifted
    assert "The impedance of the device was subtracted from the estimates." in shifted
