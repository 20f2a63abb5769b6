import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jointz.core.errors import DataError, EstimationError
from jointz.core.recording import build_recording
from jointz.gait.heel_strikes import (
    find_heel_strikes,
    is_unclean_switch,
    strikes_from_contact,
    strikes_from_cycle,
    strikes_from_force,
    strikes_from_pulse,
    strikes_from_voltage,
)
from jointz.gait.strides import find_strides

RATE = 1000.0
NO_GAPS = np.empty((0, 2))


def walk(n=30, stride=1.1, sd=0.025, seed=0, start=0.605):
    """Return time stamps, heel strikes and the contact (62 % stance) of a walk."""
    rng = np.random.default_rng(seed)
    strikes = start + np.concatenate([[0.0], np.cumsum(stride * (1 + sd * rng.normal(size=n - 1)))])
    time = np.arange(0.0, strikes[-1] + 0.9, 1.0 / RATE)
    return time, strikes, contact_of(time, strikes, 0.62 * stride)


def contact_of(time, strikes, stance):
    since = time - strikes[np.maximum(np.searchsorted(strikes, time, side="right") - 1, 0)]
    return ((since >= 0) & (since < stance)).astype(float)


def force_of(contact, load=750.0):
    """Smooth a contact into a force that rises to half its load in about 20 ms."""
    ramp = np.hanning(81)
    return load * np.convolve(contact, ramp / ramp.sum(), mode="same")


def switched(signal, time, from_s, to_s, level):
    out = signal.copy()
    out[(time >= from_s) & (time < to_s)] = level
    return out


def assert_strikes(found, expected, within_s=1.01 / RATE):
    assert found.time_s.size == expected.size
    np.testing.assert_allclose(found.time_s, expected, rtol=0, atol=within_s)


@pytest.mark.parametrize(("low", "high"), [(0.0, 1.0), (-3.0, -1.0), (2.0, 2.001)])
@pytest.mark.parametrize("start", [0.605, -0.2])
def test_a_clean_contact_gives_its_strikes_to_the_sample(low, high, start):
    time, strikes, contact = walk(start=start)
    found = strikes_from_contact(time, low + (high - low) * contact)
    assert_strikes(found, strikes[strikes > 0.0])  # none where it begins in stance
    assert found.rejected_s.size == 0
    assert low < found.low < found.high < high


def is_noted(time, signal, kind="contact"):
    return is_unclean_switch(build_recording(time, {"contact": signal}, contact_kind=kind))


def drifting(time, contact, *, decimals=6):
    """Return a footswitch in volts that wanders by 2 % of its swing, as examples/own_data has."""
    noise = 0.02 * np.random.default_rng(4).standard_normal(time.size)
    volts = 0.31 + 4.31 * contact + 0.08 * np.sin(2 * np.pi * time / 70.0) + noise
    return volts.round(decimals)


@pytest.mark.parametrize("decimals", [1, 6])
def test_a_voltage_that_is_declared_as_a_switch_is_noticed(decimals):
    time, _, contact = walk()
    volts = drifting(time, contact, decimals=decimals)
    assert is_noted(time, volts)
    assert not is_noted(time, volts, kind="voltage")
    assert is_noted(time, force_of(contact) + 30.0 * np.sin(time))


@pytest.mark.parametrize(("low", "high"), [(0.0, 1.0), (0.2, 4.8)])
@pytest.mark.parametrize("rate_hz", [1000.0, 100.0])
def test_a_real_switch_is_no_voltage(low, high, rate_hz):
    time, strikes, contact = walk()
    for s in strikes:
        contact = switched(contact, time, s + 0.002, s + 0.004, 0.0)
    every = round(RATE / rate_hz)
    time, signal = time[::every], low + (high - low) * contact[::every]
    ramped = np.convolve(signal, [0.2, 0.5, 0.2, 0.1], mode="same")  # the ends are not its own
    for one in (signal, ramped[2:-2], switched(signal, time, 3.0, 6.0, np.nan)):
        assert not is_noted(time[: one.size], one)
    ripple = 0.002 * (high - low) * np.random.default_rng(1).standard_normal(time.size)
    assert not is_noted(time, signal + ripple)


def test_several_switches_on_a_channel_and_none_are_no_voltage():
    time, strikes, contact = walk()
    toe = contact_of(time, strikes + 0.2, 0.6)
    assert not is_noted(time, contact + 2.0 * toe)
    assert not is_noted(time, np.zeros(time.size))
    assert not is_noted(time, np.full(time.size, np.nan))
    assert not is_unclean_switch(build_recording(time, {"angle": contact}, contact_kind="contact"))


def test_chatter_at_the_strike_and_at_toe_off_is_bounce():
    time, strikes, contact = walk()
    for s in strikes:
        for edge in (s, s + 0.682):
            contact = switched(contact, time, edge + 0.002, edge + 0.004, 0.0)
            contact = switched(contact, time, edge + 0.006, edge + 0.009, 1.0)
            contact = switched(contact, time, edge + 0.010, edge + 0.014, 0.0)
    found = strikes_from_contact(time, contact)
    assert_strikes(found, strikes)
    assert found.rejected_s.size > strikes.size


@pytest.mark.parametrize("into_stance_s", [0.05, 0.6])
def test_brief_drop_outs_in_stance_are_no_strikes(into_stance_s):
    time, strikes, contact = walk()
    for s in strikes:
        contact = switched(contact, time, s + into_stance_s, s + into_stance_s + 0.06, 0.0)
    assert_strikes(strikes_from_contact(time, contact), strikes)


@pytest.mark.parametrize("into_swing_s", [0.03, 0.3])
def test_brief_false_contacts_in_swing_are_no_strikes(into_swing_s):
    time, strikes, contact = walk(sd=0.0)
    for s in strikes[::3]:
        begin = s + 0.682 + into_swing_s
        contact = switched(contact, time, begin, begin + 0.02, 1.0)
    assert_strikes(strikes_from_contact(time, contact), strikes)


def test_a_long_false_contact_late_in_the_stride_does_not_replace_the_strike():
    time, strikes, contact = walk(sd=0.0)
    contact = switched(contact, time, strikes[12] + 0.76, strikes[12] + 0.86, 1.0)
    found = strikes_from_contact(time, contact)
    assert_strikes(found, strikes)
    np.testing.assert_allclose(found.rejected_s, strikes[12] + 0.76, atol=0.0011)


@pytest.mark.parametrize("level", [0.0, 1.0])
def test_five_seconds_without_strikes_cost_only_their_own_stride(level):
    time, strikes, contact = walk(n=40)
    quiet = (strikes > 20.0) & (strikes < 25.0)
    from_s, to_s = strikes[quiet][0] - 0.02, strikes[quiet][-1] + 0.85
    found = strikes_from_contact(time, switched(contact, time, from_s, to_s, level))
    stands = ~quiet if level == 0.0 else ~((strikes > from_s) & (strikes < to_s))
    assert abs(found.time_s.size - stands.sum()) <= 1
    strides = find_strides(found.time_s, NO_GAPS)
    assert strides.code.count("missing_strike") == 1
    assert (~strides.accepted).sum() == 1


def test_strikes_survive_a_lasting_change_of_cadence():
    strikes = 0.5 + np.concatenate([np.arange(20) * 0.9, 19 * 0.9 + 1.6 * np.arange(1, 21)])
    time = np.arange(0, strikes[-1] + 1.2, 1 / RATE)
    found = strikes_from_contact(time, contact_of(time, strikes, 0.55))
    assert_strikes(found, strikes)
    assert find_strides(found.time_s, NO_GAPS).accepted[-10:].all()


def test_a_bounce_right_after_a_hidden_rise_does_not_stand_in_for_it():
    time, strikes, contact = walk()
    contact = switched(contact, time, strikes[7] + 0.03, strikes[7] + 0.04, 0.0)
    keep = (time < strikes[7] - 0.02) | (time > strikes[7] + 0.02)
    assert_strikes(strikes_from_contact(time[keep], contact[keep]), np.delete(strikes, 7))


def test_a_rise_across_missing_samples_is_no_strike():
    time, strikes, contact = walk()
    contact = switched(contact, time, strikes[7] - 0.02, strikes[7] + 0.02, np.nan)
    assert_strikes(strikes_from_contact(time, contact), np.delete(strikes, 7))


def test_missing_samples_and_gaps_between_strikes_cost_none():
    time, strikes, contact = walk()
    contact = switched(contact, time, strikes[7] + 0.2, strikes[7] + 0.5, np.nan)
    contact = switched(contact, time, strikes[9] + 0.5, strikes[9] + 0.9, np.nan)
    keep = (time < strikes[11] + 0.3) | (time > strikes[11] + 0.9)
    assert_strikes(strikes_from_contact(time[keep], contact[keep]), strikes)


def test_a_contact_logged_at_a_tenth_of_the_rate_keeps_its_strikes():
    time, strikes, contact = walk()
    contact[np.arange(time.size) % 10 != 0] = np.nan
    assert_strikes(strikes_from_contact(time, contact), strikes, within_s=0.0101)


@pytest.mark.parametrize(
    "detect", [strikes_from_contact, strikes_from_voltage, strikes_from_pulse, strikes_from_force]
)
def test_a_channel_that_never_switches_has_no_strikes(detect):
    time = np.arange(0, 30, 1 / RATE)
    noise = np.random.default_rng(5).normal(1.0, 0.2, time.size)
    sine = np.sin(2 * np.pi * time)
    for signal in (np.full(time.size, 3.3), np.full(time.size, np.nan), noise, sine):
        found = detect(time, signal)
        assert found.time_s.size == 0
        assert detect is strikes_from_force or np.isnan(found.low)


@given(
    drop=st.lists(st.integers(0, 29), unique=True, max_size=6),
    seed=st.integers(0, 10_000),
    stride=st.floats(0.8, 1.6),
)
@settings(max_examples=25, deadline=None)
def test_whatever_steps_are_lost_the_others_are_found(drop, seed, stride):
    time, strikes, contact = walk(n=30, stride=stride, seed=seed)
    for k in drop:
        contact = switched(contact, time, strikes[k] - 0.01, strikes[k] + 0.63 * stride, 0.0)
    assert_strikes(strikes_from_contact(time, contact), np.delete(strikes, drop))


# --- voltage -------------------------------------------------------------------------------


def noisy_voltage(seed=0, noise=0.25, drift=0.0, n=40):
    time, strikes, contact = walk(n=n, seed=seed)
    rng = np.random.default_rng(seed + 1)
    for s in strikes:
        contact = switched(contact, time, s + 0.010, s + 0.018, 0.0)
        contact = switched(contact, time, s + 0.4, s + 0.43, 0.0)
    wander = drift * np.sin(2 * np.pi * time / 40.0)
    return time, strikes, 0.4 + 3.0 * contact + wander + noise * rng.normal(size=time.size)


@pytest.mark.parametrize("noise", [0.0, 0.5])
def test_a_noisy_bouncing_voltage_gives_its_strikes_within_two_samples(noise):
    time, strikes, voltage = noisy_voltage(noise=noise)
    assert_strikes(strikes_from_voltage(time, voltage), strikes, within_s=0.002)


def test_calibrated_levels_are_those_of_the_trigger_and_only_of_a_voltage():
    time, strikes, voltage = noisy_voltage(noise=0.1)
    recording = build_recording(time, {"contact": voltage}, contact_kind="voltage")
    found = find_heel_strikes(recording, levels_v=(1.0, 2.0))
    assert (found.low, found.high) == (1.0, 2.0)
    assert_strikes(found, strikes, within_s=0.002)
    assert find_heel_strikes(recording, levels_v=(4.0, 5.0)).time_s.size == 0
    contact = build_recording(time, {"contact": voltage > 2.0}, contact_kind="contact")
    same = find_heel_strikes(contact, levels_v=(4.0, 5.0))
    np.testing.assert_array_equal(same.time_s, find_heel_strikes(contact).time_s)


def test_a_voltage_that_drifts_by_more_than_its_step_gives_its_strikes():
    time, strikes, voltage = noisy_voltage(drift=3.0)
    assert_strikes(strikes_from_voltage(time, voltage), strikes, within_s=0.002)


def test_a_drifting_voltage_keeps_its_strikes_around_a_stop():
    time, strikes, voltage = noisy_voltage(drift=1.0)
    standing = (time > strikes[20] + 0.3) & (time < strikes[30] + 0.3)
    contact = (time > strikes[20] + 0.3) & standing
    wander = np.sin(2 * np.pi * time / 40.0)
    stopped = np.where(contact, 3.4 + wander, voltage)
    expected = np.delete(strikes, np.arange(21, 31))
    assert_strikes(strikes_from_voltage(time, stopped), expected, within_s=0.002)


def test_a_footswitch_with_steps_for_heel_and_toe_strikes_with_the_heel():
    time, strikes, contact = walk()
    levels = contact.copy()
    for s in strikes:
        levels = switched(levels, time, s + 0.15, s + 0.45, 3.0)
        levels = switched(levels, time, s + 0.45, s + 0.68, 2.0)
    assert_strikes(strikes_from_voltage(time, levels), strikes)


@given(
    gain=st.floats(0.01, 100.0),
    offset=st.floats(-50.0, 50.0),
    shift=st.floats(-1000.0, 1000.0),
    seed=st.integers(0, 50),
)
@settings(max_examples=25, deadline=None)
def test_gain_offset_and_clock_of_a_voltage_do_not_matter(gain, offset, shift, seed):
    time, _, voltage = noisy_voltage(seed=seed, drift=0.5, n=12)
    plain = strikes_from_voltage(time, voltage)
    other = strikes_from_voltage(time + shift, offset + gain * voltage)
    assert plain.time_s.size == 12
    np.testing.assert_allclose(other.time_s - shift, plain.time_s, rtol=0, atol=1e-6)


# --- pulse ---------------------------------------------------------------------------------


@pytest.mark.parametrize("width_s", [0.002, 0.03])
def test_brief_pulses_give_strikes_whatever_noise_is_about_them(width_s):
    time, strikes, _ = walk(n=60)
    rng = np.random.default_rng(2)
    pulses = contact_of(time, strikes, width_s) + 0.03 * rng.normal(size=time.size)
    assert_strikes(strikes_from_pulse(time, pulses), strikes)


@pytest.mark.parametrize("share", [0.65, 0.8])
def test_a_false_pulse_shortly_before_a_strike_yields_to_it(share):
    time, strikes, _ = walk(sd=0.0)
    false = strikes[15] + share * 1.1
    pulses = switched(contact_of(time, strikes, 0.01), time, false, false + 0.01, 1.0)
    found = strikes_from_pulse(time, pulses)
    assert_strikes(found, strikes)
    np.testing.assert_allclose(found.rejected_s, [false], rtol=0, atol=1.01 / RATE)


# --- force ---------------------------------------------------------------------------------


@pytest.mark.parametrize("offset", [0.0, 35.0, -60.0])
def test_the_strike_of_a_force_is_its_crossing_of_20_n(offset):
    time, strikes, contact = walk()
    force = force_of(contact)
    above = force > 20.0
    crossings = np.flatnonzero(~above[:-1] & above[1:])
    expected = np.array(
        [np.interp(20.0, force[k : k + 2], time[k : k + 2]) for k in crossings.tolist()]
    )
    swing = np.where(force < 1.0, 15.0 * np.sin(2 * np.pi * 9.0 * time) + 15.0, 0.0)
    assert strikes_from_force(time, force + swing).time_s.size == crossings.size
    found = strikes_from_force(time, force + offset)
    assert_strikes(found, expected, within_s=1e-6)
    assert np.all(np.abs(expected - strikes) < 0.04)


# --- cycle, recordings ---------------------------------------------------------------------


def test_a_stride_counter_strikes_where_it_changes_and_not_across_missing_samples():
    time, strikes, _ = walk()
    cycle = np.searchsorted(strikes, time, side="right").astype(float)
    assert_strikes(strikes_from_cycle(time, cycle), strikes)
    hidden = switched(cycle, time, strikes[4] - 0.01, strikes[4] + 0.01, np.nan)
    assert_strikes(strikes_from_cycle(time, hidden), np.delete(strikes, 4))
    assert strikes_from_cycle(time, np.full(time.size, np.nan)).time_s.size == 0


def test_a_recording_uses_its_contact_first_then_force_then_cycle():
    time, strikes, contact = walk(n=10)
    channels = {
        "cycle": np.searchsorted(strikes, time, side="right"),
        "ground_reaction_force": force_of(contact),
        "contact": contact,
    }
    for method in ("contact", "force", "cycle"):
        found = find_heel_strikes(build_recording(time, channels, contact_kind="contact"))
        assert found.method == method
        assert found.time_s.size == strikes.size
        channels.popitem()


@pytest.mark.parametrize("kind", ["contact", "voltage", "pulse"])
def test_the_declared_kind_of_contact_chooses_the_detector_or_else_its_values(kind):
    time, strikes, contact = walk(n=10)
    signal = contact_of(time, strikes, 0.02) if kind == "pulse" else contact
    found = find_heel_strikes(build_recording(time, {"contact": signal}, contact_kind=kind))
    assert found.method == kind
    assert_strikes(found, strikes)
    noisy = contact + np.random.default_rng(0).normal(0, 0.05, time.size)
    for values, method in ((contact, "contact"), (noisy, "voltage")):
        assert find_heel_strikes(build_recording(time, {"contact": values})).method == method


def test_a_recording_without_any_of_the_channels_is_refused():
    recording = build_recording(np.arange(3.0), {"angle": np.zeros(3)}, file="S01.csv")
    with pytest.raises(EstimationError, match=r"S01\.csv: ") as info:
        find_heel_strikes(recording)
    assert info.value.code == "no_heel_strikes"


def test_a_force_of_the_wrong_sign_is_refused():
    t = np.arange(0, 20, 0.01)
    force = np.where(np.mod(t, 1.1) < 0.68, 700.0, 0.0)
    assert strikes_from_force(t, force).time_s.size > 10
    with pytest.raises(DataError, match="-700 N"):
        strikes_from_force(t, -force)
    recording = build_recording(t, {"ground_reaction_force": -force}, file="S01.csv")
    with pytest.raises(DataError, match=r"^S01\.csv: ground_reaction_force: ") as info:
        find_heel_strikes(recording)
    assert (info.value.path, info.value.channel) == ("S01.csv", "ground_reaction_force")
