"""The result of a calibration step."""

from math import hypot

import pytest

from jointz.core.study import Calibrated, CalibrationSpec
from jointz.results.bench.calibration_failure import CalibrationFailure
from jointz.results.bench.calibration_fit import (
    ENTRY_UNITS,
    CalibrationFit,
    CalibrationSeries,
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
        method="by hand",
        n_samples=100,
        notes=("one note",),
        settings={"shares": [0.0, 1.0]},
        series=CalibrationSeries((0.0, 1.0), (1.0, 2.0), (1.1, 1.9), "time (s)", "angle (deg)"),
    )


def test_the_sd_is_that_of_all_sources_together():
    lag = example().entry("angle_lag_s")

    assert lag.sd == pytest.approx(hypot(3e-4, 4e-4))
    assert lag.unit == "s"
    assert lag.available


def test_too_large_an_sd_decides_nothing_and_says_why():
    gain = example().entry("angle_gain")

    assert (gain.status, gain.value) == ("undecided", 1.03)
    assert gain.reason == "its sd is 0.05, more than 0.03"


def test_the_specification_has_only_what_was_decided():
    fit = example()

    lag = Calibrated(value=0.008, sd=fit.entry("angle_lag_s").sd)
    assert fit.specification() == CalibrationSpec(angle_lag_s=lag)


def test_a_failure_says_what_was_found_and_what_to_do():
    (delay,) = example().reported

    assert delay.status == "failed:slip"
    assert delay.reason.startswith("it steps by 3 deg; ")
    assert delay.value is None


def test_every_entry_of_a_study_that_a_step_finds_has_a_unit():
    assert set(CalibrationSpec.model_fields) - {"torque_lag_s"} <= set(ENTRY_UNITS)


def test_an_unknown_entry_is_named_with_those_there_are():
    with pytest.raises(KeyError, match="angle_gain"):
        example().entry("torque_gain")
