"""Fits of one average and of its neighbours, against scipy and the likelihood of one record."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.signal import StateSpace, lsim

from jointz.kernels.series.second_order import PulseRecord, maximise_likelihood
from jointz.kernels.series.second_order_averages import Drive, fit_driven, refit, whitened_errors

STEP_S = 1e-3
N, LEAD = 100, 20
TRUTH = np.array([50.0, 1.5, 0.05])
START = np.array([40.0, 1.0, 0.06, 0.0])


def simulated(joint, torque) -> np.ndarray:
    """Return the angle that a torque drives from rest, by scipy."""
    K, B, J = joint
    plant = StateSpace([[0.0, 1.0], [-K / J, -B / J]], [[0.0], [1.0 / J]], [[1.0, 0.0]], [[0.0]])
    return lsim(plant, torque, np.arange(torque.size) * STEP_S)[1]


def record(joint=TRUTH, *, angle_sd=0.0, torque_sd=0.0, seed=0):
    """Return angle from the onset and torque with its lead and tail."""
    rng = np.random.default_rng(seed)
    t = (np.arange(N + 2 * LEAD) - LEAD) * STEP_S
    torque = 17.0 * np.interp(t, [0.0, 0.03], [0.0, 1.0])
    angle = simulated(joint, torque[LEAD : LEAD + N])
    angle = angle + angle_sd * rng.standard_normal(N)
    return angle, torque + torque_sd * rng.standard_normal(t.size)


def drive(**changed) -> Drive:
    given = {"lead": LEAD, "step_s": STEP_S, "noise_sd": (1e-3, 0.0), "lag_sd_s": 0.0}
    return Drive(**{**given, **changed})


@pytest.mark.parametrize("joint", [TRUTH, (-20.0, 1.5, 0.05), (0.0, 0.5, 0.1), (50.0, -0.3, 0.05)])
def test_values_of_any_sign_come_back_without_noise(joint):
    angle, torque = record(joint)
    fit = fit_driven(angle, torque, START, drive(), bounded=False)
    assert fit.converged
    np.testing.assert_allclose(fit.values[:3], joint, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("seed", range(2))
def test_the_fit_is_that_of_the_likelihood_of_one_record(seed):
    angle, torque = record(angle_sd=5e-4, torque_sd=0.05, seed=seed)
    noise = (5e-4, 0.05)
    mine = fit_driven(angle, torque, START, drive(noise_sd=noise, lag_sd_s=None), bounded=False)
    single = PulseRecord(angle, torque, LEAD, STEP_S, at_rest=True)
    theirs = maximise_likelihood(single, np.append(START, 0.0), noise_sd=noise, lag_prior=None)
    assert mine.converged
    sd = np.sqrt(np.diag(theirs.covariance))[:4]
    assert (np.abs(mine.values - theirs.values[:4]) < 0.02 * sd).all()


def test_bounds_hold_what_would_be_negative_and_refit_the_others():
    angle, torque = record((-20.0, 1.5, 0.05))
    fit = fit_driven(angle, torque, START, drive(), bounded=True)
    held = least_squares(
        lambda p: angle - simulated((0.0, *p), torque[LEAD : LEAD + N]),
        START[1:3],
        x_scale=START[1:3],
    )
    assert fit.converged
    assert fit.values[0] == 0.0
    np.testing.assert_allclose(fit.values[1:3], held.x, rtol=5e-3)


@pytest.mark.parametrize("lag_sd_s", [0.0, None, 1e-3])
def test_averages_nearby_are_fitted_as_they_would_be_one_by_one(lag_sd_s):
    settings = drive(noise_sd=(5e-4, 0.02), lag_sd_s=lag_sd_s)
    angle, torque = record()
    fit = fit_driven(angle, torque, START, settings, bounded=False)
    rng = np.random.default_rng(2)
    angles = angle + 4e-5 * rng.standard_normal((8, N))
    torques = torque + 2e-3 * rng.standard_normal((8, torque.size))
    gram, moment = refit(fit, angles, torques, settings)
    quick = np.linalg.solve(gram, moment[:, :, None])[:, :, 0]
    slow = np.array(
        [
            fit_driven(a, t, fit.values, settings, bounded=False).values[:3]
            for a, t in zip(angles, torques, strict=True)
        ]
    )
    spread = (slow - fit.values[:3]).std(axis=0)
    assert (np.abs(quick - slow) < 0.02 * spread).all()


def test_a_joint_too_quick_for_the_record_has_no_errors():
    angle, torque = record()
    quick = np.array([1e6, 1.0, 1e-3, 0.0])
    assert np.isnan(whitened_errors(quick, quick, angle[None], torque[None], drive())).all()
    assert not fit_driven(angle, torque, quick, drive(), bounded=False).converged


@pytest.mark.parametrize(
    ("start", "noise"), [((40.0, 1.0, 0.0, 0.0), (1e-3, 0.0)), (tuple(START), (0.0, 0.1))]
)
def test_impossible_starts_are_refused(start, noise):
    angle, torque = record()
    with pytest.raises(ValueError, match="> 0"):
        fit_driven(angle, torque, np.array(start), drive(noise_sd=noise), bounded=False)
