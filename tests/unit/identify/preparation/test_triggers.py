"""Pulses from a trigger: noise, bounce, drift, either idle level, and what is refused."""

import numpy as np
import pytest

from jointz.core.errors import DataError
from jointz.core.recording import build_recording
from jointz.identify.preparation.triggers import pulses_from_trigger, triggers_of

RATE_HZ = 1000.0
T = np.arange(120_000) / RATE_HZ
FIRST = 1500 + 4000 * np.arange(29) + np.random.default_rng(1).integers(0, 500, 29)
SIZES = np.tile([4.0, -8.0, 12.0, -4.0], 8)[:29]


def torque(length_s=0.1, *, turn=False):
    total = np.random.default_rng(2).normal(0.0, 0.3, T.size)
    n = round(length_s * RATE_HZ)
    for first, size in zip(FIRST, SIZES, strict=True):
        total[first + 5 : first + 5 + n] += size
        if turn:
            total[first + 5 + n : first + 5 + 2 * n] -= size
    return total


def trigger(*, noise=0.05, length_s=0.1, bounce=True, drift=1.0, low=False):
    levels = np.zeros(T.size)
    n = round(length_s * RATE_HZ)
    for first in FIRST:
        levels[first : first + n] = 1.0
        if bounce:  # drops out after the rise, comes back after the fall
            levels[first + np.array([1, 3, 4, 7])] = 0.0
            levels[first + n + np.array([2, 5, 8])] = 1.0
    volts = 5.0 * (1.0 - levels if low else levels)
    noise_v = noise * np.random.default_rng(3).standard_normal(T.size)
    return volts + noise_v + drift * np.sin(2 * np.pi * T / 150.0)


def recording_of(values, *, follows=None, threshold="", time=T):
    channels = {"trigger": values, "torque": torque() if follows is None else follows}
    return build_recording(time, channels, file="S01.csv", trigger_threshold=threshold)


@pytest.mark.parametrize("noise", [0.0, 0.02, 0.05, 0.1, 0.2])
@pytest.mark.parametrize("low", [False, True])
@pytest.mark.parametrize("length_s", [0.01, 0.1])
def test_onsets_are_those_of_the_trigger_and_shapes_those_of_the_torque(noise, low, length_s):
    values = trigger(noise=noise, low=low, length_s=length_s)

    pulses = pulses_from_trigger(recording_of(values))

    assert [p.onset_s for p in pulses] == T[FIRST].tolist()
    assert {p.duration_s for p in pulses} == {0.1}
    np.testing.assert_allclose([p.amplitude for p in pulses], SIZES, atol=0.25)


def test_a_stated_threshold_is_used_as_it_is():
    ramp = np.clip(np.interp(np.arange(T.size), *ramps()), 0.0, 5.0)
    for threshold in (1.0, 4.0):
        pulses = triggers_of(recording_of(ramp, threshold=str(threshold)))
        late = np.round((np.array([p.onset_s for p in pulses]) - T[FIRST]) * RATE_HZ)
        assert (late == 10 * threshold).all()


def ramps():
    """Corners of rises to 5 V within 50 samples."""
    at = (FIRST[:, None] + [0, 50, 150, 200]).ravel()
    return at, np.tile([0.0, 5.0, 5.0, 0.0], FIRST.size)


def test_spikes_and_missing_samples_start_no_pulse():
    values = trigger()
    values[[700, 9000]] = 60.0, -40.0
    values[800:810] = np.nan
    assert [p.onset_s for p in triggers_of(recording_of(values))] == T[FIRST].tolist()


def test_a_trigger_of_single_samples_counts_where_pulses_are_expected():
    values = np.zeros(T.size)
    values[FIRST] = 5.0
    assert len(pulses_from_trigger(recording_of(values))) == FIRST.size
    assert triggers_of(recording_of(values), brief=False) == ()


def test_triggers_of_two_lengths_are_pulses_of_two_lengths():
    values, follows = np.zeros(T.size), np.zeros(T.size)
    for k, first in enumerate(FIRST):
        values[first : first + [100, 200][k % 2]] = 5.0
        follows[first : first + [100, 200][k % 2]] = SIZES[k]
    pulses = pulses_from_trigger(recording_of(values, follows=follows))
    assert [p.duration_s for p in pulses] == np.resize([0.1, 0.2], FIRST.size).tolist()


def test_a_doublet_has_sign_and_size_of_its_first_phase():
    pulses = pulses_from_trigger(recording_of(trigger(), follows=torque(0.05, turn=True)))
    np.testing.assert_allclose([p.amplitude for p in pulses], SIZES, atol=0.25)
    assert {p.duration_s for p in pulses} == {0.05}


NOISE = np.random.default_rng(0).standard_normal(T.size)


@pytest.mark.parametrize(
    "values",
    [
        np.zeros(T.size),
        0.05 * NOISE,
        T / T[-1] + 0.02 * NOISE,
        np.sin(2 * np.pi * T / 40.0) + 0.001 * NOISE,
        np.sin(2 * np.pi * T),
        0.001 * (NOISE > 2.0),
        np.round(4e-4 * NOISE, 3),
    ],
    ids=["constant", "noise", "drift", "turning drift", "sine", "last digit", "quantised noise"],
)
def test_a_channel_of_one_level_is_no_trigger(values):
    assert triggers_of(recording_of(values), brief=False) == ()
    with pytest.raises(DataError, match=r"S01\.csv, channel 'trigger': .* median of .* range from"):
        pulses_from_trigger(recording_of(values))


def test_a_threshold_that_is_never_crossed_is_named():
    with pytest.raises(DataError, match=r"threshold 9\.0"):
        pulses_from_trigger(recording_of(trigger(), threshold="9.0"))


@pytest.mark.parametrize("motion", [0.0, 3.0])
def test_triggers_without_torque_are_refused(motion):
    follows = NOISE + motion * np.sin(2 * np.pi * 0.9 * T)
    with pytest.raises(DataError, match="expected a pulse of torque after each of its 29 runs"):
        pulses_from_trigger(recording_of(trigger(), follows=follows))


def test_a_threshold_at_the_idle_level_starts_no_pulse():
    values = trigger(noise=0.0, drift=0.0, bounce=False, low=True)
    assert triggers_of(recording_of(values, threshold="5.0")) == ()


@pytest.mark.parametrize("late", [25, 50, 100])
def test_a_trigger_that_comes_after_its_torque_is_refused(late):
    values = np.roll(trigger(bounce=False), late)
    with pytest.raises(DataError, match=r"steps about \d+ ms before its runs"):
        pulses_from_trigger(recording_of(values))


def test_a_level_taken_for_the_idle_one_is_refused():
    values = np.zeros(T.size)
    for first in FIRST:
        values[first - 500 - 3000 : first - 500] = 5.0  # falls half a second before the torque
    with pytest.raises(DataError, match=r"starts 0\.5.* s after its runs"):
        pulses_from_trigger(recording_of(values))
