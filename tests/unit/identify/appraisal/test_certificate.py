"""Virtual pulses: as noisy as real ones, and with the truth that was asked for."""

from dataclasses import replace

import numpy as np
import pytest

from jointz.core.events import PulseRecord
from jointz.core.study import Calibrated, CalibrationSpec
from jointz.identify.appraisal.certificate_draws import Injection, drawn_truth
from jointz.identify.appraisal.certificate_joint import InjectedJoint, injected_response
from jointz.identify.appraisal.certificate_study import (
    own_estimates,
    virtual_cell,
    virtual_estimates,
)
from jointz.identify.prediction.predicted_cells import PredictedCell
from jointz.identify.prediction.unperturbed_prediction import Predicted
from jointz.identify.preparation.assignment import Candidate
from jointz.identify.preparation.pulses import Pulse
from jointz.identify.rigid.walking_evidence import Evidence
from jointz.identify.rigid.walking_responses import explain_responses, priors_of
from jointz.kernels.response_search import FRICTION_GAIN, SHARED

PERIOD_S, WINDOW_S, SAMPLES = 0.002, 0.1, 66
TIMES = np.arange(SAMPLES) * PERIOD_S
TORQUE = 17.0 * (1.0 - np.exp(-TIMES / 0.012))
LAG_S = 0.007
LAG_KNOWN = CalibrationSpec(angle_lag_s=Calibrated(value=LAG_S, sd=0.0005))
TRUE = {"LRE": (120.0, 3.0), "MST": (60.0, 2.5), "TST": (80.0, 3.0), "PSW": (70.0, 2.0)}
INERTIA = 0.06


def smooth_noise(n, size, rng) -> np.ndarray:
    """Return what predictions miss: small at the onset, growing and smooth."""
    steps = rng.standard_normal((n, SAMPLES))
    grown = np.cumsum(np.cumsum(steps, axis=1), axis=1)
    return size * grown / grown[:, -1].std()


def cell_of(label, *, n_pulse=20, n_stride=120, size=0.01, rng) -> PredictedCell:
    stiffness, damping = TRUE[label]
    joint = InjectedJoint(stiffness, damping, INERTIA, lag_s=LAG_S - 0.002, delay_s=0.002)
    angle = injected_response(TORQUE, joint, period_s=PERIOD_S, window_s=WINDOW_S).shown
    misses = np.zeros((2 * n_stride, 3, SAMPLES))
    misses[:, 0] = smooth_noise(2 * n_stride, size, rng)
    responses = np.zeros((n_pulse, 3, SAMPLES))
    responses[:, 0] = angle + smooth_noise(n_pulse, size, rng)
    responses[:, 1] = TORQUE
    candidate = Candidate(
        0, Pulse(1.0, 0.25, 17.0, label), PulseRecord("S01", "a.nc", 1.0, 0.25, 17.0, label), 0.1
    )
    predicted = Predicted(
        responses=responses,
        misses=misses,
        strides=np.tile(np.arange(n_stride), 2),
        codes=("",) * n_pulse,
        posture_rad=0.3,
        unperturbed_rad=np.zeros(1),
    )
    return PredictedCell(
        label=label,
        candidates=[candidate] * n_pulse,
        predicted=predicted,
        kept=np.ones(n_pulse, dtype=bool),
        period_s=PERIOD_S,
        phase={"LRE": 0.07, "MST": 0.215, "TST": 0.405, "PSW": 0.56}[label],
        stride_s=1.1,
    )


def evidence_with(known=LAG_KNOWN, **options) -> Evidence:
    rng = np.random.default_rng(5)
    cells = tuple(cell_of(label, rng=rng, **options) for label in TRUE)
    posterior, responses = explain_responses(cells, priors_of(known), window_s=WINDOW_S)
    return Evidence("S01", cells, tuple(responses), posterior, known, ((),) * len(cells), WINDOW_S)


@pytest.fixture(scope="module")
def evidence() -> Evidence:
    return evidence_with()


def injected(evidence, injection, *, replicates=3, seed=0):
    rounds = virtual_estimates(
        evidence, injection, replicates=replicates, rng=np.random.default_rng(seed)
    )
    return [e for found in rounds for e in found]


def errors_of(estimates, parameter) -> np.ndarray:
    return np.array(
        [e.value / e.truth - 1.0 for e in estimates if e.parameter == parameter and e.decided]
    )


@pytest.mark.parametrize(("n_pulse", "n_stride"), [(10, 200), (50, 120), (30, 40)])
def test_the_average_of_virtual_pulses_varies_as_that_of_real_ones(n_pulse, n_stride):
    """Pulses against a baseline learned from N strides: 1/n + 1/N of a miss's variance."""
    rng = np.random.default_rng(1)
    cell = cell_of("MST", n_pulse=n_pulse, n_stride=n_stride, rng=rng)
    copies = cell.predicted.misses[:n_stride]
    misses = np.concatenate([copies, copies])  # both virtual onsets of a stride miss alike
    cell = replace(cell, predicted=replace(cell.predicted, misses=misses))
    angle = np.linspace(0.0, 0.3, SAMPLES)

    ends = [
        virtual_cell(cell, angle, rng).predicted.responses[:, 0, -1].mean() for _ in range(2000)
    ]

    wanted = misses[:, 0, -1].var() * (1.0 / n_pulse + 1.0 / n_stride)
    assert np.var(ends) == pytest.approx(wanted, rel=0.12)  # 4 sd of a variance of 2000
    assert np.mean(ends) == pytest.approx(0.3, abs=4.0 * np.sqrt(wanted / 2000))


def test_no_stride_serves_twice_and_the_torque_is_the_studys_own(evidence):
    cell = evidence.cells[0]
    virtual = virtual_cell(cell, np.zeros(SAMPLES), np.random.default_rng(2))
    ends = virtual.predicted.responses[:, 0, -1]

    assert np.unique(ends).size == ends.size == len(cell.used)
    np.testing.assert_allclose(virtual.predicted.responses[:, 1], np.tile(TORQUE, (20, 1)))
    assert virtual.kept.all()
    assert len(virtual.used) == len(cell.used)


def test_what_is_given_is_injected_and_the_rest_is_as_the_study_found_it(evidence):
    rng = np.random.default_rng(3)
    injection = Injection(stiffness={"LRE": 200.0}, inertia=0.1, lag_s=0.012)
    truths = [drawn_truth(evidence, injection, rng) for _ in range(200)]

    assert {t.joints[0].stiffness for t in truths} == {200.0}
    assert {t.joints[0].stiffness_slope for t in truths} == {0.0}
    assert {j.inertia for t in truths for j in t.joints} == {0.1}
    assert [j.lag_s + j.delay_s for j in truths[0].joints] == pytest.approx([0.012] * 4)
    best = evidence.posterior.best
    assert {t.joints[1].stiffness for t in truths} == {best.point(1)[0]}
    drawn = np.array([t.friction_gain for t in truths])
    sd = np.sqrt(best.covariance[-SHARED + FRICTION_GAIN, -SHARED + FRICTION_GAIN])
    assert drawn.mean() == pytest.approx(best.friction_gain, abs=4.0 * sd / np.sqrt(200))
    assert drawn.std() == pytest.approx(sd, rel=0.2)


def test_gains_and_the_frame_are_as_uncertain_as_their_calibration_says(evidence):
    known = LAG_KNOWN.overridden_by(
        CalibrationSpec(
            torque_gain=Calibrated(value=1.0, sd=0.02),
            angle_gain=Calibrated(value=2.0, sd=0.06),
            intrinsic_inertia=Calibrated(value=0.01, sd=0.001),
            intrinsic_stiffness=Calibrated(value=10.0, sd=0.0),
        )
    )
    left_in = (("inertia",), (), ("stiffness",), ())
    other = replace(evidence, known=known, subtract_intrinsic=left_in)
    rng = np.random.default_rng(6)
    truths = [drawn_truth(other, Injection(), rng) for _ in range(500)]
    frames = np.array([t.intrinsic["inertia"] for t in truths])

    assert np.std([t.torque_gain for t in truths]) == pytest.approx(0.02, rel=0.15)
    assert np.std([t.joints[0].angle_gain for t in truths]) == pytest.approx(0.03, rel=0.15)
    np.testing.assert_allclose(frames[:, 0] - frames[:, 1], 0.01)
    assert frames[:, 1].std() == pytest.approx(0.001, rel=0.15)
    assert truths[0].intrinsic["stiffness"] == (0.0, 0.0, 10.0, 0.0)


def test_the_virtual_errors_are_those_of_many_real_participants(evidence):
    """Truth and noise from one source: RMSE of real people with the same noise is expected."""
    virtual = injected(evidence, Injection(), replicates=8)
    inside = [e.ci_low <= e.truth <= e.ci_high for e in virtual if e.decided]

    for parameter, largest in (("stiffness", 0.15), ("damping", 0.1), ("inertia", 0.1)):
        errors = errors_of(virtual, parameter)
        assert errors.size >= 28
        assert np.sqrt((errors**2).mean()) < largest
    assert np.mean(inside) >= 0.85


def test_a_lag_of_which_the_calibration_knows_nothing_shows_as_bias(evidence):
    """A lag T too much reads as B + K T and J + B T (SCIENCE, trap 2)."""
    chosen = Injection(stiffness=60.0, damping=2.5, inertia=INERTIA)
    honest = injected(evidence, replace(chosen, lag_s=LAG_S))
    planted = injected(evidence, replace(chosen, lag_s=LAG_S + 0.005))

    added = {p: errors_of(planted, p).mean() for p in ("damping", "inertia")}
    assert abs(errors_of(honest, "inertia").mean()) < 0.05
    assert added["inertia"] > errors_of(honest, "inertia").mean() + 0.1
    assert max(abs(v) for v in added.values()) > 0.1


def test_own_estimates_are_the_studys_within_three_standard_errors(evidence):
    found = own_estimates(evidence)

    assert list(found) == list(TRUE)
    for label, rows in found.items():
        stiffness = rows[0]
        sd = (stiffness.ci_high - stiffness.ci_low) / 3.92
        assert abs(stiffness.value - TRUE[label][0]) < 3.0 * sd
