"""Phase in real time: which strides are believed, when it is none, and the knee's opinion."""

from math import nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jointz.core.protocols.protocol_models import GaitSpec
from jointz.rig.experiment.gait.phase_predictor import KneePhase, StridePhase

GAIT = GaitSpec(speed_m_s=1.2)  # mean of 5, band 0.75 to 1.33, steady after 3
STRIDE_NS = 1_100_000_000
T0 = 10_000_000


def struck(times_ns, **gait):
    """Return a phase after strikes, and what each of them was."""
    phase = StridePhase(GAIT.model_copy(update=gait))
    return phase, [phase.strike(round(time)) for time in times_ns]


def strikes(*durations_s, start_ns=T0):
    """Return the times of strikes with given strides between them."""
    return (start_ns + np.cumsum([0.0, *durations_s]) * 1e9).round().astype(int).tolist()


def walked(strides=8, **gait):
    """Return a phase in steady gait and the time of its last strike."""
    times = strikes(*[1.1] * strides)
    return struck(times, **gait)[0], times[-1]


# --- strides ------------------------------------------------------------------------------------


def test_phase_is_time_since_the_strike_over_the_mean_of_five():
    durations = [1.0, 1.2, 1.0, 1.1, 1.05, 1.15, 1.1]
    times = strikes(*durations)
    phase, accepted = struck(times)
    assert accepted == [False] + [True] * 7
    mean_s = sum(durations[-5:]) / 5
    assert phase.mean_ns == pytest.approx(mean_s * 1e9, abs=1)
    for share in (0.0, 0.07, 0.81, 1.05):
        at = times[-1] + round(share * mean_s * 1e9)
        assert phase.steady(at)
        assert phase.phase_pct(at) == pytest.approx(100 * share, abs=1e-6)


@pytest.mark.parametrize("n", [1, 3, 20])
def test_the_mean_is_of_as_many_strides_as_the_protocol_says(n):
    durations = (1.0 + 0.01 * np.arange(24)).tolist()
    phase, _ = struck(strikes(*durations), strides_in_mean=n)
    assert phase.mean_ns == pytest.approx(1e9 * np.mean(durations[-n:]), abs=1)


@pytest.mark.parametrize("after", [1, 3, 6])
def test_gait_is_steady_after_as_many_accepted_strides_as_the_protocol_says(after):
    times = strikes(*[1.1] * (after + 1))
    phase = StridePhase(GAIT.model_copy(update={"steady_after_strides": after}))
    for number, time in enumerate(times):
        phase.strike(time)
        assert phase.steady(time + 1) is (number >= after)


@pytest.mark.parametrize(
    ("share", "verdict"), [(0.74, "spurious"), (0.76, ""), (1.32, ""), (1.34, "missing")]
)
def test_a_stride_is_accepted_inside_the_band_around_the_mean(share, verdict):
    phase, last = walked()
    assert phase.strike(last + round(share * STRIDE_NS)) is (verdict == "")
    assert (phase.spurious, phase.missing) == (verdict == "spurious", verdict == "missing")


# --- doubt and recovery -------------------------------------------------------------------------


def test_a_spurious_strike_makes_the_phase_none_until_the_next_true_one():
    phase, last = walked()
    spurious = last + STRIDE_NS // 3
    assert phase.steady(spurious)
    assert not phase.strike(spurious)
    assert not phase.steady(spurious)
    assert not phase.steady(last + STRIDE_NS - 1)
    assert phase.strike(last + STRIDE_NS)
    assert phase.steady(last + STRIDE_NS)
    assert phase.phase_pct(last + STRIDE_NS) == 0.0
    assert phase.mean_ns == STRIDE_NS


def test_a_lost_strike_makes_the_phase_none_until_gait_is_steady_again():
    phase, last = walked()
    due = last + STRIDE_NS
    assert phase.steady(due)
    assert phase.steady(last + round(1.33 * STRIDE_NS))
    assert not phase.steady(last + round(1.33 * STRIDE_NS) + 2)
    assert not phase.strike(due + STRIDE_NS)
    for k in range(1, 4):
        assert not phase.steady(due + k * STRIDE_NS + 1)
        assert phase.strike(due + (k + 1) * STRIDE_NS)
    assert phase.steady(due + 4 * STRIDE_NS)
    assert phase.mean_ns == STRIDE_NS


@pytest.mark.parametrize("factor", [0.7, 1.4, 1.8])
def test_another_cadence_is_learnt_after_three_strangers(factor):
    phase, last = walked()
    times = strikes(*[1.1 * factor] * 12, start_ns=last)[1:]
    accepted = [phase.strike(time) for time in times]
    assert not any(accepted[:3])
    assert all(accepted[-6:])
    assert phase.spurious + phase.missing == 3
    assert phase.steady(times[-1])
    assert phase.mean_ns == pytest.approx(1.1e9 * factor, abs=1)


@pytest.mark.parametrize("factor", [0.5, 0.55, 0.6, 0.65])
def test_a_cadence_so_quick_that_two_strides_pass_for_one_is_learnt_too(factor):
    phase, last = walked()
    times = strikes(*[1.1 * factor] * 16, start_ns=last)[1:]
    accepted = [phase.strike(time) for time in times]
    assert all(accepted[-6:])
    assert phase.steady(times[-1])
    assert phase.mean_ns == pytest.approx(1.1e9 * factor, abs=1)


@pytest.mark.parametrize("variation", [0.0, 0.025, 0.0375])
def test_two_strides_do_not_pass_for_one_when_a_strike_was_missed_at_first(variation):
    rng = np.random.default_rng(4)
    times = strikes(*(1.1 * (1.0 + variation * rng.standard_normal(40))))
    phase, _ = struck(times[:1] + times[2:])  # the second strike was lost
    assert phase.mean_ns == pytest.approx(1.1e9, rel=0.05)
    assert phase.steady(times[-1])
    assert phase.strides > 30


def test_a_strike_that_is_taken_back_leaves_no_trace_but_doubt():
    phase, last = walked()
    early = last + round(0.85 * STRIDE_NS)
    assert phase.strike(early)
    phase.retract()
    assert (phase.strides, phase.spurious, phase.mean_ns) == (8, 1, STRIDE_NS)
    assert not phase.steady(early + 1)
    assert phase.strike(last + STRIDE_NS)
    assert phase.steady(last + STRIDE_NS)
    assert (phase.strides, phase.mean_ns) == (9, STRIDE_NS)


def test_a_cadence_that_a_false_strike_made_forgotten_is_known_again():
    phase, last = walked()
    for share in (0.2, 0.4, 0.6):
        phase.strike(last + round(share * STRIDE_NS))
    assert phase.mean_ns == 0.0
    phase.retract()
    assert phase.mean_ns == STRIDE_NS
    assert phase.strike(last + STRIDE_NS)


# --- properties ---------------------------------------------------------------------------------

anything = st.lists(st.floats(0.3, 4.0), min_size=1, max_size=60)


@given(anything)
def test_whatever_comes_steady_means_three_strides_in_a_band_and_a_phase_that_is_finite(durations):
    phase = StridePhase(GAIT)
    run = 0
    times = strikes(*durations)
    for number, time in enumerate(times):
        taken = phase.strike(time)
        before = phase.mean_ns
        run = run + 1 if taken else run
        if phase.steady(time):
            assert run >= 3
            assert 0.0 <= phase.phase_pct(time) <= 100.0 * GAIT.accepted_band[1]
            assert 0.5e9 * 0.75 <= before <= 2.5e9 * 1.33**20
        assert phase.strides == run
        assert phase.strides + phase.spurious + phase.missing == number
        if not taken and number:
            assert not phase.steady(time)


@given(anything)
def test_any_history_is_left_behind_after_16_even_strides(durations):
    # A strike may be taken for spurious and two strides for one, but not for ever.
    times = strikes(*durations, *[1.1] * 16)
    phase, _ = struck(times)
    assert phase.steady(times[-1])
    assert phase.mean_ns == pytest.approx(1.1e9, abs=1)


# --- the knee -----------------------------------------------------------------------------------


def knee_rad(cycles):
    """A knee like those of walking people: 15 deg in stance, 64 deg in swing at 72.2 %."""

    def bump(middle, width, height):
        return height * np.exp(-0.5 * (((cycles - middle + 0.5) % 1 - 0.5) / width) ** 2)

    return np.deg2rad(4.0 + bump(0.14, 0.07, 15.0) + bump(0.722, 0.095, 60.0))


def knee_error_pct(angle, *, strides, rate_hz, from_stride=3.0):
    """Return estimated minus true phase of a walk whose cycles are given, sample by sample."""
    phase = KneePhase(GAIT)
    errors = []
    for i, (value, cycle) in enumerate(zip(angle.tolist(), strides.tolist(), strict=True)):
        time_ns = round(i * 1e9 / rate_hz)
        phase.update(time_ns, value)
        if cycle > from_stride:
            errors.append((phase.phase_pct(time_ns) - 100 * cycle + 50) % 100 - 50)
    return np.array(errors)


@pytest.mark.parametrize("rate_hz", [100.0, 500.0, 1000.0])
def test_a_clean_knee_tells_the_phase_to_a_sample(rate_hz):
    cycles = np.arange(round(20 * 1.1 * rate_hz)) / (1.1 * rate_hz)
    error = knee_error_pct(knee_rad(cycles), strides=cycles, rate_hz=rate_hz)
    assert np.abs(error).max() < 100.0 / (1.1 * rate_hz) + 0.1


def test_noise_of_a_goniometer_does_not_end_a_swing_early():
    rng = np.random.default_rng(3)
    cycles = np.arange(round(100 * 1.1 * 500)) / (1.1 * 500)
    noisy = knee_rad(cycles) + np.deg2rad(1.0) * rng.standard_normal(cycles.size)
    error = knee_error_pct(noisy, strides=cycles, rate_hz=500.0)
    assert abs(error.mean()) < 1.0
    assert np.abs(error).max() < 4.0


def test_missing_samples_of_the_knee_change_nothing():
    cycles = np.arange(20 * 550) / 550
    whole = knee_rad(cycles)
    holed = whole.copy()
    holed[np.arange(whole.size) % 11 == 5] = nan
    error = knee_error_pct(holed, strides=cycles, rate_hz=500.0)
    assert np.abs(error).max() < 0.5


def test_a_pause_of_walking_is_no_stride():
    phase = KneePhase(GAIT)
    cycles = np.arange(6 * 550) / 550
    angle = np.concatenate([knee_rad(cycles), np.full(5000, 0.1), knee_rad(cycles)])
    for i, value in enumerate(angle.tolist()):
        phase.update(i * 2_000_000, value)
    at_ns = (angle.size - 1) * 2_000_000
    assert phase.phase_pct(at_ns) == pytest.approx(100.0, abs=0.5) or phase.phase_pct(
        at_ns
    ) == pytest.approx(0.0, abs=0.5)


def test_a_second_bend_within_half_a_second_is_no_swing():
    cycles = np.arange(20 * 550) / 550
    stumbled = knee_rad(cycles)
    at = (cycles > 10.95) & (cycles < 11.0)
    stumbled[at] = 0.8  # the knee gives way a quarter of a second after swing
    error = knee_error_pct(stumbled, strides=cycles, rate_hz=500.0)
    assert np.abs(error).max() < 0.3
