"""Reported values, limits, statuses and doubts of a timing point."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.special import ndtr
from scipy.stats import chi2, norm

from jointz.core.codes import Doubt
from jointz.core.study import Calibrated, CalibrationSpec
from jointz.identify.preparation.calibration import gains_sd, relative_sd
from jointz.identify.preparation.cell_data import PARAMETERS, intrinsic_impedance
from jointz.identify.regression.cell_parameters import per_mass
from jointz.identify.walking.body import Body
from jointz.identify.walking.coupling import STRAP, Coupling, ModelError
from jointz.identify.walking.estimands import ESTIMANDS, LogMoments
from jointz.identify.walking.posterior import LegPosterior
from jointz.identify.walking.prior import LAG_MODEL_S, untransformed
from jointz.identify.walking.responses import PointResponse
from jointz.results.estimates import ONE_SIDED_95, REACH_95, ParameterEstimate, decides
from jointz.results.unlikely_parameter import UnlikelyParameter
from jointz.results.value_scale import ValueScale

#: A value is judged by its half-width and by the geometric mean of that and the median of the
#: person's points: a single narrow one may be so by chance. Of these, the median itself may not be
#: wider: after hold pulses, the narrow ones were too stiff.
_JUDGED_BY_MEDIAN = ("stiffness", "stiffness_onset")
#: Where the data decide nothing of a person, errors of the model exceed Laplace's: one-sided limits
#: are so many times further out (docs/estimator.md).
_WIDER_LIMITS = 2.0
#: Torque against the pulse's sign, torque at the end and sizes, over the largest, of pulses that
#: hold one torque. After 250 ms of it, 10 of 60 K of ten simulated people of another world were
#: decided, 72 % too high on average; of 30 realistic people 4 of 180 B, 67 % too high.
_BACK, _STILL_ON, _SAME_SIZE = 0.2, 0.5, 1.2
#: An estimate of a larger sd (of its logarithm) has no limits that mean anything.
_NO_SD = 5.0
#: Chi-square of a point over its samples, above which the model does not explain it.
_LARGEST_MISFIT = 2.0
#: Prior sds by which the inertia may differ from the body's.
_FARTHEST_BODY_SD = 2.0
#: Prior sds by which a shared parameter may be off; on good data the farthest was 2.0.
_FARTHEST_INSTRUMENT_SD = 2.5
#: Several sensors tell errors from legs by themselves: there, one parameter may be farther off, but
#: not all of them together, by chi-square. Of clean legs of another simulator the farthest was 2.6.
_FARTHEST_OF_SEVERAL_SD, _TOGETHER_LEVEL = 3.5, 0.999
#: Of a calibrated lag, sds of lag and calibration together.
_FARTHEST_LAG_SD = 3.5
#: Values of these below the prior are no errors: a torque sensor leaves no friction, a goniometer
#: may follow the bone, and muscles need not answer.
_MAY_BE_ABSENT = ("friction_nm", "skin_share", "reflex_gain")
_MAY_BE_RIGID = ("goniometer_hz",)
#: Body mass gives a prior of the first only; no source has values of the others in a leg.
_NO_INSTRUMENTS = ("inertia", "reflex_position", "reflex_shortening", "softening_power")
#: Beside several sensors, a reflex that is early or fast says nothing about them.
_OF_REFLEX = ("reflex_latency_s", "reflex_time_s")
#: A small stiffness: of the prior's variance at most so much is left; sds
#: below zero that contradict the bound; upper limit over the stiffness that alone would resist.
_ASSUMED, _BELOW, _SMALL = 0.25, 4.0, 0.5
_AGAINST_ALL = frozenset(
    {
        Doubt.INERTIA_UNLIKE_BODY,
        Doubt.INSTRUMENTS_UNLIKELY,
        Doubt.LAG_UNLIKELY,
        Doubt.RESPONSES_UNLIKE_SIZE,
    }
)
_LIMITS = "one-sided 95 % limits, each by itself; the value is undecided"
_CI_METHOD = (
    "posterior of a leg under hypotheses about gait cycle and goniometer; errors of virtual "
    "pulses, of the model, of the calibration"
)


@dataclass(frozen=True, slots=True)
class Decision:
    """Calibration and body mass, on which the rows of a participant depend."""

    known: CalibrationSpec  # calibration: gains and the intrinsic impedance
    mass_kg: float | None  # body mass, for values per kg
    subtract: Sequence[str]  # those of K, B and J of the device that the torque still includes
    several_sensors: bool = False  # whether the gain of the angle is one of the fit's parameters
    natural_stiffness: float = 0.0  # N*m/rad, if it alone resisted the pulses; 0: not known
    by_person: bool = True  # whether the widths at the person's other points count, too

    @property
    def gain_sd(self) -> float:
        """Relative sd of the gains that the fit does not estimate, common to K, B and J."""
        return relative_sd(self.known.torque_gain) if self.several_sensors else gains_sd(self.known)

    def intrinsic(self, name: str) -> tuple[float, float]:
        """Return the device's own part of an estimate that its torque includes, and its sd."""
        parameter = name.removesuffix("_onset")
        values, sds = intrinsic_impedance(self.known)
        at = PARAMETERS.index(parameter)
        return float(values[at]) if parameter in self.subtract else 0.0, float(sds[at])


def doubts_of(
    posterior: LegPosterior,
    moments: LogMoments,
    body: Body,
    unlikely: Sequence[UnlikelyParameter],
    coupling: Coupling = STRAP,
) -> tuple[set[Doubt], ...]:
    """Return what speaks against the model at each timing point.

    An inertia that is not the body's on average is a doubt of the whole person.
    """
    off, prior_sd = _inertia_off(moments, body), body.inertia.log_sd
    of_person: set[Doubt] = set()
    if unlikely:
        of_person.add(Doubt.INSTRUMENTS_UNLIKELY)
    if body.known and abs(float(off.mean())) > _FARTHEST_BODY_SD * prior_sd:
        of_person.add(Doubt.INERTIA_UNLIKE_BODY)
    farthest = _FARTHEST_BODY_SD * float(np.hypot(prior_sd, body.inertia_of_point_sd))
    single = body.known and Doubt.INERTIA_UNLIKE_BODY not in of_person
    unlike = single & (np.abs(off) > farthest)
    return tuple(
        of_person
        | ({Doubt.RESPONSES_MISFIT} if misfit > _LARGEST_MISFIT else set())
        | ({Doubt.INERTIA_UNLIKE_AT_POINT} if unlike[point] else set())
        | held_torque(posterior.model.points[point], coupling)
        for point, misfit in enumerate(posterior.best.misfits)
    )


def unlikely_inertias(
    moments: LogMoments, body: Body, doubts: Collection[Doubt]
) -> Iterator[UnlikelyParameter]:
    """Yield the inertia of leg and device that is unlike the body's: the mean, the farthest."""
    off, prior_sd = _inertia_off(moments, body), body.inertia.log_sd
    if Doubt.INERTIA_UNLIKE_BODY in doubts:
        yield _unlike_body("inertia", body, float(off.mean()), prior_sd)
    if Doubt.INERTIA_UNLIKE_AT_POINT in doubts:
        farthest, sd = off[np.abs(off).argmax()], np.hypot(prior_sd, body.inertia_of_point_sd)
        yield _unlike_body("inertia_of_point", body, float(farthest), float(sd))


def _inertia_off(moments: LogMoments, body: Body) -> np.ndarray:
    """Return logarithms of the inertia at each timing point over that of the body."""
    return np.asarray(moments.means("inertia") - np.log(body.inertia.median))


def _unlike_body(name: str, body: Body, off: float, sd: float) -> UnlikelyParameter:
    value, expected, low, high = (
        float(body.inertia.median * np.exp(x)) for x in (off, 0.0, -REACH_95 * sd, REACH_95 * sd)
    )
    return UnlikelyParameter(name, value, expected, low, high, abs(off) / sd)


def held_torque(point: PointResponse, coupling: Coupling) -> set[Doubt]:
    """Return the doubt of pulses that hold one torque, empty for others.

    Of a leg that neither softens nor moves under a cuff, they show K, too.
    """
    return {Doubt.HELD_TORQUE} if coupling.is_strap and holds_one_torque(point) else set()


def holds_one_torque(point: PointResponse) -> bool:
    """Return whether all pulses hold the same torque, either sign, to the end of the data."""
    torques = np.stack([shape.torque for shape in point.shapes])
    peaks = torques[np.arange(len(torques)), np.abs(torques).argmax(axis=1)]
    signed = torques / np.where(peaks == 0.0, 1.0, peaks)[:, None]
    last = signed[:, -max(1, signed.shape[1] // 4) :].mean(axis=1)
    held = (signed.min(axis=1) > -_BACK) & (last > _STILL_ON)
    sizes = np.abs(peaks)
    return bool(held.all() and sizes.max() < _SAME_SIZE * sizes.min())


def unlikely_instruments(
    posterior: LegPosterior, fixed: Collection[str] = ()
) -> tuple[UnlikelyParameter, ...]:
    """Return the parameters of instruments and reflex that are too far from their prior's mean.

    Where they are so together only, these are the farthest. Those that the coupling fixes do not
    count.
    """
    fit, layout = posterior.best, posterior.model.layout
    several = bool(layout.sensors)
    left_out = {*_NO_INSTRUMENTS, *(_OF_REFLEX if several else ()), *fixed}
    names = [name for name in layout.shared_names if name not in left_out]
    places = [layout.shared(name) for name in names]
    mean, sd = fit.prior.mean[places], fit.prior.sd[places]
    off = (fit.theta[places] - mean) / sd
    far = np.where(np.isin(names, _MAY_BE_ABSENT), off.clip(0.0), np.abs(off))
    far = np.where(np.isin(names, _MAY_BE_RIGID), (-off).clip(0.0), far)
    farthest = float(far.max())
    if several:
        together = float(far @ far) > chi2.ppf(_TOGETHER_LEVEL, far.size)
        speaks = together or farthest > _FARTHEST_OF_SEVERAL_SD
    else:
        speaks = farthest > _FARTHEST_INSTRUMENT_SD
    if not speaks:
        return ()
    least = min(farthest, _FARTHEST_INSTRUMENT_SD)
    return tuple(_unlikely(names[k], off[k], mean[k], sd[k]) for k in np.flatnonzero(far >= least))


def _unlikely(name: str, off: float, mean: float, sd: float) -> UnlikelyParameter:
    """Return a parameter that is ``off`` prior sds from its mean, with the prior interval."""
    value, expected, low, high = (
        untransformed(name, mean + x * sd) for x in (off, 0.0, -REACH_95, REACH_95)
    )
    return UnlikelyParameter(name, value, expected, low, high, abs(float(off)))


def unlikely_lag(free: LegPosterior, stated: Calibrated) -> UnlikelyParameter | None:
    """Return the goniometer's lag if a fit without its calibration contradicts that."""
    lag, sd = free.lag_moments()
    known = float(np.hypot(stated.sd, LAG_MODEL_S))
    # Of a logarithm that is hardly known, one sd reaches further at longer lags.
    reached = sd * max(1.0, stated.value / lag)
    apart = abs(lag - stated.value) / float(np.hypot(reached, known))
    reach = REACH_95 * known
    low, high = stated.value - reach, stated.value + reach
    if not apart > _FARTHEST_LAG_SD:
        return None
    return UnlikelyParameter("angle_lag_s", lag, stated.value, low, high, apart)


def decided_rows(
    point: int, moments: LogMoments, decision: Decision, doubts: Collection[Doubt]
) -> tuple[ParameterEstimate, ...]:
    """Return K, B, J, values per kg, K and B at the onset, each with its status."""
    rows = [_row(name, point, moments, decision, doubts) for name in ESTIMANDS]
    kbj, onsets = rows[: len(PARAMETERS)], rows[len(PARAMETERS) :]
    return (*kbj, *per_mass(kbj, decision.mass_kg), *onsets)


def rejects_value(name: str, doubts: Collection[Doubt]) -> bool:
    """Return whether doubts leave an estimand without value and limits."""
    # Such an inertia or instrument shows that device or signals are not those of the model.
    against_all = not _AGAINST_ALL.isdisjoint(doubts)
    others = set(doubts) - {Doubt.HELD_TORQUE, Doubt.SENSORS_CONTRADICT}
    return against_all or bool(others and name != "inertia")


def only_limits(name: str, doubts: Collection[Doubt]) -> bool:
    """Return whether the pulses do not decide an estimand, however narrow its interval."""
    return Doubt.HELD_TORQUE in doubts and name != "inertia"


def _row(
    name: str,
    point: int,
    moments: LogMoments,
    decision: Decision,
    doubts: Collection[Doubt],
) -> ParameterEstimate:
    scale = moments.scale(name)
    value, sd = value_and_sd(name, point, moments, decision)
    undecided = ParameterEstimate(name, None, None, None, "undecided", unbounded=value)
    if (value <= 0.0 and not scale.unit) or rejects_value(name, doubts):
        return undecided
    sd /= float(scale.slope(value))
    if not sd < _NO_SD:  # NaN, too
        return undecided
    half, usual = scale.half_width(value, sd), _median_half_width(name, moments)
    together = usual if name in _JUDGED_BY_MEDIAN else float(np.sqrt(half * usual))
    limits_only = only_limits(name, doubts)
    if limits_only or not decides(1.0, max(half, together) if decision.by_person else half):
        known = scale.unit and not limits_only and moments.prior_share(name, point) <= _ASSUMED
        if known and (small := _at_bound(undecided, scale, sd, decision)):
            return small
        narrow = decides(1.0, usual) and not limits_only
        reach = ONE_SIDED_95 * sd * (1.0 if narrow else _WIDER_LIMITS)
        low, high = scale.moved(value, np.array([-reach, reach])).clip(0.0).tolist()
        if scale.unit:  # that a stiffness is not smaller, the data have to say, not the prior
            by_data = moments.low_by_data(name, point) - decision.intrinsic(name)[0]
            low = max(min(low, by_data), 0.0)
        limits = replace(undecided, ci_low=low, ci_high=high, ci_method=_LIMITS)
        return limits if high > 0.0 else undecided
    low, high = scale.moved(value, np.array([-REACH_95 * sd, REACH_95 * sd])).tolist()
    decided = replace(undecided, status="ok", ci_method=_CI_METHOD)
    return replace(decided, value=value, ci_low=low, ci_high=high)


def value_and_sd(
    name: str, point: int, moments: LogMoments, decision: Decision
) -> tuple[float, float]:
    """Return an estimate without the device's own part, and the sd of its whole error, SI."""
    scale, whole = moments.scale(name), moments.value(name, point)
    intrinsic, intrinsic_sd = decision.intrinsic(name)
    sd = with_model_error(name, moments.of(name, point)[1], moments.error)
    sd = float(np.hypot(sd, decision.gain_sd * scale.share(whole)))
    return whole - intrinsic, float(np.hypot(scale.slope(whole) * sd, intrinsic_sd))


def _at_bound(
    undecided: ParameterEstimate, scale: ValueScale, sd: float, decision: Decision
) -> ParameterEstimate | None:
    """Return a stiffness whose interval reaches zero and has a small upper limit."""
    value = undecided.unbounded or 0.0
    place = float(scale.of(value))
    low, high = (float(scale.value(end)) for end in bounded_interval(place, sd))
    small = low == 0.0 and high <= _SMALL * decision.natural_stiffness
    if not small or place < -_BELOW * sd:
        return None
    decided = replace(undecided, status="at_bound", ci_method=_CI_METHOD)
    return replace(decided, value=max(value, 0.0), ci_low=low, ci_high=high)


def with_model_error(name: str, sd: float, error: ModelError = STRAP.error) -> float:
    """Return the sd of an estimand, on its scale, with the error of the model."""
    is_damping = name.removesuffix("_onset") == "damping"
    return float(np.hypot(sd, error.damping_sd if is_damping else 0.0))


def _median_half_width(name: str, moments: LogMoments) -> float:
    """Return the median half-width over the person's timing points."""
    n_points = moments.mean.size // len(ESTIMANDS)
    sds = [
        with_model_error(name, moments.of(name, point)[1], moments.error)
        for point in range(n_points)
    ]
    values = [moments.value(name, point) for point in range(n_points)]
    return float(np.median(list(map(moments.scale(name).half_width, values, sds))))


_STEP = 0.01
#: A measurement further below the bound than this is taken to be here: it says more of the
#: error's size than of the mean.
_LOWEST = -2.0
#: No accepted measurement is so far above its mean; halved so often it leaves rounding.
_FARTHEST, _HALVINGS = 10.0, 55


def bounded_interval(value: float, sd: float, *, level: float = 0.95) -> tuple[float, float]:
    """Return the interval of a mean that is not negative.

    ``value`` may be negative; ``sd`` of its normal error. ``low`` is 0 where the bound is active:
    the interval is then one-sided. Feldman and Cousins 1998, Physical Review D 57, 3873, section
    IV.B: the choice between a limit and an interval is part of the construction, so it costs no
    coverage.
    """
    if not sd > 0.0 or not 0.0 < level < 1.0:
        raise ValueError(
            f"bounded_interval: expected sd > 0 and 0 < level < 1, got {sd} and {level}."
        )
    measured = max(value / sd, _LOWEST)
    reach = float(norm.ppf(0.5 + level / 2.0))
    if measured >= 2.0 * reach:  # from here on the bound has no effect
        return sd * (measured - reach), sd * (measured + reach)
    means, lowest, highest = _belts(level)
    low = float(np.interp(measured, highest, means)) if measured > highest[0] else 0.0
    return sd * low, sd * float(np.interp(measured, lowest, means))


@lru_cache(maxsize=8)
def _belts(level: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return means, and lowest and highest measurement accepted for each.

    They reach as far as the upper end of a measurement of twice the reach does.
    """
    reach = float(norm.ppf(0.5 + level / 2.0))
    means = np.arange(_STEP, 3.0 * reach + 2.0 * _STEP, _STEP)
    lowest, highest = _accepted(means, level)
    # Where nothing is ordered any more (mean 0) the lowest is minus infinity.
    return (
        np.append(0.0, means),
        np.append(-np.inf, lowest),
        np.append(float(norm.ppf(level)), highest),
    )


def _accepted(means: np.ndarray, level: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the measurements accepted for each mean: those with the largest likelihood ratio."""

    def below(high: np.ndarray) -> np.ndarray:
        mirrored = 2.0 * means - high
        ratio = (means**2 - (high - means) ** 2) / (2.0 * means)
        return np.asarray(np.where(mirrored >= 0.0, mirrored, ratio))

    short, far = means, means + _FARTHEST
    for _ in range(_HALVINGS):
        middle = 0.5 * (short + far)
        enough = ndtr(middle - means) - ndtr(below(middle) - means) >= level
        short, far = np.where(enough, short, middle), np.where(enough, middle, far)
    return below(far), far
