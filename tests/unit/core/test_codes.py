"""Codes are part of the file format: stable, and every one explained."""

import re

import pytest

from jointz.core.codes import Doubt, Exclusion, Failure, NotPooled, Trip
from jointz.results.bench.calibration_failure import CalibrationFailure
from jointz.results.statistics import pulse_effect_tests, quasi_stiffness_fit

KINDS = [
    *(Exclusion, Failure, NotPooled, Doubt, Trip, CalibrationFailure),
    *(pulse_effect_tests.Undecided, quasi_stiffness_fit.QuasiStiffnessDoubt),
]


@pytest.mark.parametrize("kind", KINDS)
def test_every_code_is_its_name_in_lower_case_and_has_a_meaning_of_its_own(kind):
    for code in kind:
        assert re.fullmatch(r"[a-z][a-z_]*", code)
        assert str(code) == f"{code}" == code.value == code.name.lower()
        assert code.meaning == code.meaning.strip().rstrip(".")
    assert len({code.meaning for code in kind}) == len(kind)


def test_a_failure_is_a_status():
    assert Failure.NO_PULSES.status == "failed:no_pulses"
    assert CalibrationFailure.SLIP.status == "failed:slip"


def test_codes_that_files_hold_are_never_renamed():
    """Codes may be added to these; one that is missing breaks files out there."""
    exclusions = (
        "gap not_finite missing_strike spurious_strike pulse_in_stride no_recent_strides "
        "no_heel_strikes edge_of_record overlapping_pulse no_baseline outside_groups lone_pulse "
        "constant_angle constant_torque user"
    )
    failures = (
        "no_pulses too_few_pulses all_pulses_excluded no_heel_strikes no_perturbed_recording "
        "no_unperturbed_recording no_unperturbed_strides constant_angle constant_torque "
        "ill_conditioned mass_missing too_few_participants"
    )
    assert set(Exclusion) >= set(exclusions.split())
    assert set(Failure) >= set(failures.split())
