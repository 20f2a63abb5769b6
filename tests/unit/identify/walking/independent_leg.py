"""Slow and independent simulator of a leg strapped to a device, for tests of the fast one.

The code shares nothing with the package. It integrates, for one pulse, the deviations from the
predicted unperturbed motion: bone angle x, device angle x2, reflex states r1 and r2, lagged
goniometer y. Everything is zero at and before the first sample; t is the time since then.

    (J1(t) x')' = -Ks(t, x) x - B(t) x' - r2 + S
    J2 x2''   = tau/(1+g_tau) + F(v0+x2', f0+f1|tau|) - F(v0, f0) - S
    S         = ks (x2-x) + cs (x2'-x')
    Ks(t, x)  = kg + (K(t)-kg) / (1 + (|x|/h)^p)
    F(v, c)   = -c tanh(v/vs)
    T r1'     = u - r1,   T r2' = r1 - r2
    u         = g K(t) [q x(t-L) + (1-q) 50 ms x'(t-L)], times a if negative
    lag y'    = x + w (x2-x) - y
    goniometer(t) = y(t-D), zero before t = D

Readings of what the equations leave open:

- tau is linear between samples; |tau| in the friction is the torque before the division by 1+g_tau.
- The reflex is delayed in x and x' only: K is that of time t.
- kg is a constant and may exceed K(t); nothing is clipped.
- J1(t) changes without a torque: only the momentum J1 x' of the deviation counts.

Units: N*m, rad, s. Method: explicit Runge-Kutta of order 8 from torque sample to torque sample (the
torque has its corners there), in pieces no longer than L; the delay reads the dense output of the
earlier pieces.
"""

from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from math import ceil, inf, tanh
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

Curve = Callable[[float], float]

REFLEX_VELOCITY_TIME_S = 0.05
RELATIVE_TOLERANCE, ABSOLUTE_TOLERANCE, LONGEST_STEP_S = 1e-8, 1e-12, 0.0005
#: Half of the time over which the change of the inertia is a difference.
_BESIDE_S = 1e-5
BONE, BONE_VELOCITY, DEVICE, DEVICE_VELOCITY, REFLEX_1, REFLEX_2, LAGGED = range(7)


@dataclass(frozen=True)
class IndependentLeg:
    """Constants of the two masses, the reflex, the friction and the goniometer, in SI units.

    The defaults switch off everything but the two masses and the strap.
    """

    inertia_device: float
    strap_stiffness: float
    strap_damping: float
    softening_angle: float = inf
    softening_power: float = 1.6
    gravity_stiffness: float = 0.0
    reflex_gain: float = 0.0
    reflex_latency: float = 0.045
    reflex_time: float = 0.04
    reflex_position_share: float = 1.0
    reflex_asymmetry: float = 1.0
    friction: float = 0.0
    load_friction: float = 0.0
    friction_velocity: float = 0.08
    torque_gain_error: float = 0.0
    skin_share: float = 0.0
    goniometer_lag: float = 0.0
    goniometer_delay: float = 0.0

    def __post_init__(self):
        if self.reflex_gain and min(self.reflex_latency, self.reflex_time) <= 0:
            raise ValueError("a reflex needs a latency and a time constant above zero")


@dataclass
class _Past:
    """Dense solution of the pieces integrated so far."""

    ends: list[float] = field(default_factory=list)
    pieces: list[Callable[[float], np.ndarray]] = field(default_factory=list)

    def state(self, time: float) -> np.ndarray:
        if time <= 0 or not self.ends:
            return np.zeros(7)
        time = min(time, self.ends[-1])  # rounding at the end of a piece
        return self.pieces[bisect_left(self.ends, time)](time)


@dataclass(frozen=True)
class _Equations:
    """Right-hand side of the state equations within one piece."""

    leg: IndependentLeg
    stiffness: Curve
    damping: Curve
    inertia: Curve
    velocity: Curve
    torque: Curve
    past: _Past

    def rates(self, time: float, state: np.ndarray) -> list[float]:
        leg = self.leg
        x, v, x2, v2, r1, r2, lagged = state.tolist()
        strap = leg.strap_stiffness * (x2 - x) + leg.strap_damping * (v2 - v)
        joint = self.elastic_torque(time, x) + float(self.damping(time)) * v + r2
        device = self.torque(time) / (1 + leg.torque_gain_error) + self.net_friction(time, v2)
        inertia = float(self.inertia(time))
        rate = (
            float(self.inertia(time + _BESIDE_S) - self.inertia(time - _BESIDE_S)) / 2 / _BESIDE_S
        )
        drive = self.reflex_input(time)
        reflex = [(drive - r1) / leg.reflex_time, (r1 - r2) / leg.reflex_time]
        sensor = (x + leg.skin_share * (x2 - x) - lagged) / (leg.goniometer_lag or inf)
        limb = (strap - joint - rate * v) / inertia
        return [v, limb, v2, (device - strap) / leg.inertia_device, *reflex, sensor]

    def elastic_torque(self, time: float, x: float) -> float:
        kg, ratio = self.leg.gravity_stiffness, abs(x) / self.leg.softening_angle
        softened = (float(self.stiffness(time)) - kg) / (1 + ratio**self.leg.softening_power)
        return (kg + softened) * x

    def net_friction(self, time: float, v2: float) -> float:
        leg, v0 = self.leg, float(self.velocity(time))
        loaded = leg.friction + leg.load_friction * abs(self.torque(time))
        moving = -loaded * tanh((v0 + v2) / leg.friction_velocity)
        return moving + leg.friction * tanh(v0 / leg.friction_velocity)

    def reflex_input(self, time: float) -> float:
        leg = self.leg
        if not leg.reflex_gain or time <= leg.reflex_latency:
            return 0.0
        x, v = self.past.state(time - leg.reflex_latency)[[BONE, BONE_VELOCITY]].tolist()
        q = leg.reflex_position_share
        stretch = q * x + (1 - q) * REFLEX_VELOCITY_TIME_S * v
        drive = leg.reflex_gain * float(self.stiffness(time)) * stretch
        return drive * leg.reflex_asymmetry if drive < 0 else drive


def independent_response(
    time_s: np.ndarray,
    torque: np.ndarray,
    *,
    stiffness: Curve,
    damping: Curve,
    inertia: Curve,
    velocity: Curve,
    leg: IndependentLeg,
) -> dict[str, Any]:
    """Deviations in angle that one pulse causes.

    Parameters
    ----------
    time_s
        Increasing times of the samples, s, shape (n,). The first is time zero of the curves.
    torque
        Torque of the pulse at these times, N*m, shape (n,); linear in between.
    stiffness, damping, inertia, velocity
        K (N*m/rad), B (N*m*s/rad), J1 (kg*m^2) and the predicted unperturbed velocity (rad/s), each
        a function of the time since the first sample.
    leg
        Constants of the model.

    Returns
    -------
    dict
        ``bone``, ``device`` and ``goniometer``, rad, each of shape (n,), and ``state``, the state
        at any time since the first sample.
    """
    times = np.asarray(time_s, dtype=float) - float(time_s[0])
    torque = np.asarray(torque, dtype=float)
    past, state = _Past(), np.zeros(7)
    for sample, (start, end) in enumerate(pairwise(times.tolist())):
        line = _line(start, end, float(torque[sample]), float(torque[sample + 1]))
        equations = _Equations(leg, stiffness, damping, inertia, velocity, line, past)
        for first, last in pairwise(_piece_edges(start, end, leg)):
            state = _integrate(equations, first, last, state)
    return _observed(past, times, leg)


def _line(start: float, end: float, first: float, last: float) -> Curve:
    slope = (last - first) / (end - start)
    return lambda time: first + slope * (time - start)


def _piece_edges(start: float, end: float, leg: IndependentLeg) -> list[float]:
    """Edges of pieces no longer than the reflex latency."""
    pieces = ceil((end - start) / leg.reflex_latency) if leg.reflex_gain else 1
    return np.linspace(start, end, pieces + 1).tolist()


def _integrate(equations: _Equations, start: float, end: float, state: np.ndarray) -> np.ndarray:
    """Integrate one piece, add it to the past and return the state at its end."""
    solution = solve_ivp(
        equations.rates,
        (start, end),
        state,
        method="DOP853",
        rtol=RELATIVE_TOLERANCE,
        atol=ABSOLUTE_TOLERANCE,
        max_step=LONGEST_STEP_S,
        dense_output=True,
    )
    if not solution.success:
        raise RuntimeError(f"integration failed between {start} and {end} s: {solution.message}")
    equations.past.ends.append(end)
    equations.past.pieces.append(solution.sol)
    return solution.y[:, -1]


def _observed(past: _Past, times: np.ndarray, leg: IndependentLeg) -> dict[str, Any]:
    now = np.array([past.state(time) for time in times])
    late = np.array([past.state(time - leg.goniometer_delay) for time in times])
    bone, device = late[:, BONE], late[:, DEVICE]
    skin = late[:, LAGGED] if leg.goniometer_lag else bone + leg.skin_share * (device - bone)
    return {"bone": now[:, BONE], "device": now[:, DEVICE], "goniometer": skin, "state": past.state}
