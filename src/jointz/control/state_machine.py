"""Four states of constant impedance, fitted to a profile."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from scipy.optimize import nnls

from jointz.control.impedance_profile import ImpedanceProfile

#: States of the Open-Source Leg's walking controller.
STATES: Final = ("ESTANCE", "LSTANCE", "ESWING", "LSWING")
#: Ends of the states where there is no mean stride to tell, % of the gait cycle: that controller
#: changes state by load, ankle angle and knee angle.
ENDS_PCT: Final = (30.0, 62.0, 72.0, 100.0)
#: Beside the mean stride the fit holds for deviations of this sd from it, rad and rad/s: about
#: those of a pulse. Along one stride alone every stiffness would do.
DEVIATION_RAD, DEVIATION_RAD_S = 0.1, 1.0
#: Least stiffness of a state, N*m/rad: without any it would have no equilibrium.
SOFTEST: Final = 1.0
#: Shortest state, nodes of the profile (% of the gait cycle).
_SHORTEST = 5


@dataclass(frozen=True, slots=True)
class ImpedanceState:
    """One state of constant impedance."""

    name: str
    begin_pct: float  # % of the gait cycle
    end_pct: float
    stiffness: float  # N*m/rad
    damping: float  # N*m*s/rad
    equilibrium: float  # rad


@dataclass(frozen=True, slots=True)
class StateMachineFit:
    """Four states fitted to a profile."""

    states: tuple[ImpedanceState, ...]
    rms_nm: float  # error along the mean stride, N*m
    rms_deviated_nm: float  # error for deviations from it, N*m


def fit_state_machine(profile: ImpedanceProfile) -> StateMachineFit:
    """Return the four states of constant impedance nearest to a profile.

    Least squares over the cycle of the torque along the mean stride and for deviations from it of
    :data:`DEVIATION_RAD` and :data:`DEVIATION_RAD_S`, with stiffness >= 1 N*m/rad and
    damping >= 0. Stance ends at toe-off (62 % of the cycle) and early swing at the knee's largest
    flexion, as in that controller; the end of early stance is fitted, among all whole % of the
    cycle.
    """
    n, toe_off = profile.gait_pct.size, round(ENDS_PCT[1])
    peak = int(np.argmax(np.where(profile.gait_pct > toe_off + _SHORTEST, profile.angle, -np.inf)))
    peak = min(max(peak, toe_off + _SHORTEST), n - _SHORTEST)
    cuts = min(
        ([0, split, toe_off, peak, n] for split in range(_SHORTEST, toe_off - _SHORTEST + 1)),
        key=lambda cuts: sum(segment_fit(profile, *pair)[1] for pair in pairwise(cuts)),
    )
    states, total = [], 0.0
    for name, (begin, end) in zip(STATES, pairwise(cuts), strict=True):
        (stiffness, damping, offset), cost = segment_fit(profile, begin, end)
        total += cost
        equilibrium = offset / stiffness
        states.append(
            ImpedanceState(name, float(begin), float(end), stiffness, damping, equilibrium)
        )
    tables = state_tables(states, profile.gait_pct)
    along = tables[0] * (tables[2] - profile.angle) - tables[1] * profile.velocity
    return StateMachineFit(
        tuple(states),
        float(np.sqrt(np.mean((along - profile.moment) ** 2))),
        float(np.sqrt(total / n)),
    )


def segment_fit(profile: ImpedanceProfile, begin: int, end: int) -> tuple[tuple[float, ...], float]:
    """Return stiffness, damping and stiffness * equilibrium of nodes, and the sum of squares.

    The torque of a state is offset - K angle - B velocity. For deviations that are independent of
    each other the mean square adds (K - K of the profile)^2 times their variance, and so for B.
    """
    at = slice(begin, end)
    angle, velocity = profile.angle[at], profile.velocity[at]
    torque = profile.torque(profile.gait_pct[at], angle, velocity)
    one, none = np.ones(angle.size), np.zeros(angle.size)
    rows = np.vstack([
        np.column_stack([-angle, -velocity, one, -one]),
        np.column_stack([DEVIATION_RAD * one, none, none, none]),
        np.column_stack([none, DEVIATION_RAD_S * one, none, none]),
    ])  # fmt: skip
    targets = np.concatenate(
        [torque, DEVIATION_RAD * profile.stiffness[at], DEVIATION_RAD_S * profile.damping[at]]
    )
    # The offset is a difference, so that it has a sign.
    solution, residual = nnls(rows, targets - SOFTEST * rows[:, 0])
    impedance = SOFTEST + solution[0], solution[1], solution[2] - solution[3]
    return tuple(map(float, impedance)), float(residual**2)


def state_tables(
    states: Sequence[ImpedanceState], gait_pct: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return stiffness, damping and equilibrium at phases."""
    ends = np.array([state.end_pct for state in states])
    which = np.searchsorted(ends, gait_pct + 1e-9, side="right").clip(max=len(states) - 1)
    table = np.array([(s.stiffness, s.damping, s.equilibrium) for s in states])[which]
    return table[:, 0], table[:, 1], table[:, 2]


#: Knee of the Open-Source Leg's example controller as published with the opensourceleg library
#: (stiffness N*m/rad, damping N*m*s/rad, equilibrium degrees of flexion).
OSL_KNEE: Final[Mapping[str, tuple[float, float, float]]] = {
    "ESTANCE": (99.372, 3.180, 5.0),
    "LSTANCE": (99.372, 1.272, 8.0),
    "ESWING": (39.749, 0.063, 60.0),
    "LSWING": (15.899, 3.816, 5.0),
}


def osl_states() -> tuple[ImpedanceState, ...]:
    """Return the published states of the Open-Source Leg's knee."""
    begins = (0.0, *ENDS_PCT[:-1])
    return tuple(
        ImpedanceState(name, begin, end, stiffness, damping, float(np.radians(degrees)))
        for (name, (stiffness, damping, degrees)), begin, end in zip(
            OSL_KNEE.items(), begins, ENDS_PCT, strict=True
        )
    )
