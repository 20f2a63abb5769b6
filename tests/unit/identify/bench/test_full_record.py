"""Full records of a load, simulated here exactly: stick, slip, pulses, lag, noise, jitter."""

import dataclasses

import numpy as np
import pytest
from numba import njit
from scipy.linalg import expm
from scipy.signal import lfilter

from jointz.core.errors import DataError, EstimationError
from jointz.identify.bench.bench_records import BenchTrial, even_records
from jointz.identify.bench.full_record import Impedance, fit_full_record
from jointz.results.bench.bench_fits import FullRecordFit

LOADS = {1: (168.0, 0.0364), 2: (273.0, 0.0364), 3: (168.0, 0.0700), 4: (273.0, 0.0700)}
#: Offset in N*m, sines (amplitude N*m, frequency Hz), period of the whole, s.
REFERENCES = {
    "A": (32.0, ((5.0, 1.4),), 1 / 1.4),
    "B": (32.0, ((5.0, 0.8),), 1 / 0.8),
    "C": (32.0, ((5.0, 2.0),), 1 / 2.0),
    "D": (32.0, ((6.0, 1.4),), 1 / 1.4),
    "E": (40.0, ((2.5, 1.4), (3.0, 2.0)), 5.0),
}
INTRINSIC = Impedance(0.388, 0.163, 0.001)
RATE_HZ, FINE_HZ, LAG_S, FRICTION_NM = 900.0, 7200.0, 0.0024, 0.15
TRACKING_S = 0.0075  # 21 Hz, between the printed bandwidths of 20 and 40 N*m
STEP = 1 / FINE_HZ
NAMES = ("stiffness", "damping", "inertia", "coulomb_friction", "torque_lag")


def discrete(K: float, B: float, J: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Matrix exponential with torque linear over a fine step."""
    m = np.zeros((4, 4))
    m[0, 1], m[1], m[2, 3] = 1.0, [-K / J, -B / J, 1 / J, 0.0], FINE_HZ
    e = expm(m * STEP)
    return e[:2, :2], e[:2, 2] - e[:2, 3], e[:2, 3]


@njit(cache=True)
def move(phi, early, late, torque, load, step):
    """Slip by matrix exponential, stop within a step, stick until friction is overcome."""
    K, J, friction = load
    angle = np.empty(torque.size)
    x, v, way = torque[0] / K, 0.0, 0.0
    angle[0] = x
    for i in range(torque.size - 1):
        if way == 0.0 and abs(torque[i] - K * x) > friction:
            way = np.sign(torque[i] - K * x)
        if way != 0.0:
            a, b = torque[i] - way * friction, torque[i + 1] - way * friction
            new_x = phi[0, 0] * x + phi[0, 1] * v + early[0] * a + late[0] * b
            new_v = phi[1, 0] * x + phi[1, 1] * v + early[1] * a + late[1] * b
            if new_v * way < 0.0:
                share = v / (v - new_v)
                x, v = x + 0.5 * v * share * step, 0.0
                force = (1 - share) * torque[i] + share * torque[i + 1] - K * x
                way = 0.0
                if abs(force) > friction:  # it turns at once
                    way = np.sign(force)
                    rest = (1 - share) * step
                    v = (force - way * friction) / J * rest
                    x += 0.5 * v * rest
            else:
                x, v = new_x, new_v
        angle[i + 1] = x
    return angle


def command(reference: str, duration: float, rng: np.random.Generator) -> np.ndarray:
    """The reference with up to eight pulses, at most one a cycle and 0.9 s apart."""
    offset, sines, period = REFERENCES[reference]
    t = np.arange(int(duration * FINE_HZ)) * STEP
    torque = offset + sum(a * np.sin(2 * np.pi * f * t) for a, f in sines)
    last, cycle = -1.0, 0
    for sign in rng.permutation(np.tile([1.0, -1.0], 4)):
        onset = -1.0
        while onset < last + 0.9:
            cycle += 1
            share = rng.choice([0.1, 0.4, 0.6, 0.9])
            if reference == "E":  # its period holds four pulses
                onset = (cycle // 4 + (0.1, 0.4, 0.6, 0.9)[cycle % 4]) * period
            else:
                onset = (cycle + share) * period
        if onset < duration - 0.5:
            torque += 7.0 * sign * np.interp(t - onset, [0, 0.075, 0.175, 0.25], [0, 1, 1, 0])
        last = onset
    return torque


def low_passed(x: np.ndarray, time_constant: float) -> np.ndarray:
    a = np.exp(-STEP / time_constant)
    return lfilter([1 - a], [1, -a], x, zi=[a * x[0]])[0]


def trial(
    case: int,
    reference: str,
    rng: np.random.Generator,
    *,
    filter_s: float = 0.0,
    torque_sd: float = 0.1,
    jitter_s: float = 50e-6,
    friction: float = FRICTION_NM,
    duration: float = 12.0,
) -> BenchTrial:
    K, J = LOADS[case][0] + INTRINSIC.stiffness, LOADS[case][1] + INTRINSIC.inertia
    applied = low_passed(command(reference, duration, rng), TRACKING_S)
    angle = move(*discrete(K, INTRINSIC.damping, J), applied, (K, J, friction), STEP)
    seen = low_passed(applied, filter_s) if filter_s else applied
    half_a_step = STEP / 2 if filter_s else 0.0  # by which the digital low-pass is ahead
    t = np.arange(applied.size) * STEP
    stamps = 0.05 + np.arange(int((duration - 0.1) * RATE_HZ)) / RATE_HZ
    stamps = stamps + rng.normal(scale=jitter_s, size=stamps.size) if jitter_s else stamps
    torque = np.interp(stamps - (LAG_S - filter_s) - half_a_step, t, seen)
    torque += rng.normal(scale=torque_sd, size=stamps.size) if torque_sd else 0.0
    return BenchTrial(stamps, np.round(np.interp(stamps, t, angle) / 1e-5) * 1e-5, torque)


def trials(case: int, reference: str, seed: int, n: int = 7, **kwargs) -> list[BenchTrial]:
    rng = np.random.default_rng([seed, case, ord(reference)])
    return [trial(case, reference, rng, **kwargs) for _ in range(n)]


def number(fit: FullRecordFit, name: str) -> float:
    """The value, or what an undecided one would be: the damping of these loads is zero."""
    p = fit.parameter(name)
    return p.unbounded if p.value is None else p.value


def errors(fit: FullRecordFit, case: int) -> np.ndarray:
    """K %, B N*m*s/rad, J %, friction N*m, lag ms."""
    K, J = LOADS[case]
    truth = np.array([K, 0.0, J, FRICTION_NM, LAG_S])
    values = np.array([number(fit, name) for name in NAMES])
    return (values - truth) / [K / 100, 1.0, J / 100, 1.0, 1e-3]


def covered(fit: FullRecordFit, case: int) -> np.ndarray:
    """Whether each interval holds the truth; one below zero is refused, and holds nothing."""
    K, J = LOADS[case]
    intervals = [(fit.parameter(name).ci_low, fit.parameter(name).ci_high) for name in NAMES]
    truth = (K, 0.0, J, FRICTION_NM, LAG_S)
    return np.array(
        [
            low is not None and low <= v <= high
            for (low, high), v in zip(intervals, truth, strict=True)
        ]
    )


@pytest.fixture(scope="module")
def recorded() -> list[BenchTrial]:
    return trials(4, "C", 1, n=4)


@pytest.fixture(scope="module")
def fitted(recorded) -> FullRecordFit:
    return fit_full_record(recorded, intrinsic=INTRINSIC)


# --- accuracy ------------------------------------------------------------------------------------


def test_without_sensor_noise_only_the_jitter_and_the_resolution_are_left():
    fit = fit_full_record(trials(3, "E", 0, torque_sd=0.0), intrinsic=INTRINSIC)

    assert (np.abs(errors(fit, 3)) < [0.05, 0.005, 0.15, 0.005, 0.02]).all()


@pytest.mark.parametrize(
    ("case", "reference", "filter_s", "kinds"),
    [(1, "A", 0.0, "delay"), (2, "D", LAG_S, "first_order")],
)
def test_loads_come_back_whether_the_lag_is_a_delay_or_a_filter(case, reference, filter_s, kinds):
    fit = fit_full_record(trials(case, reference, 5, filter_s=filter_s), intrinsic=INTRINSIC)

    sd = np.array([0.02, 0.009, 0.30, 0.002, 0.05])  # of one bench day with 0.1 N*m of noise
    assert (np.abs(errors(fit, case)) <= 2.5 * sd).all()
    assert fit.lag_model in (kinds, "mixed")
    assert fit.vaf_pct > 99.9


@pytest.mark.slow
@pytest.mark.parametrize("filter_s", [0.0, LAG_S / 2, LAG_S])
def test_no_pair_of_load_and_reference_is_biased(filter_s):
    cover, bias = [], []
    for case in LOADS:
        for reference in REFERENCES:
            fits = [
                fit_full_record(
                    trials(case, reference, seed, filter_s=filter_s), intrinsic=INTRINSIC
                )
                for seed in range(8)
            ]
            bias.append(np.mean([errors(fit, case) for fit in fits], axis=0))
            cover += [covered(fit, case) for fit in fits]

    K, B, J, _, lag = np.abs(bias).max(axis=0)
    assert K <= 0.3
    assert B <= 0.01
    assert J <= 0.3
    assert lag <= 0.05
    assert (np.mean(cover, axis=0) > 0.85).all()


def test_noise_is_read_as_it_was_before_the_grid():
    rng = np.random.default_rng(3)
    t = np.arange(50_000) / RATE_HZ + rng.normal(scale=1e-4, size=50_000)
    noise = rng.normal(size=t.size)

    even = even_records([BenchTrial(t, noise, noise)])[0]

    assert even.noise_sd(even.angle) == pytest.approx(1.0, abs=0.02)


def test_angle_noise_on_a_jittered_clock_leaves_inertia_alone():
    rng = np.random.default_rng(6)
    found = []
    for seed in range(3):
        noisy = [
            dataclasses.replace(t, angle=t.angle + rng.normal(scale=3e-5, size=t.angle.size))
            for t in trials(2, "A", seed, jitter_s=1e-4, torque_sd=0.02)
        ]
        found.append(errors(fit_full_record(noisy, lag_model="mixed", intrinsic=INTRINSIC), 2))

    assert abs(np.mean(found, axis=0)[2]) < 0.3


# --- what is known of the instruments ------------------------------------------------------------


def test_the_sd_of_the_gain_enters_the_interval_and_makes_it_cover(recorded):
    stretched = [dataclasses.replace(t, torque=1.012 * t.torque) for t in recorded]
    blind = fit_full_record(stretched, intrinsic=INTRINSIC)
    told = fit_full_record(stretched, intrinsic=INTRINSIC, torque_gain_sd=0.01)

    assert not covered(blind, 4)[0]
    assert covered(told, 4)[[0, 2]].all()
    stiffness = told.parameter("stiffness")
    half = (stiffness.ci_high - stiffness.ci_low) / 2
    assert half == pytest.approx(2.0 * 0.01 * 1.012 * 273.388, rel=0.05)
    assert told.parameter("torque_lag") == dataclasses.replace(blind.parameter("torque_lag"))


def test_gains_of_torque_and_angle_add_as_independent_errors(recorded):
    def width(**kwargs) -> float:
        p = fit_full_record(recorded, **kwargs).parameter("stiffness")
        return p.ci_high - p.ci_low

    both = width(torque_gain_sd=0.03, angle_gain_sd=0.04)

    assert both == pytest.approx(width(torque_gain_sd=0.05), rel=1e-6)


def test_torque_that_may_show_as_angle_enters_the_intervals_as_what_it_changes(recorded):
    sd = 3e-5
    unsure = [dataclasses.replace(t, angle_per_torque_sd=sd) for t in recorded]
    twisted = [dataclasses.replace(t, angle=t.angle - sd * t.torque) for t in recorded]
    plain, told, other = (
        fit_full_record(trials, intrinsic=INTRINSIC, lag_model="mixed")
        for trials in (recorded, unsure, twisted)
    )
    for i, name in enumerate(NAMES[:3]):
        one = plain.parameter(name)
        own, wide = ((p.ci_high - p.ci_low) / 2 for p in (one, told.parameter(name)))
        student = own / np.sqrt(plain.covariance[i][i])
        moved = abs(number(other, name) - number(plain, name))
        assert number(told, name) == number(plain, name)
        assert np.sqrt(wide**2 - own**2) == pytest.approx(student * moved, rel=0.02)


def test_intrinsic_impedance_is_subtracted_and_its_sd_added(recorded, fitted):
    total = fit_full_record(recorded)
    unsure = fit_full_record(recorded, intrinsic=dataclasses.replace(INTRINSIC, stiffness_sd=2.0))

    less = total.parameter("stiffness").value - fitted.parameter("stiffness").value
    assert less == pytest.approx(0.388)
    assert unsure.parameter("stiffness").ci_high > fitted.parameter("stiffness").ci_high + 3.0


def test_a_known_lag_is_not_estimated(recorded):
    fit = fit_full_record(recorded, lag_s=LAG_S, intrinsic=INTRINSIC)

    assert fit.lag_model == "given"
    assert "torque_lag" not in {p.name for p in fit.parameters}
    assert abs(fit.parameter("inertia").value / 0.07 - 1) < 0.003


def test_an_uncertain_lag_is_weighed_with_what_the_record_says(recorded):
    def lag(**kwargs):
        return fit_full_record(recorded, intrinsic=INTRINSIC, **kwargs).parameter("torque_lag")

    free = lag(lag_model="delay")
    vague, sharp = lag(lag_s=(LAG_S + 1e-3, 0.01)), lag(lag_s=(LAG_S, 1e-6))

    assert vague.value == pytest.approx(free.value, abs=2e-6)
    assert sharp.value == pytest.approx(LAG_S, abs=2e-6)
    assert sharp.ci_high - sharp.ci_low < 0.2 * (free.ci_high - free.ci_low)


# --- a spring with hardly any inertia: its lag is a damping --------------------------------------

SPRING, SPRING_DAMPING = 146.39, 0.1


def spring_trial(seed: int, *, ripple: float = 0.3, torque_sd: float = 0.05) -> BenchTrial:
    """A spring in step with its torque; a ripple over the angle is in no model."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 60.0, 1 / 500.0)
    torque = 2.0 * np.sin(2 * np.pi * 0.3 * t)
    for k in range(18):
        pulse = np.interp(t - 2.7 - 3.1 * k, [0, 0.075, 0.175, 0.25], [0, 1, 1, 0])
        torque = torque + (-1.0) ** k * 7.0 * pulse
    rate = SPRING_DAMPING / SPRING
    angle = lfilter([0.002 / (rate + 0.002)], [1, -rate / (rate + 0.002)], torque) / SPRING
    seen = torque + ripple * np.sin(378.0 * 3.0 * angle + rng.uniform(0.0, 6.0))
    noise = rng.normal(size=(2, t.size))
    return BenchTrial(t, angle + 2e-5 * noise[0], seen + torque_sd * noise[1])


def test_a_spring_keeps_its_stiffness_where_lag_and_damping_are_one():
    fit = fit_full_record([spring_trial(0)])

    stiffness = fit.parameter("stiffness")
    assert fit.vaf_pct > 97.0
    assert stiffness.value == pytest.approx(SPRING, rel=0.02)
    for name in ("damping", "inertia", "torque_lag"):
        assert fit.parameter(name).status == "undecided"
    assert fit.covariance == ()


def test_what_is_known_of_the_lag_decides_the_damping_of_a_spring():
    fit = fit_full_record([spring_trial(0, ripple=0.0)], lag_s=(0.0, 1e-4))

    damping = fit.parameter("damping")
    assert damping.ci_low <= SPRING_DAMPING <= damping.ci_high
    assert damping.ci_high - damping.ci_low > 2.0 * 1.9 * 1e-4 * SPRING


def test_a_fit_is_never_worse_than_one_without_lag():
    recorded = [spring_trial(0, ripple=1.0)]
    free, held = fit_full_record(recorded, lag_model="mixed"), fit_full_record(recorded, lag_s=0.0)
    assert free.vaf_pct >= held.vaf_pct - 1e-9


# --- friction ------------------------------------------------------------------------------------


def test_motion_that_never_reverses_leaves_friction_out():
    t = np.arange(9000) / 900.0
    angle = 0.1 * t + 0.005 * np.sin(8 * t) + 0.001 * np.sin(30 * t)
    acceleration = -0.32 * np.sin(8 * t) - 0.9 * np.sin(30 * t)
    velocity = np.gradient(angle, t)
    torque = 100 * angle + 0.5 * velocity + 0.03 * acceleration

    fit = fit_full_record([BenchTrial(t, angle, torque)])

    assert "coulomb_friction" not in {p.name for p in fit.parameters}
    assert fit.parameter("stiffness").value == pytest.approx(100, rel=1e-3)


# --- where the data do not decide, or cannot be used ---------------------------------------------


def test_one_sine_decides_nothing():
    t = np.arange(9000) / 900.0
    rng = np.random.default_rng(0)
    noise = rng.normal(scale=0.1, size=t.size)
    angle = 0.03 * np.sin(8.8 * t)
    sine = BenchTrial(t, angle, 168 * angle - 0.0364 * 77.4 * angle + noise)

    fit = fit_full_record([sine], friction=False)

    assert fit.status == "undecided"
    assert fit.parameter("inertia").value is None


def test_a_short_record_is_undecided(recorded):
    short = [BenchTrial(*(getattr(recorded[0], n)[:200] for n in ("time_s", "angle", "torque")))]

    assert fit_full_record(short).status == "undecided"


SAMPLES = np.arange(int(11.9 * RATE_HZ))


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"angle": 0.0 * SAMPLES}, EstimationError, "bench trial 1: "),
        ({"torque": 0.0 * SAMPLES + 3.0}, EstimationError, "bench trial 1: "),
        ({"torque": np.where(SAMPLES == 41, np.nan, 1.0)}, DataError, "sample 42"),
        ({"time_s": np.where(SAMPLES == 10, 8, SAMPLES)}, DataError, "time"),
        ({"time_s": SAMPLES + 450.0 * (SAMPLES > 500)}, DataError, "gap"),
        ({"angle": 1.0 * SAMPLES[:-1]}, DataError, "length"),
    ],
)
def test_a_trial_that_cannot_be_used_is_refused(recorded, changes, error, message):
    with pytest.raises(error, match=message) as caught:
        fit_full_record([dataclasses.replace(recorded[0], **changes)])
    if error is EstimationError:
        assert caught.value.code == f"constant_{next(iter(changes))}"


@pytest.mark.parametrize(
    ("named", "changes"),
    [
        ("gain", {"torque_gain_sd": -0.1}),
        ("ci_level", {"ci_level": 1.0}),
        ("lag", {"lag_s": (0.0, -1.0)}),
        ("trial", {"trials": []}),
    ],
)
def test_arguments_without_sense_are_refused(recorded, named, changes):
    with pytest.raises(DataError, match=named):
        fit_full_record(**({"trials": recorded} | changes))


def test_mixed_sampling_rates_are_refused(recorded):
    slower = dataclasses.replace(recorded[0], time_s=recorded[0].time_s * 1.2)
    with pytest.raises(DataError, match="bench trial 2"):
        fit_full_record([recorded[0], slower])


def test_the_sign_of_the_direction_changes_nothing(recorded, fitted):
    turned = [BenchTrial(t.time_s, -t.angle, -t.torque) for t in recorded]

    fit = fit_full_record(turned, intrinsic=INTRINSIC)

    np.testing.assert_allclose(errors(fit, 4), errors(fitted, 4), atol=1e-6)
