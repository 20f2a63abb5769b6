"""Paired runs: what pulses add to a moving bench gives its K, B and J back."""

import numpy as np
import pandas as pd
import pytest

from jointz.core.errors import DataError, EstimationError
from jointz.identify.bench.paired_responses import reference_shift
from jointz.identify.bench.paired_runs import identify_paired_runs
from jointz.identify.preparation.pulses import Pulse

RATE, K, B, J = 1000.0, 150.0, 1.2, 0.03
ONSETS = tuple(2.1 + 1.35 * k for k in range(10))
OMEGA = 2 * np.pi * 0.8


def response(time, onset, sign):
    """Return angle, velocity and acceleration of a smooth rise after an onset, in closed form."""
    x = np.clip((time - onset) / 0.12, 0.0, 1.0)
    # 6 x^5 - 15 x^4 + 10 x^3 up, and down again 0.3 s later: smooth to the second derivative.
    rise = np.stack(
        [
            x**3 * (10 - 15 * x + 6 * x**2),
            30 * x**2 * (1 - x) ** 2 / 0.12,
            60 * x * (1 - x) * (1 - 2 * x) / 0.12**2,
        ]
    )
    return 0.04 * sign * rise


def run(*, start_s=0.0, pulses=(), noise_nm=0.0, seed=0, length_s=17.0, omega=OMEGA):
    """Return a run along a sine of the position; its clock starts at 100 s."""
    time = np.arange(round(length_s * RATE)) / RATE
    phase = omega * (time - start_s)
    # Not of the load: the motion of the reference needs a torque of its own.
    angle, torque = 0.4 * np.sin(phase), 3.0 * np.cos(phase) + 1.0
    command = np.zeros(time.size)
    for onset, sign in pulses:
        up, down = response(time, onset, sign), response(time, onset + 0.3, sign)
        moved = up - down
        angle = angle + moved[0]
        torque = torque + K * moved[0] + B * moved[1] + J * moved[2]
        command[(time >= onset - 1e-9) & (time < onset + 0.25)] = 7.0 * sign
    rng = np.random.default_rng(seed)
    return {
        "time": 100.0 + time,
        "angle": angle,
        "torque": torque + noise_nm * rng.standard_normal(time.size),
        "command": command,
        "reference": 0.4 * np.sin(phase),
    }


PULSES = tuple((onset, (-1) ** k) for k, onset in enumerate(ONSETS))
CLEAN = (run(), run(pulses=PULSES))


def fitted(pairs, **options):
    return identify_paired_runs(pairs, **{"cutoff_hz": 60.0, "window_s": 0.15} | options)


def assert_finds_the_load(fit, rel):
    for name, truth in (("stiffness", K), ("damping", B), ("inertia", J)):
        assert fit.parameter(name).value == pytest.approx(truth, rel=rel)


def test_what_pulses_add_gives_the_load_back():
    fit = fitted([CLEAN])

    assert_finds_the_load(fit, rel=2e-4)
    assert len(fit.pulses) == len(ONSETS)
    assert [p.sign for p in fit.pulses] == [sign for _, sign in PULSES]
    assert fit.pulses[0].onset_s == pytest.approx(100.0 + ONSETS[0])
    assert all(p.stiffness == pytest.approx(K, rel=1e-3) for p in fit.pulses)
    assert fit.shifts_s == pytest.approx((0.0,), abs=1e-9)
    assert fit.status == "ok"
    assert fit.vaf_pct == pytest.approx(100.0, abs=1e-3)


@pytest.mark.parametrize("shift_s", [-0.2111, 1.0 / RATE / 3.0])
def test_runs_that_began_at_other_times_are_aligned_by_their_reference(shift_s):
    fit = fitted([(run(start_s=shift_s), CLEAN[1])])

    assert fit.shifts_s == pytest.approx((shift_s,), abs=1e-5)
    assert_finds_the_load(fit, rel=2e-3)


def test_pairs_are_pooled_and_told_apart():
    pairs = [CLEAN, (run(start_s=0.2), run(start_s=0.1, pulses=PULSES[:4]))]

    fit = fitted(pairs)

    assert_finds_the_load(fit, rel=2e-3)
    assert fit.pulses_frame()["pair"].tolist() == [1] * 10 + [2] * 4
    assert fit.shifts_s == pytest.approx((0.0, 0.1), abs=1e-5)


def test_a_table_of_pulses_takes_the_place_of_the_command():
    table = [Pulse(100.0 + onset, 0.25, 7.0 * sign) for onset, sign in PULSES]
    frames = [pd.DataFrame(r).drop(columns="command") for r in CLEAN]

    fit = fitted([tuple(frames)], pulses=[table])

    assert fit.parameters == fitted([CLEAN]).parameters


def test_intervals_cover_under_noise_of_the_torque():
    fits = [
        fitted([(run(noise_nm=0.3, seed=2 * s), run(pulses=PULSES, noise_nm=0.3, seed=2 * s + 1))])
        for s in range(40)
    ]

    for name, truth in (("stiffness", K), ("damping", B), ("inertia", J)):
        found = [fit.parameter(name) for fit in fits]
        # 95 % of 40 is 38; 34 or fewer has a probability of 2 % at 95 %.
        assert sum(p.ci_low <= truth <= p.ci_high for p in found) >= 35
        spread = np.std([p.value for p in found], ddof=1)
        assert abs(np.mean([p.value for p in found]) - truth) < 3.5 * spread / np.sqrt(40)
        width = np.mean([p.ci_high - p.ci_low for p in found]) / (2 * 2.36)
        assert width == pytest.approx(spread, rel=0.3)


def test_pulses_that_a_run_does_not_hold_are_left_out():
    fit = fitted([(run(length_s=10.0), CLEAN[1])])

    assert len(fit.pulses) == 6
    assert len(fit.left_out) == 4
    assert fit.left_out[0].startswith("pair 1, pulse at 110.2 s")


def test_a_pulse_into_which_another_falls_is_left_out():
    table = [Pulse(100.0 + onset, 0.25, 7.0) for onset in (*ONSETS[:5], ONSETS[4] + 0.05)]

    fit = fitted([CLEAN], pulses=[table])

    assert (len(fit.left_out), len(fit.pulses)) == (1, 5)


@pytest.mark.parametrize(
    ("pairs", "options", "message"),
    [
        ([], {}, "at least one"),
        ([(CLEAN[1],)], {}, "partner"),
        ([CLEAN], {"pulses": []}, "got 0"),
        ([CLEAN], {"cutoff_hz": 600.0}, "1200 Hz"),
        ([CLEAN], {"align": "position"}, "'position'"),
        ([(run(omega=2.7), CLEAN[1])], {}, "reference"),
        ([CLEAN], {"align": "command"}, "reference"),
        ([({k: v[::2] for k, v in CLEAN[0].items()}, CLEAN[1])], {}, "pair 1: .*1000 Hz"),
    ],
)
def test_what_is_no_pair_is_refused(pairs, options, message):
    with pytest.raises(DataError, match=message):
        fitted(pairs, **options)


@pytest.mark.parametrize(
    ("pulses", "changed", "code"),
    [
        ((), {}, "no_pulses"),
        (PULSES[:1], {}, "too_few_pulses"),
        (PULSES, {"angle": CLEAN[0]["angle"]}, "constant_angle"),
        (PULSES, {"torque": CLEAN[0]["torque"]}, "constant_torque"),
    ],
)
def test_pulses_without_a_response_are_refused(pulses, changed, code):
    with pytest.raises(EstimationError) as refused:
        fitted([(CLEAN[0], run(pulses=pulses) | changed)])

    assert refused.value.code == code


def test_noise_of_the_angle_is_told_where_it_lowers_the_inertia():
    rng = np.random.default_rng(5)
    pair = [r | {"angle": r["angle"] + 4e-5 * rng.standard_normal(r["angle"].size)} for r in CLEAN]

    low, high = (fitted([tuple(pair)], cutoff_hz=hz, window_s=0.1) for hz in (20.0, 100.0))

    assert low.warnings == ()
    assert low.parameter("inertia").value == pytest.approx(J, rel=5e-3)
    assert high.warnings
    assert high.parameter("inertia").value < 0.8 * J


def test_three_pulses_give_values_but_no_interval():
    fit = fitted([(CLEAN[0], run(pulses=PULSES[:3]))])

    stiffness = fit.parameter("stiffness")
    assert stiffness.status == "undecided"
    assert stiffness.value is None
    assert stiffness.unbounded == pytest.approx(K, rel=1e-3)


def test_a_periodic_reference_is_shifted_as_little_as_possible():
    time = np.arange(8000) / RATE
    keep = np.ones(time.size, dtype=bool)

    shift = reference_shift(
        np.sin(OMEGA * time), np.sin(OMEGA * (time - 1.35)), rate_hz=RATE, keep=keep, where="pair"
    )

    # A cycle lasts 1.25 s: 1.35 s late is 0.1 s late.
    assert shift == pytest.approx(0.1, abs=1e-5)


def test_pulses_in_the_reference_do_not_shift_the_runs():
    perturbed = dict(CLEAN[1])
    perturbed["reference"] = perturbed["reference"] + perturbed["command"]

    fit = fitted([(run(start_s=0.05), perturbed)])

    assert fit.shifts_s == pytest.approx((0.05,), abs=1e-5)
