"""Wider intervals, or no values, of estimates whose window lies on a steep change of K.

The effect of a drift of K over the window on K and B follows from the response, the possible size
of the drift from the neighbouring timing points.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from jointz.core.gait_phases import phase_difference
from jointz.identify.preparation.cell_data import PARAMETERS
from jointz.kernels.joint_response import (
    DAMPING,
    INERTIA,
    STIFFNESS,
    STIFFNESS_SLOPE,
    joint_motion,
)
from jointz.kernels.response_search import K_FLOOR
from jointz.results.estimates import REACH_95, CellEstimate, ParameterEstimate, decides
from jointz.results.statistics.pooled_estimates import unbounded_estimate

#: Steep drift of K over the window, share of its value.
_STEEP = 0.15
#: Least difference between neighbours that is no chance, sds.
_CLEAR = 1.0
#: Part of the window after the centre over the part before it.
_REST = 0.6
#: Fewest phases with neighbours on both sides.
_FEWEST = 3
#: Least distance of phases.
_SAME_PCT = 1e-6
#: Parameters that a drift of K changes.
MOVED = ("stiffness", "damping")


@dataclass(frozen=True, slots=True)
class Widened:
    """Cells with errors that allow for a steep drift."""

    cells: tuple[CellEstimate, ...]  # all cells, in the order given
    # (label, timing point) -> cell whose window lies on a steep change
    steep: Mapping[tuple[str, str], CellEstimate]


def widen_steep(cells: Sequence[CellEstimate], follows: Mapping[str, float]) -> Widened:
    """Widen the errors of K and B of windows on a steep change of K.

    The slope at a timing point is the lesser of those to its two neighbours, and zero if they
    differ in sign or a difference may be chance (minmod limiter: Roe 1986, Annual Review of Fluid
    Mechanics 18, 337). A change is steep if it exceeds 15 % of K over the window. The true change
    is unknown; the largest possible one is from one neighbour to the other, or that of a drift
    which begins at the first. It is multiplied by :func:`drift_reach` and added to the error budget
    as ``drift``.

    Shorter windows do not help: on a rise as long as the window they have the same error (+30,
    +42, +43 % of K in 100, 80, 60 ms), and one person's estimates in 60 and 100 ms differ by only
    1.4 sds, which is no test.

    It misleads if a rise is so narrow that no neighbour shows it, and at its first and last timing
    point, which have one neighbour on it only. If K rises between timing points but is constant in
    each window, it is called steep although it is not.
    """
    widened = list(cells)
    steep: dict[tuple[str, str], CellEstimate] = {}
    for person in dict.fromkeys(cell.label for cell in cells):
        indices = [i for i, cell in enumerate(cells) if cell.label == person]
        # The estimator allows for the drift as far as it follows the curve.
        surprise = float(np.sqrt(1.0 - follows.get(person, 0.0)))
        drifts = _drifts([cells[i] for i in indices], surprise)
        for i, drift in zip(indices, drifts, strict=True):
            if drift > 0.0:
                wide = _widened(cells[i], float(drift))
                widened[i] = steep[person, cells[i].timing_point] = wide
    return Widened(tuple(widened), steep)


def undecided_where_steep(
    cells: Sequence[CellEstimate], curve_probability: float
) -> list[CellEstimate]:
    """Withhold K and B of a person if a neighbour within one window shows a steep change.

    Like :func:`widen_steep`, for values that are read one by one. A more distant neighbour shows
    little of what happens inside a window.
    """
    drifts = _drifts(cells, float(np.sqrt(1.0 - curve_probability)))
    places = [_place(cell) for cell in cells]
    decided = []
    for cell, drift, place in zip(cells, drifts, places, strict=True):
        near = place is not None and any(
            0.0 < abs(phase_difference(other[0], place[0])) < place[3]
            for other in places
            if other is not None
        )
        if drift > 0.0 and near:
            rows = [_undecided(p) if _is_moved(p) else p for p in cell.parameters]
            decided.append(replace(cell, parameters=tuple(rows), gravity_corrected=None))
        else:
            decided.append(cell)
    return decided


def drift_reach(cell: CellEstimate) -> tuple[float, float] | None:
    """Return the change of estimated K and B by a drift of K, if K is assumed constant.

    Unweighted least squares of the angle's derivative to the slope of K on those to K, B and J, in
    the estimated joint. It misleads if the estimator weights samples differently or knows J: on
    simulated walkers its error budget agrees within a third for B, and for K in stance; in swing
    it is twice as large for K.
    """
    values = [p.unbounded for n in PARAMETERS if (p := cell.parameter(n)) is not None]
    response = cell.response
    known = [value for value in values if value is not None]
    if response is None or len(known) < len(PARAMETERS) or not known[-1] > 0.0:
        return None
    stiffness, damping, inertia = known
    lag_s = next((p.value or 0.0 for p in cell.nuisance if p.name == "angle_lag"), 0.0)
    window_s = float(response.time_s[-1]) - lag_s
    since = response.time_s - response.time_s[0]
    middle = np.full(3, window_s / (1.0 + _REST) - response.time_s[0])
    torque = np.vstack([response.torque, np.zeros(since.size)])
    impedance = np.array([stiffness, 0.0, damping, 0.0, inertia, 0.0])
    motion = joint_motion(torque, 0.0, impedance, middle, float(since[1]), 1)
    shown = [
        np.interp(since - lag_s, since, motion[:, column])
        for column in (STIFFNESS, DAMPING, INERTIA, STIFFNESS_SLOPE)
    ]
    reach = np.linalg.lstsq(np.column_stack(shown[:-1]), shown[-1] / window_s, rcond=None)[0]
    return float(reach[0]), float(reach[1])


def _drifts(cells: Sequence[CellEstimate], surprise: float) -> np.ndarray:
    """Return the possible unmodelled drift of K over each window, N*m/rad; 0 if it is small."""
    drifts = np.zeros(len(cells))
    places = [(i, *place) for i, cell in enumerate(cells) if (place := _place(cell))]
    if len(places) < _FEWEST:
        return drifts
    places.sort(key=lambda entry: entry[1])
    at, values, sds, windows = np.array([entry[1:] for entry in places]).T
    rises = values - np.roll(values, 1)
    rises[np.abs(rises) < _CLEAR * np.hypot(sds, np.roll(sds, 1))] = 0.0
    before = rises / np.maximum((at - np.roll(at, 1)) % 100.0, _SAME_PCT)
    after = np.roll(before, -1)
    slope = np.where(before * after > 0.0, np.minimum(np.abs(before), np.abs(after)), 0.0)
    # A drift that begins beyond a neighbour is not one between the two.
    most = np.minimum(np.abs(rises + np.roll(rises, -1)), (1.0 + _REST) * np.abs(rises))
    little = _STEEP * np.maximum(np.abs(values), K_FLOOR)
    steep = (slope * windows > little) & (surprise * most > little)
    drifts[[entry[0] for entry in places]] = np.where(steep, surprise * most, 0.0)
    return drifts


def _place(cell: CellEstimate) -> tuple[float, float, float, float] | None:
    """Return phase of K (%), its value and sd, and the length of the window (%)."""
    estimate = unbounded_estimate(cell, "stiffness")
    onset, centre = cell.onset_gait_pct, cell.centre_gait_pct
    if estimate is None or onset is None or centre is None:
        return None
    window = (1.0 + _REST) * ((centre - onset) % 100.0)
    return centre, estimate.value, estimate.sd, window


def _widened(cell: CellEstimate, drift: float) -> CellEstimate:
    reach = drift_reach(cell)
    if reach is None:
        return cell
    budget = {name: dict(sources) for name, sources in cell.budget.items()}
    for name, moved in zip(MOVED, reach, strict=True):
        sources = budget.setdefault(name, {})
        sources["drift"] = float(np.hypot(sources.get("drift", 0.0), moved * drift))
    wide = replace(cell, budget=budget)
    return replace(wide, parameters=tuple(_decided(wide, p) for p in wide.parameters))


def _decided(cell: CellEstimate, parameter: ParameterEstimate) -> ParameterEstimate:
    """Return a parameter, undecided if its errors are too large."""
    estimate = unbounded_estimate(cell, parameter.name)
    if estimate is None or not _is_moved(parameter):
        return parameter
    decided = decides(estimate.value, REACH_95 * estimate.sd)
    return parameter if decided else _undecided(parameter)


def _is_moved(parameter: ParameterEstimate) -> bool:
    """Return whether a parameter has a value that a drift of K changes."""
    return parameter.available and parameter.name.startswith(MOVED)


def _undecided(parameter: ParameterEstimate) -> ParameterEstimate:
    return replace(parameter, value=None, ci_low=None, ci_high=None, status="undecided")
