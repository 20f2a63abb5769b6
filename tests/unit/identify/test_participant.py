"""One participant: several methods, every pulse, stride and gap reported, nothing else matters."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from jointz.core.recording import build_recording
from jointz.core.study import CalibrationSpec, PerturbationsSpec, UserExclusion
from jointz.identify import participant
from jointz.identify.estimators import Estimates
from jointz.identify.participant import analyze_participant
from jointz.identify.preparation.sources import ParticipantSettings, RecordingInput
from jointz.identify.study_kinds import WALKING
from jointz.results.log_posterior import LogPosterior

RATE_HZ = 500.0
TRUTH = np.array([50.0, 1.5, 0.05])
ONSETS = (6.2, 9.2, 12.2, 15.2, 18.2)


def bump(t):
    total = np.zeros((3, t.size))
    for centre, width, height in ((0.055, 0.018, 0.05), (0.11, 0.03, -0.03)):
        z = (t - centre) / width
        g = height * np.exp(-(z**2) / 2)
        total += [g, -g * z / width, g * (z**2 - 1) / width**2]
    return total


def given(condition, *, pulses=(), lag_s=0.0, calibration=None, cut=None):
    t = np.arange(int(24 * RATE_HZ)) / RATE_HZ

    def angle_at(time):
        return 0.3 * np.cos(2 * np.pi * time) + sum(bump(time - p)[0] for p in pulses)

    torque = 3.0 * np.sin(4 * np.pi * t) + sum(TRUTH @ bump(t - p) for p in pulses)
    command = sum((17.0 * ((t >= p) & (t < p + 0.2)) for p in pulses), np.zeros(t.size))
    channels = {
        "angle": angle_at(t - lag_s),
        "torque": torque,
        "command": command,
        "contact": np.arange(t.size) % RATE_HZ < 0.6 * RATE_HZ,
    }
    kept = np.ones(t.size, bool) if cut is None else (t < cut[0]) | (t >= cut[1])
    made = build_recording(
        t[kept],
        {k: v[kept] for k, v in channels.items()},
        condition=condition,
        file=f"{condition}.csv",
        contact_kind="contact",
    )
    return RecordingInput(made, calibration or CalibrationSpec())


def analyzed(*recordings, methods=("dissertation",), exclusions=(), **options):
    settings = ParticipantSettings(
        kind=WALKING,
        perturbations=PerturbationsSpec(),
        methods=methods,
        n_resamples=300,
        mass_kg=70.0,
        user_exclusions=tuple(exclusions),
        coupling="rigid",
        **options,
    )
    return analyze_participant("S01", recordings, settings)


def estimates(result, method="dissertation"):
    return result.cells[method][0].parameters


def test_every_method_has_its_cells_and_the_first_one_codes_the_pulses():
    result = analyzed(
        given("perturbed", pulses=ONSETS), methods=("dissertation", "matched_strides")
    )
    assert {p.code for p in result.pulses} == {"no_baseline"}
    assert estimates(result, "matched_strides")[0].value == pytest.approx(50.0, rel=1e-3)
    assert result.cells["matched_strides"][0].n_used == 5


def test_strides_of_all_recordings_are_reported_with_their_codes():
    line = UserExclusion("S01", "unperturbed.csv", 9.0, "exclude", "stumbled")
    result = analyzed(
        given("unperturbed", pulses=[5.3]), given("perturbed", pulses=ONSETS), exclusions=[line]
    )

    mine = {s.start_s: s.code for s in result.strides if s.condition == "unperturbed"}
    assert mine[5.0] == "pulse_in_stride"
    assert mine[9.0] == "user"
    assert [s.detail for s in result.strides if s.code == "user"] == ["stumbled"]
    assert set(mine.values()) == {"", "pulse_in_stride", "user"}
    # A perturbed recording is there to be perturbed.
    assert {s.code for s in result.strides if s.condition == "perturbed"} == {""}
    assert [s.duration_s for s in result.strides] == pytest.approx([1.0] * len(result.strides))


def test_gaps_are_reported_and_exclude_what_they_touch():
    result = analyzed(given("unperturbed"), given("perturbed", pulses=ONSETS, cut=(12.25, 12.3)))

    (gap,) = result.gaps
    assert (gap.recording, gap.start_s) == ("perturbed.csv", pytest.approx(12.248))
    assert gap.duration_s == pytest.approx(0.052)
    assert [p.code for p in result.pulses] == ["", "", "gap", "", ""]
    assert estimates(result)[0].value == pytest.approx(50.0, rel=1e-3)


def test_a_recording_without_strikes_has_no_strides_to_report():
    perturbed = given("perturbed", pulses=ONSETS)
    silent = RecordingInput(perturbed.recording.drop_vars("contact"), perturbed.calibration)
    result = analyzed(silent)
    assert result.strides == ()
    assert {p.code for p in result.pulses} == {"no_heel_strikes"}
    assert result.cells["dissertation"] == ()


def test_a_posterior_has_session_and_side_of_its_recordings(monkeypatch):
    one, eye = np.zeros(1), np.eye(1)
    posterior = LogPosterior("S01", ("stiffness",), ("LRE",), one, eye, one, eye)

    mine = SimpleNamespace(estimate=lambda *_: Estimates((), (), log_posterior=posterior))
    monkeypatch.setattr(participant, "METHODS", {"mine": mine})
    recording = given("perturbed", pulses=ONSETS)
    recording.recording.attrs |= {"session": "day 2", "side": "left"}

    result = analyzed(recording, methods=("mine",))

    assert result.log_posteriors == (replace(posterior, session="day 2", side="left"),)


@pytest.mark.parametrize("asked", [False, True])
@pytest.mark.parametrize("method", ["dissertation", "pre_pulse", "least_squares"])
def test_two_pulses_give_no_estimate(method, asked):
    def cell(n):
        perturbed = given("perturbed", pulses=ONSETS[:n])
        result = analyzed(
            perturbed, given("unperturbed"), methods=(method,), method_asked_for=asked
        )
        return result.cells[method][0]

    assert {p.status for p in cell(2).parameters} == {"failed:too_few_pulses"}
    assert all(p.value is None for p in cell(2).parameters)
    assert "failed:too_few_pulses" not in {p.status for p in cell(3).parameters}


def test_compared_methods_need_three_pulses_too():
    methods = ("dissertation", "matched_strides")
    result = analyzed(given("perturbed", pulses=ONSETS[:2]), methods=methods)
    assert {p.status for p in estimates(result, "matched_strides")} == {"failed:too_few_pulses"}


@pytest.mark.parametrize("asked", [False, True])
def test_an_inertia_below_that_of_the_device_is_not_ok(asked):
    device = CalibrationSpec(intrinsic_inertia={"value": 0.08, "sd": 0.001})
    perturbed = given("perturbed", pulses=ONSETS, calibration=device)
    result = analyzed(perturbed, given("unperturbed"), method_asked_for=asked)
    stiffness, _, inertia, *_ = estimates(result)
    assert (inertia.value, inertia.status) == (None, "failed:below_zero")
    assert inertia.unbounded == pytest.approx(0.05 - 0.08, abs=0.003)
    assert stiffness.status == "ok"
