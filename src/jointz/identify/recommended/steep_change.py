"""Estimates whose window lies on a rise that the estimator did not follow: wider, or undecided.

How far a drift of K over the window moves K and B follows from the response; how large it may be
the neighbours tell.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from jointz.core.gait_phases import phase_difference
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

#: Drift of K over the window, share of its value, that is steep.
_STEEP = 0.15
#: A difference between neighbours of fewer sd vouches for nothing.
_CLEAR = 1.0
#: What follows the centre in the window, over what is before it.
_REST = 0.6
#: Fewer phases have no neighbours on both sides.
_FEWEST = 3
#: Phases closer than this are one.
_SAME_PCT = 1e-6
_IMPEDANCE = ("stiffness", "damping", "inertia")
#: What moves with the drift of K, and is told over the cycle.
MOVED = ("stiffness", "damping")


@dataclass(frozen=True, slots=True)
class Widened:
    """Cells with errors that allow for a steep drift."""

    cells: tuple[CellEstimate, ...]  # all of them, in their order
    # label and timing point -> cell whose window lies on a steep rise or fall
    steep: Mapping[tuple[str, str], CellEstimate]


def widen_steep(cells: Sequence[CellEstimate], follows: Mapping[str, float]) -> Widened:
    """Widen the errors of K and B where the window lies on a steep rise or fall of K.

    The slope at a timing point is the lesser of those to its two neighbours, and none where they
    differ in sign or a difference may be chance (minmod limiter: Roe 1986, Annual Review of Fluid
    Mechanics 18, 337): it is what both neighbours vouch for. K is steep where it so changes by
    more than 15 % of its value over the window. How much it changes in fact is open: at most from
    the one neighbour to the other, and by a drift that does not begin beyond the first. That
    change, times what :func:`drift_reach` says, is added to the error budget as ``drift``.

    Why not shorter windows: on a rise that takes as long as the window they have the same error
    (+30, +42, +43 % of K in 100, 80, 60 ms), and one person's estimates in 60 and 100 ms differ by
    1.4 sd only: no test.

    Misleads where a rise is so narrow that no neighbour shows it, and at its first and its last
    timing point: K is told from one side only there. Where K rises from timing point to timing
    point but stays in each window, it is called steep without being so.
    """
    widened = list(cells)
    steep: dict[tuple[str, str], CellEstimate] = {}
    for person in dict.fromkeys(cell.label for cell in cells):
        mine = [i for i, cell in enumerate(cells) if cell.label == person]
        # A drift is no surprise where the estimator has followed the curve.
        surprise = float(np.sqrt(1.0 - follows.get(person, 0.0)))
        for i, drift in zip(mine, _drifts([cells[i] for i in mine], surprise), strict=True):
            if drift > 0.0:
                wide = _widened(cells[i], float(drift))
                widened[i] = steep[person, cells[i].timing_point] = wide
    return Widened(tuple(widened), steep)


def undecided_where_steep(
    cells: Sequence[CellEstimate], curve_probability: float
) -> list[CellEstimate]:
    """Withhold K and B of a person where a neighbour within one window tells of a steep change.

    As :func:`widen_steep`, for values that are read one by one. A neighbour further off than a
    window says little of what happens inside it: K may rise from point to point and stay in each.
    """
    drifts = _drifts(cells, float(np.sqrt(1.0 - curve_probability)))
    placed = [_placed(cell) for cell in cells]
    found = []
    for cell, drift, own in zip(cells, drifts, placed, strict=True):
        near = own is not None and any(
            0.0 < abs(phase_difference(other[0], own[0])) < own[3]
            for other in placed
            if other is not None
        )
        found.append(_withheld(cell) if drift > 0.0 and near else cell)
    return found


def _withheld(cell: CellEstimate) -> CellEstimate:
    """Return a cell whose K and B are undecided."""
    rows = [_undecided(p) if p.stands and p.name.startswith(MOVED) else p for p in cell.parameters]
    return replace(cell, parameters=tuple(rows), gravity_corrected=None)


def drift_reach(cell: CellEstimate) -> tuple[float, float] | None:
    """Return how far a drift of K moves K and B, were the window to have one K.

    Least squares, all samples alike, of the angle's derivative to the slope of K on those to K, B
    and J, in the joint that was estimated. Misleads by as much as the estimator weighs samples
    unlike, or knows J: on simulated walkers its own budget agrees within a third for B, and for K
    in stance; in swing it says twice as much for K.
    """
    values = [p.unbounded for n in _IMPEDANCE if (p := cell.parameter(n)) is not None]
    response = cell.response
    known = [value for value in values if value is not None]
    if response is None or len(known) < len(_IMPEDANCE) or not known[-1] > 0.0:
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
    """Return what K of a person may drift over each window unexpectedly, N*m/rad; 0: little."""
    drifts = np.zeros(len(cells))
    found = [(i, *placed) for i, cell in enumerate(cells) if (placed := _placed(cell))]
    if len(found) < _FEWEST:
        return drifts
    found.sort(key=lambda entry: entry[1])
    at, values, sds, windows = np.array([entry[1:] for entry in found]).T
    rises = values - np.roll(values, 1)
    rises[np.abs(rises) < _CLEAR * np.hypot(sds, np.roll(sds, 1))] = 0.0
    before = rises / np.maximum((at - np.roll(at, 1)) % 100.0, _SAME_PCT)
    after = np.roll(before, -1)
    vouched = np.where(before * after > 0.0, np.minimum(np.abs(before), np.abs(after)), 0.0)
    # A drift that begins outside of what the two neighbours span is none between them.
    most = np.minimum(np.abs(rises + np.roll(rises, -1)), (1.0 + _REST) * np.abs(rises))
    little = _STEEP * np.maximum(np.abs(values), K_FLOOR)
    steep = (vouched * windows > little) & (surprise * most > little)
    drifts[[entry[0] for entry in found]] = np.where(steep, surprise * most, 0.0)
    return drifts


def _placed(cell: CellEstimate) -> tuple[float, float, float, float] | None:
    """Return phase of K, value and sd, and how long the window is, % of the cycle."""
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
    """Return a parameter as it is, or undecided where its errors are too wide."""
    estimate = unbounded_estimate(cell, parameter.name)
    moved = parameter.stands and parameter.name.startswith(MOVED)
    if estimate is None or not moved or decides(estimate.value, REACH_95 * estimate.sd):
        return parameter
    return _undecided(parameter)


def _undecided(parameter: ParameterEstimate) -> ParameterEstimate:
    return replace(parameter, value=None, ci_low=None, ci_high=None, status="undecided")
