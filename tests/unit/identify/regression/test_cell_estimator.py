"""Every cell by one method: whose strides serve, what fails and why, what is counted."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from jointz.core.gait_phases import mean_phase
from jointz.core.recording import build_recording
from jointz.core.study import Calibrated, CalibrationSpec, PerturbationsSpec
from jointz.identify.estimators import METHODS
from jointz.identify.preparation.assignment import assign_pulses
from jointz.identify.preparation.sources import ParticipantSettings, RecordingInput, prepare_sources
from jointz.identify.regression import cell_resampling
from jointz.identify.regression.cell_estimator import CellEstimator
from jointz.identify.study_kinds import BENCH, WALKING
from jointz.kernels.resampling import resample_weights

RATE_HZ = 500.0
TRUTH = (50.0, 1.5, 0.05)


def bump(t):
    total = np.zeros((3, t.size))
    for centre, width, height in ((0.055, 0.018, 0.05), (0.11, 0.03, -0.03)):
        z = (t - centre) / width
        g = height * np.exp(-(z**2) / 2)
        total += [g, -g * z / width, g * (z**2 - 1) / width**2]
    return total


def record(
    condition="perturbed", onsets=(), *, n=25, level=0.0, strikes=True, names=None, **attributes
):
    """Strides of 1 s; the torque of the cycle is not of the model."""
    t = np.arange(int(n * RATE_HZ)) / RATE_HZ
    angle = level + 0.3 * np.cos(2 * np.pi * t)
    torque = 3.0 * np.sin(4 * np.pi * t) - 10 * level
    for onset in onsets:
        response = bump(t - onset)
        angle = angle + response[0]
        torque = torque + np.array(TRUTH) @ response
    channels = {"angle": angle, "torque": torque}
    if strikes:
        channels["contact"] = np.arange(t.size) % RATE_HZ < 0.6 * RATE_HZ
    attributes = {"file": f"{condition}.csv", "contact_kind": "contact", **attributes}
    table = None
    if condition == "perturbed":
        table = pd.DataFrame(
            {
                "onset_s": np.asarray(onsets, dtype=float),
                "duration_s": 0.2,
                "amplitude_nm": 17.0,
                "timing_point": names if names is not None else "",
            }
        )
    made = build_recording(t, channels, condition=condition, **attributes)
    return RecordingInput(made, CalibrationSpec(), table)


def run(*given, method="dissertation", walking=True, **more):
    settings = ParticipantSettings(
        kind=WALKING if walking else BENCH,
        perturbations=PerturbationsSpec(**more),
        methods=(method,),
        n_resamples=50,
    )
    sources = prepare_sources(given, settings)
    estimator = CellEstimator("S01", METHODS[method], sources, settings)
    return estimator.run(assign_pulses("S01", sources, settings, baseline=estimator.baseline))


def values(cell):
    return [p.value for p in cell.parameters[:3]]


def test_pulses_used_and_left_out_are_counted_at_their_timing_point():
    onsets = [1.2, 6.2, 10.2, 14.2, 18.2]
    given = record(onsets=onsets, names=["MST"] * 5)
    (cell,), records = run(record("unperturbed"), given)

    assert [r.code for r in records] == ["no_recent_strides", "", "", "", ""]
    assert (cell.timing_point, cell.n_used, cell.n_excluded) == ("MST", 4, 1)
    assert cell.onset_gait_pct == pytest.approx(20.0, abs=0.5)
    np.testing.assert_allclose(values(cell), TRUTH, rtol=1e-3)


def test_calibrations_of_several_sessions_are_pooled_in_any_order():
    def session(name, stiffness):
        known = CalibrationSpec(intrinsic_stiffness=Calibrated(value=stiffness, sd=2.0))
        onsets = [6.2, 10.2, 14.2]
        return [
            replace(record(c, o, session=name, file=f"{c}{name}"), calibration=known)
            for c, o in (("unperturbed", ()), ("perturbed", onsets))
        ]

    first, second = session("1", 10.0), session("2", 20.0)
    (cell,), _ = run(*first, *second)
    (turned,), _ = run(*second, *first)
    (alone,), _ = run(*first)

    np.testing.assert_allclose(values(cell), np.array(TRUTH) - [15.0, 0.0, 0.0], rtol=1e-3)
    np.testing.assert_allclose(values(turned), values(cell), rtol=1e-6)
    width, widest = (p.parameters[0].ci_high - p.parameters[0].ci_low for p in (cell, alone))
    assert width < 0.95 * widest  # two errors of 2 N*m/rad that know nothing of each other


def test_a_session_without_unperturbed_strides_takes_those_of_the_others():
    given = [
        record("unperturbed", session="1", file="u"),
        record(onsets=[6.2, 10.2], session="2", file="p"),
    ]
    (cell,), _ = run(*given)
    np.testing.assert_allclose(values(cell), TRUTH, rtol=1e-3)


def test_trials_of_a_bench_take_the_reference_of_their_own_trial():
    given = [
        record(
            c,
            [6.2, 10.2] if c == "perturbed" else (),
            level=level,
            trial=trial,
            strikes=False,
            file=f"{c}{trial}",
        )
        for trial, level in (("A", 0.0), ("B", 0.4))
        for c in ("unperturbed", "perturbed")
    ]
    cells, _ = run(*given, walking=False, source="table")

    assert [c.timing_point for c in cells] == ["A", "B"]
    for cell in cells:
        np.testing.assert_allclose(values(cell), TRUTH, rtol=1e-3)
        assert cell.onset_gait_pct is None
        assert len(cell.parameters) == 3


@pytest.mark.parametrize(("walking", "runs"), [(True, {4}), (False, {1})])
def test_strides_are_resampled_in_runs_and_trials_of_a_bench_one_by_one(walking, runs, monkeypatch):
    drawn = []

    def seen(count, n_resamples, rng, *, block=1):
        drawn.append((count, block))
        return resample_weights(count, n_resamples, rng, block=block)

    monkeypatch.setattr(cell_resampling, "resample_weights", seen)
    pulses = [6.2, 8.2, 10.2]
    given = [record("unperturbed"), record("perturbed", pulses)]
    run(*given, method="least_squares", walking=walking, source="table",
        baseline="unperturbed_mean")  # fmt: skip

    assert {block for count, block in drawn if count != len(pulses)} == runs


def test_strides_that_hold_or_follow_a_pulse_never_serve():
    """A response that lasts into the next stride would spoil a match with it."""
    onsets = [6.93, 9.93, 12.93, 15.93, 18.93]
    (cell,), records = run(
        record(onsets=onsets), method="matched_strides", timing_points={"TSW": 93.5}
    )

    assert [r.code for r in records] == [""] * 5
    np.testing.assert_allclose(values(cell), TRUTH, rtol=1e-3)


def test_without_free_strides_there_is_no_baseline():
    onsets = np.arange(0.2, 25.0)  # in every stride
    names = ["MST"] * len(onsets)
    (cell,), records = run(record(onsets=onsets, names=names), method="matched_strides")

    assert {r.code for r in records} == {"no_recent_strides", "no_baseline"}
    assert (cell.n_used, cell.n_excluded) == (0, len(onsets))
    assert {p.status for p in cell.parameters} == {"failed:no_unperturbed_strides"}


def test_without_an_unperturbed_recording_the_method_says_so():
    (cell,), records = run(record(onsets=[6.2, 10.2]))
    assert {r.code for r in records} == {"no_baseline"}
    assert {p.status for p in cell.parameters} == {"failed:no_unperturbed_recording"}


def test_an_unperturbed_recording_without_strikes_gives_no_strides():
    (cell,), _ = run(record("unperturbed", strikes=False), record(onsets=[6.2, 10.2]))
    assert {p.status for p in cell.parameters} == {"failed:no_unperturbed_strides"}


@pytest.mark.parametrize("method", ["dissertation", "matched_strides"])
def test_named_pulses_without_strikes_have_no_baseline_over_strides(method):
    given = record(onsets=[6.2, 10.2], strikes=False, names=["MST", "MST"])
    _, records = run(record("unperturbed"), given, method=method)
    assert {r.code for r in records} == {"no_baseline"}


def test_named_pulses_without_strikes_are_estimated_from_their_own_level():
    t = np.arange(12_500) / RATE_HZ
    response = bump(t - 6.2) + bump(t - 10.2)
    given = record(onsets=[6.2, 10.2], strikes=False, names=["MST", "MST"])
    quiet = given.recording.assign(
        angle=("time", response[0], {"units": "rad"}),
        torque=("time", np.array(TRUTH) @ response, {"units": "N*m"}),
    )
    (cell,), _ = run(
        RecordingInput(quiet, given.calibration, given.pulse_table), baseline="pre_pulse"
    )

    assert cell.baseline == "pre_pulse"
    assert cell.onset_gait_pct is None
    np.testing.assert_allclose(values(cell), TRUTH, rtol=1e-3)


@pytest.mark.parametrize(
    ("onsets", "status"),
    [([6.2], "failed:too_few_pulses"), ([1.2, 2.2], "failed:all_pulses_excluded")],
)
def test_a_cell_without_two_pulses_fails_with_a_reason(onsets, status):
    given = record(onsets=onsets, names=["MST"] * len(onsets))
    (cell,), _ = run(record("unperturbed"), given)
    assert {p.status for p in cell.parameters} == {status}
    assert (cell.n_used, cell.n_excluded) == (0, len(onsets))


def test_named_pulses_with_a_dead_contact_are_estimated_from_their_own_level():
    given = record(onsets=[1.2, 6.2, 10.2], names=["MST"] * 3)
    silent = given.recording.assign(contact=0.0 * given.recording["contact"])
    dead = replace(given, recording=silent)
    (cell,), records = run(dead, baseline="pre_pulse")

    assert [r.code for r in records] == [""] * 3
    assert (cell.n_used, cell.onset_gait_pct) == (3, None)
    (strides,), _ = run(record("unperturbed"), dead)
    assert {p.status for p in strides.parameters} == {"failed:no_heel_strikes"}


def test_a_pulse_that_alone_has_a_baseline_is_lone():
    # The unperturbed record ends before the later pulse's time since its strike.
    unperturbed = record("unperturbed", n=6, strikes=False, file="u", trial="")
    given = record(onsets=[2.2, 10.2], strikes=False, file="p", trial="")
    (cell,), records = run(unperturbed, given, walking=False, source="table")

    assert [r.code for r in records] == ["lone_pulse", "no_baseline"]
    assert (cell.n_used, cell.n_excluded) == (0, 2)


@pytest.mark.parametrize("channel", ["angle", "torque"])
def test_a_dead_sensor_gives_no_response_though_the_baseline_moves(channel):
    given = record(onsets=[6.2, 10.2, 14.2])
    still = given.recording.assign({channel: 0.0 * given.recording[channel] + 0.3})
    dead = RecordingInput(still, given.calibration, given.pulse_table)
    (cell,), records = run(record("unperturbed"), dead)

    assert {p.status for p in cell.parameters} == {f"failed:constant_{channel}"}
    assert [r.code for r in records] == [f"constant_{channel}"] * 3
    assert (cell.n_used, cell.n_excluded) == (0, 3)


def test_pulses_after_a_sensor_died_are_left_out_and_the_others_stand():
    given = record(onsets=[6.2, 10.2, 14.2])
    time = given.recording["time"]
    angle = given.recording["angle"].where(time < 13.0, 0.2)
    dead = RecordingInput(given.recording.assign(angle=angle), given.calibration, given.pulse_table)
    (cell,), records = run(record("unperturbed"), dead)
    assert [r.code for r in records] == ["", "", "constant_angle"]
    assert (cell.n_used, cell.n_excluded) == (2, 1)


def test_themean_phase_is_taken_on_the_circle():
    assert mean_phase([98.0, 2.0, 3.0]) == pytest.approx(1.0, abs=0.01)
    assert mean_phase([10.0, None]) == pytest.approx(10.0)
    assert mean_phase([None]) is None
