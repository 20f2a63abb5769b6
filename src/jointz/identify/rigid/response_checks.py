"""Checks whether responses can be those of a joint and its instruments."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from jointz.core.codes import Failure
from jointz.identify.prediction.signal_checks import shows_stiff_joint, smallest_response
from jointz.identify.rigid.response_model import CellResponse, Priors
from jointz.identify.rigid.response_posterior import JointPosterior, inertia_evidence
from jointz.results.impedance_limits import LARGEST_IMPEDANCE

#: Probability that a good timing point is called a misfit.
_LEVEL = 1e-4
#: Posterior sds, and a margin, by which the angle leads the torque if they are out of step.
_SD, _MARGIN_S = 2.0, 0.0005
#: Sds by which the responses move a calibrated lag that they contradict, and the least sd that is
#: assumed for this, as a share of the calibration's.
_CONFLICT, _LEAST_SHARE = 4.5, 0.15
#: Odds against a calibrated lag above which it is wrong, and above which it is doubted.
_ODDS, DOUBTFUL_ODDS = 1e4, 100.0
_LARGEST_LOG = 700.0


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
    if float(angle @ response.weights() @ angle) < smallest_response(angle.size):
        return Failure.CONSTANT_ANGLE if shows_stiff_joint(response.noise, torque) else None
    work = float(0.5 * (torque[1:] + torque[:-1]) @ np.diff(angle))
    return Failure.OPPOSITE_SIGN if work < 0.0 else None


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
    if any(value > largest for value, largest in zip(values, LARGEST_IMPEDANCE, strict=True)):
        return Failure.OUTSIDE_RANGE
    off = response.angle - posterior.fitted(i)
    misfit = float(off @ response.weights() @ off)
    return Failure.MODEL_MISFIT if misfit > chi2.ppf(1.0 - _LEVEL, off.size) else None
