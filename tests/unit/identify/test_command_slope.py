"""A torque that contradicts its own command is told, and decides nothing if it is far off."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from jointz.core.codes import Failure
from jointz.core.errors import EstimationError
from jointz.core.recording import build_recording
from jointz.core.study import Calibrated, CalibrationSpec, PerturbationsSpec, TorqueModelSpec
from jointz.identify.preparation.command_slope import DOUBTED, REFUSED, pulse_slope
from jointz.identify.preparation.sources import (
    ParticipantSettings,
    RecordingInput,
    prepare_sources,
)
from jointz.identify.record.joint import identify_joint
from jointz.identify.study_kinds import BENCH


@pytest.fixture(scope="module")
def walked(walkers):
    walker = walkers.Walker(counts={"A": 12, "B": 12})
    given = walkers.walk(walker)
    time = given.recording["time"].to_numpy()
    command = sum(
        row.amplitude_nm * ((time >= row.onset_s) & (time < row.onset_s + row.duration_s))
        for row in given.pulse_table.itertuples()
    )
    return walker, replace(given, recording=given.recording.assign(command=("time", command)))


def scaled(given, factor, *, gain=None):
    recording = given.recording.assign(torque=factor * given.recording["torque"])
    known = given.calibration
    if gain is not None:
        known = known.model_copy(update={"torque_gain": Calibrated(value=gain, sd=0.01)})
    return replace(given, recording=recording, calibration=known)


def statuses(result):
    return {p.status for cell in result.cells["bayesian"] for p in cell.parameters}


def notes_of(result):
    return [n for n in result.notes if "walk0.csv: the torque is" in n]


@pytest.mark.parametrize("factor", [0.6, 1.6, 2.5])
def test_a_torque_in_walking_far_from_its_command_decides_nothing(walkers, walked, factor):
    walker, given = walked
    result = walkers.analyze(walker, scaled(given, factor))
    assert "ok" not in statuses(result)
    (note,) = notes_of(result)
    assert f"the torque is {factor:.2f} " in note


def test_a_torque_in_walking_somewhat_off_its_command_is_noted(walkers, walked):
    walker, given = walked
    right = walkers.analyze(walker, given)
    assert not notes_of(right)
    assert "ok" in statuses(right)
    result = walkers.analyze(walker, scaled(given, 0.8))
    assert "the torque is 0.80 " in notes_of(result)[0]
    assert "ok" in statuses(result)


def test_a_stated_gain_explains_a_torque_and_is_named(walkers, walked):
    walker, given = walked
    result = walkers.analyze(walker, scaled(given, 1.6, gain=1.6))
    assert "ok" in statuses(result)
    assert "torque_gain 1.6 of [calibration] explains" in notes_of(result)[0]
    result = walkers.analyze(walker, scaled(given, 1.0, gain=1.6))
    assert "ok" not in statuses(result)
    assert "torque_gain 1.6 of [calibration], without which they agree" in notes_of(result)[0]


def test_a_table_that_states_what_a_motor_reached_agrees_with_the_torque(walkers, walked):
    walker, given = walked
    table = given.pulse_table.assign(amplitude_nm=0.6 * given.pulse_table["amplitude_nm"])
    result = walkers.analyze(walker, scaled(replace(given, pulse_table=table), 0.6))
    assert not notes_of(result)


RATE_HZ = 500.0
SHAPES = {
    "hold": lambda t: ((t >= 0.0) & (t < 0.2)) * 1.0,
    "short": lambda t: ((t >= 0.0) & (t < 0.06)) * 1.0,
    "doublet": lambda t: ((t >= 0.0) & (t < 0.06)) * 1.0 - ((t >= 0.06) & (t < 0.12)),
    "ramps": lambda t: np.interp(t, [0.0, 0.03, 0.09, 0.12], [0.0, 1.0, 1.0, 0.0]),
    "half sine": lambda t: np.where((t > 0.0) & (t < 0.1), np.sin(np.pi * t / 0.1), 0.0),
}
LENGTHS = {"hold": 0.2, "short": 0.06, "doublet": 0.12, "ramps": 0.12, "half sine": 0.1}


def bench(shape, *, factor=1.0, commanded=True, amplitude=True, noise=0.1, current=False):
    """Return 20 pulses behind a delay of 6 ms and a lag of 12 ms."""
    t = np.arange(int(22.0 * RATE_HZ)) / RATE_HZ
    onset, signs = 1.0 + np.arange(20), np.tile([6.0, -6.0], 10)
    fine = np.arange(0.0, 0.5, 1e-4)
    course = np.zeros(fine.size)
    for i in range(1, fine.size):
        wanted = SHAPES[shape](np.array([fine[i] - 0.006]))[0]
        course[i] = course[i - 1] + 1e-4 / 0.012 * (wanted - course[i - 1])
    command = sum(s * SHAPES[shape](t - o) for o, s in zip(onset, signs, strict=True))
    torque = sum(s * np.interp(t - o, fine, course) for o, s in zip(onset, signs, strict=True))
    rng = np.random.default_rng(4)
    torque = factor * torque + noise * rng.standard_normal(t.size)
    channels = {"angle": 0.01 * torque}
    channels |= {"current": torque / 0.9} if current else {"torque": torque}
    channels |= {"command": command} if commanded else {}
    table = pd.DataFrame(
        {
            "onset_s": onset,
            "duration_s": LENGTHS[shape],
            "amplitude_nm": signs if amplitude else np.nan,
            "timing_point": "",
        }
    )
    recording = build_recording(t, channels, condition="perturbed", file="load.csv")
    settings = ParticipantSettings(
        kind=BENCH,
        perturbations=PerturbationsSpec(source="table"),
        torque_model=TorqueModelSpec(gear_ratio=9.0, torque_constant=0.1),
    )
    (source,) = prepare_sources([RecordingInput(recording, CalibrationSpec(), table)], settings)
    return pulse_slope(source)


@pytest.mark.parametrize("commanded", [True, False], ids=["command", "table"])
@pytest.mark.parametrize("shape", SHAPES)
def test_the_lag_of_an_actuator_does_not_change_the_slope(shape, commanded):
    right = bench(shape, commanded=commanded)
    assert right.value == pytest.approx(1.0, abs=0.03 if commanded else 0.12)
    assert not right.exceeds(DOUBTED)
    assert bench(shape, commanded=commanded, factor=2.0).exceeds(REFUSED)


@pytest.mark.parametrize("shape", ["hold", "short", "doublet"])
def test_a_torque_below_its_command_is_refused_on_a_bench(shape):
    assert bench(shape, factor=0.6).exceeds(REFUSED)
    assert bench(shape, factor=0.6, commanded=False).exceeds(REFUSED)
    slope = bench(shape, factor=0.8)
    assert slope.exceeds(DOUBTED)
    assert not slope.exceeds(REFUSED)


def test_noise_that_hides_the_slope_refuses_nothing():
    assert not bench("short", factor=0.8, noise=20.0).exceeds(DOUBTED)


def test_an_amplitude_that_is_measured_is_no_command():
    assert bench("hold", factor=0.6, commanded=False, amplitude=False) is None


def test_a_torque_from_current_is_compared_with_the_command():
    assert not bench("hold", current=True).exceeds(DOUBTED)
    assert bench("hold", current=True, factor=0.6).value == pytest.approx(0.6, abs=0.02)


@pytest.fixture(scope="module")
def shaken():
    """Return a minute of a joint of K 60, B 1, J 0.03 under random torque."""
    rng = np.random.default_rng(2)
    s = 2j * np.pi * np.fft.rfftfreq(30_000, 1.0 / RATE_HZ)
    spectrum = np.fft.rfft(rng.standard_normal(30_000)) * (np.abs(s) < 2 * np.pi * 10.0)
    inside = np.fft.rfft(rng.standard_normal(30_000)) * (np.abs(s) < 2 * np.pi * 2.0)
    angle = np.fft.irfft((spectrum - 0.1 * inside) / (60.0 + s + 0.03 * s**2))
    torque = np.fft.irfft(spectrum)
    noisy = torque + 0.05 * torque.std() * rng.standard_normal(30_000)
    return {"angle": angle, "torque": noisy, "command": torque}


@pytest.mark.parametrize("factor", [0.6, 1.6, 2.5])
@pytest.mark.parametrize("model", ["kbj", "irf", "frf"])
def test_a_record_of_a_torque_far_from_its_command_is_refused(shaken, factor, model):
    data = shaken | {"torque": factor * shaken["torque"]}
    with pytest.raises(EstimationError, match=f"the torque is {factor:.2f}") as refused:
        identify_joint(data, rate_hz=RATE_HZ, model=model)
    assert refused.value.code == Failure.TORQUE_UNLIKE_COMMAND.value


def test_a_record_of_a_torque_somewhat_off_its_command_has_a_warning(shaken):
    fit = identify_joint(shaken, rate_hz=RATE_HZ)
    assert not any("command" in w for w in fit.warnings)
    fit = identify_joint(shaken | {"torque": 0.8 * shaken["torque"]}, rate_hz=RATE_HZ)
    assert fit.status == "ok"
    assert "the torque is 0.80 " in fit.warnings[-1]


@pytest.mark.parametrize("duration_s", [np.nan, 0.0])
def test_amplitudes_are_compared_where_durations_are_not_stated(walkers, walked, duration_s):
    walker, given = walked
    table = given.pulse_table.assign(duration_s=duration_s)
    recording = given.recording.drop_vars("command")
    right = walkers.analyze(walker, replace(given, recording=recording, pulse_table=table))
    assert "ok" in statuses(right)
    assert not notes_of(right)
    twice = table.assign(amplitude_nm=2.0 * table["amplitude_nm"])
    result = walkers.analyze(walker, replace(given, recording=recording, pulse_table=twice))
    assert "ok" not in statuses(result)
    assert "the torque is 0.50 " in notes_of(result)[0]
