"""Checks of the clocks of angle and torque, where they are two, by the responses to pulses."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.integrate import cumulative_trapezoid

from jointz.core.codes import Failure
from jointz.identify.prediction.predicted_cells import CellPredictor
from jointz.identify.prediction.unperturbed_prediction import Predicted
from jointz.identify.preparation.assignment import assign_pulses
from jointz.identify.preparation.channel_clocks import sampled_hz
from jointz.identify.preparation.raw_signals import TORQUE_ROWS
from jointz.identify.preparation.sources import ParticipantSettings, Source
from jointz.kernels.derivatives import derivative

#: Responses are compared from so long before a pulse to so long after its onset, s.
_BEFORE_S, _AFTER_S = 0.06, 0.13
_FEWEST = 6
#: Standard errors, and times, beyond which clocks drift apart or the angle leads the torque.
_SURE, _DRIFT_S, _LEAD_S = 4.0, 2e-3, 2e-3
#: Shifts that are tried, s, and the pseudo-inverse's least eigenvalue of a covariance.
_SHIFTS_S = np.arange(-0.05, 0.0501, 1e-3)
_LEAST_EIGENVALUE = 1e-4


def clock_failure(
    participant: str, sources: Sequence[Source], settings: ParticipantSettings
) -> tuple[Failure, str] | None:
    """Return why the angle's own clock cannot be right, with the error; None if it can."""
    pulsed = [s for s in sources if s.input.condition == "perturbed" and s.pulses]
    own_clock = (s for s in pulsed if "angle" in sampled_hz(s.input.recording))
    if not (settings.kind.by_gait and any(own_clock)):
        return None
    candidates = assign_pulses(participant, sources, settings, baseline="predicted", alone=True)
    # Responses begin before the onsets: the angle may lead the torque.
    early = [
        replace(c, pulse=replace(c.pulse, onset_s=c.pulse.onset_s - _BEFORE_S)) for c in candidates
    ]
    predictor = CellPredictor(sources, settings, reach_s=_BEFORE_S + _AFTER_S)
    cell, _ = predictor.predict("all", early)
    if cell is None or len(cell.used) < _FEWEST:
        return None
    predicted, period_s = cell.predicted.of(cell.kept), cell.period_s
    onset_s = np.array([c.pulse.onset_s + _BEFORE_S for c in cell.used])
    drift_s = _drift_s(predicted, onset_s, period_s)
    if drift_s is not None:
        return Failure.CLOCKS_DRIFT, (
            f"the angle moves by {1e3 * drift_s:.3g} ms against the torque over the pulses; join "
            "it as a file with two events_s"
        )
    lead_s = _lead_s(predicted, period_s)
    if lead_s is not None:
        return Failure.OUT_OF_STEP, (
            f"the angle moves {1e3 * lead_s:.3g} ms before the torque; correct the start of its "
            "clock"
        )
    return None


def _drift_s(predicted: Predicted, onset_s: np.ndarray, period_s: float) -> float | None:
    """Return how far later responses are shifted against earlier ones, s; None if they are not."""
    angles = predicted.sign_aligned[:, 0]
    mean = angles.mean(axis=0)
    whiten = _whitening(predicted.prediction_errors[:, 0])
    speed = derivative(mean, rate_hz=1.0 / period_s)
    basis = whiten @ np.stack([mean, -speed, np.ones_like(mean)], axis=1)
    shift_s = np.linalg.lstsq(basis, whiten @ angles.T, rcond=None)[0][1]
    since = onset_s - onset_s.mean()
    slope = float(since @ shift_s / (since @ since))
    left = shift_s - shift_s.mean() - slope * since
    error = float(np.sqrt(left @ left / (len(left) - 2) / (since @ since)))
    span_s = float(np.ptp(onset_s))
    sure = abs(slope) > _SURE * error and abs(slope) * span_s > _DRIFT_S
    return slope * span_s if sure else None


def _lead_s(predicted: Predicted, period_s: float) -> float | None:
    """Return how long the angle moves before the torque, s; None if it follows.

    After its onset a torque makes an acceleration, then damping and stiffness tell: the mean
    response is a sum of the torque's integrals, shifted by the lag.
    """
    mean = predicted.sign_aligned.mean(axis=0)
    time_s = np.arange(mean.shape[1]) * period_s
    n = int(np.searchsorted(time_s, time_s[-1] + _SHIFTS_S[0]))  # all shifts are within
    integrals = [mean[TORQUE_ROWS].sum(axis=0)]
    for _ in range(4):
        integrals.append(cumulative_trapezoid(integrals[-1], dx=period_s, initial=0.0))
    whiten = _whitening(predicted.prediction_errors[:, 0, :n]) * np.sqrt(len(predicted.responses))
    target = whiten @ mean[0, :n]
    misfit = np.empty(_SHIFTS_S.size)
    for k, shift_s in enumerate(_SHIFTS_S):
        rows = [np.interp(time_s[:n] - shift_s, time_s, one, left=0.0) for one in integrals[2:]]
        basis = whiten @ np.stack([*rows, np.ones(n)], axis=1)
        left = target - basis @ np.linalg.lstsq(basis, target, rcond=None)[0]
        misfit[k] = left @ left
    scale = max(1.0, misfit.min() / (n - 4))
    near = _SHIFTS_S[misfit <= misfit.min() + _SURE**2 * scale]
    return -float(_SHIFTS_S[misfit.argmin()]) if near.max() < -_LEAD_S else None


def _whitening(errors: np.ndarray) -> np.ndarray:
    """Return the matrix (n, n) that makes the errors of a prediction (v, n) white."""
    values, vectors = np.linalg.eigh(errors.T @ errors / len(errors))
    return np.asarray((vectors / np.sqrt(np.maximum(values, _LEAST_EIGENVALUE * values[-1]))).T)
