"""Quasi-stiffness of unperturbed gait, and the published comparison with stiffness (4.3.2.3).

Quasi-stiffness is how a joint's moment goes with its angle while a person walks. It is no
stiffness: muscles make most of the moment, and nothing was perturbed.
"""

from collections.abc import Mapping, Sequence
from math import ceil, isfinite, pi, radians
from typing import Literal

import numpy as np
from scipy.special import stdtrit

from jointz.core.errors import DataError
from jointz.core.gait_phases import PHASES, TIMING_POINTS, phase_name
from jointz.core.provenance import own_version
from jointz.results.statistics.quasi_stiffness_fit import (
    STEP_PCT,
    WINDOW_PCT,
    ComparedPoint,
    QuasiStiffness,
    QuasiStiffnessComparison,
    QuasiStiffnessDoubt,
    QuasiStiffnessEstimate,
)
from jointz.stats.comparison import NoSpreadError, group_difference

#: Share of backward travel from which the angle counts as turning.
TURNS_FROM = 0.2
#: Below this the angle's range, or the angle under a secant, is small.
SMALL_RAD = radians(1.0)
#: Below this the moment does not follow a line over angle.
LINE_FROM = 0.5
_FEWEST_NODES = 3
#: Share of the variance of parts of a curve, in their mean, above which they are strides.
_ALIKE = 0.9
_MOST_STRIDES = 100
_LARGEST_ANGLE_RAD = 2 * pi

MomentUnit = Literal["N*m", "N*m/kg"]


def quasi_stiffness(
    angle: Sequence[float] | np.ndarray,
    moment: Sequence[float] | np.ndarray,
    *,
    gait_pct: Sequence[float] | np.ndarray | None = None,
    timing_points: Mapping[str, float] | None = None,
    window_pct: float = WINDOW_PCT,
    moment_unit: MomentUnit = "N*m/kg",
) -> QuasiStiffness:
    """Return slope, local slope and secant of moment over angle at every timing point.

    Parameters
    ----------
    angle : (n,) float, rad
        Mean angle over the gait cycle, from zero at the neutral posture.
    moment : (n,) float, ``moment_unit``
        Torque on the joint, positive where the angle is: an internal extension moment
        goes with a flexion angle as it is.
    gait_pct : (n,) float, optional
        Where the nodes lie, % of the gait cycle, rising; by default evenly from 0 to 100.
    timing_points : mapping of str to float, optional
        Timing point -> % of the gait cycle; by default the dissertation's six.
    window_pct : float
        Width of the window of the local slope, centred on the timing point, % of the cycle;
        it is cut at 0 and 100.
    moment_unit : str
        ``N*m/kg`` (the default) or ``N*m``.

    Returns
    -------
    QuasiStiffness
        Per timing point ``slope`` (over the gait phase it lies in), ``local_slope``,
        ``secant`` (moment / angle), each with doubts.

    Raises
    ------
    DataError
        When the arrays do not fit, hold NaN, look like degrees, or do not reach over a phase.

    Notes
    -----
    A slope is the least-squares line of moment on angle, both interpolated linearly every
    :data:`STEP_PCT` % of the cycle, both ends of the phase included, so that every part
    of the phase counts by its duration. Where the angle turns (:data:`TURNS_FROM`), hardly
    moves (:data:`SMALL_RAD`) or does not carry the moment (:data:`LINE_FROM`) the estimate is
    marked ``ill_conditioned``: at 40.5 % the knee is at its smallest flexion of stance, and
    the slope over terminal stance moves by some per cent with the choice of nodes alone.
    Errors in the angle shrink a slope. The secant changes with the angle's zero. The
    dissertation (4.2.4) does not say how its quasi-stiffness was computed, and no slope
    of Winter's data gives the values that 4.3.2.3 implies.

    Examples
    --------
    >>> import numpy as np
    >>> angle = 0.3 - 0.25 * np.cos(np.linspace(0.0, 2 * np.pi, 101))
    >>> found = quasi_stiffness(angle, 2.0 * (angle - 0.1))
    >>> round(found.estimate("LRE").value, 6), round(found.estimate("LRE", "secant").value, 3)
    (2.0, -0.71)
    """
    points = dict(TIMING_POINTS if timing_points is None else timing_points)
    curve = _checked_curve(angle, moment, gait_pct)
    _check_request(points, window_pct, moment_unit)
    _check_reach(curve[0], points)
    estimates = tuple(
        estimate
        for name, onset in points.items()
        for estimate in _at_point(name, float(onset), curve, window_pct)
    )
    return QuasiStiffness(
        estimates=estimates,
        unit=moment_unit.replace("N*m", "N*m/rad"),
        gait_pct=tuple(curve[0].tolist()),
        angle=tuple(curve[1].tolist()),
        moment=tuple(curve[2].tolist()),
        settings={"window_pct": window_pct, "step_pct": STEP_PCT, "jointz": own_version()},
        notes=("a secant changes with the zero of the angle; a slope does not",),
    )


_Curve = tuple[np.ndarray, np.ndarray, np.ndarray]


def _checked_curve(
    angle: Sequence[float] | np.ndarray,
    moment: Sequence[float] | np.ndarray,
    gait_pct: Sequence[float] | np.ndarray | None,
) -> _Curve:
    angles, moments = np.asarray(angle, dtype=float), np.asarray(moment, dtype=float)
    grid = np.linspace(0.0, 100.0, angles.size) if gait_pct is None else gait_pct
    places = np.asarray(grid, dtype=float)
    if angles.ndim != 1 or not angles.shape == moments.shape == places.shape:
        raise DataError(
            "quasi_stiffness: expected angle, moment and gait_pct of one length, one value a node; "
            f"got shapes {angles.shape}, {moments.shape}, {places.shape}. Pass one mean curve"
        )
    for name, values in (("angle", angles), ("moment", moments), ("gait_pct", places)):
        broken = np.flatnonzero(~np.isfinite(values))
        if broken.size:
            raise DataError(
                f"quasi_stiffness: {name} must be finite, node {broken[0]} (of {values.size}) "
                f"is {values[broken[0]]}. Leave the node out, or fill it"
            )
    falls = int((np.diff(places) <= 0).sum())
    if angles.size < _FEWEST_NODES or falls:
        raise DataError(
            f"quasi_stiffness: gait_pct must rise over at least {_FEWEST_NODES} nodes; got "
            f"{places.size}, and {falls} times no rise. Several strides or people in one table: "
            "pass the mean stride of one person. Else sort the nodes and drop repeated ones"
        )
    if gait_pct is None and (n := _n_strides(angles)) > 1:
        raise DataError(
            f"quasi_stiffness: the angle repeats {n} times; expected one stride, as there is no "
            "gait_pct. Pass the mean stride of one person, or gait_pct if it is one stride"
        )
    if np.abs(angles).max() > _LARGEST_ANGLE_RAD:
        raise DataError(
            f"quasi_stiffness: angle must be in rad, the largest is {np.abs(angles).max():g}: "
            "these look like degrees. Pass numpy.radians(angle), or COLUMN:deg in a command"
        )
    return places, angles, moments


def _n_strides(angle: np.ndarray) -> int:
    """Return the number of similar parts (strides) of a curve, 1 if it does not repeat."""
    for n in range(min(_MOST_STRIDES, angle.size // _FEWEST_NODES), 1, -1):
        parts = angle[: angle.size // n * n].reshape(n, -1)
        parts = parts - parts.mean(axis=1, keepdims=True)
        mean = parts.mean(axis=0)
        # A part of a straight curve resembles the others, too, but holds little of its range.
        if mean.var() > _ALIKE * parts.var() and np.ptp(mean) > 0.5 * np.ptp(angle):
            return n
    return 1


def _check_request(points: Mapping[str, float], window_pct: float, moment_unit: str) -> None:
    outside = {name: onset for name, onset in points.items() if not 0.0 <= onset < 100.0}
    if outside or not points:
        raise DataError(
            "quasi_stiffness: expected timing points in 0..100 % of the cycle; got "
            f"{outside or 'none'}"
        )
    if not 0.0 < window_pct <= 100.0:
        raise DataError(
            f"quasi_stiffness: expected 0 < window_pct <= 100, got {window_pct:g} % of the cycle"
        )
    if moment_unit not in ("N*m", "N*m/kg"):
        raise DataError(
            f"quasi_stiffness: expected moment_unit N*m or N*m/kg, got {moment_unit!r}. Convert "
            "the moment"
        )


def _check_reach(places: np.ndarray, points: Mapping[str, float]) -> None:
    short = [
        name
        for name, onset in points.items()
        if PHASES[phase_name(onset)][0] < places[0] or PHASES[phase_name(onset)][1] > places[-1]
    ]
    if short:
        raise DataError(
            f"quasi_stiffness: the curve reaches from {places[0]:g} to {places[-1]:g} % of the "
            f"cycle, the phases of {', '.join(short)} reach further. Pass a whole cycle, or "
            "timing_points inside the curve"
        )


def _at_point(
    name: str, onset: float, curve: _Curve, window_pct: float
) -> tuple[QuasiStiffnessEstimate, ...]:
    half = window_pct / 2.0
    window = (max(onset - half, float(curve[0][0])), min(onset + half, float(curve[0][-1])))
    return (
        _slope((name, onset, "slope"), PHASES[phase_name(onset)], curve),
        _slope((name, onset, "local_slope"), window, curve),
        _secant(name, onset, curve),
    )


def _slope(
    what: tuple[str, float, str], stretch: tuple[float, float], curve: _Curve
) -> QuasiStiffnessEstimate:
    places, angles, moments = curve
    start, end = stretch
    nodes = np.linspace(start, end, ceil((end - start) / STEP_PCT) + 1)
    angle, moment = np.interp(nodes, places, angles), np.interp(nodes, places, moments)
    spread = float(np.ptp(angle))
    n_nodes = int(((places >= start) & (places <= end)).sum())
    value = r_squared = None
    if n_nodes >= _FEWEST_NODES and spread > 0.0:
        value, r_squared = _line(angle, moment)
    backtrack = _backtrack(angle)
    doubts = _slope_doubts(spread=spread, n_nodes=n_nodes, backtrack=backtrack, r_squared=r_squared)
    line = r_squared, spread, backtrack
    return QuasiStiffnessEstimate(*what, value, start, end, *line, _status(value, doubts), doubts)


def _line(angle: np.ndarray, moment: np.ndarray) -> tuple[float, float | None]:
    """Return slope and R squared; None for the latter where the moment does not vary."""
    a, m = angle - angle.mean(), moment - moment.mean()
    slope = float(a @ m / (a @ a))
    varies = np.ptp(moment) > 0.0
    return slope, float((a @ m) ** 2 / ((a @ a) * (m @ m))) if varies else None


def _backtrack(angle: np.ndarray) -> float:
    steps = np.diff(angle)
    travel = float(np.abs(steps).sum())
    if travel == 0.0:
        return 0.0
    up = float(steps[steps > 0].sum())
    return max(min(up, travel - up), 0.0) / travel


def _slope_doubts(
    *, spread: float, n_nodes: int, backtrack: float, r_squared: float | None
) -> tuple[str, ...]:
    if n_nodes < _FEWEST_NODES:
        return (QuasiStiffnessDoubt.TOO_FEW_NODES.value,)
    if spread == 0.0:
        return (QuasiStiffnessDoubt.NO_RANGE.value,)
    raised = {
        QuasiStiffnessDoubt.ANGLE_TURNS: backtrack >= TURNS_FROM,
        QuasiStiffnessDoubt.SMALL_RANGE: spread < SMALL_RAD,
        QuasiStiffnessDoubt.NOT_A_LINE: r_squared is not None and r_squared < LINE_FROM,
    }
    return tuple(doubt.value for doubt, stands in raised.items() if stands)


def _secant(name: str, onset: float, curve: _Curve) -> QuasiStiffnessEstimate:
    angle = float(np.interp(onset, curve[0], curve[1]))
    moment = float(np.interp(onset, curve[0], curve[2]))
    value = moment / angle if angle != 0.0 else None
    doubts: tuple[str, ...] = ()
    if value is None or not isfinite(value):
        value, doubts = None, (QuasiStiffnessDoubt.NO_RANGE.value,)
    elif abs(angle) < SMALL_RAD:
        doubts = (QuasiStiffnessDoubt.SMALL_ANGLE.value,)
    no_line = (None, None, None)  # no line, no range
    return QuasiStiffnessEstimate(
        name, onset, "secant", value, onset, onset, *no_line, _status(value, doubts), doubts
    )


def _status(value: float | None, doubts: tuple[str, ...]) -> str:
    if value is None:
        return "undecided"
    return "ill_conditioned" if doubts else "ok"


# --- the published comparison --------------------------------------------------------------------


def compare_quasi_stiffness(
    quasi_stiffness: Mapping[str, float],
    stiffness: Mapping[str, float],
    *,
    unit: str = "N*m/rad/kg",
    alpha: float = 0.05,
) -> QuasiStiffnessComparison:
    """Compare quasi-stiffness with stiffness as 4.3.2.3 does: per cent, and Welch's t-test.

    Parameters
    ----------
    quasi_stiffness, stiffness : mapping of str to float
        By timing point, in ``unit``; the same timing points in both.
    unit : str
        Of both.
    alpha : float
        Level of the interval of the mean difference.

    Returns
    -------
    QuasiStiffnessComparison
        Percent differences 100 (Q - K) / K, the unpaired test with unequal variances, n, and
        the interval of the difference.

    Raises
    ------
    DataError
        When the timing points differ, fewer than two are there, a value is not finite, or
        nothing varies.

    Notes
    -----
    As published: the rows are timing points, already averaged over people, and the test takes
    them as unpaired and independent. Differences between timing points count as error, so the
    test hardly ever rejects, and people count for nothing. A p above ``alpha`` does not show
    that the two are alike: read the interval.

    Examples
    --------
    The dissertation's p-value, from the quasi-stiffness that its percent differences imply:

    >>> from jointz.reference import chapter4, row_mean
    >>> stiffness = {point: row_mean(row) for point, row in chapter4.STIFFNESS.items()}
    >>> found = compare_quasi_stiffness(chapter4.implied_quasi_stiffness(), stiffness)
    >>> round(found.p, 4), found.n
    (0.3374, 6)
    """
    _check_comparison(quasi_stiffness, stiffness, alpha)
    q = np.array([quasi_stiffness[point] for point in stiffness], dtype=float)
    k = np.array([stiffness[point] for point in stiffness], dtype=float)
    try:
        test = group_difference(q, k)
    except NoSpreadError as exc:
        raise DataError(
            "compare_quasi_stiffness: expected values that vary over the timing points; all are "
            "equal within each kind"
        ) from exc
    half = float(stdtrit(test.df, 1.0 - alpha / 2.0)) * test.se
    return QuasiStiffnessComparison(
        points=tuple(
            ComparedPoint(name, one, other, 100.0 * (one - other) / other if other else None)
            for name, one, other in zip(stiffness, q.tolist(), k.tolist(), strict=True)
        ),
        unit=unit,
        statistic=test.t,
        df=test.df,
        p=test.p,
        difference=test.difference,
        ci_low=test.difference - half,
        ci_high=test.difference + half,
        n=q.size,
        alpha=alpha,
        notes=(
            f"the {q.size} rows of each kind are timing points, not people; unpaired, so that "
            "differences between timing points count as error",
            "a p above the level does not show that the two are alike; the interval says how far "
            "apart they may be",
        ),
    )


def _check_comparison(
    quasi_stiffness: Mapping[str, float], stiffness: Mapping[str, float], alpha: float
) -> None:
    if not 0.0 < alpha < 1.0:
        raise DataError(f"compare_quasi_stiffness: expected 0 < alpha < 1, got {alpha:g}")
    if set(quasi_stiffness) != set(stiffness):
        raise DataError(
            "compare_quasi_stiffness: expected the same timing points in both; got "
            f"{', '.join(quasi_stiffness)} and {', '.join(stiffness)}. Drop those that one lacks"
        )
    if len(stiffness) < 2:
        raise DataError(
            f"compare_quasi_stiffness: expected at least 2 timing points, got {len(stiffness)}"
        )
    for name, values in (("quasi_stiffness", quasi_stiffness), ("stiffness", stiffness)):
        broken = {point: value for point, value in values.items() if not isfinite(value)}
        if broken:
            raise DataError(
                f"compare_quasi_stiffness: {name} must be finite, got {broken}. Drop these timing "
                "points from both"
            )
