"""Stiffness and damping at timing points, and smooth curves with intervals through them."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Literal

import numpy as np
from scipy.stats import t as students_t

from jointz.control.impedance_profile import GRID_PCT
from jointz.core.errors import EstimationError
from jointz.core.gait_phases import TIMING_POINTS
from jointz.identify.over_cycle.phase_curve import phase_curve
from jointz.kernels.series.periodic_process import periodic_curve
from jointz.reference import chapter4
from jointz.results.estimates import CellEstimate, ParameterEstimate
from jointz.results.log_posterior import LogPosterior
from jointz.results.series.cycle_curve import MEAN, ParameterBand
from jointz.results.study_analysis import PopulationEstimate, StudyAnalysis

FEWEST = 4
#: A measured curve must not count the smoothing of its estimates as data; any small number does.
_EXACT = 1e-6
_REACH_95 = NormalDist().inv_cdf(0.975)
#: Half of the dissertation's window in a stride of 1.1 s, % of the cycle: where its values belong.
_HALF_WINDOW_PCT = 4.5

Displacement = Literal["onset", "window"]


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """One parameter over the cycle, and the estimates that it goes by."""

    value: np.ndarray  # (100,) at the phases of a profile, SI
    low: np.ndarray
    high: np.ndarray
    points: tuple[tuple[str, float, float, float, float], ...]  # name, %, value, low, high


@dataclass(frozen=True, slots=True, eq=False)
class Impedance:
    """Stiffness and damping of one subject over the cycle."""

    stiffness: Curve
    damping: Curve
    covariance: np.ndarray  # of the logarithms at the points: stiffness of all, damping of all
    displacement: Displacement
    source: str
    method: str
    warnings: tuple[str, ...] = ()


def measured_impedance(analysis: StudyAnalysis, label: str | None) -> Impedance:
    """Return the impedance of a participant, or of the mean over people (None)."""
    posterior = next((p for p in analysis.log_posteriors if p.label == label), None)
    if posterior is not None:
        return _of_posterior(posterior, analysis)
    if any(cell.budget for cell in analysis.cells) and not analysis.log_posteriors:
        return _of_phase_curve(analysis, label)
    return _of_rows(analysis, label)


def _of_phase_curve(analysis: StudyAnalysis, label: str | None) -> Impedance:
    names = ("stiffness", "damping")
    curves = phase_curve(analysis, label, parameters=names)
    who = MEAN if label is None else label
    bands = {band.parameter: band for band in curves.bands if band.participant == who}
    missing = [name for name in names if name not in bands]
    if missing:
        raise EstimationError(
            "no_pulses",
            f"profile of {who}: no curve of {' and '.join(missing)}: {'; '.join(curves.warnings)}",
        )
    stiffness, damping = (_of_band(bands[name]) for name in names)
    cells = [cell for cell in analysis.cells if label is None or cell.label == label]
    return Impedance(
        stiffness,
        damping,
        _covariance(stiffness, damping, _correlations(cells, stiffness)),
        "window",
        _source(analysis, "secants over the window of the pulses"),
        curves.ci_method,
        curves.warnings,
    )


def _of_band(band: ParameterBand) -> Curve:
    points = tuple((p.timing_point, p.gait_pct, p.value, p.ci_low, p.ci_high) for p in band.points)
    value, low, high = (np.array(v[:-1]) for v in (band.value, band.ci_low, band.ci_high))
    return Curve(value, low, high, points)


def _correlations(cells: Sequence[CellEstimate], stiffness: Curve) -> np.ndarray:
    """Return the correlation of the errors of K and B at each point, the mean over people."""
    found: dict[str, list[float]] = {}
    for cell in cells:
        if cell.covariance is not None:
            (kk, kb, _), (_, bb, _), _ = cell.covariance
            found.setdefault(cell.timing_point, []).append(kb / np.sqrt(kk * bb))
    return np.array([float(np.mean(found.get(p[0], [0.0]))) for p in stiffness.points])


def _covariance(stiffness: Curve, damping: Curve, correlation: np.ndarray) -> np.ndarray:
    """Return the covariance of the logarithms, (2k, 2k): K and B of one point are correlated."""
    sds = np.array([log_sd(*point[2:]) for curve in (stiffness, damping) for point in curve.points])
    covariance = np.diag(sds**2)
    n = len(stiffness.points)
    if len(damping.points) == n:
        both = correlation * sds[:n] * sds[n:]
        covariance[range(n), range(n, 2 * n)] = covariance[range(n, 2 * n), range(n)] = both
    return covariance


def log_sd(value: float, low: float, high: float) -> float:
    """Return the sd of the logarithm of an estimate with a 95 % interval."""
    if low > 0.0:
        return float(np.log(high / low) / (2.0 * _REACH_95))
    return float((high - low) / (2.0 * _REACH_95 * abs(value)))


def _of_posterior(posterior: LogPosterior, analysis: StudyAnalysis) -> Impedance:
    """Return the curves of the method strapped, small displacements where it tells of them."""
    small = "stiffness_onset" in posterior.parameters
    names = [f"{name}_onset" if small else name for name in ("stiffness", "damping")]
    rows = [[k for k, p in enumerate(posterior.parameters) if p == name] for name in names]
    where = [*rows[0], *rows[1]]
    _refuse_doubted(posterior, where)
    cells = {c.timing_point: c for c in analysis.cells if c.label == posterior.label}
    curves = []
    for own, name in zip(rows, names, strict=True):
        device = dict(posterior.intrinsic).get(name, 0.0)
        sds = np.hypot(posterior.sd[own], posterior.gain_sd)
        points = []
        for k, sd in zip(own, sds, strict=True):
            cell = cells.get(posterior.timing_points[k])
            at = None if cell is None else (cell.onset_gait_pct if small else cell.centre_gait_pct)
            if at is not None:
                whole = np.exp(posterior.mean[k] + np.array([0.0, -_REACH_95 * sd, _REACH_95 * sd]))
                points.append((posterior.timing_points[k], at, *(whole - device).tolist()))
        curves.append(curve_through(points, what=f"{name} of {posterior.label}"))
    covariance = posterior.covariance[np.ix_(where, where)] + posterior.gain_sd**2
    text = "small displacements at the onset" if small else "secants over the window of the pulses"
    warnings = () if small else ("small displacements were not estimated: secants were taken",)
    return Impedance(
        curves[0],
        curves[1],
        covariance,
        "onset" if small else "window",
        _source(analysis, text),
        "posterior of a strapped leg; between the points a periodic Gaussian process",
        warnings,
    )


def _refuse_doubted(posterior: LogPosterior, where: Sequence[int]) -> None:
    doubted = [
        posterior.timing_points[k]
        for k in where
        if k < len(posterior.doubted) and posterior.doubted[k]
    ]
    if doubted:
        raise EstimationError(
            "doubted",
            f"profile of {posterior.label}: the data speak against the model at "
            f"{', '.join(dict.fromkeys(doubted))} ({', '.join(posterior.doubts)}): the intervals "
            "there do not hold. See the report on these timing points.",
        )


def _of_rows(analysis: StudyAnalysis, label: str | None) -> Impedance:
    """Return curves through the decided estimates, or the means, of any method."""
    rows = _rows(analysis, label)
    chosen, warnings, curves = [], [], []
    for name in ("stiffness", "damping"):
        small = _decided(rows, f"{name}_onset")
        enough = len(small) >= FEWEST
        chosen.append(enough)
        points = small if enough else _decided(rows, name)
        curves.append(curve_through(points, what=f"{name} of {label or MEAN}"))
    if not all(chosen):
        warnings.append("small displacements are not decided: secants over the window were taken")
    displacement: Displacement = "onset" if all(chosen) else "window"
    none = np.zeros(len(curves[0].points))
    text = "small displacements" if all(chosen) else "secants over the window of the pulses"
    return Impedance(
        curves[0],
        curves[1],
        _covariance(curves[0], curves[1], none),
        displacement,
        _source(analysis, text),
        "intervals of the estimates; between the points a periodic Gaussian process",
        tuple(warnings),
    )


def _rows(analysis: StudyAnalysis, label: str | None) -> list[PopulationEstimate | CellEstimate]:
    if label is None:
        return [p for p in analysis.population if p.n_participants > 1]
    return [cell for cell in analysis.cells if cell.label == label]


def _decided(
    rows: Sequence[PopulationEstimate | CellEstimate], name: str
) -> list[tuple[str, float, float, float, float]]:
    """Return the decided values of one parameter: timing point, phase, value, low, high."""
    points = []
    for row in rows:
        at, found = _found(row, name)
        if found is None or at is None or found.status != "ok":
            continue
        value, low, high = found.value, found.ci_low, found.ci_high
        if value is not None and low is not None and high is not None:
            points.append((row.timing_point, at, value, low, high))
    return points


def _found(
    row: PopulationEstimate | CellEstimate, name: str
) -> tuple[float | None, PopulationEstimate | ParameterEstimate | None]:
    """Return the phase that a parameter belongs to, and the parameter."""
    if isinstance(row, PopulationEstimate):
        return row.onset_gait_pct, row if row.parameter == name else None
    centre = None if name.endswith("_onset") else row.centre_gait_pct
    return row.onset_gait_pct if centre is None else centre, row.parameter(name)


def curve_through(points: Sequence[tuple[str, float, float, float, float]], *, what: str) -> Curve:
    """Return the smooth curve through estimates, exact at them but for their own errors.

    A periodic Gaussian process of the logarithms; the estimates' errors are added in full, since a
    method may have smoothed them over the cycle already.
    """
    points = sorted(points, key=lambda point: point[1])
    if len(points) < FEWEST:
        raise EstimationError(
            "no_pulses",
            f"{what}: decided at {len(points)} timing points, expected {FEWEST} or more. Plan "
            "pulses at more phases of the cycle, or take the mean over people.",
        )
    if any(low <= 0.0 for _, _, _, low, _ in points):
        at = ", ".join(point[0] for point in points if point[3] <= 0.0)
        raise EstimationError("undecided", f"{what}: the interval reaches zero at {at}.")
    values = np.array([point[2:] for point in points])
    logs = np.log(values[:, 0])
    curve = periodic_curve(
        np.array([point[1] for point in points]) / 100.0,
        logs,
        _EXACT * np.eye(len(points)),
        systematic=np.array([log_sd(*row) for row in values.tolist()]),
        at=GRID_PCT / 100.0,
    )
    return Curve(np.exp(curve.value), np.exp(curve.low), np.exp(curve.high), tuple(points))


def published_impedance() -> Impedance:
    """Return the dissertation's means over ten people (tables 4.1 and 4.2), per kg."""
    curves = []
    for table in (chapter4.STIFFNESS, chapter4.DAMPING):
        points = []
        for point, row in _columns(table).items():
            values = np.array(row)
            mean, n = float(values.mean()), values.size
            reach = float(students_t.ppf(0.975, n - 1) * values.std(ddof=1) / np.sqrt(n))
            at = TIMING_POINTS[point] + _HALF_WINDOW_PCT
            points.append((point, at, mean, mean - reach, mean + reach))
        curves.append(curve_through(points, what="published"))
    return Impedance(
        curves[0],
        curves[1],
        _covariance(curves[0], curves[1], np.zeros(len(curves[0].points))),
        "window",
        "published: dissertation, tables 4.1 and 4.2, means over ten people, secants over 100 ms",
        "Student's interval over people; between the points a periodic Gaussian process",
    )


def _columns(table: chapter4.Table) -> dict[str, list[float]]:
    """Return timing point -> one value a participant."""
    return {point: [row[s].value for s in chapter4.SUBJECTS] for point, row in table.items()}


def refuse_zero(impedance: Impedance, cells: Sequence[CellEstimate], who: str) -> None:
    """Refuse a curve whose interval reaches zero, with the pulses that would help."""
    problems = []
    for name in ("stiffness", "damping"):
        curve: Curve = getattr(impedance, name)
        bad = GRID_PCT[curve.low <= 0.0]
        if bad.size:
            problems.append(
                f"the interval of {name} reaches zero from {bad.min():.0f} to {bad.max():.0f} % "
                f"of the gait cycle. {_help(curve, cells, name)}"
            )
    if problems:
        raise EstimationError("undecided", f"profile of {who}: " + " ".join(problems))


def _help(curve: Curve, cells: Sequence[CellEstimate], name: str) -> str:
    """Return which pulses would keep an interval away from zero."""
    weak = {point[0]: abs(point[2]) for point in curve.points if point[3] <= 0.0}
    if not weak:
        return "Plan pulses at a timing point in between: the points around it are decided."
    own = {c.timing_point: c for c in cells if c.timing_point in weak and name in c.budget}
    return " ".join(
        _pulses_needed(own[point], name, value) if point in own else f"Plan more pulses at {point}."
        for point, value in weak.items()
    )


def _pulses_needed(cell: CellEstimate, name: str, value: float) -> str:
    """Return how many pulses would bring the interval of a value above zero."""
    sds = cell.budget[name]
    noise = sds.get("noise", 0.0)
    others = sum(sd**2 for source, sd in sds.items() if source != "noise")
    room = (value / _REACH_95) ** 2 - others
    if room <= 0.0:
        return f"More pulses at {cell.timing_point} do not help: its error is not noise."
    needed = max(int(np.ceil(cell.n_used * noise**2 / room)), cell.n_used) + 1
    return f"About {needed} pulses at {cell.timing_point} would do ({cell.n_used} so far)."


def _source(analysis: StudyAnalysis, what: str) -> str:
    study, method = analysis.settings.get("study", "?"), analysis.settings.get("method", "?")
    return f"study {study}, method {method}: {what}"
