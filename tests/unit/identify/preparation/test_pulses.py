"""Where pulses are: in the command, a table, the difference of references, the angle itself."""

import numpy as np
import pandas as pd
import pytest

from jointz.core.recording import build_recording
from jointz.identify.preparation.pulses import (
    Pulse,
    pulses_from_angle,
    pulses_from_command,
    pulses_from_reference,
    pulses_from_table,
)

RATE_HZ = 500.0
T = np.arange(5000) / RATE_HZ


def trapezoid(t, onset, *, height, ramp=0.075, hold=0.1):
    corners = np.cumsum([onset, ramp, hold, ramp])
    return np.interp(t, corners, [0, height, height, 0])


def of_command(command):
    return pulses_from_command(build_recording(T, {"command": command}))


def test_runs_of_the_command_are_pulses_of_both_signs():
    command = np.where((T >= 1) & (T < 1.25), 17.0, 0.0) - np.where((T >= 3) & (T < 3.1), 7.0, 0)

    assert [
        (p.onset_s, round(p.duration_s, 9), p.amplitude, p.sign) for p in of_command(command)
    ] == [(1.0, 0.25, 17.0, 1.0), (3.0, 0.1, -7.0, -1.0)]


def test_a_ramp_belongs_to_its_pulse():
    (pulse,) = of_command(trapezoid(T, 2.0, height=-7.0))

    assert pulse.onset_s == pytest.approx(2.0, abs=1.5 / RATE_HZ)
    assert pulse.duration_s == pytest.approx(0.25, abs=3 / RATE_HZ)
    assert pulse.amplitude == -7.0


@pytest.mark.parametrize("bad", [np.nan, np.inf, 5e4])
def test_bad_samples_inside_a_pulse_neither_split_nor_hide_it(bad):
    command = np.where((T >= 1) & (T < 1.25), 17.0, 0.0) + np.where((T >= 3) & (T < 3.25), 17.0, 0)
    command[540:545] = np.nan
    command[1530] = bad
    assert [p.onset_s for p in of_command(command)] == [1.0, 3.0]


def test_no_command_is_no_pulse_and_missing_samples_are_zero():
    assert of_command(np.zeros(T.size)) == ()
    command = np.full(T.size, np.nan)
    assert of_command(command) == ()
    command[500:600] = 5.0
    (pulse,) = of_command(command)
    assert (pulse.onset_s, pulse.duration_s) == (1.0, pytest.approx(0.2))


def test_a_pulse_at_the_very_end_ends_with_the_record():
    (pulse,) = of_command(np.where(T >= 9.9, 3.0, 0.0))
    assert pulse.onset_s == pytest.approx(9.9)
    assert pulse.duration_s == pytest.approx(T[-1] - 9.9)


def test_traces_of_a_filter_are_no_pulse():
    command = np.where((T >= 1) & (T < 1.2), 17.0, 0.0) + 1e-3
    assert len(of_command(command)) == 1


def noisy_command(noise, kind, *, rest=0.3):
    """Pulses of 4, 8 and 12 N*m, both signs, in a command that rests with noise."""
    t = np.arange(120_000) / 1000.0
    onsets, sizes = 1.0 + 3.8 * np.arange(30), np.tile([4.0, -4.0, 8.0, -8.0, 12.0, -12.0], 5)
    command = rest + noise * np.random.default_rng(0).standard_normal(t.size)
    for onset, size in zip(onsets, sizes, strict=True):
        since = t - onset + 1e-9
        first, whole = (since >= 0) & (since < 0.05), (since >= 0) & (since < 0.1)
        course = {
            "step": 1.0 * whole,
            "doublet": 2.0 * first - whole,
            "ramp": trapezoid(t, onset, height=1.0),
        }
        command += size * course[kind]
    return build_recording(t, {"command": command}), onsets, sizes


@pytest.mark.parametrize("noise", [0.1, 0.2, 0.5])
@pytest.mark.parametrize(("kind", "late_s"), [("step", 1e-3), ("doublet", 1e-3)])
def test_a_noisy_command_has_its_pulses_and_no_others(noise, kind, late_s):
    recording, onsets, sizes = noisy_command(noise, kind)

    pulses = pulses_from_command(recording)

    assert len(pulses) == len(onsets)
    np.testing.assert_allclose([p.onset_s for p in pulses], onsets, atol=late_s + 1e-6)
    np.testing.assert_allclose([p.amplitude for p in pulses], sizes, atol=max(3 * noise, 0.2))
    np.testing.assert_allclose([p.duration_s for p in pulses], 0.1, atol=2.5 * late_s + 1e-6)


@pytest.mark.parametrize("kind", ["step", "doublet", "ramp"])
def test_a_command_without_noise_is_a_pulse_above_a_share_of_its_largest(kind):
    recording, _, sizes = noisy_command(0.0, kind, rest=0.0)
    command, time = recording["command"].to_numpy(), recording["time"].to_numpy()
    largest = np.percentile(np.abs(command[command != 0]), 99)
    rises = np.flatnonzero(np.diff(np.abs(command) > 1e-3 * largest, prepend=False))[::2]

    pulses = pulses_from_command(recording)

    assert [p.onset_s for p in pulses] == time[rises].tolist()
    assert [p.amplitude for p in pulses] == pytest.approx(sizes, rel=1e-12)


def test_a_random_command_that_never_rests_is_on_nearly_all_the_time():
    command = np.random.default_rng(0).standard_normal(T.size)
    assert sum(p.duration_s for p in of_command(command)) > 0.95 * T[-1]


def test_a_table_is_put_in_the_order_of_time():
    table = pd.DataFrame(
        {
            "onset_s": [3.0, 1.0],
            "duration_s": [0.25, np.nan],
            "amplitude_nm": [-17.0, np.nan],
            "timing_point": ["LRE", ""],
        }
    )
    first, second = pulses_from_table(table)

    assert (first.onset_s, first.timing_point, first.sign) == (1.0, "", 1.0)
    assert np.isnan([first.duration_s, first.amplitude]).all()
    assert second == Pulse(3.0, 0.25, -17.0, "LRE")


def reference(t, *, pulses=()):
    total = 5.0 * np.sin(2 * np.pi * 0.5 * t)
    return total + sum(trapezoid(t, at, height=h) for at, h in pulses)


def test_the_difference_of_references_is_where_the_pulses_are():
    start_s = 40.0  # the clocks of two trials need not agree
    perturbed = build_recording(
        T + start_s, {"reference": reference(T, pulses=[(1.0, 7.0), (3.0, -7.0)])}
    )
    unperturbed = build_recording(T, {"reference": reference(T)})

    first, second = pulses_from_reference(perturbed, unperturbed)

    assert first.onset_s == pytest.approx(start_s + 1.0, abs=1.5 / RATE_HZ)
    assert second.onset_s == pytest.approx(start_s + 3.0, abs=1.5 / RATE_HZ)
    assert first.amplitude == pytest.approx(7.0)
    assert second.amplitude == pytest.approx(-7.0)


def test_only_what_both_references_cover_is_compared():
    perturbed = build_recording(T, {"reference": reference(T, pulses=[(1.0, 7.0), (8.0, 7.0)])})
    unperturbed = build_recording(T[:3000], {"reference": reference(T[:3000])})

    (pulse,) = pulses_from_reference(perturbed, unperturbed)

    assert pulse.onset_s == pytest.approx(1.0, abs=1.5 / RATE_HZ)


def test_rounding_of_the_same_reference_is_no_pulse():
    rounded = build_recording(T, {"reference": reference(T) + 1e-9 * np.sin(77 * T)})
    assert pulses_from_reference(rounded, build_recording(T, {"reference": reference(T)})) == ()


def moved(steps, *, n=8000):
    """Steps of the angle with a rise of 20 ms, held until the next."""
    t = np.arange(n) / 1000.0
    return t, sum(size * np.clip((t - at) / 0.02, 0, 1) for at, size in steps)


def test_steps_of_the_angle_are_found_where_they_begin():
    steps = [(1.0, 0.035), (1.4, -0.035), (2.0, 0.035), (3.1, -0.035), (5.0, 0.03)]
    t, angle = moved(steps)

    found = pulses_from_angle(build_recording(t, {"angle": angle}), cutoff_hz=40.0)

    assert len(found) == 5
    for pulse, (at, size) in zip(found, steps, strict=True):
        assert -0.015 < pulse.onset_s - at < 0.005  # the filter smears it to before
        assert pulse.amplitude == pytest.approx(size, abs=1e-4)
        assert np.isnan(pulse.duration_s)


@pytest.mark.parametrize("noise", [0.0, 2e-4])
def test_rare_steps_are_found_among_rest(noise):
    t, angle = moved([(5.0, 0.05), (15.0, -0.05)], n=20_000)
    angle = angle + noise * np.random.default_rng(0).standard_normal(t.size)

    found = pulses_from_angle(build_recording(t, {"angle": angle}), cutoff_hz=20.0)

    assert [round(p.onset_s, 1) for p in found] == [5.0, 15.0]


def test_small_steps_steps_out_of_motion_and_steps_at_the_edges_do_not_count():
    t, angle = moved([(0.03, 0.035), (1.0, 0.035), (2.0, -0.035), (3.0, 0.012), (7.98, 0.035)])
    angle += np.where((t > 4) & (t < 5), 0.02 * np.sin(2 * np.pi * 8 * (t - 4)), 0.0)

    found = pulses_from_angle(build_recording(t, {"angle": angle}), cutoff_hz=40.0)

    assert [round(p.onset_s, 1) for p in found] == [1.0, 2.0]


@pytest.mark.parametrize("cutoff_hz", [10.0, 20.0, 40.0])
@pytest.mark.parametrize("rate_hz", [200.0, 1000.0])
@pytest.mark.parametrize("motion_hz", [0.5, 1.0, 2.0])
def test_smooth_motion_is_no_row_of_steps_though_it_is_quiet_where_it_turns(
    motion_hz, rate_hz, cutoff_hz
):
    t = np.arange(int(30 * rate_hz)) / rate_hz
    noise = np.random.default_rng(0).standard_normal(t.size)
    angle = np.deg2rad(20.0 * np.sin(2 * np.pi * motion_hz * t) + 0.05 * noise)

    assert pulses_from_angle(build_recording(t, {"angle": angle}), cutoff_hz=cutoff_hz) == ()


@pytest.mark.parametrize("cutoff_hz", [10.0, 20.0, 40.0])
@pytest.mark.parametrize("rise_s", [0.001, 0.02, 0.05])
def test_the_filter_makes_no_motion_of_a_step(rise_s, cutoff_hz):
    t = np.arange(6000) / 1000.0
    angle = 0.035 * sum(np.clip((t - at) / rise_s, 0, 1) for at in (1.0, 3.0))

    found = pulses_from_angle(build_recording(t, {"angle": angle}), cutoff_hz=cutoff_hz)

    assert [round(p.onset_s) for p in found] == [1, 3]


def test_a_step_across_a_hole_does_not_count():
    t, angle = moved([(1.0, 0.035), (3.0, 0.035)])
    kept = (t < 2.99) | (t > 3.03)
    found = pulses_from_angle(build_recording(t[kept], {"angle": angle[kept]}), cutoff_hz=40.0)
    assert [round(p.onset_s, 1) for p in found] == [1.0]


def test_an_angle_without_a_number_has_no_steps():
    t = np.arange(100) / 1000.0
    nothing = build_recording(t, {"angle": np.full(100, np.nan)})
    assert pulses_from_angle(nothing, cutoff_hz=40.0) == ()
