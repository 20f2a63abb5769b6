"""Estimates over the cycle, on a joint whose stiffness changes with it: simulated here."""

from typing import Any

import numpy as np
import pytest
import xarray as xr
from numba import njit
from scipy.signal import butter, lfilter, sosfilt
from scipy.stats import binomtest

import jointz
from jointz.core.errors import DataError, EstimationError
from jointz.results.series.time_varying_fit import TimeVaryingFit

RATE = 500.0
STRIDE_S = 1.1
DAMPING, INERTIA = 1.0, 0.05
_STEPS = 4


def stiffness(phase: np.ndarray) -> np.ndarray:
    return 90.0 - 60.0 * np.cos(2.0 * np.pi * phase)


def segment_stiffness(fit: TimeVaryingFit) -> np.ndarray:
    """Return the stiffness averaged over each segment."""
    reach = np.linspace(-0.5, 0.5, 41) * fit.segment_s / STRIDE_S
    return stiffness(np.array(fit.gait_pct)[:, np.newaxis] / 100.0 + reach).mean(axis=1)


@njit(cache=True)
def displaced(k: np.ndarray, torque: np.ndarray, dt: float) -> np.ndarray:
    """Return the displacement of a joint about its path: Runge and Kutta, linear inputs."""
    out = np.zeros(torque.size)
    x, v, h = 0.0, 0.0, dt / _STEPS
    dx, dv = np.zeros(5), np.zeros(5)
    ahead = np.array([0.0, 0.5, 0.5, 1.0])
    for i in range(torque.size - 1):
        for s in range(_STEPS):
            for stage in range(4):
                share = (s + ahead[stage]) / _STEPS
                now_k = k[i] + share * (k[i + 1] - k[i])
                now_t = torque[i] + share * (torque[i + 1] - torque[i])
                at_x = x + ahead[stage] * h * dx[stage]
                at_v = v + ahead[stage] * h * dv[stage]
                dx[stage + 1] = at_v
                dv[stage + 1] = (now_t - DAMPING * at_v - now_k * at_x) / INERTIA
            x += h / 6.0 * (dx[1] + 2.0 * dx[2] + 2.0 * dx[3] + dx[4])
            v += h / 6.0 * (dv[1] + 2.0 * dv[2] + 2.0 * dv[3] + dv[4])
        out[i + 1] = x
    return out


def walk(
    seed: int = 0,
    *,
    n_strides: int = 100,
    amplitude_nm: float = 3.0,
    internal_nm: float = 1.0,
    variability: float = 1.0,
    device_stiffness: float = 0.0,
) -> dict[str, np.ndarray]:
    """Walk on a moving path with random torque on top.

    Path: 3 % amplitude, 1 deg offset, 0.8 deg slow noise from stride to stride, durations
    2.5 %. Torque: random binary, 30 ms, through a 20 Hz actuator. Inside the joint: torque
    below 2 Hz. Sensors: 3 mrad, 0.05 N*m.
    """
    rng = np.random.default_rng(seed)
    duration = STRIDE_S * (1.0 + 0.025 * rng.standard_normal(n_strides + 2))
    strike = np.append(0.0, np.cumsum(duration))
    n = int(strike[-1] * RATE)
    time = np.arange(n) / RATE
    stride = np.searchsorted(strike, time, side="right") - 1
    phase = (time - strike[stride]) / duration[stride]
    slow = sosfilt(butter(2, 2.0, fs=RATE, output="sos"), rng.standard_normal((2, n)))
    slow /= slow.std(axis=1, keepdims=True)
    size = 1.0 + 0.03 * variability * np.interp(time, strike, rng.standard_normal(strike.size))
    drift = lfilter([0.6], [1.0, -0.8], rng.standard_normal(strike.size))
    offset = np.radians(np.interp(time, strike, drift) + 0.8 * slow[0]) * variability
    shape = 25.0 * np.sin(2.0 * np.pi * phase) + 12.0 * np.sin(4.0 * np.pi * phase + 1.0)
    hold = int(0.03 * RATE)
    command = amplitude_nm * np.repeat(rng.choice([-1.0, 1.0], n // hold + 1), hold)[:n]
    driven = sosfilt(butter(2, 20.0, fs=RATE, output="sos"), command)
    moved = displaced(
        stiffness(phase) + device_stiffness, driven + internal_nm * slow[1], 1.0 / RATE
    )
    noise = rng.standard_normal((2, n))
    return {
        "time": time,
        "angle": np.radians(shape) * size + offset + moved + 0.003 * noise[0],
        "torque": driven - device_stiffness * moved + 0.05 * noise[1],
        "command": command,
        "strike": strike,
    }


def identify(
    made: dict[str, np.ndarray], *, command: bool = False, **kwargs: Any
) -> TimeVaryingFit:
    names = ("time", "angle", "torque", "command") if command else ("time", "angle", "torque")
    settings = {"n_phases": 10, "resamples": 400, "heel_strikes": made["strike"]} | kwargs
    return jointz.identify_time_varying(**{name: made[name] for name in names}, **settings)


def values(fit: TimeVaryingFit, name: str) -> np.ndarray:
    return np.array(fit.parameter(name).value, dtype=float)


def held(fit: TimeVaryingFit, name: str, truth: Any) -> np.ndarray:
    curve = fit.parameter(name)
    low, high = (np.array(ends, dtype=float) for ends in (curve.ci_low, curve.ci_high))
    return (low <= truth) & (truth <= high)


@pytest.fixture(scope="module")
def walked() -> dict[str, np.ndarray]:
    return walk(n_strides=200)


@pytest.fixture(scope="module")
def fitted(walked) -> TimeVaryingFit:
    return identify(walked, command=True)


# --- what comes out ------------------------------------------------------------------------------


def test_the_stiffness_follows_the_cycle(fitted):
    assert fitted.status == "ok"
    assert values(fitted, "stiffness") == pytest.approx(segment_stiffness(fitted), rel=0.06)
    assert values(fitted, "damping") == pytest.approx(DAMPING, rel=0.06)
    assert values(fitted, "inertia") == pytest.approx(INERTIA, rel=0.04)


def test_without_noise_only_what_a_segment_averages_is_lost():
    made = walk(n_strides=60, internal_nm=0.0, variability=0.0)

    fit = identify(made, segment_s=0.05)

    true = segment_stiffness(fit)
    assert np.abs(values(fit, "stiffness") / true - 1.0).max() < 0.03
    assert np.abs(values(fit, "damping") / DAMPING - 1.0).max() < 0.04


def test_the_bands_hold_the_truth_of_most_phases(fitted):
    assert held(fitted, "stiffness", segment_stiffness(fitted)).mean() >= 0.8


def test_torque_inside_the_joint_biases_torque_on_angle_and_not_the_instrument():
    """SCIENCE trap 4, with 1 N*m RMS below 2 Hz and nothing else that varies."""
    errors: dict[str, list[float]] = {"torque": [], "angle": []}
    for seed in range(4):
        made = walk(seed, variability=0.0)
        for perturbed, found in errors.items():
            fit = identify(made, input=perturbed)
            found.append(float(np.mean(values(fit, "stiffness") / segment_stiffness(fit) - 1.0)))

    assert abs(np.mean(errors["torque"])) < 0.01
    assert -0.15 < np.mean(errors["angle"]) < -0.06


def test_a_device_that_reacts_needs_the_command():
    errors: dict[bool, list[float]] = {True: [], False: []}
    for seed in range(4):
        made = walk(seed, n_strides=150, device_stiffness=100.0)
        for command, found in errors.items():
            fit = identify(made, command=command)
            found.append(float(np.mean(values(fit, "stiffness") / segment_stiffness(fit) - 1.0)))

    assert abs(np.mean(errors[True])) < 0.015
    assert np.mean(errors[False]) > 0.02


def test_an_angle_perturbation_gives_the_two_sided_impedance():
    made = walk(n_strides=100, internal_nm=0.0, variability=0.0)
    command = made.pop("command")

    fit = identify(made, input="angle")

    lags = fit.responses.lag_s
    assert lags[0] == pytest.approx(-lags[-1])
    assert fit.response_of == "impedance"
    assert command.size
    assert values(fit, "stiffness") == pytest.approx(segment_stiffness(fit), rel=0.05)
    assert min(fit.vaf_pct) > 90.0


def test_the_admittance_is_that_of_the_second_order_joint(fitted):
    lag = np.array(fitted.responses.lag_s)
    at = int(np.argmax(values(fitted, "stiffness")))
    found = np.array(fitted.responses.response[at])
    k = segment_stiffness(fitted)[at]
    turn = np.sqrt(k / INERTIA - (DAMPING / (2.0 * INERTIA)) ** 2)
    true = np.exp(-DAMPING / (2.0 * INERTIA) * lag) * np.sin(turn * lag) / (INERTIA * turn)

    assert fitted.response_of == "admittance"
    assert np.corrcoef(found, true)[0, 1] > 0.9


def test_a_perturbation_that_is_too_weak_is_undecided():
    fit = identify(walk(n_strides=40, amplitude_nm=0.2))

    curve = fit.parameter("stiffness")
    assert fit.status == "undecided"
    assert curve.n_decided < 5
    assert "undecided" in curve.status
    assert all(v is None for v, s in zip(curve.value, curve.status, strict=True) if s != "ok")
    assert all(r is not None for r in curve.raw)


def test_the_resolution_is_stated(fitted):
    assert fitted.resolution_pct == pytest.approx(100.0 * 0.1 / STRIDE_S, rel=0.02)
    assert fitted.gait_pct[0] == pytest.approx(5.0)
    assert fitted.cutoff_hz == 20.0


# --- what goes in --------------------------------------------------------------------------------


def test_strikes_come_from_the_contact(walked, fitted):
    time, strike = walked["time"], walked["strike"]
    stride = np.searchsorted(strike, time, side="right") - 1
    contact = (time - strike[stride] < 0.6).astype(float)
    channels = {n: walked[n] for n in ("time", "angle", "torque", "command")}
    samples = {n: ("time", channels[n]) for n in ("angle", "torque", "command")}
    dataset = xr.Dataset(samples | {"contact": ("time", contact)}, coords={"time": time})

    mapped = jointz.identify_time_varying(channels | {"contact": contact}, n_phases=10)
    recorded = jointz.identify_time_varying(dataset, n_phases=10)

    assert mapped.n_used == pytest.approx(fitted.n_used, abs=2)
    assert values(mapped, "stiffness") == pytest.approx(values(fitted, "stiffness"), rel=0.03)
    assert recorded.parameters == mapped.parameters


def test_clock_offsets_and_a_torque_on_the_device_change_nothing(walked, fitted):
    moved = {name: np.array(signal) for name, signal in walked.items()}
    moved["time"] += 100.0
    moved["strike"] += 100.0
    moved["angle"] += 0.5
    moved["torque"] = 3.0 - moved["torque"]

    fit = identify(moved, command=True, torque_acts_on="device")

    assert values(fit, "stiffness") == pytest.approx(values(fitted, "stiffness"), rel=1e-6)


def test_strides_out_of_band_are_left_out_and_counted(walked):
    strikes = np.delete(walked["strike"], [50, 90])
    strikes = np.sort(np.append(strikes, strikes[120] + 0.3))

    fit = identify(walked | {"strike": strikes}, command=True)

    assert fit.excluded["missing_strike"] == 2
    assert fit.excluded["spurious_strike"] >= 1
    assert fit.excluded["edge_of_record"] == 2
    assert fit.n_used + fit.n_excluded == strikes.size - 1


def test_torque_on_the_other_body_is_told(walked):
    turned = identify(walked | {name: -walked[name] for name in ("torque", "command")}, n_phases=3)

    assert turned.parameter("stiffness").raw[0] < 0.0
    assert turned.parameter("stiffness").value == (None, None, None)


@pytest.mark.parametrize(
    ("strikes", "message"),
    [
        (lambda s: s[:20], "30 strides"),
        (lambda s: s + 1e4, "edge_of_record"),  # on another clock
        (lambda s: s[::-1], "increase"),
        (lambda _: [0.0, 1.0, np.nan], "list of times"),
        (lambda _: [[0.0, 1.0]], "list of times"),
    ],
)
def test_strikes_that_make_no_strides_are_refused(walked, strikes, message):
    with pytest.raises(DataError, match=message):
        identify(walked, heel_strikes=strikes(walked["strike"]))


def test_no_strikes_are_refused(walked):
    with pytest.raises(EstimationError, match="heel_strikes=") as caught:
        identify(walked, heel_strikes=None)
    assert caught.value.code == "no_heel_strikes"


def test_channels_of_unequal_length_are_refused(walked):
    with pytest.raises(DataError, match="long"):
        identify(walked | {"angle": walked["angle"][:-5]})


@pytest.mark.parametrize(
    ("name", "code"), [("command", "constant_command"), ("torque", "constant_torque")]
)
def test_a_perturbation_that_repeats_with_the_stride_is_refused(name, code):
    rng = np.random.default_rng(0)
    one = lfilter([0.1], [1.0, -0.9], rng.standard_normal(500))
    made = {
        "time": np.arange(25_000) / RATE,
        "angle": 0.1 * rng.standard_normal(25_000),
        "torque": rng.standard_normal(25_000),
        "command": rng.standard_normal(25_000),
        "strike": np.arange(0.0, 50.0),
    } | {name: np.tile(one, 50)}

    with pytest.raises(EstimationError) as caught:
        identify(made, command=name == "command")

    assert caught.value.code == code


@pytest.mark.parametrize(
    "setting", [{"segment_s": 0.01}, {"cutoff_hz": 150.0}, {"resamples": 5}, {"length_s": -0.1}]
)
def test_a_setting_outside_its_range_is_refused_by_name(walked, setting):
    with pytest.raises(ValueError, match=next(iter(setting))):
        identify(walked, **setting)


def test_a_segment_of_most_of_the_stride_is_refused(walked):
    with pytest.raises(DataError, match="stride"):
        identify(walked, segment_s=0.8)


def test_an_angle_that_is_the_same_in_all_strides_fails_every_phase():
    rng = np.random.default_rng(0)
    made = {
        "time": np.arange(25_000) / RATE,
        "angle": np.zeros(25_000),
        "torque": rng.standard_normal(25_000),
        "strike": np.arange(0.0, 50.0),
    }
    made["angle"][0] = 1.0

    fit = identify(made)

    assert set(fit.parameter("stiffness").status) == {"failed:ill_conditioned"}
    assert fit.vaf_pct[0] is None


# --- calibration ---------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("n_strides", [50, 100, 200])
def test_the_bands_hold_the_truth_as_often_as_they_say(n_strides):
    """One phase a walk at random, so that the trials are independent."""
    count, inside = 200, {"stiffness": 0, "damping": 0, "inertia": 0}
    for seed in range(count):
        fit = identify(walk(1000 + seed, n_strides=n_strides), n_phases=5, segment_s=0.05)
        at = seed % 5
        true = {"stiffness": segment_stiffness(fit)[at], "damping": DAMPING, "inertia": INERTIA}
        for name, value in true.items():
            inside[name] += bool(held(fit, name, value)[at])

    for name, k in inside.items():
        assert binomtest(k, count, 0.95).pvalue > 0.01, (name, k)
