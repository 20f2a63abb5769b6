"""Pulses of both directions and several sizes: what a linear joint does, and what others do."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.stats import binom

from jointz.core.codes import Doubt
from jointz.identify.prediction.predicted_cells import PredictedCell
from jointz.identify.prediction.unperturbed_prediction import LEAD_SAMPLES, Predicted
from jointz.identify.rigid.response_linearity import Contrast, contrasts, doubted
from jointz.identify.rigid.response_model import Priors
from jointz.identify.rigid.walking_responses import explain_responses
from jointz.results.estimates import CellEstimate, ParameterEstimate

PERIOD_S, STEP_S, N, WINDOW_S = 0.002, 0.0005, 70, 0.1
KNOWN = replace(Priors(), lag_s=(0.002, 0.0003), friction_gain=(1.0, 1e-5))
DIRECTION = Doubt.RESPONSES_DIFFER_WITH_DIRECTION
SIZE = Doubt.RESPONSES_NOT_PROPORTIONAL


@dataclass(frozen=True)
class Push:
    sign: float


@dataclass(frozen=True)
class Pushed:
    pulse: Push


def rise(t):
    return 1.0 - np.exp(-t / 0.012)


def answer(size_nm, *, K=60.0, B=2.5, J=0.06, reflex=0.0, softening_rad=np.inf):
    """Return the motion of a joint by Euler's method in fine steps, reflex after 40 ms."""
    steps = int(N * PERIOD_S / STEP_S)
    x, v = np.zeros(steps), np.zeros(steps)
    for k in range(steps - 1):
        late = max(v[k - 80], 0.0) if k >= 80 else 0.0
        torque = size_nm * rise(k * STEP_S) - B * v[k] - reflex * late
        torque -= K * x[k] / (1.0 + (x[k] / softening_rad) ** 2)
        v[k + 1] = v[k] + STEP_S * torque / J
        x[k + 1] = x[k] + STEP_S * v[k + 1]
    shown = np.interp(np.arange(N) * PERIOD_S - 0.002, np.arange(steps) * STEP_S, x, left=0.0)
    return np.concatenate([np.zeros(LEAD_SAMPLES), shown[:-LEAD_SAMPLES]])


def pushes(sizes_nm, signs, *, n=24, seed=0, noise_rad=0.004, **joint):
    """Return a timing point whose joint may be another in the positive direction."""
    rng = np.random.default_rng(seed)
    level = np.exp(-0.5 * (np.subtract.outer(np.arange(N), np.arange(N)) / 25.0) ** 2)
    root = np.linalg.cholesky(noise_rad**2 * (level + 0.01 * np.eye(N)))
    wander = root @ rng.standard_normal((N, n))
    chosen_signs = np.tile(signs, n)[:n]
    sizes = np.repeat(sizes_nm, len(signs))
    sizes = np.tile(sizes, n)[:n]
    torque = np.concatenate([np.zeros(LEAD_SAMPLES), rise(np.arange(N) * PERIOD_S)])[:N]
    known = {}
    responses = np.zeros((n, 3, N))
    for k, (sign, size) in enumerate(zip(chosen_signs, sizes, strict=True)):
        own = joint if sign > 0 else {**joint, "reflex": 0.0}
        key = (float(size), sign)
        if key not in known:
            known[key] = answer(float(size), **own)
        responses[k, 0] = known[key] + sign * wander[:, k]
        responses[k, 1] = size * torque
    misses = np.zeros((200, 3, N))
    misses[:, 0] = (root @ rng.standard_normal((N, 200))).T
    predicted = Predicted(responses, misses, np.arange(200), ("",) * n, 0.0, np.zeros(1))
    return PredictedCell(
        label="A",
        candidates=[Pushed(Push(float(sign))) for sign in chosen_signs],
        predicted=predicted,
        kept=np.ones(n, dtype=bool),
        period_s=PERIOD_S,
        phase=0.3,
        stride_s=1.1,
    )


def compared(cell):
    posterior, responses = explain_responses([cell], KNOWN, window_s=WINDOW_S)
    return {c.doubt: c for c in contrasts([cell], responses, posterior)}


def test_a_linear_joint_is_doubted_as_rarely_as_is_claimed():
    p_values = []
    cell = pushes((8.0, 17.0), (1.0, -1.0), n=40)
    posterior, responses = explain_responses([cell], KNOWN, window_s=WINDOW_S)
    for seed in range(100):
        other = pushes((8.0, 17.0), (1.0, -1.0), n=40, seed=seed)
        p_values += [c.p_value for c in contrasts([other], responses, posterior)]
    assert len(p_values) == 200
    # The shapes are alike, so that the number of tests counts for too much.
    assert sum(p < 0.05 for p in p_values) <= binom.ppf(0.999, 200, 0.05)
    assert sum(p < 0.01 for p in p_values) <= binom.ppf(0.999, 200, 0.01)


def test_a_reflex_against_one_direction_is_told_and_widens_what_it_moves():
    found = compared(pushes((17.0,), (1.0, -1.0), n=50, reflex=2.0))
    assert set(found) == {DIRECTION}
    assert found[DIRECTION].significant
    stiffness, damping, inertia = found[DIRECTION].shifts["A"]
    assert stiffness > 1.0
    assert np.isfinite([damping, inertia]).all()


def test_a_shift_is_about_what_the_reflex_does_to_the_average():
    with_it = pushes((17.0,), (1.0, -1.0), n=50, reflex=0.5)
    without = pushes((17.0,), (1.0, -1.0), n=50)
    posterior, responses = explain_responses([with_it], KNOWN, window_s=WINDOW_S)
    (contrast,) = contrasts([with_it], responses, posterior)
    plain, _ = explain_responses([without], KNOWN, window_s=WINDOW_S)
    moved = posterior.stiffness(0).mean - plain.stiffness(0).mean
    # To first order, with the reflex taken to be that of the shape that is looked for.
    assert 0.5 * moved < contrast.shifts["A"][0] < 2.0 * moved


def test_a_timing_point_with_too_few_pulses_of_a_direction_is_widened_like_the_others():
    often = pushes((17.0,), (1.0, -1.0), n=40, noise_rad=0.001, reflex=2.0)
    rare = replace(pushes((17.0,), (1.0, -1.0), n=8, reflex=2.0), label="B")
    posterior, responses = explain_responses([often, rare], KNOWN, window_s=WINDOW_S)
    (found,) = contrasts([often, rare], responses, posterior)
    assert found.significant
    assert set(found.shifts) == {"A", "B"}
    # Its noise is four times as large: what it says of K gives way to the reflex more readily.
    assert 0.4 < found.shifts["B"][0] / found.shifts["A"][0] < 2.5


def test_which_direction_is_called_positive_does_not_matter():
    cell = pushes((17.0,), (1.0, -1.0), n=40, reflex=0.5)
    turned = replace(cell, candidates=[Pushed(Push(-c.pulse.sign)) for c in cell.candidates])
    one, other = compared(cell)[DIRECTION], compared(turned)[DIRECTION]
    assert other.p_value == pytest.approx(one.p_value)


def test_a_joint_that_softens_is_not_proportional_and_no_matter_of_direction():
    found = compared(pushes((6.0, 17.0), (1.0, -1.0), n=48, softening_rad=0.3))
    assert found[SIZE].significant
    assert not found[DIRECTION].significant
    assert not found[SIZE].shifts


@pytest.mark.parametrize(
    ("sizes_nm", "signs", "n", "doubts"),
    [
        ((17.0,), (1.0,), 50, set()),
        ((17.0,), (1.0, -1.0), 14, set()),
        ((17.0,), (1.0, -1.0), 16, {DIRECTION}),
        ((16.0, 17.0), (1.0,), 50, set()),
        ((8.0, 17.0), (-1.0,), 50, {SIZE}),
    ],
)
def test_only_pulses_that_differ_are_compared(sizes_nm, signs, n, doubts):
    assert set(compared(pushes(sizes_nm, signs, n=n))) == doubts


# --- what a difference does to an estimate --------------------------------------------------------


def estimate(half=0.1, **more):
    rows = [
        ParameterEstimate(name, v, v * (1 - half), v * (1 + half), "ok", unbounded=v)
        for name, v in (
            ("stiffness", 60.0),
            ("damping", 2.0),
            ("inertia", 0.06),
            ("stiffness_per_mass", 1.0),
        )
    ]
    budget = {name: {"noise": 1.0, "model": 0.0} for name in ("stiffness", "damping", "inertia")}
    return CellEstimate("S01", "A", 30.0, tuple(rows), 99.0, 50, 0, "rigid",
                        budget=budget, gravity_corrected=rows[0], **more)  # fmt: skip


def contrast(p_value, shift):
    return Contrast(DIRECTION, p_value, {"A": np.array(shift)})


def test_nothing_changes_where_no_difference_stands():
    assert doubted(estimate(), [contrast(0.5, (6.0, 0.1, 0.1))]) == estimate()
    assert doubted(estimate(), []) == estimate()


def test_intervals_are_widened_on_both_sides_by_the_shift():
    found = doubted(estimate(), [contrast(1e-6, (-6.0, 0.1, 0.05))])
    stiffness, damping, inertia, per_kg = found.parameters
    assert (stiffness.ci_low, stiffness.ci_high) == pytest.approx((48.0, 72.0))
    assert (damping.ci_low, damping.ci_high) == pytest.approx((1.7, 2.3))
    assert (inertia.ci_low, inertia.ci_high) == pytest.approx((0.051, 0.069))
    assert (per_kg.ci_low, per_kg.ci_high) == pytest.approx((0.8, 1.2))
    assert "directions" in stiffness.ci_method
    assert found.gravity_corrected.ci_high == pytest.approx(72.0)
    assert found.budget["stiffness"]["model"] == pytest.approx(6.0 / 1.96, rel=1e-3)


def test_a_difference_as_large_as_the_value_leaves_it_undecided():
    found = doubted(estimate(), [contrast(1e-6, (40.0, 0.0, 0.0))])
    stiffness = found.parameter("stiffness")
    assert (stiffness.status, stiffness.value, stiffness.unbounded) == ("undecided", None, 60.0)
    assert found.parameter("stiffness_per_mass").status == "undecided"
    assert found.gravity_corrected is None
    assert found.parameter("damping").status == "ok"


def test_a_limit_at_the_bound_stays_one_and_moves_up():
    bound = ParameterEstimate("stiffness", 0.0, 0.0, 4.0, "at_bound", unbounded=-1.0)
    given = estimate()
    given = replace(given, parameters=(bound, *given.parameters[1:3]), gravity_corrected=None)
    found = doubted(given, [contrast(1e-6, (2.0, 0.0, 0.0))]).parameter("stiffness")
    assert (found.status, found.ci_low, found.ci_high) == ("at_bound", 0.0, 6.0)
