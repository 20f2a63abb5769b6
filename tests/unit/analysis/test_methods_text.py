"""The methods section: every number is one of the settings, the study or the data."""

import re
from dataclasses import replace

import numpy as np
import pytest
from tests.unit.analysis.studies import study_record
from tests.unit.conftest import recommended_analysis

from jointz.analysis.page.report_page import render_report
from jointz.analysis.paper.citations import CITATIONS, cite, cited
from jointz.analysis.paper.methods_text import methods_latex, methods_text
from jointz.core.events import PulseRecord
from jointz.report.wording import MINUS

STUDY = {
    "torque_acts_on": "device",
    "channels": {"angle": {"column": "knee"}, "torque": {"column": "tau"}},
    "participants": [
        {"id": "S01", "mass_kg": 60.0, "height_m": 1.7},
        {"id": "S02", "mass_kg": 80.0},
        {"id": "S03"},
    ],
}  # fmt: skip


def with_study(analysis, **changes):
    study = study_record(**{**STUDY, **changes})
    return replace(analysis, provenance={**analysis.provenance, "study": study})


#: (side, positive direction of the torque) -> whether its sign was inverted for the joint.
INVERTED = {
    ("device", "flexion"): True,
    ("device", "extension"): False,  # inverted twice, that is, not at all
    ("joint", "flexion"): False,
    ("joint", "extension"): True,
}


@pytest.mark.parametrize(("side", "positive"), INVERTED)
@pytest.mark.parametrize("perturbed", [True, False])
def test_the_sign_of_the_torque_is_told_as_it_was_read(
    recommended, unperturbed, perturbed, side, positive
):
    torque = {"column": "tau", "positive": positive}
    channels = {"angle": {"column": "knee"}, "torque": torque}
    study = {"positive": "flexion", "torque_acts_on": side, "channels": channels}
    text = methods_text(with_study(recommended if perturbed else unperturbed, **study))
    assert ("sign inverted" in text) == INVERTED[side, positive]


def calibrated(analysis, study, person=None):
    people = [{"id": "S01", "calibration": person or {}}]
    changes = {"calibration": study, "participants": people}
    return methods_text(with_study(analysis, channels={"current": {"column": "i"}}, **changes))


def test_a_calibration_is_given_with_its_sd_that_of_the_participant_before_that_of_the_study(
    recommended,
):
    entries = {
        "torque_gain": {"value": 0.9, "sd": 0.02},
        "angle_lag_s": {"value": 0.0065, "sd": 5e-4},
        "angle_zero_rad": {"value": 0.0, "sd": 0.02},
    }
    own = {"torque_gain": {"value": 1.1, "sd": 0.03}}
    text = calibrated(recommended, entries, own)
    assert "gain of the torque 1.100 ± 0.030" in text
    assert "0.900" not in text
    assert "lag of the angle 6.50 ± 0.50 ms" in text
    assert "zero of the angle 0.0 ± 1.1 degrees" in text


def test_calibrations_that_differ_are_one_range(recommended):
    lags = [(0.00095, 5e-4), (-0.00019, 5e-4), (0.0003, 5e-4)]
    people = [
        {"id": f"S{k}", "calibration": {"angle_lag_s": {"value": value, "sd": sd}}}
        for k, (value, sd) in enumerate(lags)
    ]
    text = methods_text(with_study(recommended, participants=people))
    span = f"lag of the angle {MINUS}0.19 ± 0.50 ms to 0.95 ± 0.50 ms (3 calibrations)"
    assert span in text
    assert " ms or " not in text


def test_no_text_of_a_paper_has_a_placeholder(recommended, walking, bench):
    for analysis in (recommended, walking, bench, strapped_study(recommended)):
        text = methods_text(analysis)
        assert "to be added" not in text
        assert "+-" not in text
        assert not re.search(r"\[[^\d]", text)
    assert not any("[" in entry.full for entry in CITATIONS.values())


def pulse(amplitude=17.0, duration_s=0.25, code="", **more):
    return PulseRecord("S01", "a.csv", 1.0, duration_s, amplitude, "LRE", 7.0, 7.5, code, **more)


def test_people_are_those_of_the_study_with_what_is_known_of_them(recommended):
    text = methods_text(with_study(recommended))
    mean, sd = np.mean([60.0, 80.0]), np.std([60.0, 80.0], ddof=1)
    assert "in the knee of 3 participants (S01, S02, S03)." in text
    assert f"Body mass: {mean:.1f} ± {sd:.1f} kg, mean ± SD (2 of 3)." in text
    assert "Body height: 1.70 m (1 of 3)." in text


def test_what_a_study_does_not_hold_is_not_written(recommended):
    text = methods_text(replace(recommended, provenance={}))
    for unknown in ("Body mass", "Torque was", "Software", "SHA-256", "None"):
        assert unknown not in text
    assert not re.search(r"\bnan\b", text)


def test_pulses_are_as_they_were_found(recommended):
    one_size = methods_text(replace(recommended, pulses=(pulse(), pulse(-17.0))))
    assert "(amplitude 17.0 N·m, duration 250 ms; 1 positive, 1 negative)" in one_size
    angle = with_study(recommended, perturbations={"source": "angle"})
    assert "(amplitude 0.100 rad" in methods_text(replace(angle, pulses=(pulse(0.1),)))
    mixed = (pulse(10.0, 0.1), pulse(17.0, None), pulse(None, 0.25))
    text = methods_text(replace(recommended, pulses=mixed))
    assert "amplitude 10.0 to 17.0 N·m, median 13.5, duration 100 to 250 ms, median 175" in text


def test_onsets_are_off_on_the_circle_and_one_has_no_standard_deviation(recommended):
    pulses = tuple(
        PulseRecord("S01", "a.csv", 1.0, 0.25, 17.0, "ICO", 1.0, pct) for pct in (99.0, 2.0)
    )
    text = methods_text(replace(recommended, pulses=(*pulses, pulse())))
    assert f"ICO at 1 % ({MINUS}0.50 ± 2.12 %, n 2), LRE at 7 % (+0.50 %, n 1)." in text


def test_what_is_cited_is_listed_and_nothing_else(recommended, walking, bench):
    for analysis in (recommended, walking, bench):
        whole = methods_text(analysis)
        body, _, listed = whole.partition("\nReferences\n")
        for key, entry in CITATIONS.items():
            assert (entry.full in listed) == (cite(key) in body)
    assert CITATIONS["dissertation"].full in methods_text(bench)
    assert cited(["nothing"]) == []


def test_latex_holds_the_same_words_and_no_bare_special_characters(walking):
    tex = methods_latex(walking)
    assert not re.search(r"(?<!\\)[%&#_]", tex)
    assert tex.count("$") % 2 == 0
    assert tex.isascii()


def test_a_pulse_without_a_timing_point_is_counted(recommended):
    nameless = PulseRecord("S01", "a.csv", 1.0, 0.25, 17.0, "", None, None, "no_heel_strikes")
    text = methods_text(replace(recommended, pulses=(pulse(), pulse(), nameless)))
    assert "Of 3 pulses, 2 were used." in text


def strapped_study(analysis, **provenance):
    settings = {**analysis.settings, "coupling": "strap", "window_s": 0.15}
    made = with_study(replace(analysis, settings=settings))
    return replace(made, provenance={**made.provenance, **provenance})


def test_a_strap_is_described_with_hypotheses_widening_estimands_and_decisions(recommended):
    text = methods_text(strapped_study(recommended))

    for part in (
        "explained by the same parameters",
        "Data up to 212 ms",
        "1.5 % of the response and 0.02 degrees",
        "follow one curve over the gait cycle (90 % of the variance)",
        "Standard deviations of the posterior were multiplied by 1.1",
        "mean over 150 ms of torque over displacement",
        "damping at the onset are those of small displacements",
        "2.5 standard deviations from its prior",
        "two one-sided 95 % limits",
    ):
        assert part in text
    assert r"\%" in methods_latex(strapped_study(recommended))


def test_a_device_that_moves_with_the_bone_is_described_without_a_strap(recommended):
    text = methods_text(recommended)

    for part in (
        "was assumed to move with the bone",
        "Data up to 112 ms",
        "0.1 % of the response and 0.0011 degrees",
        "per torque (SD 0.0003 rad/(N·m), unless calibrated)",
        "(32 % of the variance, prior probability 33 %)",
        "between timing points by 0.01 or 0.35 (SD of its logarithm)",
        "No value is given if half of its interval exceeds 50 % of it; if the model",
        "sensor delay 0.002, 0.5 (for a device that moves with the bone)",
    ):
        assert part in text
    assert not re.search("strap|falls with displacement|multiplied|height", text)


def test_results_of_a_former_method_have_a_page_that_does_not_describe_it():
    former = recommended_analysis()
    assert "does not describe the method “rigid”" in methods_text(former)
    assert render_report(former, {}, title="t")


def test_priors_stand_with_their_source_those_of_the_study_as_such(recommended):
    usual = methods_text(strapped_study(recommended))
    own = methods_text(
        strapped_study(recommended, priors={"strap_hz": {"median": 15.0, "log_sd": 0.3}})
    )

    assert "strap 20, 0.45 (Hz: strap and tissue with the device, 8 to 49)" in usual
    assert "softening power 1.6 ± 0.4 (no source: the form is not known)" in usual
    assert "strap 15, 0.3 (stated by the study)" in own


def test_several_sizes_of_pulse_are_all_named(recommended):
    sizes = [8.0, -8.0, 17.0, -17.0] * 3
    pulses = tuple(pulse(a, d) for a, d in zip(sizes, [0.06, 0.15] * 6, strict=True))
    text = methods_text(replace(recommended, pulses=pulses))

    assert "amplitude 8.00 and 17.0 N·m" in text
    assert "duration 60.0 and 150 ms" in text
    assert "6 positive, 6 negative" in text
