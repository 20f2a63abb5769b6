r"""K(phase) and B(phase) as smooth curves with bands, from estimates at single phases.

The curve is a periodic Gaussian process of unknown level through the estimates; amplitude and
length over which it stays alike are integrated over a grid by their evidence.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from jointz.core.codes import Failure
from jointz.core.errors import DataError, EstimationError
from jointz.core.gait_phases import mean_phase
from jointz.core.method_names import STRAPPED
from jointz.core.provenance import software
from jointz.identify.rigid.steep_change import Widened, widen_steep
from jointz.kernels.series.periodic_process import periodic_curve
from jointz.results.estimates import REACH_95, CellEstimate, decides
from jointz.results.person_estimates import person_cells
from jointz.results.series.cycle_curve import MEAN, CurvePoint, ParameterBand, PhaseCurve
from jointz.results.statistics.pooled_estimates import (
    UnboundedEstimate,
    estimate_without_priors,
    unbounded_estimate,
)
from jointz.results.study_analysis import PopulationEstimate, StudyAnalysis

_LEVEL = 0.95
_PARAMETERS = ("stiffness", "damping", "stiffness_per_mass", "damping_per_mass")
#: Fewest phases of a curve.
_FEWEST = 4
#: If all estimates lie so many sds above zero, the logarithm of the curve is smooth.
_CLEAR = 2.0
#: B is estimated earlier in the window than K: share of the time from onset to K's centre.
_DAMPING_SHARE = 0.8
_GRID_PCT = np.arange(0.0, 100.5, 1.0)
_CI_METHOD = "periodic Gaussian process, length and amplitude by evidence"
#: A second smoothing would count the first one, which is in every estimate, as data.
_NOT_OF_STRAPPED = (
    "phase_curve: these results are by the method strapped, whose estimates follow one curve over "
    "the gait cycle already, as far as the responses support it; a curve through them would be too "
    "narrow. Show them with analysis.log_posteriors[0].plot(), or, if the device is coupled "
    "rigidly, analyse the study by the method rigid."
)
_SETTINGS = ("study", "joint", "method", "window_s")


@dataclass(frozen=True, slots=True, eq=False)
class _Measured:
    """Values at phases (cycles), the covariance of their errors, and systematic errors."""

    phases: np.ndarray  # (n,) cycles
    values: np.ndarray  # (n,) SI
    covariance: np.ndarray  # (n, n) of the errors, unit of ``values`` squared
    systematic: np.ndarray  # (n,) sds of the systematic errors, unit of ``values``

    @property
    def largest_sds(self) -> np.ndarray:
        return np.asarray(np.maximum(np.sqrt(np.diag(self.covariance)), self.systematic))


def phase_curve(
    analysis: StudyAnalysis,
    participant: str | None = None,
    *,
    parameters: Sequence[str] = _PARAMETERS,
) -> PhaseCurve:
    """Return stiffness and damping as smooth curves over the gait cycle.

    Parameters
    ----------
    analysis : StudyAnalysis
        Analysis of a walking study by the method ``rigid``.
    participant : str, optional
        A participant, with session and side if the study has them: ``S01, left``; by default
        all participants and the mean over them.
    parameters : sequence of str
        Names among ``stiffness``, ``damping`` and both per kg.

    Returns
    -------
    PhaseCurve
        Participants with estimates at fewer than four phases have no curve, but a warning.

    Raises
    ------
    DataError
        If the analysis does not include the participant, or is by the method ``strapped``.
    EstimationError
        ``no_pulses`` if no participant has estimates at four phases.

    Notes
    -----
    Covariance between phases p and q: a^2 exp(-2 sin^2(pi (p - q)) / (2 pi l)^2) (MacKay 1998,
    Introduction to Gaussian processes, equation 47), flat prior of the level, l between 5 and
    50 % of the cycle and a between 0.1 and 3 times the range of the estimates, both with even
    chances in the logarithm. Where all estimates lie two sd above zero the process is that of
    the logarithm. Each estimate is placed at the mean time in the window at which the response
    depends on K, or on B. Errors other than noise (lag, gains, drift inside the window, model) are
    similar at neighbouring phases: their variance is added in full to the band instead of
    averaging out along the curve. The curve of the mean goes through the means over people; their
    intervals over people are added in full, so that values between the timing points are as
    uncertain for many people as for one.

    An estimate whose window lies on a change of K that both neighbours show, and that the
    estimator has not followed, has a wider interval here than in the analysis and may be undecided
    (:mod:`jointz.identify.rigid.steep_change`); if most people's do, so does their mean.
    Windows shorter than 100 ms do not help.

    The curve misleads if K or B change within less than 5 % of the cycle, such as at heel strike:
    a smooth curve rounds off a step, and an estimate is itself a mean over its window. Between
    timing points the band depends on the process more than on the data. Bands are pointwise.
    """
    _refuse_strapped(analysis)
    people = list(dict.fromkeys(cell.label for cell in analysis.cells))
    rows = {cell.label for cell in analysis.cells if cell.participant == participant}
    if len(rows) == 1:  # the id is unambiguous
        (participant,) = rows
    if participant is not None and participant not in people:
        raise DataError(
            f"phase_curve: expected one of the participants {'; '.join(people)}, got "
            f"{participant!r}."
        )
    known = {p.name for cell in analysis.cells for p in cell.parameters} | set(_PARAMETERS)
    if isinstance(parameters, str) or not set(parameters) <= known:
        raise DataError(
            f"phase_curve: parameters: expected a list out of {', '.join(sorted(known))}; got "
            f"{parameters!r}."
        )
    chosen = people if participant is None else [participant]
    follows = {model.label: model.curve_probability for model in analysis.models}
    widened = widen_steep(analysis.cells, follows)
    everybody, wide = person_cells(analysis.cells), person_cells(widened.cells)
    steep_people = {
        (cell.label, cell.timing_point): cell
        for cell, plain in zip(wide, everybody, strict=True)
        if cell.budget != plain.budget
    }
    bands: list[ParameterBand] = []
    warnings = _steep_warnings(widened, chosen)
    for name in parameters:
        table = {
            person: _estimates([c for c in widened.cells if c.label == person], name)
            for person in chosen
        }
        for person, placed in table.items():
            if len(placed) >= _FEWEST:
                bands.append(_band(person, name, _points(placed, name), _measured(placed)))
            elif name in ("stiffness", "damping"):
                warnings.append(
                    f"no curve of {name} of {person}: estimates at {len(placed)} phases, "
                    f"expected {_FEWEST} or more of the method rigid."
                )
        if participant is None and len(people) > 1:
            # Not widened: a single person's steep change must not reduce that person's weight.
            placed = _estimates(everybody, name, estimate_without_priors)
            mean = _mean_band(name, analysis.population, placed, steep_people)
            bands += [] if mean is None else [mean]
    if not bands:
        missing = f"no participant has estimates of {' or '.join(parameters)} at {_FEWEST} phases"
        raise EstimationError(
            Failure.NO_PULSES.value, " ".join([f"phase_curve: {missing}.", *warnings])
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


def _refuse_strapped(analysis: StudyAnalysis) -> None:
    if analysis.cells and all(cell.method == STRAPPED for cell in analysis.cells):
        raise DataError(_NOT_OF_STRAPPED)


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


@dataclass(frozen=True, slots=True)
class _Placed:
    """An estimate and its phase in the cycle, %."""

    cell: CellEstimate
    estimate: UnboundedEstimate
    gait_pct: float


def _estimates(
    cells: Sequence[CellEstimate],
    name: str,
    of: Callable[[CellEstimate, str], UnboundedEstimate | None] = unbounded_estimate,
) -> list[_Placed]:
    """Return the cells that have an estimate and a phase, in order of phase."""
    placed = [
        _Placed(cell, estimate, place)
        for cell in cells
        if (estimate := of(cell, name)) is not None and (place := _place(cell, name)) is not None
    ]
    return sorted(placed, key=lambda p: p.gait_pct)


def _place(cell: CellEstimate, name: str) -> float | None:
    """Return the phase at which a parameter is estimated, %."""
    onset, centre = cell.onset_gait_pct, cell.centre_gait_pct
    if onset is None or centre is None:
        return None
    share = _DAMPING_SHARE if name.startswith("damping") else 1.0
    return (onset + share * ((centre - onset) % 100.0)) % 100.0


def _points(placed: Sequence[_Placed], name: str) -> tuple[CurvePoint, ...]:
    points = []
    for p in placed:
        estimate, parameter = p.estimate, p.cell.parameter(name)
        points.append(
            CurvePoint(
                timing_point=p.cell.timing_point,
                gait_pct=p.gait_pct,
                value=estimate.value,
                ci_low=estimate.value - REACH_95 * estimate.sd,
                ci_high=estimate.value + REACH_95 * estimate.sd,
                decided=parameter is not None and parameter.available,
            )
        )
    return tuple(points)


def _measured(placed: Sequence[_Placed]) -> _Measured:
    return _Measured(
        phases=np.array([p.gait_pct for p in placed]) / 100.0,
        values=np.array([p.estimate.value for p in placed]),
        covariance=np.diag([p.estimate.sd**2 for p in placed]),
        systematic=np.array([p.estimate.systematic_sd for p in placed]),
    )


def _steep_warnings(widened: Widened, people: Sequence[str]) -> list[str]:
    """Return a warning about windows on a steep change of K."""
    counts = Counter(point for person, point in widened.steep if person in people)
    where = ", ".join(f"{point} ({n} of {len(people)} people)" for point, n in counts.items())
    return [
        f"stiffness may change steeply inside the window at {where}: more than the estimator "
        "expects, so that stiffness and damping have wider intervals here than in the analysis "
        "and may be undecided. A shorter window hardly helps, pulses before and after it do"
    ] * bool(counts)


def _mean_band(
    name: str,
    means: Sequence[PopulationEstimate],
    estimates: Sequence[_Placed],
    steep: Mapping[tuple[str, str], CellEstimate],
) -> ParameterBand | None:
    """Return the curve through the decided means over people, None for too few of them."""
    known = {m.timing_point: m for m in means if m.parameter == name and m.value is not None}
    by_point: dict[str, list[_Placed]] = {}
    for placed in estimates:
        by_point.setdefault(placed.cell.timing_point, []).append(placed)
    several = [
        (mean_phase([placed.gait_pct for placed in group]) or 0.0, known[label], group)
        for label, group in by_point.items()
        if label in known
    ]
    if len(several) < _FEWEST:
        return None
    several.sort(key=lambda entry: entry[0])
    values, lows, highs = (
        np.array([getattr(mean, key) for _, mean, _ in several], dtype=float)
        for key in ("value", "ci_low", "ci_high")
    )
    noise = [sum(p.estimate.sd**2 for p in group) / len(group) ** 2 for _, _, group in several]
    common = np.array([_common_sd(group, name, steep) for _, _, group in several])
    half = np.hypot(0.5 * (highs - lows), REACH_95 * common)
    measured = _Measured(
        phases=np.array([at for at, _, _ in several]) / 100.0,
        values=values,
        covariance=np.diag(np.array(noise) + common**2),
        # People above the mean at one phase mostly are so at the next: no averaging.
        systematic=half / REACH_95,
    )
    points = tuple(
        CurvePoint(
            m.timing_point, at, value, value - reach, value + reach, bool(decides(value, reach))
        )
        for (at, m, _), value, reach in zip(several, values.tolist(), half.tolist(), strict=True)
    )
    return _band(MEAN, name, points, measured)


def _common_sd(
    group: Sequence[_Placed], name: str, steep: Mapping[tuple[str, str], CellEstimate]
) -> float:
    """Return the sd of the error by a steep change that is common to people.

    A mean does not remove it. A change that only few people show is not common.
    """
    sds = []
    for placed in group:
        wide = steep.get((placed.cell.label, placed.cell.timing_point))
        estimate = None if wide is None else unbounded_estimate(wide, name)
        sds.append(0.0 if estimate is None else estimate.systematic_sd)
    return float(np.median(sds))


def _band(
    participant: str, name: str, points: tuple[CurvePoint, ...], measured: _Measured
) -> ParameterBand:
    logarithmic = bool((measured.values > _CLEAR * measured.largest_sds).all())
    curve = periodic_curve(
        measured.phases,
        np.log(measured.values) if logarithmic else measured.values,
        measured.covariance / (np.outer(measured.values, measured.values) if logarithmic else 1.0),
        systematic=measured.systematic / (np.abs(measured.values) if logarithmic else 1.0),
        at=_GRID_PCT / 100.0,
        level=_LEVEL,
    )
    value, low, high = curve.value, curve.low, curve.high
    if logarithmic:
        value, low, high = np.exp(value), np.exp(low), np.exp(high)
    return ParameterBand(
        participant=participant,
        parameter=name,
        value=tuple(value.tolist()),
        ci_low=tuple(low.tolist()),
        ci_high=tuple(high.tolist()),
        scale="logarithmic" if logarithmic else "linear",
        length_pct=100.0 * curve.length,
        points=points,
    )
