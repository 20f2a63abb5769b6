"""What can be told of a response before and after a fit, and of one kind of failure for all."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from jointz.core.codes import Failure
from jointz.identify.prediction.pulse_checks import copied_pulses
from jointz.identify.prediction.signal_checks import common_failure
from jointz.identify.preparation.instrument_checks import torque_failure
from jointz.identify.preparation.pulses import Pulse
from jointz.identify.rigid.response_checks import (
    instrument_failure,
    response_failure,
    shared_failure,
)
from jointz.identify.rigid.response_model import CellResponse, Priors
from jointz.identify.rigid.response_posterior import Moments

N = 51
TIME_S = np.arange(N) * 0.002


def response(angle, torque=None, *, variance=1e-4):
    torque = np.full(N, 17.0) if torque is None else torque
    noise = variance * (0.05 * np.eye(N) + np.exp(-0.5 * ((TIME_S[:, None] - TIME_S) / 0.03) ** 2))
    return CellResponse("A", angle, np.stack([torque, 0.0 * torque]), noise, 0.002, 0.1, 1.1)


def test_noise_alone_is_no_response_at_the_level_it_claims():
    rng = np.random.default_rng(0)
    root = np.linalg.cholesky(response(np.zeros(N)).noise)
    called = [
        response_failure(response(root @ rng.standard_normal(N))) is not Failure.CONSTANT_ANGLE
        for _ in range(2000)
    ]
    assert sum(called) <= 8  # 2 are expected


@pytest.mark.parametrize(
    ("size", "variance", "expected"),
    [(0.0, 4e-4, None), (10.0, 1e-4, None), (-10.0, 1e-4, Failure.OPPOSITE_SIGN)],
    ids=["walking could hide it", "a response", "energy out of a joint at rest"],
)
def test_a_response_is_judged_by_its_size_and_sign(size, variance, expected):
    assert response_failure(response(size * TIME_S**2 / 0.1, variance=variance)) is expected


def dataset(**channels):
    n = len(next(iter(channels.values())))
    return xr.Dataset(
        {name: ("time", values) for name, values in channels.items()},
        coords={"time": np.arange(n) / 500.0},
    )


PULSES = tuple(Pulse(float(k), 0.25, 17.0) for k in range(1, 5))


def torque_of(level, noise):
    rng = np.random.default_rng(0)
    time = np.arange(3000) / 500.0
    inside = sum(((time >= p.onset_s) & (time < p.onset_s + 0.25) for p in PULSES), 0 * time)
    return level * inside + noise * rng.standard_normal(time.size)


@pytest.mark.parametrize(
    ("torque", "expected"),
    [
        (torque_of(17.0, 0.0), None),  # flat where the command is
        (torque_of(17.0, 0.2).clip(max=10.0), Failure.TORQUE_SATURATED),
        (torque_of(17.0, 0.2).clip(max=17.5), None),
        (torque_of(17.0, 0.2).clip(max=1.0), None),  # none to speak of came: another matter
        (torque_of(10.0, 0.2), None),  # less than asked, but no flat top: the controller's matter
    ],
)
def test_a_flat_top_below_the_command_is_saturation(torque, expected):
    assert torque_failure(dataset(torque=torque), PULSES) is expected


@pytest.mark.parametrize(("limit", "expected"), [(10.0, Failure.TORQUE_SATURATED), (17.5, None)])
def test_pulses_below_the_limit_do_not_hide_saturation(limit, expected):
    sizes = (17.0, 7.0, -7.0, -17.0)
    pulses = [Pulse(p.onset_s, 0.25, size) for p, size in zip(PULSES, sizes, strict=True)]
    time = np.arange(3000) / 500.0
    torque = 0.2 * np.random.default_rng(0).standard_normal(time.size)
    for p in pulses:
        torque += p.amplitude * ((time >= p.onset_s) & (time < p.onset_s + 0.25))

    assert torque_failure(dataset(torque=torque.clip(-limit, limit)), pulses) is expected


def test_a_channel_of_the_users_own_called_friction_says_nothing_of_saturation():
    torque = torque_of(17.0, 0.2).clip(max=10.0)
    own = {"torque": torque, "friction": np.full(torque.size, 9.0)}
    assert torque_failure(dataset(**own), PULSES) is Failure.TORQUE_SATURATED


def test_without_an_amplitude_nothing_is_said_of_saturation():
    silent = (Pulse(1.0, 0.25, np.nan),)
    assert torque_failure(dataset(torque=torque_of(5.0, 0.0)), silent) is None


def test_a_fault_of_half_the_timing_points_is_that_of_all():
    one, none = Failure.CONSTANT_ANGLE, None
    assert common_failure({"A": one, "B": none, "C": none}) == {"A": one, "B": none, "C": none}
    assert set(common_failure({"A": one, "B": none}).values()) == {one}
    mixed = {"A": one, "B": Failure.TORQUE_SATURATED, "C": one, "D": none}
    assert common_failure(mixed) == {**mixed, "D": one}


def test_a_wrong_sign_where_most_points_do_not_move_is_one_of_chance():
    still, turned = Failure.CONSTANT_ANGLE, Failure.OPPOSITE_SIGN
    assert set(common_failure({"A": still, "B": turned, "C": still}).values()) == {still}
    assert set(common_failure({"A": turned, "B": still, "C": turned}).values()) == {still, turned}


@pytest.mark.parametrize(
    ("moved_s", "apart_s", "expected"),
    [
        (0.0001, 0.0, None),
        (0.0004, 0.0, Failure.LAG_OUT_OF_RANGE),
        # Hypotheses that disagree by a quarter of the move do not let it count for as much.
        (0.0004, 0.0001, None),
    ],
)
def test_a_calibrated_lag_is_contradicted_by_more_than_hypotheses_disagree(
    moved_s, apart_s, expected
):
    priors = replace(Priors(), lag_s=(0.008, 0.0005))
    told = {"lag": 0.0005**2 - 0.00005**2, "model": apart_s**2}
    posterior = SimpleNamespace(lag_s=lambda: Moments(0.008 + moved_s, told))
    assert instrument_failure(posterior, priors, odds=1.0, longest_s=0.03) is expected


@pytest.mark.parametrize(("odds", "expected"), [(9e3, None), (2e4, Failure.LAG_OUT_OF_RANGE)])
def test_evidence_against_a_calibrated_lag_refuses_it_though_it_was_not_moved(odds, expected):
    priors = replace(Priors(), lag_s=(0.008, 0.0005))
    posterior = SimpleNamespace(lag_s=lambda: Moments(0.008, {"lag": 0.0005**2, "model": 0.0}))
    assert instrument_failure(posterior, priors, odds=odds, longest_s=0.03) is expected


@pytest.mark.parametrize(
    ("lag_s", "expected"),
    [(0.012, None), (0.033, Failure.LAG_OUT_OF_RANGE), (-0.004, Failure.OUT_OF_STEP)],
)
def test_a_lag_that_was_not_calibrated_may_be_anything_from_none_to_the_longest(lag_s, expected):
    posterior = SimpleNamespace(lag_s=lambda: Moments(lag_s, {"noise": 0.001**2, "model": 0.0}))
    assert instrument_failure(posterior, Priors(), odds=0.0, longest_s=0.03) is expected


def test_a_fault_of_the_instruments_explains_misfits_and_signs_but_no_other_reason():
    late, misfit, sign = Failure.OUT_OF_STEP, Failure.MODEL_MISFIT, Failure.OPPOSITE_SIGN
    found = {"A": late, "B": misfit, "C": sign, "D": Failure.TORQUE_SATURATED, "E": None}
    all_late = dict.fromkeys(found, late) | {"D": Failure.TORQUE_SATURATED}
    assert shared_failure(found, late) == all_late


@pytest.mark.parametrize("late", [0, 1, 2])
def test_a_copied_window_is_found_also_beside_its_logged_onset(late):
    rng = np.random.default_rng(1)
    angle, torque = rng.standard_normal(3000), rng.standard_normal(3000)
    for values in (angle, torque):
        values[1500 - 60 : 1700] = values[500 - 60 : 700]
    pulses = [Pulse(at / 500.0 + 1e-6, 0.25, 17.0) for at in (500, 1000, 1500 + late)]
    given = dataset(angle=angle, torque=torque)
    assert copied_pulses(given, pulses, window_s=0.1) == [False, False, True]


def test_copies_are_found_whichever_side_of_a_sample_rounding_puts_their_onsets():
    rng = np.random.default_rng(4)
    angle, torque = rng.standard_normal(9000), rng.standard_normal(9000)
    at = np.arange(500, 8500, 400)
    for values in (angle, torque):
        for k in at[1:]:
            values[k - 20 : k + 150] = values[at[0] - 20 : at[0] + 150]
    given = dataset(angle=angle, torque=torque)
    given = given.assign_coords(time=given["time"] * (1.0 + 3e-16))
    pulses = [Pulse(float(k) / 500.0, 0.25, 17.0) for k in at]
    assert copied_pulses(given, pulses, window_s=0.1) == [False] + [True] * (at.size - 1)


def test_windows_of_a_noisy_sensor_are_no_copies():
    rng = np.random.default_rng(2)
    given = dataset(angle=rng.standard_normal(4000).round(1), torque=np.zeros(4000))
    table = pd.DataFrame({"onset_s": np.arange(1.0, 7.0, 0.5)})
    pulses = [Pulse(float(t), 0.25, 17.0) for t in table["onset_s"]]
    assert not any(copied_pulses(given, pulses, window_s=0.1))
