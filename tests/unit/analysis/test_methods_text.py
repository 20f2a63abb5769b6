"""The methods section: every number is one of the settings, the study or the data."""

import re
from dataclasses import replace
from itertools import cycle

import numpy as np
import pytest

from jointz.analysis.paper.citations import CITATIONS, cite, cited
from jointz.analysis.paper.methods_text import methods_latex, methods_text
from jointz.core.events import PulseRecord
from jointz.report.wording import MINUS
from jointz.results.estimates import ParameterEstimate

CALIBRATION = {
    "torque_gain": {"value": 1.0, "sd": 0.02},
    "angle_lag_s": {"value": 0.0065, "sd": 5e-4},
}
STUDY = {
    "torque_acts_on": "device",
    "channels": {"angle": {"column": "knee"}, "torque": {"column": "tau"}},
    "participants": [
        {"id": "S01", "mass_kg": 60.0, "height_m": 1.7, "calibration": CALIBRATION},
        {"id": "S02", "mass_kg": 80.0},
        {"id": "S03"},
    ],
}  # fmt: skip


def with_study(analysis, **changes):
    study = {**STUDY, **changes}
    return replace(analysis, provenance={**analysis.provenance, "study": study})


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


CURRENT = {"gear_ratio": 9.0, "torque_constant": 0.11, "bias": 0.0}
OPPOSITE = {"positive": "flexion", "channels": {"torque": {"positive": "extension"}}}


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({}, "measured on the device, and its sign inverted to give the torque on the"),
        ({"torque_acts_on": "joint"}, "Torque was measured and is the torque on the joint."),
        (
            {"channels": {"current": {}}, "torque_model": CURRENT},
            "from the current of the motor by equation 4.1 (dissertation, 4.2) with gear ratio "
            "9, torque constant 0.11 N·m/A. It is the torque on the joint.",
        ),
        (OPPOSITE, "on the device, with the opposite positive direction, so that it equals the"),
        (OPPOSITE | {"torque_acts_on": "joint"}, "on the joint, with its sign inverted."),
    ],
)
def test_the_path_of_the_torque_is_that_of_the_study(recommended, changes, said):
    assert said in methods_text(with_study(recommended, **changes))


def test_a_calibration_is_given_with_its_sd_and_its_absence_is_told(recommended):
    known = methods_text(with_study(recommended))
    assert "gain of the torque 1.000 ± 0.020" in known
    assert "lag of the angle 6.50 ± 0.50 ms" in known
    assert "No lag between angle and torque was calibrated." not in known
    unknown = methods_text(with_study(recommended, participants=[]))
    assert "No lag between angle and torque was calibrated." in unknown


def test_pulses_are_as_they_were_found(recommended):
    one_size = methods_text(replace(recommended, pulses=(pulse(), pulse(-17.0))))
    assert (
        "2 pulses of torque were detected (amplitude 17.0 N·m, duration 250 ms; 1 positive, "
        "1 negative)." in one_size
    )
    mixed = (pulse(10.0, 0.1), pulse(17.0, None), pulse(None, 0.25))
    text = methods_text(replace(recommended, pulses=mixed))
    assert "amplitude 10.0 to 17.0 N·m, median 13.5, duration 100 to 250 ms, median 175" in text
    unknown = methods_text(replace(recommended, pulses=(pulse(None, None),)))
    assert "amplitude not recorded, duration not recorded" in unknown


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            {"perturbations": {"source": "angle"}},
            "1 step of the angle was detected (amplitude 0.100 rad",
        ),
        (
            {"channels": {"reference": {"unit": "deg"}}},
            "1 pulse of the reference angle was detected",
        ),
        (
            {"channels": {"reference": {"unit": "mN*m"}}},
            "1 pulse of torque was detected (amplitude 0.100 N",
        ),
        (
            {
                "channels": {"reference": {"unit": "deg"}},
                "recordings": [{"participant": "S01", "perturbations": "pulses.csv"}],
            },
            "1 pulse of torque was detected (amplitude 0.100 N·m",
        ),
    ],
)
def test_pulses_have_the_name_and_unit_of_what_they_were_read_off(recommended, changes, said):
    study = with_study(recommended, **changes)
    assert said in methods_text(replace(study, pulses=(pulse(0.1),)))


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
    assert CITATIONS["dissertation"].full in methods_text(recommended)
    assert cited(["nothing"]) == []


@pytest.mark.parametrize("method", ["output_error", "errors_in_variables", "weak_form"])
def test_a_method_that_filters_nothing_does_not_say_that_it_does(walking, method):
    cells = tuple(replace(c, method=method) for c in walking.cells)
    text = methods_text(replace(walking, cells=cells))
    assert "passed the same low-pass filter" not in text
    assert "were fitted as sampled" in text


@pytest.mark.parametrize("method", ["recommended", "dissertation", "output_error", "full_record"])
@pytest.mark.parametrize("window_s", [0.1, None])
def test_sentences_have_one_comma_and_one_stop(walking, method, window_s):
    cells = tuple(replace(c, method=method) for c in walking.cells)
    settings = {**walking.settings, "window_s": window_s, "method": method}
    text = methods_text(replace(walking, cells=cells, settings=settings))
    for slip in (",,", ", ,", ", .", ",.", "  ", " ,", "..", "None"):
        assert slip not in text
    assert ("over 100 ms" in text) == (window_s is not None and method != "full_record")


def test_a_strapped_leg_has_its_own_model_without_filter_and_resamples(recommended):
    cells = tuple(replace(c, method="strapped", budget={}) for c in recommended.cells)
    text = methods_text(replace(recommended, cells=cells, models=()))

    assert "two masses on a spring and a damper" in text
    assert "predicted from the half second before its onset" in text
    assert not any(word in text for word in ("Butterworth", "resamples", "K·angle", "{"))


def test_latex_holds_the_same_words_and_no_bare_special_characters(walking):
    tex = methods_latex(walking)
    assert not re.search(r"(?<!\\)[%&#_]", tex)
    assert tex.count("$") % 2 == 0
    assert r"95 \% intervals of each participant" in tex
    assert r"\paragraph{References}" in tex
    assert tex.isascii()


# --- what was not done is not said -------------------------------------------------------------


def test_pulses_of_which_none_could_be_used_estimate_nothing(failed):
    text = methods_text(failed)
    assert "No pulse could be used: no impedance was estimated." in text
    assert "was estimated with jointz" not in text


def test_a_pulse_without_a_timing_point_is_counted(recommended):
    nameless = PulseRecord("S01", "a.csv", 1.0, 0.25, 17.0, "", None, None, "no_heel_strikes")
    text = methods_text(replace(recommended, pulses=(pulse(), pulse(), nameless)))
    assert "Of 3 pulses, 2 were used." in text
    assert "Excluded were 1 of 3 pulses" in text


def by_method(analysis, method, *, kind, baseline="", **settings):
    cells = tuple(replace(c, method=method, baseline=baseline) for c in analysis.cells)
    changed = {**analysis.settings, "method": method, "kind": kind, **settings}
    return replace(analysis, cells=cells, settings=changed)


@pytest.mark.parametrize("method", ["dissertation", "weak_form"])
def test_only_walkers_have_bounds(walking, method):
    assert "K, B and J not negative" in methods_text(by_method(walking, method, kind="walking"))
    bench = methods_text(by_method(walking, method, kind="bench"))
    assert "not negative" not in bench
    assert "without bounds" in bench


def test_a_bench_subtracts_a_recording_and_nobody_walks_there(walking):
    text = methods_text(
        by_method(walking, "dissertation", kind="bench", baseline="unperturbed_mean")
    )
    assert "at the same time since the beginning of the cycle" in text
    assert "heel strike, was subtracted" not in text
    assert "Walking was recorded" not in text
    assert "Cycles were detected " in text
    without = replace(walking, strides=())
    text = methods_text(
        by_method(without, "dissertation", kind="bench", baseline="unperturbed_mean")
    )
    assert "at the same time since the beginning." in text


def test_the_dissertation_reports_a_mean_over_resamples_with_its_own_baseline_only(walking):
    told = "The mean over the bootstrap resamples is reported."
    letter = by_method(walking, "dissertation", kind="walking", baseline="unperturbed_mean")
    assert told in methods_text(letter)
    other = by_method(walking, "dissertation", kind="walking", baseline="pre_pulse")
    assert told not in methods_text(other)


def with_interval(analysis, *made):
    cells = tuple(
        replace(c, parameters=tuple(replace(p, ci_method=text) for p in c.parameters))
        for c, text in zip(analysis.cells, cycle(made), strict=False)
    )
    return replace(analysis, cells=cells)


def test_a_jackknife_has_no_resamples_and_is_told_once(walking):
    made = [f"Student's t interval of the delete-one jackknife over {n} pulses" for n in (50, 48)]
    text = methods_text(with_interval(by_method(walking, "pilot", kind="walking"), *made))
    assert "delete-one jackknife over 48 to 50 pulses (Efron 1982)." in text
    assert "Number of resamples" not in text
    assert text.count("delete-one jackknife") == 1


def test_resamples_are_told_where_there_are_any_and_how_they_were_spread(walking):
    made = "percentile interval of 1000 bootstrap resamples of pulses"
    plain = methods_text(with_interval(by_method(walking, "dissertation", kind="walking"), made))
    assert "Number of resamples: 1000, seed 1." in plain
    assert "widened to Student's t" not in plain
    wide = methods_text(with_interval(by_method(walking, "least_squares", kind="walking"), made))
    assert "Deviations of the pulses were widened to Student's t." in wide


@pytest.mark.parametrize(
    ("recorded", "said"),
    [
        (1000.0, "Angle and torque were used as sampled, without a filter."),
        (
            2100.0,
            "Angle and torque were averaged over 2 samples each, resampled to one rate by linear "
            "interpolation, and not filtered otherwise.",
        ),
    ],
)
def test_samples_that_were_averaged_are_not_used_as_sampled(recommended, recorded, said):
    rows = [
        {"participant": p, "recording": "a", "condition": "perturbed", "rate_hz": recorded}
        for p in ("S01", "S02", "S03")
    ]
    text = methods_text(replace(recommended, statistics={"sampling": rows}))
    assert said in text
    assert f"Recordings have {recorded:g} samples per second." in text


def friction(*names):
    return tuple(ParameterEstimate(n, 0.03, 0.02, 0.04, "ok") for n in names)


@pytest.mark.parametrize(
    ("sliding", "said"),
    [
        (1, "against the motion (in 1 of 4 cases) and an offset"),
        (0, "J·acceleration (dissertation, 4.2) with an offset for each trial"),
    ],
)
def test_friction_is_told_where_it_was_in_the_model(bench, sliding, said):
    cells = tuple(
        replace(
            c,
            method="full_record",
            baseline="none",
            nuisance=friction("torque_lag", *["coulomb_friction"] * (k < sliding)),
        )
        for k, c in enumerate(bench.cells)
    )
    settings = {**bench.settings, "method": "full_record"}
    text = methods_text(replace(bench, cells=cells, settings=settings))
    assert said in text
    assert ("may have stopped the motion" in text) == (sliding > 0)


@pytest.mark.parametrize("from_current", [True, False])
def test_friction_is_given_if_the_torque_is_from_current(recommended, from_current):
    changes = {"channels": {"current": {}}, "torque_model": {"gear_ratio": 9.0}}
    text = methods_text(with_study(recommended, **(changes if from_current else {})))
    each = "S01 1.10 ± 0.10, S02 1.10 ± 0.10, S03 1.10 ± 0.10"
    estimate = f"Estimated actual over stated friction of the actuator, ± SD: {each}."
    for said in (estimate, "actual over stated friction 1 ± 0.2;"):
        assert (said in text) is from_current
