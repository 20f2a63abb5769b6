"""Errors of torque, angle and units in a bench record: none comes out as a wrong ``ok``."""

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest
from scipy.signal import cont2discrete, lfilter

from jointz.core.codes import Failure
from jointz.core.errors import DataError, EstimationError
from jointz.core.recording import build_recording
from jointz.core.study import CalibrationSpec, PerturbationsSpec
from jointz.identify.bench.bench_records import BenchTrial
from jointz.identify.bench.full_record import fit_full_record
from jointz.identify.participant import analyze_participant
from jointz.identify.preparation.sources import ParticipantSettings, RecordingInput
from jointz.identify.record.joint import identify_joint
from jointz.identify.study_kinds import BENCH

RATE_HZ, FINE = 500.0, 10
TRUTH = {"stiffness": 60.0, "damping": 2.3, "inertia": 0.05}
ONSETS = 1.0 + 1.5 * np.arange(24)
Channels = tuple[np.ndarray, np.ndarray]
Error = Callable[[np.ndarray, np.ndarray], Channels]


def moved(torque: np.ndarray) -> np.ndarray:
    """Return the angle of the load under a torque, both at the fine rate."""
    K, B, J = TRUTH.values()
    system = ([[1.0 / J]], [1.0, B / J, K / J])
    (numerator,), denominator, _ = cont2discrete(system, 1.0 / (FINE * RATE_HZ))
    return lfilter(numerator, denominator, 0.5 * (torque + np.append(torque[1:], torque[-1])))


def recorded(torque: np.ndarray, *, friction: float = 0.0) -> Channels:
    """Return angle and torque of sensors with noise."""
    angle = moved(torque)
    if friction:  # against the motion, from the step before
        for _ in range(8):
            held = friction * np.tanh(np.gradient(angle) * FINE * RATE_HZ / 0.02)
            angle = moved(torque - held)
    rng = np.random.default_rng(3)
    n = angle[::FINE].size
    return (
        angle[::FINE] + 5e-5 * rng.standard_normal(n),
        torque[::FINE] + 0.05 * rng.standard_normal(n),
    )


def pulses(size_nm: float = 6.0) -> np.ndarray:
    """Return 24 pulses of 250 ms behind an actuator of 6 ms, at the fine rate."""
    t = np.arange(int(38.0 * RATE_HZ * FINE)) / (RATE_HZ * FINE)
    signs = np.tile([1.0, -1.0], 12)
    command = sum(
        size_nm * s * ((t >= o) & (t < o + 0.25)) for o, s in zip(ONSETS, signs, strict=True)
    )
    decay = np.exp(-1.0 / (0.006 * RATE_HZ * FINE))
    return lfilter([1.0 - decay], [1.0, -decay], command)


def wandering(size_nm: float = 3.0) -> np.ndarray:
    """Return a minute of random torque, at the fine rate."""
    rng = np.random.default_rng(8)
    n = int(60.0 * RATE_HZ * FINE)
    decay = np.exp(-2.0 * np.pi * 8.0 / (RATE_HZ * FINE))
    torque = lfilter([1.0 - decay], [1.0, -decay], rng.standard_normal(n))
    torque = lfilter([1.0 - decay], [1.0, -decay], torque)
    return torque * size_nm / torque.std()


def delayed(signal: np.ndarray, seconds: float) -> np.ndarray:
    return np.roll(signal, round(seconds * RATE_HZ))


def stretched(signal: np.ndarray, share: float) -> np.ndarray:
    at = np.arange(signal.size)
    return np.interp(at * (1.0 + share), at, signal)


def held(signal: np.ndarray, seconds: float) -> np.ndarray:
    step = round(seconds * RATE_HZ)
    return signal[np.arange(signal.size) // step * step]


ERRORS: dict[str, Error] = {
    "torque 20 ms late": lambda a, m: (a, delayed(m, 0.02)),
    "torque resampled by 2 %": lambda a, m: (a, stretched(m, 0.02)),
    "torque held at 25 Hz": lambda a, m: (a, held(m, 0.04)),
    "torque clipped": lambda a, m: (a, m.clip(-3.6, 3.6)),
    "torque of the other body": lambda a, m: (a, -m),
    "N*mm for N*m": lambda a, m: (a, 1000.0 * m),
    "degrees for rad": lambda a, m: (np.rad2deg(a), m),
    "exchanged": lambda a, m: (m, a),
}


@pytest.fixture(scope="module")
def bench() -> Channels:
    return recorded(pulses())


@pytest.fixture(scope="module")
def shaken() -> Channels:
    return recorded(wandering())


def analyzed(angle: np.ndarray, torque: np.ndarray, *, amplitude_nm: float = 6.0, **settings):
    t = np.arange(angle.size) / RATE_HZ
    signs = np.tile([1.0, -1.0], 12)
    table = pd.DataFrame(
        {
            "onset_s": ONSETS,
            "duration_s": 0.25,
            "amplitude_nm": amplitude_nm * signs,
            "timing_point": "",
        }
    )
    recording = build_recording(
        t, {"angle": angle, "torque": torque}, condition="perturbed", file="load.csv"
    )
    given = RecordingInput(recording, CalibrationSpec(), table)
    asked = {"methods": ("full_record",), "n_resamples": 20} | settings
    source = PerturbationsSpec(source="table", baseline=asked.pop("baseline", None))
    return analyze_participant(
        "rig", [given], ParticipantSettings(kind=BENCH, perturbations=source, **asked)
    )


def wrong(parameters) -> dict[str, float]:
    """Return what is ``ok`` and more than 30 % off."""
    values = {p.name: p.value for p in parameters if p.name in TRUTH and p.status == "ok"}
    return {name: v for name, v in values.items() if abs(v / TRUTH[name] - 1.0) > 0.3}


def test_a_clean_record_of_24_pulses_decides_all_three(bench):
    (cell,) = analyzed(*bench).cells["full_record"]
    for name, truth in TRUTH.items():
        p = cell.parameter(name)
        assert p.status == "ok"
        assert p.value == pytest.approx(truth, rel=0.01)
        assert p.ci_low < truth < p.ci_high


def test_friction_that_shows_at_rest_stays_in_the_model():
    angle, torque = recorded(pulses(), friction=0.2)
    fit = fit_full_record([BenchTrial(np.arange(angle.size) / RATE_HZ, angle, torque)])
    assert "coulomb_friction" in {p.name for p in fit.parameters}
    assert not wrong(fit.parameters)


def test_a_known_lag_that_the_record_contradicts_decides_nothing(bench):
    angle, torque = ERRORS["torque 20 ms late"](*bench)
    trial = BenchTrial(np.arange(angle.size) / RATE_HZ, angle, torque)
    fit = fit_full_record([trial], lag_s=(0.0, 3e-4))
    assert {p.status for p in fit.parameters} == {"undecided"}


FAILURES = {
    "torque clipped": Failure.TORQUE_SATURATED,
    "torque held at 25 Hz": Failure.TORQUE_HELD,
    "N*mm for N*m": Failure.TORQUE_UNLIKE_COMMAND,
    "degrees for rad": Failure.ANGLE_OUT_OF_RANGE,
    "torque resampled by 2 %": Failure.NOT_ONE_LOAD,
}


@pytest.mark.parametrize("error", ERRORS)
def test_no_planted_error_is_ok_on_a_bench(bench, error):
    methods = ("full_record", "dissertation")
    (cell,) = analyzed(*ERRORS[error](*bench), methods=methods).cells["full_record"]
    assert not wrong(cell.parameters), cell.parameters
    assert cell.method == "full_record"  # nothing weaker answers what it refuses
    if error in FAILURES:
        assert {p.status for p in cell.parameters} == {FAILURES[error].status}


def test_one_trial_of_a_file_is_judged_by_its_own_samples(bench):
    parts = {"good": bench, "bad": ERRORS["torque clipped"](*bench)}
    table = pd.DataFrame(
        {"onset_s": ONSETS, "duration_s": 0.25, "amplitude_nm": 6.0 * np.tile([1.0, -1.0], 12)}
    ).assign(timing_point="")
    given = []
    for k, name in enumerate(("bad", "good")):
        angle, torque = parts[name]
        t = np.arange(angle.size) / RATE_HZ + 100.0 * k
        recording = build_recording(
            t, {"angle": angle, "torque": torque}, condition="perturbed", file="all.csv", trial=name
        )
        own = table.assign(onset_s=table["onset_s"] + 100.0 * k)
        given.append(RecordingInput(recording, CalibrationSpec(), own))
    settings = ParticipantSettings(
        kind=BENCH, perturbations=PerturbationsSpec(source="table"), methods=("full_record",)
    )
    cells = {
        c.timing_point: c for c in analyze_participant("rig", given, settings).cells["full_record"]
    }
    assert cells["good"].parameter("stiffness").status == "ok"
    assert cells["bad"].parameter("stiffness").status == Failure.TORQUE_SATURATED.status


@pytest.mark.parametrize("change", [0.1, 4.0])
def test_a_torque_unlike_its_command_is_told(bench, change):
    angle, torque = bench
    (cell,) = analyzed(angle, change * torque).cells["full_record"]
    assert {p.status for p in cell.parameters} == {Failure.TORQUE_UNLIKE_COMMAND.status}


def test_a_bench_without_any_torque_fails_by_name(bench):
    angle, torque = bench
    (cell,) = analyzed(angle, torque * np.nan).cells["full_record"]
    assert all(p.status.startswith("failed:") for p in cell.parameters)


def test_a_commanded_torque_that_is_used_as_measured_is_not_clipped(bench):
    signal = np.convolve(pulses()[::FINE], np.ones(20) / 20.0, mode="same")
    angle = moved(np.repeat(signal, FINE))[::FINE]
    noise = 5e-5 * np.random.default_rng(1).standard_normal(angle.size)
    (cell,) = analyzed(angle + noise, signal).cells["full_record"]
    assert cell.parameter("stiffness").value == pytest.approx(TRUTH["stiffness"], rel=0.02)


def test_a_wrong_unit_of_torque_and_command_is_refused_but_for_a_method_asked_for_by_name(bench):
    both = ERRORS["N*mm for N*m"](*bench)
    (cell,) = analyzed(*both, amplitude_nm=6000.0).cells["full_record"]
    assert {p.status for p in cell.parameters} == {Failure.OUTSIDE_RANGE.status}
    asked = {"methods": ("dissertation",), "method_asked_for": True, "baseline": "pre_pulse"}
    result = analyzed(*both, amplitude_nm=6000.0, **asked)
    (cell,) = result.cells["dissertation"]
    assert cell.parameter("stiffness").status == "ok"
    assert result.notes


@pytest.mark.parametrize("error", ERRORS)
@pytest.mark.parametrize("model", ["kbj", "frf"])
def test_no_planted_error_is_ok_in_one_record(shaken, error, model):
    angle, torque = ERRORS[error](*shaken)
    try:
        fit = identify_joint(angle=angle, torque=torque, rate_hz=RATE_HZ, model=model)
    except (DataError, EstimationError):
        return
    assert not wrong(fit.parameters), fit.parameters


def test_a_clean_record_of_one_joint_is_decided(shaken):
    angle, torque = shaken
    fit = identify_joint(angle=angle, torque=torque, rate_hz=RATE_HZ)
    assert fit.status == "ok"
    for name, truth in TRUTH.items():
        assert fit.parameter(name).value == pytest.approx(truth, rel=0.05)
