"""Phases of the gait cycle (Perry), the timing points in their middles, and walking speed."""

from collections.abc import Iterable, Mapping
from math import isfinite, sqrt
from typing import TypeVar

import numpy as np

_Phase = TypeVar("_Phase", float, np.ndarray)

#: Phase name -> (start, end), % of the gait cycle.
PHASES: Mapping[str, tuple[float, float]] = {
    "ICO": (0.0, 2.0),
    "LRE": (2.0, 12.0),
    "MST": (12.0, 31.0),
    "TST": (31.0, 50.0),
    "PSW": (50.0, 62.0),
    "ISW": (62.0, 75.0),
    "MSW": (75.0, 87.0),
    "TSW": (87.0, 100.0),
}

#: The six timing points of the dissertation (4.2.2), % of the gait cycle.
TIMING_POINTS: Mapping[str, float] = {
    "LRE": 7.0,
    "MST": 21.5,
    "TST": 40.5,
    "PSW": 56.0,
    "ISW": 68.5,
    "MSW": 81.0,
}

#: Stands where a timing point could, for all of a participant's; no timing point has this name.
ALL_POINTS = "all"

#: The dissertation's; stride times that are assumed or drawn belong to it, m/s.
REFERENCE_SPEED_M_S = 1.2
#: Where people walk: below it they stop between steps, above it they run.
SLOWEST_M_S, FASTEST_M_S = 0.3, 2.2


def phase_name(gait_pct: float) -> str:
    """Name the gait phase at a percentage of the cycle."""
    if not isfinite(gait_pct):
        raise ValueError(f"gait_pct: expected a number, got {gait_pct}.")
    wrapped = gait_pct % 100.0 % 100.0  # -1e-20 % 100.0 is 100.0
    return next(name for name, (_, end) in PHASES.items() if wrapped < end)


def nearest_timing_point(gait_pct: float, timing_points: Mapping[str, float]) -> str:
    """Name the timing point nearest on the circle of the gait cycle."""
    return min(timing_points, key=lambda name: abs(phase_difference(gait_pct, timing_points[name])))


def phase_difference(first: _Phase, second: float) -> _Phase:
    """Return first minus second on the circle of the gait cycle, -50 to 50 %."""
    return (first - second + 50.0) % 100.0 - 50.0


def circular_mean_pct(phases: Iterable[float]) -> float:
    """Return the mean of phases of the gait cycle, where 99 and 1 % lie side by side."""
    angles = np.asarray(list(phases)) * 2 * np.pi / 100.0
    return float(np.angle(np.exp(1j * angles).mean()) * 100.0 / (2 * np.pi) % 100.0)


def mean_phase(phases: Iterable[float | None]) -> float | None:
    """Return the circular mean of the known phases in %, None if there is none."""
    known = [p for p in phases if p is not None]
    return circular_mean_pct(known) if known else None


def stride_time_ratio(speed_m_s: float) -> float:
    """Return the stride time at a speed over that at 1.2 m/s.

    Adults keep the walk ratio, step length over step rate, nearly constant (Bogen et al. 2018,
    Gait & Posture 61, 479, doi 10.1016/j.gaitpost.2018.02.019). Speed is the product of the two,
    so the stride time goes with speed to the power -1/2. Misleads in very slow walking, where the
    walk ratio grows and strides are longer in time than this.
    """
    return sqrt(REFERENCE_SPEED_M_S / speed_m_s)
