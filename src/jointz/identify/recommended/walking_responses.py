"""From predicted pulses to the responses that a joint and its sensor are to explain."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from jointz.core.study import Calibrated, CalibrationSpec
from jointz.identify.preparation.assignment import Candidate
from jointz.identify.preparation.calibration import pooled_calibration, twist_sd, value_of
from jointz.identify.recommended.response_model import (
    CellResponse,
    Posterior,
    Priors,
    response_to_kick,
)
from jointz.identify.recommended.response_posterior import (
    JointPosterior,
    compare_sensors,
    estimate_responses,
)
from jointz.identify.recommended.unperturbed_prediction import LEAD_SAMPLES, Predicted
from jointz.kernels.noise_covariance import shrunk_covariance
from jointz.kernels.robust_spread import robust_moments, robust_sd

#: A lag longer than this is not followed: the window would reach into what the joint does later.
LONGEST_LAG_S = 0.03
#: K and B change in a longer window in ways that no hypothesis holds, and no misfit shows it.
LONGEST_WINDOW_S = 0.12
#: No angle is known better (0.01 degrees), nor does any joint follow the model more closely.
_FINEST_RAD = 2e-4
#: Finer than any goniometer resolves; without noise nothing would be new in a sample.
_RESOLUTION_RAD = 2e-5
#: Sd of what the prediction misses, beyond which a response is not like its neighbours'.
_UNLIKE_SD = 8.0
_FEWEST_TO_COMPARE = 4
#: What is said to be exact is taken for this exact: the search divides by it, rad/(N*m) and
#: logarithm of Hz.
_LEAST_TWIST_SD, _LEAST_RESONANCE_SD = 1e-7, 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class PredictedCell:
    """A timing point whose pulses were predicted."""

    label: str  # the timing point
    candidates: list[Candidate]  # the pulses that a prediction was asked for
    predicted: Predicted  # their responses, and what the prediction misses
    kept: np.ndarray  # responses that count
    period_s: float  # s: between samples
    phase: float  # mean predicted phase of the onsets, cycles; NaN where unknown
    stride_s: float  # s: duration of a stride

    @property
    def used(self) -> list[Candidate]:
        """Pulses whose responses count."""
        fine = [
            c for c, code in zip(self.candidates, self.predicted.codes, strict=True) if not code
        ]
        return [c for c, keep in zip(fine, self.kept, strict=True) if keep]


def known_together(calibrations: Sequence[CalibrationSpec]) -> CalibrationSpec:
    """Combine the calibrations of a participant's pulses.

    A lag, a friction, a twist or a tissue that was calibrated in one session only is, in the
    others, what it is where nothing was calibrated: wide, not perfect.
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
    """Return what is known of the instruments as priors; wide where nothing was said."""
    priors = _twist_and_tissue(Priors(), known)
    friction = known.friction_gain
    if friction is not None:
        # The torque was made with its value already.
        priors = replace(priors, friction_gain=(1.0, max(friction.sd / friction.value, 1e-5)))
    angle, torque = known.angle_lag_s, known.torque_lag_s
    if angle is not None or torque is not None:
        none = Calibrated(value=0.0, sd=0.0)
        late, early = angle or none, torque or none
        sd = float(np.hypot(late.sd, early.sd))
        # Only one of the two was measured: the other may still be anything usual.
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
    """Average the responses over the window, and say how far off the average may be.

    Torque that the prediction misses moves the joint: its share in the missed angle is no
    error, as the measured torque explains it.
    """
    late_s = float(np.clip(lag_s, 0.0, LONGEST_LAG_S))
    n = int((window_s + late_s) / cell.period_s + 1e-9) + 1 + LEAD_SAMPLES
    responses = cell.predicted.responses[cell.kept][:, :, :n]
    misses = cell.predicted.misses[:, :, :n]
    missed = misses[:, 0]
    posterior, i = fit
    if posterior is not None:
        kick = response_to_kick(posterior, i, period_s=cell.period_s, n=n)
        lower = np.tril(kick[np.subtract.outer(np.arange(n), np.arange(n)).clip(0)])
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
        + _FINEST_RAD**2 * np.eye(n),
        period_s=cell.period_s,
        phase=cell.phase,
        stride_s=cell.stride_s,
        lead_s=LEAD_SAMPLES * cell.period_s,
    )


def unlike_from(sd: np.ndarray) -> np.ndarray:
    """Return the deviation from which on a response is not like its neighbours'."""
    return np.asarray(_UNLIKE_SD * np.hypot(sd, _FINEST_RAD))


def explain_responses(
    cells: Sequence[PredictedCell], priors: Priors, *, window_s: float
) -> tuple[JointPosterior, list[CellResponse]]:
    """Explain the responses of all timing points of a participant."""
    sensors: tuple[Posterior, ...] = ()
    # The lag says how long the window must be, and the fit what missed torque explains.
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
    """Average the responses of a timing point, before anything is known of its joint."""
    return _response(cell, window_s=window_s, lag_s=LONGEST_LAG_S, fit=(None, 0))


def alike(predicted: Predicted, *, whole: np.ndarray | None = None) -> np.ndarray:
    """Tell which responses are like the others, by what the prediction usually misses.

    The usual response is the median one, per torque: a pulse of twice the torque moves the joint
    twice as far and is not unlike for that.
    """
    angles = predicted.responses[:, 0]
    fine = np.ones(len(angles), dtype=bool) if whole is None else whole
    if fine.sum() < _FEWEST_TO_COMPARE:
        return fine
    torque = predicted.responses[:, 1:].sum(axis=1)
    shape = torque[fine].mean(axis=0)
    size = torque @ shape / (shape @ shape)
    usual, _ = robust_moments(angles[fine] / size[fine, None])
    off = np.abs(angles - size[:, None] * usual)
    limit = unlike_from(robust_sd(predicted.misses[:, 0]))
    return np.asarray(fine & (off <= limit).all(axis=1))
