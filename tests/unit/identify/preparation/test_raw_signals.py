"""Recordings on an even clock, unfiltered."""

from dataclasses import replace

import numpy as np
import pytest

from jointz.core.recording import build_recording
from jointz.core.study import Calibrated, CalibrationSpec, PerturbationsSpec, TorqueModelSpec
from jointz.identify.preparation.raw_signals import (
    COMMAND,
    DRIVING,
    FRICTION,
    RAW_ANGLE,
    SENSOR_ROWS,
    common_rate_hz,
    intrinsic_left_in,
    raw_signals,
)
from jointz.identify.preparation.sensor_agreement import choose_sensors
from jointz.identify.preparation.sources import ParticipantSettings, RecordingInput, prepare_sources
from jointz.identify.study_kinds import WALKING


def source(time, channels, *, calibration=None, torque_model=None, condition="perturbed"):
    recording = build_recording(time, channels, condition=condition, file="walk.csv")
    settings = ParticipantSettings(
        kind=WALKING,
        perturbations=PerturbationsSpec(source="command"),
        torque_model=torque_model,
        n_resamples=10,
    )
    given = RecordingInput(recording, calibration or CalibrationSpec())
    return prepare_sources([given], settings)[0]


def plain(rate_hz, *, length_s=4.0, **more):
    time = np.arange(round(length_s * rate_hz)) / rate_hz
    channels = {"angle": np.sin(5.0 * time), "torque": np.cos(3.0 * time), "command": 0.0 * time}
    return source(time, channels, **more)


@pytest.mark.parametrize(
    ("rate_hz", "expected"), [(100.0, 100.0), (500.0, 500.0), (1000.0, 500.0), (1900.0, 475.0)]
)
def test_fast_recordings_are_averaged_to_about_500_hz(rate_hz, expected):
    signals = raw_signals(plain(rate_hz))
    assert signals.rate_hz == pytest.approx(expected, rel=1e-6)
    stretch = signals.stretches[0]
    assert np.diff(stretch.time) == pytest.approx(1.0 / expected, rel=1e-6)
    # A mean over samples is the signal at their mean time, but for its bend.
    assert stretch.signals[RAW_ANGLE] == pytest.approx(np.sin(5.0 * stretch.time), abs=1e-5)
    assert stretch.signals[DRIVING] == pytest.approx(np.cos(3.0 * stretch.time), abs=1e-5)


def test_gains_are_divided_out_and_lags_are_left():
    known = CalibrationSpec(
        angle_gain=Calibrated(value=1.1, sd=0.0),
        torque_gain=Calibrated(value=0.8, sd=0.0),
        angle_lag_s=Calibrated(value=0.01, sd=0.0),
    )
    stretch = raw_signals(plain(500.0, calibration=known)).stretches[0]
    assert stretch.signals[RAW_ANGLE] == pytest.approx(np.sin(5.0 * stretch.time) / 1.1)
    assert stretch.signals[DRIVING] == pytest.approx(np.cos(3.0 * stretch.time) / 0.8)


def test_a_gain_of_the_torque_is_not_that_of_friction_nor_of_the_rotors_inertia():
    time = np.arange(2000) / 500.0
    velocity = 2.0 * np.sign(np.sin(time + 0.1))
    model = TorqueModelSpec(
        gear_ratio=9.0, torque_constant=0.1, coulomb_friction=0.4, rotor_inertia=0.2
    )
    channels = {
        "angle": np.sin(5.0 * time),
        "current": np.cos(3.0 * time),
        "motor_velocity": velocity,
        "motor_acceleration": np.sin(7.0 * time),
        "command": 0.0 * time,
    }
    known = CalibrationSpec(
        torque_gain=Calibrated(value=0.8, sd=0.0), friction_gain=Calibrated(value=1.5, sd=0.1)
    )
    made = source(time, channels, calibration=known, torque_model=model)
    stretch = raw_signals(made).stretches[0]

    driving = 0.9 * np.cos(3.0 * time) / 0.8 - 0.2 * np.sin(7.0 * time)
    friction = -0.4 * 1.5 * np.sign(velocity)
    assert stretch.signals[DRIVING] == pytest.approx(driving)
    assert stretch.signals[FRICTION] == pytest.approx(friction)
    assert not stretch.signals[COMMAND].any()
    # What other methods divide by the gain is the true torque too.
    assert made.input.recording["torque"].to_numpy() / 0.8 == pytest.approx(driving + friction)


def test_what_torque_shows_as_angle_is_left_to_the_model_of_the_sensor():
    known = CalibrationSpec(angle_per_torque=Calibrated(value=0.01, sd=1e-4))
    told, plain_ = (
        raw_signals(plain(500.0, **m)).stretches[0].signals for m in ({"calibration": known}, {})
    )
    np.testing.assert_array_equal(told, plain_)


def test_a_channel_of_the_users_own_called_friction_is_left_alone():
    time = np.arange(2000) / 500.0
    channels = {"angle": np.sin(time), "torque": np.cos(3.0 * time), "command": 0.0 * time}
    own = {"friction": np.where(time < 2.0, 5.0, np.nan)}
    made = source(time, channels | own)
    stretch = raw_signals(made).stretches[0]

    assert stretch.signals[DRIVING] == pytest.approx(np.cos(3.0 * time))
    assert not stretch.signals[FRICTION].any()
    np.testing.assert_array_equal(made.input.recording["friction"], own["friction"])


@pytest.mark.parametrize("motor", ["motor_velocity", "motor_angle"])
def test_intrinsic_damping_is_taken_out_where_the_motor_was_recorded(motor):
    time = np.arange(2000) / 500.0
    angle = 0.3 * np.sin(4.0 * time)
    turned = angle if motor == "motor_angle" else 1.2 * np.cos(4.0 * time)
    channels = {"angle": 0.1 * time, "torque": 0.0 * time, "command": 0.0 * time, motor: turned}
    known = CalibrationSpec(
        torque_gain=Calibrated(value=0.8, sd=0.0),  # the impedance is one of true torque
        intrinsic_damping=Calibrated(value=0.5, sd=0.0),
    )
    made = source(time, channels, calibration=known)
    stretch = raw_signals(made).stretches[0]
    expected = -0.5 * 1.2 * np.cos(4.0 * time)
    inner = slice(10, -10)
    assert stretch.signals[DRIVING][inner] == pytest.approx(expected[inner], abs=1e-4)


@pytest.mark.parametrize(
    ("motor", "taken_out"),
    [
        (("motor_velocity",), 0.0),
        (("motor_angle",), 10.0),
        (("motor_velocity", "motor_angle"), 10.0),
    ],
)
def test_intrinsic_stiffness_is_taken_out_where_the_angle_of_the_motor_was_recorded(
    motor, taken_out
):
    time = np.arange(2000) / 500.0
    moved = {"motor_angle": 0.3 * np.sin(4.0 * time), "motor_velocity": 1.2 * np.cos(4.0 * time)}
    channels = {"angle": 0.1 * time, "torque": 0.0 * time, "command": 0.0 * time}
    known = CalibrationSpec(intrinsic_stiffness=Calibrated(value=10.0, sd=0.0))
    made = source(time, channels | {name: moved[name] for name in motor}, calibration=known)
    stretch = raw_signals(made).stretches[0]
    assert intrinsic_left_in(made.input.recording) == (
        ("inertia",) if taken_out else ("stiffness", "inertia")
    )
    assert stretch.signals[DRIVING] == pytest.approx(-taken_out * moved["motor_angle"])


def test_missing_samples_and_holes_part_the_stretches():
    time = np.arange(3000) / 500.0
    angle = np.sin(time)
    angle[700:715] = np.nan
    kept = (time < 3.0) | (time > 3.5)
    channels = {"angle": angle, "torque": np.cos(time), "command": 0.0 * time}
    made = source(time[kept], {k: v[kept] for k, v in channels.items()})
    signals = raw_signals(made)
    assert [s.time[0] for s in signals.stretches] == pytest.approx([0.0, 1.43, 3.502])
    assert np.isfinite(np.concatenate([s.signals for s in signals.stretches], axis=1)).all()
    assert len(signals.gaps) == 1


def test_recordings_of_unlike_rates_come_to_the_slowest():
    fast, slow, odd = plain(1000.0), plain(240.0), plain(900.0)
    rate = common_rate_hz([fast, slow, odd])
    assert rate == pytest.approx(240.0, rel=1e-6)
    for made in (fast, slow, odd):
        signals = raw_signals(made, target_hz=rate)
        stretch = signals.stretches[0]
        assert signals.rate_hz == rate
        assert np.diff(stretch.time) == pytest.approx(1.0 / rate, rel=1e-3)
        # Straight between samples of 200 Hz or more: a 5 rad/s sine is off by a ten-thousandth.
        assert stretch.signals[RAW_ANGLE] == pytest.approx(np.sin(5.0 * stretch.time), abs=3e-4)


def test_only_perturbed_recordings_decide_the_common_rate():
    slow = plain(100.0)
    level = replace(slow, input=replace(slow.input, recording=slow.input.recording.copy()))
    level.input.recording.attrs["condition"] = "unperturbed"
    assert common_rate_hz([plain(500.0), level]) == pytest.approx(500.0)


def walked(**sensors):
    time = np.arange(2000) / 500.0
    channels = {"angle": np.sin(5.0 * time), "torque": np.cos(3.0 * time), "command": 0.0 * time}
    calibration = sensors.pop("calibration", None)
    return source(
        time, channels | {n: f(time) for n, f in sensors.items()}, calibration=calibration
    )


def encoder(time):
    return 1.02 * np.sin(5.0 * time) + 0.1


def shank(time):
    return 3.0 * np.cos(5.0 * time) + 0.3 * np.sin(9.0 * time)


def thigh(time):
    return shank(time) - 5.0 * np.cos(5.0 * time)


def mostly_silent(time):
    return np.where(time < 3.7, encoder(time), np.nan)


def dead(time):
    return np.full_like(time, 0.3)


@pytest.mark.parametrize(
    ("recordings", "used", "unused"),
    [
        ([{}], (), []),
        ([{"joint_encoder": encoder}], ("joint_encoder",), []),
        (
            [{"shank_velocity": shank, "thigh_velocity": thigh, "joint_encoder": encoder}],
            ("joint_encoder", "joint_velocity"),
            [],
        ),
        ([{"shank_velocity": shank}], ("shank_velocity",), []),
        ([{"thigh_velocity": thigh}], (), ["thigh_velocity"]),
        ([{"joint_encoder": encoder}, {}], (), ["joint_encoder"]),
        ([{"joint_encoder": mostly_silent}], (), ["joint_encoder"]),
        ([{"joint_encoder": dead}], (), ["joint_encoder"]),
        ([{"joint_encoder": lambda t: np.rad2deg(encoder(t))}], (), ["joint_encoder"]),
        ([{"joint_encoder": lambda t: -encoder(t)}], (), ["joint_encoder"]),
        ([{"joint_encoder": lambda t: np.sin(5.0 * t)}], (), ["joint_encoder"]),
        ([{"shank_velocity": lambda t: np.rad2deg(shank(t))}], (), ["shank_velocity"]),
        (
            [{"shank_velocity": shank, "thigh_velocity": lambda t: -thigh(t)}],
            (),
            ["shank_velocity", "thigh_velocity"],
        ),
        (
            [{"shank_velocity": shank, "thigh_velocity": thigh}, {"shank_velocity": shank}],
            ("shank_velocity",),
            ["thigh_velocity"],
        ),
    ],
)
def test_sensors_are_used_that_all_recordings_have(recordings, used, unused):
    sources = [walked(**sensors) for sensors in recordings]

    choice = choose_sensors(sources)
    assert (choice.used, choice.unused) == (used, tuple(unused))


def scaled(sensor, gain):
    return lambda time: gain * sensor(time)


@pytest.mark.parametrize(
    ("sensors", "used", "odd", "goniometer_gain", "disagree"),
    [
        ({"joint_encoder": scaled(encoder, 1.6)}, (), {"joint_encoder": 1.63}, None, True),
        (
            {
                "joint_encoder": scaled(encoder, 1.6),
                "shank_velocity": shank,
                "thigh_velocity": thigh,
            },
            ("joint_velocity",),
            {"joint_encoder": 1.63},
            None,
            False,
        ),
        (
            {
                "joint_encoder": scaled(encoder, 1.6),
                "shank_velocity": scaled(shank, 1.6),
                "thigh_velocity": scaled(thigh, 1.6),
            },
            ("joint_encoder", "joint_velocity"),
            {},
            0.62,
            False,
        ),
        (
            {
                "joint_encoder": scaled(encoder, 1.6),
                "shank_velocity": scaled(shank, 0.5),
                "thigh_velocity": scaled(thigh, 0.5),
            },
            (),
            {"joint_encoder": 1.63, "joint_velocity": 0.5},
            None,
            True,
        ),
    ],
    ids=["two camps", "encoder odd", "goniometer odd", "none agree"],
)
def test_sensors_judge_each_other_by_their_gains(sensors, used, odd, goniometer_gain, disagree):
    choice = choose_sensors([walked(**sensors)])

    assert (choice.used, choice.disagree) == (used, disagree)
    assert choice.odd == pytest.approx(odd, abs=0.02)
    assert choice.goniometer_gain == pytest.approx(goniometer_gain, abs=0.02)
    assert any("was not used" in note for note in choice.notes()) == bool(odd)
    assert any("gain was taken" in note for note in choice.notes()) == bool(goniometer_gain)


def test_further_sensors_are_free_of_their_calibrated_gains_and_lags():
    known = CalibrationSpec(
        joint_encoder_gain=Calibrated(value=1.25, sd=0.01),
        joint_encoder_lag_s=Calibrated(value=0.004, sd=1e-4),
        shank_velocity_gain=Calibrated(value=2.0, sd=0.01),
        shank_velocity_lag_s=Calibrated(value=0.01, sd=1e-4),
        thigh_velocity_lag_s=Calibrated(value=0.006, sd=1e-4),
    )
    made = walked(
        joint_encoder=lambda t: 1.25 * np.sin(5.0 * (t - 0.004)),
        shank_velocity=lambda t: 2.0 * np.cos(4.0 * (t - 0.01)),
        thigh_velocity=lambda t: np.cos(9.0 * (t - 0.006)),
        calibration=known,
    )
    sensors = ("joint_encoder", "joint_velocity")
    stretch = raw_signals(made, sensors=sensors).stretches[0]
    encoder, velocity = stretch.signals[SENSOR_ROWS:, :-10]
    time = stretch.time[:-10]

    assert encoder == pytest.approx(np.sin(5.0 * time), abs=1e-4)
    assert velocity == pytest.approx(np.cos(4.0 * time) - np.cos(9.0 * time), abs=1e-3)


@pytest.mark.parametrize(("half_s", "stretches"), [(0.008, 1), (0.05, 2)])
def test_short_holes_of_a_sensor_are_filled_and_long_ones_are_gaps(half_s, stretches):
    made = walked(joint_encoder=lambda t: np.where(abs(t - 2.0) < half_s, np.nan, encoder(t)))

    assert len(raw_signals(made).stretches) == 1
    found = raw_signals(made, sensors=("joint_encoder",)).stretches
    assert len(found) == stretches
    for stretch in found:
        assert stretch.signals[SENSOR_ROWS] == pytest.approx(encoder(stretch.time), abs=1e-3)


@pytest.mark.parametrize(
    ("motor", "left_in"),
    [("motor_angle", ("inertia",)), ("motor_velocity", ("stiffness", "inertia"))],
)
def test_the_torque_moves_the_inertia_of_the_device_too(motor, left_in):
    known = CalibrationSpec(intrinsic_inertia=Calibrated(value=0.05, sd=0.001))
    made = walked(**{motor: lambda t: np.sin(6.0 * t)}, calibration=known)
    driven = raw_signals(made).stretches[0]

    assert driven.signals[DRIVING] == pytest.approx(np.cos(3.0 * driven.time))
    assert intrinsic_left_in(made.input.recording) == left_in
