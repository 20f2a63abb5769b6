"""What angle and torque would have been without a pulse."""

from dataclasses import replace

import numpy as np
import pytest

from jointz.core.study import PerturbationsSpec
from jointz.identify.prediction.unperturbed_prediction import LEAD_SAMPLES, UnperturbedPredictor
from jointz.identify.preparation.assignment import assign_pulses
from jointz.identify.preparation.raw_signals import raw_signals
from jointz.identify.preparation.sources import ParticipantSettings, prepare_sources
from jointz.identify.study_kinds import WALKING

WINDOW_S = 0.13


def prepared(walker, given):
    settings = ParticipantSettings(
        kind=WALKING,
        perturbations=PerturbationsSpec(timing_points=dict(walker.points), source="table"),
        n_resamples=10,
    )
    source = prepare_sources([given], settings)[0]
    candidates = assign_pulses("S01", [source], settings, baseline="predicted", alone=True)
    return source, candidates


def predicted(walker, given, point="A"):
    source, candidates = prepared(walker, given)
    predictor = UnperturbedPredictor(source, raw_signals(source), window_s=WINDOW_S)
    chosen = [c for c in candidates if c.record.timing_point == point and not c.record.code]
    return predictor.predict(chosen)


@pytest.fixture(scope="module")
def idle(walkers):
    """A walker whose pulses have no torque, so that every response is a miss."""
    walker = walkers.Walker(sizes_nm=(1e-9,), counts={"A": 40, "B": 40})
    return walker, walkers.walk(walker)


def test_pulses_without_torque_are_predicted_as_well_as_virtual_ones(idle):
    found = predicted(*idle)
    pulses, misses = (np.sqrt((x[:, 0] ** 2).mean()) for x in (found.responses, found.misses))
    assert pulses == pytest.approx(misses, rel=0.25)
    # 0.3 deg of the sensor and what nobody can foresee of 1 deg of wandering.
    assert np.radians(0.3) < misses < np.radians(1.0)


def test_the_mean_response_of_nothing_is_zero_within_its_error(idle):
    found = predicted(*idle)
    mean = found.responses[:, 0].mean(axis=0)
    sd = found.misses[:, 0].std(axis=0) * np.sqrt(1.0 / 40 + 1.0 / found.n_strides)
    assert np.sqrt(np.mean((mean / sd) ** 2)) < 2.0


def test_prediction_from_the_past_beats_the_mean_of_the_same_strides(walkers, idle):
    walker, given = idle
    source, candidates = prepared(walker, given)
    signals = raw_signals(source)
    onsets = np.array([c.pulse.onset_s for c in candidates if c.record.timing_point == "A"])
    windows, _ = signals.cut(onsets, before_s=0.0, after_s=WINDOW_S, rows=slice(0, 1))
    found = predicted(walker, given)
    by_mean = windows[:, 0].std(axis=0).mean()
    assert np.sqrt((found.responses[:, 0] ** 2).mean()) < 0.8 * by_mean


def test_responses_are_turned_by_the_sign_of_their_pulse(walkers):
    walker = walkers.Walker(signs=(1.0, -1.0))
    found = predicted(walker, walkers.walk(walker))
    late = found.responses[:, :, 45:]
    assert np.all(late[:, 0].mean(axis=1) > 0.0)
    assert late[:, 1].mean(axis=1) == pytest.approx(17.0, abs=0.5)


def test_virtual_onsets_keep_clear_of_pulses_and_spread_over_strides(walkers, idle):
    walker = walkers.Walker()
    found = predicted(walker, walkers.walk(walker))
    bare = predicted(
        replace(walker, sizes_nm=(1e-9,)), walkers.walk(replace(walker, sizes_nm=(1e-9,)))
    )
    # A pulse in a virtual window would be a miss of 10 deg.
    assert np.abs(found.misses[:, 0]).max() < 1.5 * np.abs(bare.misses[:, 0]).max()
    assert np.bincount(found.strides).max() <= 2


@pytest.mark.parametrize("pct", [0.0, 0.5, 99.5])
def test_pulses_about_a_heel_strike_are_all_kept(walkers, pct):
    walker = walkers.Walker(points={"A": pct, "B": 70.0})
    found = predicted(walker, walkers.walk(walker))
    assert set(found.codes) == {""}
    # Some lie before their strike and some behind it.
    assert np.sqrt((found.misses[:, 0] ** 2).mean()) < np.radians(1.0)


def test_a_step_like_no_other_is_left_out(walkers):
    walker = walkers.Walker()
    given = walkers.walk(walker)
    time = given.recording["time"].to_numpy()
    _, candidates = prepared(walker, given)
    first = next(c for c in candidates if c.record.timing_point == "A").pulse.onset_s
    recording = given.recording.copy(deep=True)
    stumble = np.where((time > first - 0.3) & (time < first), 0.6, 0.0)
    recording["angle"] = recording["angle"] + stumble
    found = predicted(walker, replace(given, recording=recording))
    assert found.codes[0] == "unusual_gait"
    assert set(found.codes[1:]) == {""}
    assert len(found.responses) == len(found.codes) - 1


def test_without_strides_to_learn_from_every_pulse_says_so(walkers):
    walker = walkers.Walker(between=1, counts={"A": 4, "B": 4})
    found = predicted(walker, walkers.walk(walker))
    assert set(found.codes) == {"no_baseline"}
    assert found.responses.shape == (0, 3, 66 + LEAD_SAMPLES)
    assert found.n_strides == 0


def test_posture_is_that_of_the_joint_where_another_recording_teaches(walkers, idle):
    walker = walkers.Walker(between=1, counts={"A": 6, "B": 6})
    source, candidates = prepared(walker, walkers.walk(walker))
    teacher, _ = prepared(*idle)
    signals = raw_signals(source)
    others = [(teacher, raw_signals(teacher))]
    predictor = UnperturbedPredictor(source, signals, window_s=WINDOW_S, others=others)
    chosen = [c for c in candidates if c.record.timing_point == "A" and not c.record.code]
    found = predictor.predict(chosen)
    assert found.n_strides > 0
    # Posture wanders by 1 degree from stride to stride.
    usual = predicted(*idle).posture_rad
    assert found.posture_rad == pytest.approx(usual, abs=np.radians(3.0))
