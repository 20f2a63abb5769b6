"""From a recording to calibrated signals: rates, holes, clocks, lags, windows, motor torque."""

import numpy as np
import pytest

from jointz.core.errors import DataError
from jointz.core.recording import build_recording
from jointz.core.study import Calibrated, CalibrationSpec, TorqueModelSpec
from jointz.identify.preparation.conditioning import condition, torque_from_current

PLAIN = CalibrationSpec()
W = 2 * np.pi * 2.0


def recording(t, **more):
    channels = {"angle": np.sin(W * t), "torque": 3 * np.cos(W * t), **more}
    return build_recording(t, channels, file="r.csv")


def clock(n=3000, rate_hz=500.0):
    return np.arange(n) / rate_hz


def inner(stretch):
    """The samples that the filter's ends do not reach."""
    return slice(200, stretch.time.size - 200)


def assert_is_the_motion(stretch, *, rel=1e-3, late_s=0.0):
    t = stretch.time[inner(stretch)] + late_s
    expected = [np.sin(W * t), W * np.cos(W * t), -(W**2) * np.sin(W * t)]
    for row, values in zip(stretch.signals, expected, strict=False):
        scale = np.abs(values).max()
        np.testing.assert_allclose(row[inner(stretch)], values, atol=rel * scale)


def test_angle_is_differentiated_and_torque_filtered_alike():
    made = condition(recording(clock()), cutoff_hz=20.0, calibration=PLAIN)

    (stretch,) = made.stretches
    assert made.rate_hz == pytest.approx(500.0)
    assert made.guard_s == pytest.approx(0.05)
    assert_is_the_motion(stretch)
    t = stretch.time[inner(stretch)]
    np.testing.assert_allclose(stretch.signals[3][inner(stretch)], 3 * np.cos(W * t), atol=3e-3)


def test_gains_are_divided_out_after_what_torque_shows_as_angle():
    known = CalibrationSpec(
        angle_gain=Calibrated(value=1.1, sd=0.0),
        angle_per_torque=Calibrated(value=0.004, sd=0.0),
        torque_gain=Calibrated(value=0.8, sd=0.0),
    )
    plain, taken = (
        condition(recording(clock()), cutoff_hz=20.0, calibration=c).stretches[0].signals
        for c in (PLAIN, known)
    )

    np.testing.assert_allclose(
        1.1 * taken[0], plain[0] - 0.004 * plain[3] / 0.8, rtol=1e-9, atol=1e-9
    )
    np.testing.assert_allclose(taken[3] * 0.8, plain[3], rtol=1e-9, atol=1e-9)


def test_each_lag_shifts_its_own_signals():
    known = CalibrationSpec(
        angle_lag_s=Calibrated(value=0.0065, sd=0.0), torque_lag_s=Calibrated(value=0.003, sd=0.0)
    )
    made = condition(recording(clock()), cutoff_hz=20.0, calibration=known)

    (stretch,) = made.stretches
    assert_is_the_motion(stretch, late_s=0.0065)
    t = stretch.time[inner(stretch)] + 0.003
    np.testing.assert_allclose(stretch.signals[3][inner(stretch)], 3 * np.cos(W * t), atol=3e-3)


def test_jittered_time_stamps_give_the_motion_at_uniform_times():
    t = clock()
    t = t + np.random.default_rng(0).uniform(-2e-4, 2e-4, t.size)
    made = condition(recording(t), cutoff_hz=20.0, calibration=PLAIN)

    (stretch,) = made.stretches
    np.testing.assert_allclose(np.diff(stretch.time), 1 / made.rate_hz)
    assert_is_the_motion(stretch, rel=5e-3)


def test_a_clock_that_drifts_keeps_its_time_stamps():
    t = 1.004 * clock() + 1e-6 * clock() ** 2
    made = condition(recording(t), cutoff_hz=20.0, calibration=PLAIN)

    (stretch,) = made.stretches
    np.testing.assert_array_equal(stretch.time, t)
    assert_is_the_motion(stretch)


def test_gaps_and_missing_samples_cut_stretches_and_short_ones_are_dropped():
    t = clock()
    angle = np.sin(W * t)
    angle[1000:1010] = np.nan
    angle[1015:1020] = np.nan  # five good samples between: too short to filter
    kept = (t < 4.0) | (t >= 4.2)
    made = condition(
        build_recording(t[kept], {"angle": angle[kept], "torque": angle[kept] * 2}),
        cutoff_hz=20.0,
        calibration=PLAIN,
    )

    spans = [(s.time[0], s.time[-1]) for s in made.stretches]
    np.testing.assert_allclose(spans, [(0, 1.998), (2.04, 3.998), (4.2, 5.998)])
    np.testing.assert_allclose(made.gaps, [[3.998, 4.2]])


def test_windows_say_why_they_cannot_be_cut():
    t = clock()
    angle = np.sin(W * t)
    angle[1000:1010] = np.nan
    kept = (t < 4.0) | (t >= 4.2)
    made = condition(
        build_recording(t[kept], {"angle": angle[kept], "torque": angle[kept]}),
        cutoff_hz=20.0,
        calibration=PLAIN,
    )
    starts = np.array([0.02, 0.5, 1.95, 2.03, 3.9, 4.1, 4.22, 5.5, 5.88])

    windows, codes = made.cut(starts, before_s=0.0, after_s=0.1)

    assert codes == [
        "edge_of_record", "", "not_finite", "not_finite", "gap", "gap", "gap", "", "edge_of_record",
    ]  # fmt: skip
    assert windows.shape == (9, 4, 50)
    np.testing.assert_array_equal(np.isnan(windows).all(axis=(1, 2)), [c != "" for c in codes])
    np.testing.assert_array_equal(np.isnan(windows).any(axis=(1, 2)), [c != "" for c in codes])


def test_a_window_begins_at_the_nearest_sample():
    made = condition(recording(clock()), cutoff_hz=20.0, calibration=PLAIN)
    signals = made.stretches[0].signals

    windows, _ = made.cut(np.array([1.0009, 1.0011]), before_s=0.01, after_s=0.02)

    np.testing.assert_array_equal(windows[0], signals[:, 495:510])
    np.testing.assert_array_equal(windows[1], signals[:, 496:511])


def test_a_recording_without_any_good_stretch_gives_windows_without_numbers():
    t = clock()
    made = condition(recording(t, angle=np.full(t.size, np.nan)), cutoff_hz=20.0, calibration=PLAIN)

    windows, codes = made.cut(np.array([1.0]), before_s=0.0, after_s=0.1)

    assert made.stretches == ()
    assert codes == ["not_finite"]
    assert np.isnan(windows).all()


def test_without_a_device_the_torque_is_zero():
    t = clock()
    made = condition(build_recording(t, {"angle": np.sin(t)}), cutoff_hz=20.0, calibration=PLAIN)
    np.testing.assert_array_equal(made.stretches[0].signals[3], 0.0)


def test_a_cutoff_above_half_the_rate_is_refused():
    with pytest.raises(DataError, match=r"r.csv: cutoff_hz"):
        condition(recording(clock(400, 40.0)), cutoff_hz=20.0, calibration=PLAIN)


MODEL = TorqueModelSpec(
    gear_ratio=9.0,
    torque_constant=0.1,
    bias=0.2,
    viscous_friction=0.03,
    coulomb_friction=0.38,
    gear_friction=0.09,
    rotor_inertia=0.0092,
)


def by_hand(current, velocity, acceleration):
    """Equation 4.1, with the bias of 3.3 and a viscous term."""
    return (
        0.2
        + 9.0 * 0.1 * current
        - (0.38 + 0.09 * np.abs(current)) * np.sign(velocity)
        - 0.03 * velocity
        - 0.0092 * acceleration
    )


def test_torque_from_current_is_equation_4_1():
    rng = np.random.default_rng(0)
    t = clock()
    current, velocity, acceleration = rng.standard_normal((3, t.size))
    made = recording(
        t, current=current, motor_velocity=velocity, motor_acceleration=acceleration
    ).drop_vars("torque")

    np.testing.assert_allclose(
        torque_from_current(made, MODEL, cutoff_hz=20.0)[0],
        by_hand(current, velocity, acceleration),
    )


@pytest.mark.parametrize("given", ["angle", "motor_angle", "velocity", "motor_velocity"])
def test_motion_that_was_not_measured_is_differentiated(given):
    t = clock()
    current = 5 * np.sin(3 * t)
    position = 0.5 * np.sin(W * t)
    velocity, acceleration = 0.5 * W * np.cos(W * t), -0.5 * W**2 * np.sin(W * t)
    more = {given: velocity if "velocity" in given else position}
    other = {} if given == "angle" else {"angle": np.zeros(t.size)}
    made = build_recording(t, {"current": current, **other, **more})

    found, _ = torque_from_current(made, MODEL, cutoff_hz=40.0)

    # Friction turns with the sign of velocity; compare where it is plain.
    moving = (np.abs(velocity) > 0.5) & (t > 0.3) & (t < t[-1] - 0.3)
    expected = by_hand(current, velocity, acceleration)
    np.testing.assert_allclose(found[moving], expected[moving], atol=5e-3)


def test_torque_is_missing_where_current_or_motion_are():
    t = clock()
    current = np.ones(t.size)
    current[100] = np.nan
    angle = np.sin(W * t)
    angle[2000:2005] = np.nan
    made = build_recording(t, {"current": current, "angle": angle})

    missing = np.isnan(torque_from_current(made, MODEL, cutoff_hz=20.0)[0])

    assert np.flatnonzero(missing).tolist() == [100, *range(2000, 2005)]
