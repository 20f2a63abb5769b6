"""Checks whether responses can be those of a joint and its instruments."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import xarray as xr
from scipy.stats import chi2

from jointz.core.codes import Failure
from jointz.identify.preparation.pulses import Pulse
from jointz.identify.preparation.sources import FRICTION_OF_MODEL
from jointz.identify.recommended.response_model import CellResponse, Priors
from jointz.identify.recommended.response_posterior import JointPosterior, inertia_evidence

#: Probability that a good timing point is called a misfit.
_LEVEL = 1e-4
#: A response that walking alone makes as large with a higher probability is none.
_NO_RESPONSE = 1e-3
#: The response of a stiff joint (N*m/rad) must exceed so many sds of walking.
_CLEAR, _STIFF = 4.0, 300.0
#: Posterior sds, and a margin, by which the angle leads the torque if they are out of step.
_SD, _MARGIN_S = 2.0, 0.0005
#: Sds by which the responses move a calibrated lag that they contradict, and the least sd that is
#: assumed for this, as a share of the calibration's.
_CONFLICT, _LEAST_SHARE = 4.5, 0.15
#: Widest range of a walking joint; degrees that are declared as radians exceed it.
_WIDEST_RAD = np.pi
_USUAL_PCT = (1.0, 99.0)
#: A flat top has this share of a pulse's samples at the largest value, within a tolerance; it is a
#: sign of clipping if it lies between these shares of the command.
_FLAT_SHARE, _SAME = 0.2, 1e-9
_CLIPPED_SHARES = (0.2, 0.95)
#: Largest stiffness (N*m/rad) and damping (N*m*s/rad) of the search, and an inertia (kg*m^2) above
#: that of any limb.
_LARGEST = (4900.0, 98.0, 5.0)
#: Odds against a calibrated lag above which it is wrong, and above which it is doubted.
_ODDS, DOUBTFUL_ODDS = 1e4, 100.0
_LARGEST_LOG = 700.0


def angle_failure(recording: xr.Dataset) -> Failure | None:
    """Return why the angle cannot be that of a joint in rad, None if it can."""
    angle = recording["angle"].to_numpy()
    angle = angle[np.isfinite(angle)]
    if angle.size == 0:
        return Failure.CONSTANT_ANGLE
    low, high = np.percentile(angle, _USUAL_PCT)
    return Failure.ANGLE_OUT_OF_RANGE if high - low > _WIDEST_RAD else None


def torque_failure(recording: xr.Dataset, pulses: Sequence[Pulse]) -> Failure | None:
    """Return a failure if the torque looks clipped.

    Both a motor at its limit, whose torque is correct, and a saturated sensor, whose torque is too
    small, clip it; the latter makes K, B and J too small by one factor without a worse fit. The
    shape of the rise distinguishes them only if the lag is known well, so this is not attempted.
    A flat top at the commanded torque indicates neither.
    """
    if not pulses or not np.isfinite([p.amplitude for p in pulses]).all():
        return None
    time, torque = recording["time"].to_numpy(), recording["torque"].to_numpy()
    raw = recording["current"].to_numpy() if "current" in recording else torque
    if FRICTION_OF_MODEL in recording:
        torque = torque - recording[FRICTION_OF_MODEL].to_numpy()
    durations = [p.duration_s if np.isfinite(p.duration_s) else 0.1 for p in pulses]
    spans = [
        np.searchsorted(time, [p.onset_s, p.onset_s + d])
        for p, d in zip(pulses, durations, strict=True)
    ]
    inside = [
        (p.sign * raw[a:b], p.sign * torque[a:b]) for p, (a, b) in zip(pulses, spans, strict=True)
    ]
    top = max((float(np.nanmax(r)) for r, _ in inside if np.isfinite(r).any()), default=np.nan)
    clipped = 0
    for pulse, (record, driving) in zip(pulses, inside, strict=True):
        at_top = record >= top - _SAME * abs(top)
        if record.size and at_top.mean() > _FLAT_SHARE:
            reached = float(np.median(driving[at_top])) / abs(pulse.amplitude)
            clipped += _CLIPPED_SHARES[0] < reached < _CLIPPED_SHARES[1]
    return Failure.TORQUE_SATURATED if clipped > len(pulses) / 2 else None


def shared_failure(
    failures: Mapping[str, Failure | None], shared: Failure
) -> dict[str, Failure | None]:
    """Return failures with one of the instruments in place of those that it explains."""
    explained = (None, Failure.MODEL_MISFIT, Failure.OPPOSITE_SIGN)
    return {
        label: shared if failure in explained else failure for label, failure in failures.items()
    }


def response_failure(response: CellResponse) -> Failure | None:
    """Return why an average response cannot be fitted, None if it can.

    A joint that is moved from rest takes in energy as long as its stiffness is not negative,
    whatever the lag of the sensor: if it gives energy, torque or angle has the wrong sign.
    """
    angle, torque = response.angle, response.torque.sum(axis=0)
    if float(angle @ response.weights() @ angle) < chi2.ppf(1.0 - _NO_RESPONSE, angle.size):
        error = _CLEAR * float(np.sqrt(np.diag(response.noise).max()))
        # Walking must not hide the response of a stiff joint, too.
        clear = error < float(np.abs(torque).max()) / _STIFF
        return Failure.CONSTANT_ANGLE if clear else None
    work = float(0.5 * (torque[1:] + torque[:-1]) @ np.diff(angle))
    return Failure.OPPOSITE_SIGN if work < 0.0 else None


def common_failure(failures: Mapping[str, Failure | None]) -> dict[str, Failure | None]:
    """Return failures with the most frequent one for all, if half of the timing points fail.

    All share sensors and actuator, so that the others are no more reliable. If most do not move
    in response, a wrong sign is due to chance.
    """
    counts = Counter(failure for failure in failures.values() if failure is not None)
    if 2 * counts.total() < len(failures):
        return dict(failures)
    usual = counts.most_common(1)[0][0]
    by_chance = Failure.OPPOSITE_SIGN if usual is Failure.CONSTANT_ANGLE else None
    return {
        label: usual if failure in (None, by_chance) else failure
        for label, failure in failures.items()
    }


def lag_odds(
    posterior: JointPosterior,
    responses: Sequence[CellResponse],
    priors: Priors,
    *,
    window_s: float,
) -> float:
    """Return the odds of the responses against the calibrated lag; 0 without a calibration.

    This is the evidence with the prior of an unknown lag over that with the calibration's. For a
    correct calibration it exceeds x in fewer than one case in x (Markov's inequality), if one of
    the hypotheses is true.
    """
    unknown = replace(priors, lag_s=Priors().lag_s)
    if priors.lag_s == unknown.lag_s:
        return 0.0
    best = posterior.best
    plain = replace(best, hypothesis=replace(best.hypothesis, resonance=False))
    sensors = (best, plain) if best.hypothesis.resonance else (best,)
    calibrated = inertia_evidence(responses, priors, window_s=window_s, start=best)
    other = max(
        inertia_evidence(responses, unknown, window_s=window_s, start=start) for start in sensors
    )
    return float(np.exp(min(other - calibrated, _LARGEST_LOG)))


def instrument_failure(
    posterior: JointPosterior, priors: Priors, *, odds: float, longest_s: float
) -> Failure | None:
    """Return a failure if the lag contradicts its calibration or cannot be modelled.

    A calibrated lag is contradicted by the odds or, if another hypothesis explains these away, by
    moving further than responses that agree with it would move it.
    """
    lag = posterior.lag_s()
    mean, sd = priors.lag_s
    if priors.lag_s != Priors().lag_s:
        # Responses that agree with a calibration move it by the precision that they add, and by
        # the difference between hypotheses.
        apart = lag.sources["model"]
        added = sd**2 - (lag.variance - apart)
        usual = np.sqrt(max(added + apart, (_LEAST_SHARE * sd) ** 2))
        moved = abs(lag.mean - mean) > _CONFLICT * usual
        return Failure.LAG_OUT_OF_RANGE if moved or odds > _ODDS else None
    if lag.mean > longest_s:
        return Failure.LAG_OUT_OF_RANGE
    early = lag.mean + _SD * float(np.sqrt(lag.variance)) + _MARGIN_S < 0.0
    return Failure.OUT_OF_STEP if early else None


def fit_failure(i: int, posterior: JointPosterior, response: CellResponse) -> Failure | None:
    """Return a failure if no joint and sensor explain the response of a timing point.

    The weighted sum of squares is chi-square distributed with at most as many degrees of freedom
    as there are samples, where the model holds; the chance of a false alarm is 1e-4 or less.
    """
    inertia = float(np.exp(posterior.log_inertia(i).mean))
    values = (posterior.stiffness(i).mean, posterior.damping(i).mean, inertia)
    if any(value > largest for value, largest in zip(values, _LARGEST, strict=True)):
        return Failure.OUTSIDE_RANGE
    off = response.angle - posterior.fitted(i)
    misfit = float(off @ response.weights() @ off)
    return Failure.MODEL_MISFIT if misfit > chi2.ppf(1.0 - _LEVEL, off.size) else None
