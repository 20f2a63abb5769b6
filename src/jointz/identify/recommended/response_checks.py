"""Whether the responses can be those of a joint and its instruments at all; if not, why."""

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

#: Chance that a good timing point is called a misfit.
_LEVEL = 1e-4
#: Chance that walking alone makes a response as large, above which there is none.
_NO_RESPONSE = 1e-3
#: Sd of walking that the answer of a stiff joint (N*m/rad) must exceed to be missed.
_CLEAR, _STIFF = 4.0, 300.0
#: Posterior sd, and a margin, by which the angle must lead the torque to be out of step.
_SD, _MARGIN_S = 2.0, 0.0005
#: Sd by which the responses must move a calibrated lag to speak against it, and the share of the
#: calibration's sd below which they tell nothing of it.
_CONFLICT, _LEAST_TOLD = 4.5, 0.15
#: No joint that is walked with turns further; one in degrees that are taken for radians does.
_WIDEST_RAD = np.pi
_USUAL_PCT = (1.0, 99.0)
#: Share of a pulse's samples at one and the same largest value that makes a flat top, how alike
#: they are, and the share of the command below which a flat top is not what was asked for.
_FLAT_SHARE, _SAME, _ASKED_SHARE = 0.2, 1e-9, 0.95
#: Below this share of the command a flat top is no torque that came.
_CAME_SHARE = 0.2
#: Largest stiffness (N*m/rad) and damping (N*m*s/rad) that the search leaves room for, and an
#: inertia (kg*m^2) that no limb has.
_LARGEST = (4900.0, 98.0, 5.0)
#: Odds against a calibrated lag beyond which it is wrong, and beyond which it is doubted.
_ODDS, DOUBTFUL_ODDS = 1e4, 100.0
_LARGEST_LOG = 700.0


def angle_failure(recording: xr.Dataset) -> Failure | None:
    """Return why the angle cannot be that of a joint in rad."""
    angle = recording["angle"].to_numpy()
    angle = angle[np.isfinite(angle)]
    if angle.size == 0:
        return Failure.CONSTANT_ANGLE
    low, high = np.percentile(angle, _USUAL_PCT)
    return Failure.ANGLE_OUT_OF_RANGE if high - low > _WIDEST_RAD else None


def torque_failure(recording: xr.Dataset, pulses: Sequence[Pulse]) -> Failure | None:
    """Return whether the torque looks clipped.

    A motor at its limit looks like that, whose torque is true, and so does a sensor at its end,
    whose torque is not: K, B and J are then too small by one factor, and the fit is as good. What
    tells the two apart is the shape of the rise, by a factor of the likelihood that a lag which is
    not known well takes back; so it is not tried. A flat top at the commanded torque is no sign
    of either.
    """
    if not pulses or not np.isfinite([p.amplitude for p in pulses]).all():
        return None
    time, torque = recording["time"].to_numpy(), recording["torque"].to_numpy()
    raw = recording["current"].to_numpy() if "current" in recording else torque
    if FRICTION_OF_MODEL in recording:
        torque = torque - recording[FRICTION_OF_MODEL].to_numpy()
    spans = [np.searchsorted(time, [p.onset_s, p.onset_s + _length(p)]) for p in pulses]
    inside = [
        (p.sign * raw[a:b], p.sign * torque[a:b]) for p, (a, b) in zip(pulses, spans, strict=True)
    ]
    top = max((float(np.nanmax(r)) for r, _ in inside if np.isfinite(r).any()), default=np.nan)
    clipped = 0
    for pulse, (record, driving) in zip(pulses, inside, strict=True):
        at_top = record >= top - _SAME * abs(top)
        if record.size and at_top.mean() > _FLAT_SHARE:
            reached = float(np.median(driving[at_top])) / abs(pulse.amplitude)
            clipped += _CAME_SHARE < reached < _ASKED_SHARE
    return Failure.TORQUE_SATURATED if clipped > len(pulses) / 2 else None


def _length(pulse: Pulse) -> float:
    return pulse.duration_s if np.isfinite(pulse.duration_s) else 0.1


def shared_failure(
    failures: Mapping[str, Failure | None], shared: Failure
) -> dict[str, Failure | None]:
    """Return failures with one of the instruments for all that it explains."""
    explained = (None, Failure.MODEL_MISFIT, Failure.OPPOSITE_SIGN)
    return {
        label: shared if failure in explained else failure for label, failure in failures.items()
    }


def response_failure(response: CellResponse) -> Failure | None:
    """Return why an average response is none, before anything is fitted to it.

    A joint that is moved from rest takes in energy as long as its stiffness is that of a spring,
    however late the sensor: where it gave energy, torque or angle has the wrong sign.
    """
    angle, torque = response.angle, response.torque.sum(axis=0)
    if float(angle @ response.weights() @ angle) < chi2.ppf(1.0 - _NO_RESPONSE, angle.size):
        error = _CLEAR * float(np.sqrt(np.diag(response.noise).max()))
        # Where walking would hide a stiff joint's answer too, nothing is decided.
        clear = error < float(np.abs(torque).max()) / _STIFF
        return Failure.CONSTANT_ANGLE if clear else None
    work = float(0.5 * (torque[1:] + torque[:-1]) @ np.diff(angle))
    return Failure.OPPOSITE_SIGN if work < 0.0 else None


def common_failure(failures: Mapping[str, Failure | None]) -> dict[str, Failure | None]:
    """Return failures with that of the most for all, where half of the timing points have one.

    All share sensors and actuator: the others' answers are no better for having passed. Where
    most do not move in response, a sign that seems wrong is one of chance.
    """
    found = Counter(failure for failure in failures.values() if failure is not None)
    if 2 * found.total() < len(failures):
        return dict(failures)
    usual = found.most_common(1)[0][0]
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
    """Return the odds that the responses give against the lag that was calibrated; 0 without.

    Evidence with the prior of a lag of which nothing is known, over that with the calibration's.
    Of a calibration that is right it exceeds x in fewer than one case in x (Markov's inequality),
    as long as the joint is one that the hypotheses hold.
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
    """Return whether angle and torque are further apart in time than known, or can be followed.

    A calibrated lag may be contradicted by the evidence or, where another hypothesis explains
    that away, by being moved further than responses which agree with it would.
    """
    lag = posterior.lag_s()
    mean, sd = priors.lag_s
    if priors.lag_s != Priors().lag_s:
        # Responses that agree with a calibration move it by what they add to its precision, and
        # by what hypotheses disagree about.
        apart = lag.sources["model"]
        added = sd**2 - (lag.variance - apart)
        usual = np.sqrt(max(added + apart, (_LEAST_TOLD * sd) ** 2))
        moved = abs(lag.mean - mean) > _CONFLICT * usual
        return Failure.LAG_OUT_OF_RANGE if moved or odds > _ODDS else None
    if lag.mean > longest_s:
        return Failure.LAG_OUT_OF_RANGE
    early = lag.mean + _SD * float(np.sqrt(lag.variance)) + _MARGIN_S < 0.0
    return Failure.OUT_OF_STEP if early else None


def fit_failure(i: int, posterior: JointPosterior, response: CellResponse) -> Failure | None:
    """Return whether a joint and its sensor explain the response of a timing point.

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
