"""Average responses of predicted pulses, and their explanation by a joint and its sensor."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import toeplitz

from jointz.core.study import Calibrated, CalibrationSpec
from jointz.identify.prediction.predicted_cells import FINEST_RAD, PredictedCell, unlike_from
from jointz.identify.prediction.unperturbed_prediction import LEAD_SAMPLES
from jointz.identify.preparation.calibration import pooled_calibration, twist_sd, value_of
from jointz.identify.rigid.response_model import (
    CellResponse,
    Posterior,
    Priors,
    response_to_kick,
)
from jointz.identify.rigid.response_posterior import (
    JointPosterior,
    compare_sensors,
    estimate_responses,
)
from jointz.kernels.noise_covariance import shrunk_covariance
from jointz.kernels.robust_spread import robust_sd

#: Longest lag that is modelled; with a longer one the window would extend into later motion.
LONGEST_LAG_S = 0.03
#: In a longer window K and B change in ways that no hypothesis includes and no misfit reveals.
LONGEST_WINDOW_S = 0.12
#: Smallest noise of a sample, below the resolution of goniometers.
_RESOLUTION_RAD = 2e-5
#: Smallest sds of a calibration, rad/(N*m) and logarithm of Hz; the search divides by them.
_LEAST_TWIST_SD, _LEAST_RESONANCE_SD = 1e-7, 1e-3


def known_together(calibrations: Sequence[CalibrationSpec]) -> CalibrationSpec:
    """Combine the calibrations of a participant's pulses.

    An entry that was calibrated in one session only has, in the others, its prior without
    calibration.
    """
    unknown = Priors()
    resonance_hz = float(np.exp(unknown.log_resonance[0]))
    entries = {
        "angle_lag_s": unknown.lag_s,
        "friction_gain": unknown.friction_gain,
        "angle_per_torque": unknown.cross_talk,
        "tissue_hz": (resonance_hz, unknown.log_resonance[1] * resonance_hz),
    }
    usual = {name: Calibrated(value=value, sd=sd) for name, (value, sd) in entries.items()}
    return pooled_calibration(calibrations, usual=usual)


def priors_of(known: CalibrationSpec) -> Priors:
    """Return priors of the instruments from their calibration, wide for unknown entries."""
    priors = _twist_and_tissue(Priors(), known)
    friction = known.friction_gain
    if friction is not None:
        # The torque already includes its value.
        priors = replace(priors, friction_gain=(1.0, max(friction.sd / friction.value, 1e-5)))
    angle, torque = known.angle_lag_s, known.torque_lag_s
    if angle is not None or torque is not None:
        none = Calibrated(value=0.0, sd=0.0)
        late, early = angle or none, torque or none
        sd = float(np.hypot(late.sd, early.sd))
        # The lag of the angle was not calibrated: it keeps its prior.
        if angle is None:
            sd = float(np.hypot(sd, priors.lag_s[1]))
            late = Calibrated(value=priors.lag_s[0], sd=0.0)
        priors = replace(priors, lag_s=(late.value - early.value, max(sd, 1e-5)))
    return priors


def _twist_and_tissue(priors: Priors, known: CalibrationSpec) -> Priors:
    twist, tissue = known.angle_per_torque, known.tissue_hz
    if twist is not None:
        # The model's angle is that of the joint, the entry's what is shown.
        shown = twist.value / value_of(known.angle_gain, 1.0)
        priors = replace(priors, cross_talk=(shown, max(twist_sd(known), _LEAST_TWIST_SD)))
    if tissue is not None:
        sd = max(tissue.sd / tissue.value, _LEAST_RESONANCE_SD)
        priors = replace(priors, log_resonance=(float(np.log(tissue.value)), sd))
    return priors


def _response(
    cell: PredictedCell, *, window_s: float, lag_s: float, fit: tuple[Posterior | None, int]
) -> CellResponse:
    """Average the responses over the window, with the covariance of the average's error.

    An error of the predicted torque moves the joint; that part of the angle's error is removed,
    because the measured torque explains it.
    """
    late_s = float(np.clip(lag_s, 0.0, LONGEST_LAG_S))
    n = int((window_s + late_s) / cell.period_s + 1e-9) + 1 + LEAD_SAMPLES
    responses = cell.predicted.responses[cell.kept][:, :, :n]
    misses = cell.predicted.misses[:, :, :n]
    missed = misses[:, 0]
    posterior, i = fit
    if posterior is not None:
        kick = response_to_kick(posterior, i, period_s=cell.period_s, n=n)
        lower = toeplitz(kick, np.zeros(n))
        missed = missed - (misses[:, 1] + posterior.friction_gain * misses[:, 2]) @ lower.T
    usual = (np.abs(missed) <= unlike_from(robust_sd(missed))).all(axis=1)
    n_strides = cell.predicted.n_strides
    share = 1.0 / len(responses) + 1.0 / n_strides
    # The size of the noise is known from so many strides: variance of Student's t.
    share *= (n_strides - 1) / (n_strides - 3)
    average = responses.mean(axis=0)
    return CellResponse(
        label=cell.label,
        angle=average[0],
        torque=average[1:],
        noise=shrunk_covariance(np.cov(missed[usual].T) + _RESOLUTION_RAD**2 * np.eye(n), n_strides)
        * share
        + FINEST_RAD**2 * np.eye(n),
        period_s=cell.period_s,
        phase=cell.phase,
        stride_s=cell.stride_s,
        lead_s=LEAD_SAMPLES * cell.period_s,
    )


def explain_responses(
    cells: Sequence[PredictedCell], priors: Priors, *, window_s: float
) -> tuple[JointPosterior, list[CellResponse]]:
    """Explain the responses of all timing points of a participant."""
    sensors: tuple[Posterior, ...] = ()
    # The window depends on the lag, and the noise on the fit.
    responses = _responses(cells, None, window_s=window_s, lag_s=priors.lag_s[0])
    for _ in range(2):
        sensors = compare_sensors(responses, priors, window_s=window_s, earlier=sensors)
        likelier = max(sensors, key=lambda sensor: sensor.log_evidence)
        responses = _responses(cells, likelier, window_s=window_s, lag_s=likelier.late_s)
    sensors = compare_sensors(responses, priors, window_s=window_s, earlier=sensors)
    return estimate_responses(responses, priors, window_s=window_s, sensors=sensors), responses


def _responses(
    cells: Sequence[PredictedCell], fit: Posterior | None, *, window_s: float, lag_s: float
) -> list[CellResponse]:
    return [
        _response(cell, window_s=window_s, lag_s=lag_s, fit=(fit, i))
        for i, cell in enumerate(cells)
    ]


def average_responses(cell: PredictedCell, *, window_s: float) -> CellResponse:
    """Average the responses of a timing point, before any fit."""
    return _response(cell, window_s=window_s, lag_s=LONGEST_LAG_S, fit=(None, 0))
