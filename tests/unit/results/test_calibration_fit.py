"""The result of a calibration step."""

from math import hypot

import pytest

from jointz.core.study import Calibrated, CalibrationSpec
from jointz.results.bench.calibration_failure import CalibrationFailure
from jointz.results.bench.calibration_fit import (
    ENTRY_UNITS,
    CalibrationFit,
    decided,
    failed,
)


def example() -> CalibrationFit:
    return CalibrationFit(
        step="hinge",
        entries=(
            decided("angle_lag_s", 0.008, {"noise": 3e-4, "delay_or_filter": 4e-4}),
            decided("angle_gain", 1.03, {"noise": 0.05}, largest_sd=0.03),
        ),
        reported=failed(("angle_delay_s",), CalibrationFailure.SLIP, "it steps by 3 deg"),
    )


def test_the_sd_is_that_of_all_sources_together():
    lag = example().entry("angle_lag_s")

    assert lag.sd == pytest.approx(hypot(3e-4, 4e-4))
    assert lag.unit == "s"
    assert lag.available


def test_the_specification_has_only_what_was_decided():
    fit = example()
    gain, (delay,) = fit.entry("angle_gain"), fit.reported

    assert (gain.status, gain.value) == ("undecided", 1.03)
    assert (delay.status, delay.value) == ("failed:slip", None)
    lag = Calibrated(value=0.008, sd=fit.entry("angle_lag_s").sd)
    assert fit.specification() == CalibrationSpec(angle_lag_s=lag)


def test_every_entry_of_a_study_that_a_step_finds_has_a_unit():
    of_no_step = ("torque_lag_s", "joint_encoder_", "shank_velocity_", "thigh_velocity_")
    found = {name for name in CalibrationSpec.model_fields if not name.startswith(of_no_step)}
    assert found <= set(ENTRY_UNITS)
