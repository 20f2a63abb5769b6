"""A reflex beside every other hypothesis: dense regression, and a joint that has one."""

from dataclasses import replace

import numpy as np
import pytest

from jointz.identify.rigid.reflex_hypothesis import LATENCIES_S, reflex_shape, with_reflexes
from jointz.identify.rigid.response_model import (
    CellResponse,
    Hypothesis,
    Priors,
    ResponseModel,
)

PERIOD_S, N, WINDOW_S, STEP_S = 0.002, 51, 0.1, 0.00005
TIME_S = np.arange(N) * PERIOD_S
JOINTS = {"A": (60.0, 2.5, 0.06), "B": (35.0, 3.0, 0.06)}
GAIN_SD, SD_RAD = 0.3, 5e-4


def answer(joint, *, gain=0.0, latency_s=0.03, twitch_s=0.04):
    """Return the motion under 17 N*m: K, B, J and a reflex, by small steps."""
    K, B, J = joint
    n = round((N - 1) * PERIOD_S / STEP_S) + 1
    x, v = np.zeros(n), np.zeros(n)
    level, rate = 0.0, 0.0  # the twitch, a critically damped second order
    late = round(latency_s / STEP_S)
    for k in range(n - 1):
        torque = 17.0 * (1.0 - np.exp(-k * STEP_S / 0.012))
        stretch = max(v[k - late], 0.0) if k >= late else 0.0
        pull = (stretch * twitch_s - level) / twitch_s**2 - 2.0 * rate / twitch_s
        rate += STEP_S * pull
        level += STEP_S * rate
        v[k + 1] = v[k] + STEP_S / J * (torque - B * v[k] - K * x[k] - gain * K * level)
        x[k + 1] = x[k] + STEP_S * v[k + 1]
    return x[:: round(PERIOD_S / STEP_S)]


def responses(*, sd_rad=SD_RAD, seed=0, **reflex):
    rng = np.random.default_rng(seed)
    torque = np.stack([17.0 * (1.0 - np.exp(-TIME_S / 0.012)), np.zeros(N)])
    return [
        CellResponse(
            label=label,
            angle=answer(joint, **reflex) + sd_rad * rng.standard_normal(N),
            torque=torque,
            noise=sd_rad**2 * np.eye(N),
            period_s=PERIOD_S,
            phase=0.2 + 0.4 * k,
            stride_s=1.1,
        )
        for k, (label, joint) in enumerate(JOINTS.items())
    ]


@pytest.fixture(scope="module")
def posterior_of():
    priors = Priors(lag_s=(0.0, 1e-5), delay_s=(0.0, 1e-5), cross_talk=(0.0, 1e-7))

    def fit(cells):
        model = ResponseModel(cells, priors, Hypothesis(0.01, 0.02), window_s=WINDOW_S)
        return model.fit(model.start(inertia=0.08))

    return fit


def test_every_latency_stands_beside_no_reflex_and_half_the_chance_is_that_there_is_none(
    posterior_of,
):
    cells = responses()
    plain = posterior_of(cells)
    found = with_reflexes([plain, plain], cells)
    latencies = [p.hypothesis.reflex_s for p in found]
    assert latencies == [0.0, 0.0, *np.repeat(LATENCIES_S, 2)]
    assert found[0].log_evidence == pytest.approx(plain.log_evidence + np.log(0.5))
    assert not found[0].reflex_reach.any()


def test_it_is_the_regression_with_one_column_more(posterior_of):
    cells = responses(seed=1, gain=0.2)
    plain = posterior_of(cells)
    twin = with_reflexes([plain], cells)[1]
    weights = [cell.weights() for cell in cells]
    shapes = [reflex_shape(i, c, plain, latency_s=LATENCIES_S[0]) for i, c in enumerate(cells)]
    information = np.linalg.inv(plain.bread)
    p = len(plain.values)
    full, score = np.zeros((p + 1, p + 1)), np.zeros(p + 1)
    full[:p, :p] = information
    full[p, p] = GAIN_SD**-2
    for cell, gain, w, shape, shown in zip(
        cells, plain.gains, weights, shapes, plain.fitted, strict=True
    ):
        jacobian = np.linalg.solve(w, (information @ gain).T)
        cross = jacobian.T @ w @ shape
        full[:p, p] += cross
        full[p, :p] += cross
        full[p, p] += shape @ w @ shape
        score[p] += shape @ w @ (cell.angle - shown)
    step = np.linalg.solve(full, score)
    sds = np.sqrt(np.diag(plain.covariance))
    assert (twin.values - plain.values) / sds == pytest.approx(step[:p] / sds, abs=1e-6)
    scale = np.outer(sds, sds)
    assert twin.bread / scale == pytest.approx(np.linalg.inv(full)[:p, :p] / scale, abs=1e-6)
    # Bayes factor of the column: that of a normal prior on its coefficient.
    _, with_column = np.linalg.slogdet(full)
    _, without = np.linalg.slogdet(information)
    bayes = 0.5 * score @ step - 0.5 * (with_column - without) - np.log(GAIN_SD)
    assert twin.log_evidence - plain.log_evidence == pytest.approx(bayes + np.log(0.25), abs=1e-6)


def test_gains_say_what_a_change_of_the_angle_does(posterior_of):
    cells = responses(seed=2, gain=0.2)
    plain = posterior_of(cells)
    twin = with_reflexes([plain], cells)[1]
    change = 1e-5 * np.sin(TIME_S / 0.02)
    moved = [replace(cells[0], angle=cells[0].angle + change), cells[1]]
    shift = with_reflexes([posterior_of(moved)], moved)[1].values - twin.values
    sds = np.sqrt(np.diag(twin.covariance))
    assert shift / sds == pytest.approx((twin.gains[0] @ change) / sds, abs=0.02)


@pytest.mark.parametrize("gain", [0.0, 0.3])
def test_of_a_reflex_that_is_there_less_is_taken_for_stiffness(posterior_of, gain):
    off = []
    for seed in range(12):
        cells = responses(seed=seed, gain=gain)
        plain, reflex, _ = with_reflexes([posterior_of(cells)], cells)
        for k, (K, _, _) in enumerate(JOINTS.values()):
            off.append((plain.point(k)[0] / K - 1.0, reflex.point(k)[0] / K - 1.0))
        assert abs(reflex.point(0)[0] - 60.0) < 3.0 * np.sqrt(reflex.covariance[0, 0])
        assert reflex.covariance[0, 0] > plain.covariance[0, 0]
    without, beside = np.mean(off, axis=0)
    if gain:
        assert 0.0 < beside < 0.75 * without
    else:
        assert abs(beside) < 0.02
