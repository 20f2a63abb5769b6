r"""Stiffness and damping over the gait cycle, from the posterior at the timing points.

The prior of the method holds what connects phases: a person's level, one curve over the cycle, and
a part of each timing point's own. Conditioning on the posterior gives the values between them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls
from scipy.special import stdtrit

from jointz.core.codes import Failure
from jointz.core.errors import DataError, EstimationError
from jointz.core.gait_phases import mean_phase
from jointz.core.grouping import by_key
from jointz.core.method_names import WITH_POSTERIOR
from jointz.core.provenance import software
from jointz.identify.walking.coupling import COUPLINGS, ModelError
from jointz.identify.walking.decisions import with_model_error
from jointz.identify.walking.leg_model import LENGTH_CYCLES
from jointz.results.estimates import FEWEST_PEOPLE, REACH_95, CellEstimate
from jointz.results.log_posterior import LogPosterior
from jointz.results.series.cycle_curve import MEAN, CurvePoint, ParameterBand, PhaseCurve
from jointz.results.study_analysis import StudyAnalysis
from jointz.results.value_scale import ValueScale

_LEVEL = 0.95
_PARAMETERS = ("stiffness", "damping", "stiffness_per_mass", "damping_per_mass")
_PER_MASS = "_per_mass"
#: Distance of phases that count as one, cycles, and a variance that counts as none.
_SAME_PHASE, _TINY = 1e-6, 1e-12
#: Fewest phases of a curve.
_FEWEST = 4
_GRID_PCT = np.arange(0.0, 100.5, 1.0)
_CI_METHOD = "posterior between timing points; mean over people: t interval"
_SETTINGS = ("study", "joint", "method", "coupling", "window_s")


def phase_curve(
    analysis: StudyAnalysis,
    participant: str | None = None,
    *,
    parameters: Sequence[str] = _PARAMETERS,
) -> PhaseCurve:
    """Return stiffness and damping as curves over the gait cycle.

    Parameters
    ----------
    analysis : StudyAnalysis
        Analysis of a walking study by the method ``bayesian``.
    participant : str, optional
        A participant, with session and side if the study has them: ``S01, left``; by default
        all participants and the mean over them.
    parameters : sequence of str
        Names among ``stiffness``, ``damping`` and both per kg; ``inertia``, ``stiffness_onset``
        and ``damping_onset`` are possible, too.

    Returns
    -------
    PhaseCurve
        Participants with estimates at fewer than four phases have no curve, but a warning. Timing
        points at which the data speak against the model (``doubts``) are left out, with a warning.

    Raises
    ------
    DataError
        If the analysis does not include the participant, or is by a method without a posterior.
    EstimationError
        ``no_pulses`` if no participant has estimates at four phases.

    Notes
    -----
    Under the prior of the method, a parameter on its scale (logarithm; K: asinh) is a person's
    level, a curve over the cycle with the correlation exp(-2 sin^2(pi (p - q)) / (2 pi l)^2)
    between phases p and q, l = 0.13, and a part that each timing point has by itself. Their
    variances are those of the saved prior covariance C of the timing points: least squares of its
    off-diagonal elements gives level and curve, and the own part is the rest. C mixes the
    hypotheses of the method by their posterior probabilities, and so does the curve, which is
    normal although the mixture is not. With the posterior mean m and covariance S of the timing
    points, the value at a phase has the mean c C^-1 (m - prior mean) above the prior mean and the
    variance v - c C^-1 (C - S) C^-1 c, where c is its prior covariance with the timing points and v
    its prior variance. As an estimate is, the value at a phase is the mean over a window centred
    there: a timing point's own part counts by the overlap of both windows, and ends at the next
    timing point if that is nearer.

    At a timing point the curve is the estimate. Between them it is wider, and as wide as the prior
    of the person if nothing follows the cycle (``cycle_share`` 0). Errors of the gains, and of the
    model in B, are added in full. The device's own part (``intrinsic``) is subtracted; the error of
    its calibration is not in the band. Bands are pointwise.

    The mean over people (three or more) is that of their curves at each phase, not that of
    ``population.csv``: t interval of the variance between people plus the mean variance of their
    curves, over the number of people; errors of gains and model in full. Sessions and sides of a
    person are averaged first. Curves tend to the prior away from timing points, and so does their
    mean.

    The curve misleads if K or B change within less than 10 % of the cycle, such as at heel strike:
    the prior rounds off a step, and an estimate is itself a mean over its window.
    """
    labels = list(dict.fromkeys(cell.label for cell in analysis.cells))
    chosen = _chosen(analysis, labels, participant)
    _check(analysis, parameters)
    posteriors = [p for p in analysis.log_posteriors if p.label in chosen]
    warnings = [
        f"no curve of {label}: the analysis has no posterior of this participant"
        for label in chosen
        if label not in {p.label for p in posteriors}
    ]
    bands: list[ParameterBand] = []
    for name in parameters:
        curves = []
        for posterior in posteriors:
            points, notes = _points(analysis, posterior, name)
            warnings += notes if name in ("stiffness", "damping") else []
            if points is not None:
                curves.append(_Curve(points, _GRID_PCT / 100.0))
        bands += [curve.band(name) for curve in curves]
        if participant is None and (mean := _mean_band(analysis, curves, name)) is not None:
            bands.append(mean)
    if not bands:
        missing = f"no participant has estimates of {' or '.join(parameters)} at {_FEWEST} phases"
        raise EstimationError(
            Failure.NO_PULSES.value, ". ".join([f"phase_curve: {missing}", *warnings])
        )
    return PhaseCurve(
        gait_pct=tuple(_GRID_PCT.tolist()),
        bands=tuple(bands),
        ci_level=_LEVEL,
        ci_method=_CI_METHOD,
        settings={n: analysis.settings[n] for n in _SETTINGS if n in analysis.settings}
        | software(),
        warnings=tuple(warnings),
    )


def timing_points_of_phases(
    measured_pct: np.ndarray, *, width_pct: float = 5.0, fewest: int = 5
) -> dict[str, float]:
    """Return timing points for pulses at arbitrary phases of the cycle.

    Parameters
    ----------
    measured_pct : (n,) float
        Measured phases of the onsets, % of the cycle; NaN where unknown.
    width_pct : float
        Width of the groups.
    fewest : int
        Fewest pulses of a timing point.

    Returns
    -------
    dict
        Name -> mean phase of the group, % of the cycle: ``timing_points`` of a study.

    Raises
    ------
    DataError
        If the width is no part of the cycle, or no group has enough pulses.

    Notes
    -----
    Pulses of a group that is too small go to the nearest timing point, as all pulses do. The
    window of a pulse spans about 9 % of the cycle: groups much narrower than 5 % lose pulses
    without more resolution; in wider ones K changes from pulse to pulse.

    Examples
    --------
    >>> timing_points_of_phases(np.array([11.0, 12.0, 13.0, 60.0]), fewest=3)
    {'10-15 %': 12.0}
    """
    if not 0.0 < width_pct <= 50.0:
        raise DataError(f"timing_points_of_phases: expected 0 < width_pct <= 50, got {width_pct}.")
    phases = measured_pct[np.isfinite(measured_pct)] % 100.0
    groups = (phases // width_pct).astype(int)
    points = {}
    for group in np.unique(groups):
        inside = phases[groups == group]
        if inside.size >= fewest:
            low, high = group * width_pct, min((group + 1) * width_pct, 100.0)
            points[f"{low:g}-{high:g} %"] = float(inside.mean())
    if not points:
        raise DataError(
            f"timing_points_of_phases: expected {fewest} pulses or more within {width_pct:g} % of "
            f"the cycle, got {phases.size} pulses in all. Widen the groups or ask for fewer."
        )
    return points


def _chosen(
    analysis: StudyAnalysis, labels: Sequence[str], participant: str | None
) -> Sequence[str]:
    """Return the labels of the requested participants."""
    if participant is None:
        return labels
    chosen = {cell.label for cell in analysis.cells if cell.participant == participant}
    if participant in labels or len(chosen) != 1:  # else the id is unambiguous
        chosen = {participant}
    if not chosen <= set(labels):
        raise DataError(
            f"phase_curve: expected one of the participants {'; '.join(labels)}, got "
            f"{participant!r}."
        )
    return list(chosen)


def _check(analysis: StudyAnalysis, parameters: Sequence[str]) -> None:
    """Refuse unknown parameters, and walking results without posteriors."""
    known = {p.name for cell in analysis.cells for p in cell.parameters} | set(_PARAMETERS)
    if isinstance(parameters, str) or not set(parameters) <= known:
        raise DataError(
            f"phase_curve: parameters: expected a list out of {', '.join(sorted(known))}; got "
            f"{parameters!r}."
        )
    methods = {c.method for c in analysis.cells if c.onset_gait_pct is not None}
    if not analysis.log_posteriors and methods - WITH_POSTERIOR:
        raise DataError(
            f"phase_curve: these results (method {' and '.join(sorted(methods))}) hold no "
            "posterior of K and B over the gait cycle. Analyse the study again by the method "
            "bayesian: jointz analyze."
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Points:
    """A parameter of a person at the timing points, on its scale."""

    posterior: LogPosterior
    cells: tuple[CellEstimate, ...]
    name: str  # of the parameter, without "per mass"
    phases: np.ndarray  # (n,) cycles
    places: np.ndarray  # (n,) elements of the posterior
    per: float  # factor of values: 1, or 1 / mass
    error: ModelError

    @property
    def scale(self) -> ValueScale:
        return self.posterior.scale(self.name)

    def among(self, matrix: np.ndarray) -> np.ndarray:
        """Return the elements of a covariance that belong to the points."""
        return np.asarray(matrix[np.ix_(self.places, self.places)])

    def near(self, at: np.ndarray) -> np.ndarray:
        """Return the shares of the points' own parts at some phases, (k, n).

        The part of a window about a phase that lies in the window of a point.
        """
        onsets = np.array([c.onset_gait_pct for c in self.cells]) / 100.0
        centres = np.array([c.centre_gait_pct for c in self.cells]) / 100.0
        next_one = _apart(self.phases, self.phases) + np.eye(self.phases.size)
        window = 2.0 * ((centres - onsets) % 1.0)
        reach = np.minimum(window, next_one.min(axis=1)).clip(_SAME_PHASE)
        shares = (1.0 - _apart(at, self.phases) / reach).clip(0.0)
        return np.asarray(shares / shares.sum(axis=1, keepdims=True).clip(1.0))


def _points(
    analysis: StudyAnalysis, posterior: LogPosterior, name: str
) -> tuple[_Points | None, list[str]]:
    """Return the points of a curve, None for fewer than four, and warnings."""
    cells = {c.timing_point: c for c in analysis.cells if c.label == posterior.label}
    base = name.removesuffix(_PER_MASS)
    elements = [k for k, parameter in enumerate(posterior.parameters) if parameter == base]
    flags = dict(enumerate(posterior.doubted))
    doubted = [posterior.timing_points[k] for k in elements if flags.get(k)]
    placed = {
        k: cell
        for k in elements
        if (cell := cells.get(posterior.timing_points[k])) is not None
        and not flags.get(k)
        and cell.onset_gait_pct is not None
        and cell.centre_gait_pct is not None
    }
    doubts = f"doubts at {', '.join(doubted)}: {', '.join(posterior.doubts)}"
    per = 1.0 if base == name else _per_mass(list(placed.values()), base)
    if len(placed) < _FEWEST or per is None:
        text = (
            f"no curve of {name} of {posterior.label}: {len(placed)} timing points with a phase "
            f"and without doubts, expected {_FEWEST} or more"
        )
        return None, [f"{text} ({doubts})" if doubted else text]
    at_onset = base.endswith("_onset")
    phases = [c.onset_gait_pct if at_onset else c.centre_gait_pct for c in placed.values()]
    points = _Points(
        posterior=posterior,
        cells=tuple(placed.values()),
        name=base,
        phases=np.array(phases, dtype=float) / 100.0,
        places=np.array(list(placed)),
        per=per,
        error=COUPLINGS[analysis.coupling].error,
    )
    return points, [f"curve of {name} of {posterior.label}: {doubts}"] * bool(doubted)


def _per_mass(cells: Sequence[CellEstimate], name: str) -> float | None:
    """Return a value per kg over the value, None if the mass is not known."""
    for cell in cells:
        whole, per = cell.parameter(name), cell.parameter(name + _PER_MASS)
        if whole and per and whole.unbounded and per.unbounded:
            return per.unbounded / whole.unbounded
    return None


class _Curve:
    """Curve of a parameter of a person at some phases."""

    def __init__(self, points: _Points, at: np.ndarray) -> None:
        self.points = points
        mean, variance, self.cycle_share = _conditioned(points, at)
        posterior, scale = points.posterior, points.scale
        device = dict(posterior.intrinsic).get(points.name, 0.0)
        whole, sd = scale.value(mean), np.sqrt(variance)
        known = np.hypot(
            with_model_error(points.name, 0.0, points.error), posterior.gain_sd * scale.share(whole)
        )
        reach = REACH_95 * np.hypot(sd, known)
        self.value = points.per * (whole - device)
        self.low = points.per * (scale.moved(whole, -reach) - device)
        self.high = points.per * (scale.moved(whole, reach) - device)
        slope = points.per * scale.slope(whole)
        self.sd = slope * sd
        self.systematic_sd = slope * known

    def band(self, name: str) -> ParameterBand:
        """Return the curve with the estimates behind it."""
        points = self.points
        at_points = _Curve(points, points.phases)
        decided = [(p := c.parameter(name)) is not None and p.available for c in points.cells]
        columns = (at_points.value.tolist(), at_points.low.tolist(), at_points.high.tolist())
        entries = [
            CurvePoint(cell.timing_point, phase, *numbers)
            for cell, phase, *numbers in zip(
                points.cells, (100.0 * points.phases).tolist(), *columns, decided, strict=True
            )
        ]
        return ParameterBand(
            participant=points.posterior.label,
            parameter=name,
            value=tuple(self.value.tolist()),
            ci_low=tuple(self.low.tolist()),
            ci_high=tuple(self.high.tolist()),
            scale="asinh" if points.scale.unit else "logarithmic",
            cycle_share=self.cycle_share,
            points=tuple(sorted(entries, key=lambda point: point.gait_pct)),
        )


def _conditioned(points: _Points, at: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Return mean and variance at some phases, on the scale, and the share of the cycle."""
    posterior, phases = points.posterior, points.phases
    prior = points.among(posterior.prior_covariance)
    prior_mean = posterior.prior_mean[points.places]
    level, curve = _level_and_curve(prior, phases)
    of_points = prior - level - curve * _likeness(phases, phases)
    own_variance = np.diag(of_points)
    across = level + curve * _likeness(at, phases) + points.near(at) @ of_points
    gains = np.linalg.solve(prior, across.T).T
    usual = np.interp(at, phases, prior_mean, period=1.0)
    mean = usual + gains @ (posterior.mean[points.places] - prior_mean)
    total = level + curve + np.interp(at, phases, own_variance, period=1.0)
    unknown = (total - np.einsum("kn,kn->k", gains, across)).clip(0.0)
    known = np.einsum("kn,nm,km->k", gains, points.among(posterior.covariance), gains)
    share = curve / (curve + max(float(own_variance.mean()), _TINY))
    return np.asarray(mean), unknown + known, share


def _level_and_curve(prior: np.ndarray, phases: np.ndarray) -> tuple[float, float]:
    """Return the prior variances of a person's level and of the curve over the cycle."""
    pairs = np.triu_indices(phases.size, 1)
    likeness = _likeness(phases, phases)[pairs]
    (level, curve), _ = nnls(np.column_stack([np.ones_like(likeness), likeness]), prior[pairs])
    return float(level), float(curve)


def _apart(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the distances around the cycle between phases, (len(a), len(b)) cycles."""
    return np.asarray(np.abs((a[:, None] - b + 0.5) % 1.0 - 0.5))


def _likeness(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the prior correlation of the curve between phases."""
    turn = np.sin(np.pi * _apart(a, b)) ** 2
    return np.asarray(np.exp(-2.0 * turn / (2.0 * np.pi * LENGTH_CYCLES) ** 2))


def _mean_band(
    analysis: StudyAnalysis, curves: Sequence[_Curve], name: str
) -> ParameterBand | None:
    """Return the mean over the people's curves, None for too few of them."""
    people = by_key((curve.points.posterior.participant, curve) for curve in curves)
    n = len(people)
    if n < FEWEST_PEOPLE:
        return None
    # Sessions and sides of a person may share their errors: variances are averaged.
    values = np.array([np.mean([c.value for c in person], axis=0) for person in people.values()])
    variances = np.array([np.mean([c.sd**2 for c in person], axis=0) for person in people.values()])
    systematic = np.mean([c.systematic_sd for c in curves], axis=0)
    variance = (values.var(axis=0, ddof=1) + variances.mean(axis=0)) / n
    by_people = stdtrit(n - 1, 0.5 + 0.5 * _LEVEL) * np.sqrt(variance)
    mean, half = values.mean(axis=0), np.hypot(by_people, REACH_95 * systematic)
    return ParameterBand(
        participant=MEAN,
        parameter=name,
        value=tuple(mean.tolist()),
        ci_low=tuple((mean - half).tolist()),
        ci_high=tuple((mean + half).tolist()),
        scale="linear",
        cycle_share=float(np.mean([c.cycle_share for c in curves])),
        points=_means(analysis, name),
    )


def _means(analysis: StudyAnalysis, name: str) -> tuple[CurvePoint, ...]:
    """Return the means over people at the timing points, as in ``population.csv``."""
    points = []
    for row in analysis.population:
        phases = [c.centre_gait_pct for c in analysis.cells if c.timing_point == row.timing_point]
        at = mean_phase(phases)
        if row.parameter != name or at is None or row.value is None:
            continue
        if row.ci_low is not None and row.ci_high is not None:
            ends = row.ci_low, row.ci_high
            points.append(CurvePoint(row.timing_point, at, row.value, *ends, decided=True))
    return tuple(sorted(points, key=lambda point: point.gait_pct))
