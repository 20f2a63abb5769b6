r"""K(phase) and B(phase) as smooth curves with bands, from estimates at single phases.

The curve is a periodic Gaussian process of unknown level through the estimates; amplitude and
length over which it stays alike are integrated over a grid by their evidence.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from jointz.core.codes import Failure
from jointz.core.errors import DataError, EstimationError
from jointz.core.gait_phases import mean_phase
from jointz.core.provenance import software
from jointz.identify.recommended.steep_change import Widened, widen_steep
from jointz.kernels.series.periodic_process import periodic_curve
from jointz.kernels.statistics.pooling_posterior import partial_pooling
from jointz.results.estimates import REACH_95, CellEstimate, decides
from jointz.results.person_estimates import person_cells
from jointz.results.series.cycle_curve import MEAN, CurvePoint, ParameterBand, PhaseCurve
from jointz.results.statistics.pooled_estimates import (
    UnboundedEstimate,
    estimate_without_priors,
    unbounded_estimate,
)
from jointz.results.study_analysis import StudyAnalysis

_LEVEL = 0.95
_PARAMETERS = ("stiffness", "damping", "stiffness_per_mass", "damping_per_mass")
#: Fewer phases make no curve.
_FEWEST = 4
#: Estimates that all lie so many sd above zero make a curve that is smooth in its logarithm.
_CLEAR = 2.0
#: In a window a response tells of B earlier than of K: share of the way from onset to K's centre.
_DAMPING_SHARE = 0.8
_GRID_PCT = np.arange(0.0, 100.5, 1.0)
_MADE = "periodic Gaussian process, length and amplitude by evidence"
_SETTINGS = ("study", "joint", "method", "window_s")


@dataclass(frozen=True, slots=True, eq=False)
class _Measured:
    """Values at phases, cycles, the covariance of their errors, and what never averages out."""

    phases: np.ndarray
    values: np.ndarray
    covariance: np.ndarray
    systematic: np.ndarray

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
        Of a walking study, by the recommended method.
    participant : str, optional
        Whose curves, with session and side where the study has them: ``S01, left``; by default
        those of everyone and of the mean over people.
    parameters : sequence of str
        Of what: ``stiffness``, ``damping`` and both per kg.

    Returns
    -------
    PhaseCurve
        Who has estimates at fewer than four phases has no curve: the warnings say so.

    Raises
    ------
    DataError
        For a participant that the analysis does not have.
    EstimationError
        ``no_pulses`` when no participant has estimates at four phases.

    Notes
    -----
    Covariance between phases p and q: a^2 exp(-2 sin^2(pi (p - q)) / (2 pi l)^2) (MacKay 1998,
    Introduction to Gaussian processes, equation 47), flat prior of the level, l between 5 and
    50 % of the cycle and a between 0.1 and 3 times the range of the estimates, both with even
    chances in the logarithm. Where all estimates lie two sd above zero the process is that of
    the logarithm. An estimate stands where in the window the response tells of K, or of B.
    Errors other than noise - lag, gains, drift inside the window, model - are alike at
    neighbouring phases: their variance is added whole to the band instead of averaging out
    along the curve. The curve of the mean goes through the means over people, their intervals
    over people (:mod:`jointz.stats.partial_pooling`) added whole, so that what lies between
    the timing points is as uncertain for many people as for one.

    An estimate whose window lies on a rise or fall of K that both neighbours vouch for, and that
    the estimator has not followed, is wider here than in the analysis and may be undecided
    (:mod:`jointz.identify.recommended.steep_change`); where most people's are, so is their mean's.
    Windows shorter than 100 ms do not help there.

    Misleads where K or B change within less than 5 % of the cycle, such as at heel strike: a
    smooth curve rounds a step off, and an estimate is itself a mean over its window. Between
    timing points the band is the process', not the data's. Bands are pointwise.
    """
    people = list(dict.fromkeys(cell.label for cell in analysis.cells))
    rows = {cell.label for cell in analysis.cells if cell.participant == participant}
    if len(rows) == 1:  # a plain id says enough
        (participant,) = rows
    if participant is not None and participant not in people:
        raise DataError(
            f"phase_curve: expected one of the participants {'; '.join(people)}, got "
            f"{participant!r}."
        )
    asked = people if participant is None else [participant]
    follows = {model.label: model.curve_probability for model in analysis.models}
    widened = widen_steep(analysis.cells, follows)
    everybody, wide = person_cells(analysis.cells), person_cells(widened.cells)
    steep_people = {
        (cell.label, cell.timing_point): cell
        for cell, plain in zip(wide, everybody, strict=True)
        if cell.budget != plain.budget
    }
    bands: list[ParameterBand] = []
    warnings = _said_steep(widened, asked)
    for name in parameters:
        table = {
            person: _estimates([c for c in widened.cells if c.label == person], name)
            for person in asked
        }
        for person, found in table.items():
            if len(found) >= _FEWEST:
                bands.append(_band(person, name, _points(found, name), _measured(found)))
            elif name in ("stiffness", "damping"):
                warnings.append(
                    f"no curve of {name} of {person}: estimates at {len(found)} phases, "
                    f"expected {_FEWEST} or more of the recommended method."
                )
        if participant is None and len(people) > 1:
            # As they are: who seems steep at a point where others do not is not to weigh less.
            own = _estimates(everybody, name, estimate_without_priors)
            mean = _mean_band(name, own, steep_people)
            bands += [] if mean is None else [mean]
    if not bands:
        raise EstimationError(Failure.NO_PULSES.value, f"phase_curve: {' '.join(warnings)}")
    return PhaseCurve(
        gait_pct=tuple(_GRID_PCT.tolist()),
        bands=tuple(bands),
        ci_level=_LEVEL,
        ci_method=_MADE,
        settings=_settings(analysis.settings),
        warnings=tuple(warnings),
    )


def timing_points_of_phases(
    measured_pct: np.ndarray, *, width_pct: float = 5.0, fewest: int = 5
) -> dict[str, float]:
    """Return timing points for pulses that fall anywhere in the cycle.

    Parameters
    ----------
    measured_pct : (n,) float
        Measured phases of the onsets, % of the cycle; NaN where unknown.
    width_pct : float
        Of the groups.
    fewest : int
        Pulses that make a timing point.

    Returns
    -------
    dict
        Name -> mean phase of the group, % of the cycle: ``timing_points`` of a study.

    Raises
    ------
    DataError
        When the width is not a part of the cycle, or no group has enough pulses.

    Notes
    -----
    Pulses of a group that is too small go to the nearest timing point, as all pulses do. A
    pulse's window spans about 9 % of the cycle: groups much narrower than 5 % cost pulses
    without telling more; in wider ones K changes from pulse to pulse.

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


def _settings(settings: Mapping[str, Any]) -> dict[str, Any]:
    return {name: settings[name] for name in _SETTINGS if name in settings} | software()


@dataclass(frozen=True, slots=True)
class _Placed:
    """An estimate and where in the cycle it was made, %."""

    cell: CellEstimate
    estimate: UnboundedEstimate
    gait_pct: float


def _estimates(
    cells: Sequence[CellEstimate],
    name: str,
    of: Callable[[CellEstimate, str], UnboundedEstimate | None] = unbounded_estimate,
) -> list[_Placed]:
    """Return the cells that have an estimate and a place in the cycle, in order of phase."""
    found = []
    for cell in cells:
        estimate, place = of(cell, name), _place(cell, name)
        if estimate is not None and place is not None:
            found.append(_Placed(cell, estimate, place))
    return sorted(found, key=lambda placed: placed.gait_pct)


def _place(cell: CellEstimate, name: str) -> float | None:
    """Return where in the cycle the response tells of a parameter, %."""
    onset, centre = cell.onset_gait_pct, cell.centre_gait_pct
    if onset is None or centre is None:
        return None
    share = _DAMPING_SHARE if name.startswith("damping") else 1.0
    return (onset + share * ((centre - onset) % 100.0)) % 100.0


def _points(found: Sequence[_Placed], name: str) -> tuple[CurvePoint, ...]:
    points = []
    for placed in found:
        estimate, parameter = placed.estimate, placed.cell.parameter(name)
        points.append(
            CurvePoint(
                timing_point=placed.cell.timing_point,
                gait_pct=placed.gait_pct,
                value=estimate.value,
                ci_low=estimate.value - REACH_95 * estimate.sd,
                ci_high=estimate.value + REACH_95 * estimate.sd,
                decided=parameter is not None and parameter.stands,
            )
        )
    return tuple(points)


def _measured(found: Sequence[_Placed]) -> _Measured:
    return _Measured(
        phases=np.array([placed.gait_pct for placed in found]) / 100.0,
        values=np.array([placed.estimate.value for placed in found]),
        covariance=np.diag([placed.estimate.sd**2 for placed in found]),
        systematic=np.array([placed.estimate.systematic_sd for placed in found]),
    )


def _said_steep(widened: Widened, people: Sequence[str]) -> list[str]:
    """Say where estimates lie on a rise inside the window, and what was done about it."""
    counts = Counter(point for person, point in widened.steep if person in people)
    where = ", ".join(f"{point} ({n} of {len(people)} people)" for point, n in counts.items())
    return [
        f"stiffness may change steeply inside the window at {where}: more than the estimator "
        "expects, so that stiffness and damping have wider intervals here than in the analysis "
        "and may be undecided. A shorter window hardly helps, pulses before and after it do"
    ] * bool(counts)


def _mean_band(
    name: str, found: Sequence[_Placed], steep: Mapping[tuple[str, str], CellEstimate]
) -> ParameterBand | None:
    """Return the curve through the means over people; None for too few of them."""
    by_point: dict[str, list[_Placed]] = {}
    for placed in found:
        by_point.setdefault(placed.cell.timing_point, []).append(placed)
    most = max(map(len, by_point.values()), default=0)
    several = [
        (mean_phase([placed.gait_pct for placed in group]) or 0.0, label, group)
        for label, group in by_point.items()
        if len(group) > 1
    ]
    if len(several) < _FEWEST:
        return None
    several.sort(key=lambda entry: entry[:2])
    values, sds = np.full((2, len(several), most), np.nan)
    for row, (_, _, group) in enumerate(several):
        values[row, : len(group)] = [placed.estimate.value for placed in group]
        sds[row, : len(group)] = [placed.estimate.sd for placed in group]
    pooled = partial_pooling(values, sds, level=_LEVEL)
    n = np.array([len(group) for _, _, group in several])
    common = np.array([_common_sd(group, name, steep) for _, _, group in several])
    half = np.hypot(0.5 * (pooled.mean_high - pooled.mean_low), REACH_95 * common)
    measured = _Measured(
        phases=np.array([at for at, _, _ in several]) / 100.0,
        values=pooled.mean,
        covariance=np.diag(np.nansum(sds**2, axis=1) / n**2 + common**2),
        # Who is above the mean at one phase mostly is so at the next: that does not average out.
        systematic=half / REACH_95,
    )
    typical = REACH_95 * np.nanmedian(sds, axis=1)  # as means over people are decided
    points = tuple(
        CurvePoint(
            label, at, mean, mean - reach, mean + reach, mean > 0.0 and decides(mean, furthest)
        )
        for (at, label, _), mean, reach, furthest in zip(
            several,
            pooled.mean.tolist(),
            half.tolist(),
            np.maximum(half, typical).tolist(),
            strict=True,
        )
    )
    return _band(MEAN, name, points, measured)


def _common_sd(
    group: Sequence[_Placed], name: str, steep: Mapping[tuple[str, str], CellEstimate]
) -> float:
    """Return the sd of what a steep window does to all people alike: no mean removes it.

    What most people's neighbours vouch for is common; what few do belongs to these.
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
