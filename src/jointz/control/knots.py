"""Stiffness and damping at timing points, and smooth curves with intervals through them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.stats import t as students_t

from jointz.control.impedance_profile import GRID_PCT
from jointz.core.errors import EstimationError
from jointz.core.gait_phases import TIMING_POINTS
from jointz.core.grouping import by_key
from jointz.core.priors import PriorsSpec
from jointz.kernels.series.periodic_process import periodic_curve
from jointz.reference import chapter4
from jointz.results.estimates import REACH_95, CellEstimate, ParameterEstimate
from jointz.results.log_posterior import LogPosterior
from jointz.results.series.cycle_curve import MEAN
from jointz.results.statistics.pooled_estimates import unbounded_estimate
from jointz.results.study_analysis import PopulationEstimate, StudyAnalysis

FEWEST = 4
METHOD = (
    "a periodic Gaussian process of the logarithms through the timing points, sd over the cycle by "
    "the priors of the method strapped, length by evidence"
)
#: Beside a noise of zero, so that the process has an inverse.
_TINY = 1e-6
_PRIORS = PriorsSpec()
_OVER_CYCLE = {
    "stiffness": _PRIORS.stiffness_over_cycle.sd,
    "damping": _PRIORS.damping_over_cycle.sd,
}
#: Half of the dissertation's window in a stride of 1.1 s, % of the cycle: where its values belong.
_HALF_WINDOW_PCT = 4.5

Displacement = Literal["onset", "window"]


@dataclass(frozen=True, slots=True)
class Point:
    """An estimate of one parameter at a timing point."""

    timing_point: str
    gait_pct: float
    value: float  # SI
    noise: float  # relative sd of the error that other points do not share
    systematic: float  # relative sd of errors that are alike at neighbouring points

    @property
    def sd(self) -> float:
        """Relative sd of all errors."""
        return float(np.hypot(self.noise, self.systematic))

    @property
    def interval(self) -> tuple[float, float]:
        """Ends of the 95 % interval, SI."""
        reach = float(np.exp(REACH_95 * self.sd))
        return self.value / reach, self.value * reach


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """One parameter over the cycle, and the estimates behind it."""

    value: np.ndarray  # (100,) at the phases of a profile, SI
    low: np.ndarray
    high: np.ndarray
    points: tuple[Point, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Impedance:
    """Stiffness and damping of one subject over the cycle."""

    stiffness: Curve
    damping: Curve
    covariance: np.ndarray  # of the logarithms at the points: stiffness of all, damping of all
    displacement: Displacement
    source: str
    warnings: tuple[str, ...] = ()


def measured_impedance(analysis: StudyAnalysis, label: str | None) -> Impedance:
    """Return the impedance of a participant, or of the mean over people (None)."""
    posterior = next((p for p in analysis.log_posteriors if p.label == label), None)
    if posterior is not None:
        return _of_posterior(posterior, analysis)
    names = ("stiffness", "damping")
    onset = [_points(analysis, label, f"{name}_onset") for name in names]
    small = all(len(points) >= FEWEST for points in onset)
    points = onset if small else [_points(analysis, label, name) for name in names]
    stiffness, damping = (
        curve_through(own, name, label or MEAN) for own, name in zip(points, names, strict=True)
    )
    text = "small displacements are not decided: secants over the window were taken"
    return Impedance(
        stiffness,
        damping,
        _covariance(stiffness, damping, _correlations(analysis, label)),
        "onset" if small else "window",
        _source(analysis, small=small),
        () if small else (text,),
    )


def _points(analysis: StudyAnalysis, label: str | None, name: str) -> list[Point]:
    """Return the estimates of a parameter, undecided ones included where their error is known."""
    if label is None:
        rows = [p for p in analysis.population if p.parameter == name and p.n_participants > 1]
        points = [_decided(p.timing_point, p.onset_gait_pct, p, name) for p in rows]
    else:
        points = [_of_cell(c, name) for c in analysis.cells if c.label == label]
    return [point for point in points if point is not None]


def _of_cell(cell: CellEstimate, name: str) -> Point | None:
    centre = None if name.endswith("_onset") else cell.centre_gait_pct
    at = cell.onset_gait_pct if centre is None else centre
    estimate, parameter = unbounded_estimate(cell, name), cell.parameter(name)
    if parameter is None or at is None or parameter.status.startswith("failed"):
        return None
    if estimate is None:
        return _decided(cell.timing_point, at, parameter, name)
    if estimate.value - REACH_95 * estimate.sd <= 0.0:
        raise EstimationError("undecided", _reaches_zero(cell, name, abs(estimate.value)))
    relative = estimate.noise_sd / estimate.value, estimate.systematic_sd / estimate.value
    return Point(cell.timing_point, at, estimate.value, *relative)


def _decided(
    timing_point: str,
    at: float | None,
    estimate: PopulationEstimate | ParameterEstimate,
    name: str,
) -> Point | None:
    """Return a value that is decided; its whole error counts as alike at neighbouring points."""
    value, low, high = estimate.value, estimate.ci_low, estimate.ci_high
    if estimate.status != "ok" or at is None or value is None or low is None or high is None:
        return None
    if low <= 0.0:
        text = f"the interval of {name} at {timing_point} reaches zero. Plan more pulses there."
        raise EstimationError("undecided", text)
    return Point(timing_point, at, value, 0.0, float(np.log(high / low)) / (2.0 * REACH_95))


def _reaches_zero(cell: CellEstimate, name: str, value: float) -> str:
    """Return which pulses would keep an interval away from zero."""
    sds, point = cell.budget[name], cell.timing_point
    others = sum(sd**2 for source, sd in sds.items() if source != "noise")
    room = (value / REACH_95) ** 2 - others
    text = f"profile of {cell.label}: the interval of {name} at {point} reaches zero. "
    if room <= 0.0:
        return f"{text}More pulses there do not help: its error is not noise (see its budget)."
    needed = max(int(np.ceil(cell.n_used * sds.get("noise", 0.0) ** 2 / room)), cell.n_used) + 1
    return f"{text}About {needed} pulses there would do ({cell.n_used} so far)."


def _correlations(analysis: StudyAnalysis, label: str | None) -> dict[str, float]:
    """Return timing point -> correlation of the errors of K and B, the mean over people."""
    cells = [cell for cell in analysis.cells if label in (None, cell.label)]
    errors = ((c.timing_point, np.array(c.covariance)) for c in cells if c.covariance is not None)
    known = ((point, e) for point, e in errors if e[0, 0] * e[1, 1] > 0.0)
    correlations = by_key((point, e[0, 1] / np.sqrt(e[0, 0] * e[1, 1])) for point, e in known)
    return {point: float(np.mean(values)) for point, values in correlations.items()}


def _covariance(stiffness: Curve, damping: Curve, correlations: dict[str, float]) -> np.ndarray:
    """Return the covariance of the logarithms, (2k, 2k): K and B of one point are correlated."""
    points = [*stiffness.points, *damping.points]
    covariance = np.diag([point.sd**2 for point in points])
    place = {point.timing_point: k for k, point in enumerate(stiffness.points)}
    for j, point in enumerate(damping.points, start=len(stiffness.points)):
        i = place.get(point.timing_point)
        if i is not None:
            both = correlations.get(point.timing_point, 0.0) * points[i].sd * point.sd
            covariance[i, j] = covariance[j, i] = both
    return covariance


def _of_posterior(posterior: LogPosterior, analysis: StudyAnalysis) -> Impedance:
    """Return the curves of the method strapped, for small displacements if it estimates them."""
    small = "stiffness_onset" in posterior.parameters
    names = [f"{name}_onset" if small else name for name in ("stiffness", "damping")]
    places = {
        cell.timing_point: cell.onset_gait_pct if small else cell.centre_gait_pct
        for cell in analysis.cells
        if cell.label == posterior.label
    }
    curves, where = [], []
    for name in names:
        own = [k for k, p in enumerate(posterior.parameters) if p == name]
        _refuse_doubted(posterior, own)
        placed = {k: at for k in own if (at := places.get(posterior.timing_points[k])) is not None}
        points = [_of_element(posterior, k, name, at) for k, at in placed.items()]
        curves.append(curve_through(points, name, posterior.label))
        where += sorted(placed, key=placed.__getitem__)
    # The device's own part is no unknown: what is left of the value has the whole error.
    values = np.array([point.value for curve in curves for point in curve.points])
    scales = [posterior.scale(posterior.parameters[k]) for k in where]
    wholes = [s.value(posterior.mean[k]) for s, k in zip(scales, where, strict=True)]
    own_share, shares = np.array(wholes) / values, posterior.shares[where]
    relative = posterior.covariance[np.ix_(where, where)] / np.outer(shares, shares)
    warnings = () if small else ("small displacements were not estimated: secants were taken",)
    return Impedance(
        curves[0],
        curves[1],
        (relative + posterior.gain_sd**2) * np.outer(own_share, own_share),
        "onset" if small else "window",
        _source(analysis, small=small),
        warnings,
    )


def _of_element(posterior: LogPosterior, k: int, name: str, at: float) -> Point:
    """Return a point of a posterior, which smooths over the cycle: its error is shared."""
    device = dict(posterior.intrinsic).get(name, 0.0)
    scale = posterior.scale(name)
    whole = float(scale.value(posterior.mean[k]))
    value = whole - device
    if value <= 0.0 or scale.moved(whole, -REACH_95 * posterior.sd[k]) <= device:
        text = f"profile of {posterior.label}: {name} at {posterior.timing_points[k]} is that of"
        raise EstimationError("undecided", f"{text} the device alone: its interval reaches zero.")
    sd = float(np.hypot(posterior.sd[k] / posterior.shares[k], posterior.gain_sd)) * whole / value
    return Point(posterior.timing_points[k], at, value, 0.0, sd)


def _refuse_doubted(posterior: LogPosterior, own: Sequence[int]) -> None:
    flags = dict(enumerate(posterior.doubted))
    doubted = [posterior.timing_points[k] for k in own if flags.get(k)]
    if doubted:
        raise EstimationError(
            "doubted",
            f"profile of {posterior.label}: the data speak against the model at "
            f"{', '.join(dict.fromkeys(doubted))} ({', '.join(posterior.doubts)}): the intervals "
            "there do not hold. See the report on these timing points.",
        )


def curve_through(points: Sequence[Point], name: str, who: str) -> Curve:
    """Return the smooth curve through estimates, with its interval.

    A periodic Gaussian process of the logarithms. Its sd is that of the priors of the method
    strapped, the length over which it stays alike between 5 and 50 % of the cycle by evidence.
    """
    points = sorted(points, key=lambda point: point.gait_pct)
    if len(points) < FEWEST:
        raise EstimationError(
            "no_pulses",
            f"profile of {who}: {name} is estimated at {len(points)} timing points, expected "
            f"{FEWEST} or more. Plan pulses at more phases of the cycle; a study of one person has "
            "no mean: name the participant.",
        )
    curve = periodic_curve(
        np.array([point.gait_pct for point in points]) / 100.0,
        np.log([point.value for point in points]),
        np.diag([point.noise**2 + _TINY for point in points]),
        systematic=np.array([point.systematic for point in points]),
        at=GRID_PCT / 100.0,
        sd=_OVER_CYCLE[name.removesuffix("_onset")],
    )
    return Curve(np.exp(curve.value), np.exp(curve.low), np.exp(curve.high), tuple(points))


def published_impedance() -> Impedance:
    """Return the dissertation's means over ten people (tables 4.1 and 4.2), per kg."""
    tables = {"stiffness": chapter4.STIFFNESS, "damping": chapter4.DAMPING}
    curves = [
        curve_through([_of_people(point, row) for point, row in table.items()], name, "published")
        for name, table in tables.items()
    ]
    return Impedance(
        curves[0],
        curves[1],
        _covariance(curves[0], curves[1], {}),
        "window",
        "published: dissertation, tables 4.1 and 4.2, means over ten people, secants over 100 ms",
    )


def _of_people(point: str, row: chapter4.Row) -> Point:
    values = np.array([row[subject].value for subject in chapter4.SUBJECTS])
    reach = float(students_t.ppf(0.975, values.size - 1)) / REACH_95
    sd = reach * values.std(ddof=1) / np.sqrt(values.size) / values.mean()
    at = TIMING_POINTS[point] + _HALF_WINDOW_PCT
    return Point(point, at, float(values.mean()), 0.0, float(sd))


def _source(analysis: StudyAnalysis, *, small: bool) -> str:
    study, method = analysis.settings.get("study", "?"), analysis.settings.get("method", "?")
    what = "small displacements at the onset" if small else "secants over the window of the pulses"
    return f"study {study}, method {method}: {what}"
