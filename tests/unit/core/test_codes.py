"""Codes are part of the file format: stable, and every one explained."""

import re

import pytest

from jointz.core.codes import Doubt, Exclusion, Failure, NotPooled, Trip
from jointz.results.bench.calibration_failure import CalibrationFailure
from jointz.results.statistics import pulse_effect_tests, quasi_stiffness_fit

KINDS = [
    *(Exclusion, Failure, NotPooled, Doubt, Trip, CalibrationFailure),
    *(pulse_effect_tests.Undecided, quasi_stiffness_fit.Doubt),
]
CODES = [code for kind in KINDS for code in kind]


@pytest.mark.parametrize("code", CODES, ids=repr)
def test_every_code_has_a_meaning(code):
    meaning = code.meaning

    assert len(meaning) > 15
    assert meaning == meaning.strip().rstrip(".")


@pytest.mark.parametrize("kind", KINDS)
def test_no_two_codes_mean_the_same(kind):
    assert len({code.meaning for code in kind}) == len(kind)


@pytest.mark.parametrize("code", CODES, ids=repr)
def test_a_code_is_its_name_in_lower_case_and_fits_a_csv_cell(code):
    assert code.value == code.name.lower()
    assert re.fullmatch(r"[a-z][a-z_]*", code)
    assert str(code) == f"{code}" == code.value


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
