"""Impedance of a person's knee over the gait cycle, and the leg as two links."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi, radians

import numpy as np
from scipy.interpolate import CubicSpline

from jointz.core.gait_phases import TIMING_POINTS
from jointz.sim.internal_moment import internal_moment
from jointz.sim.knee_joint import impedance_curve, knee_angle
from jointz.sim.layout import CURVE_PIECES
from jointz.sim.people import Person
from jointz.sim.presets import Preset

_GRAVITY = 9.81  # m/s^2

# Winter, Biomechanics and Motor Control of Human Movement, table 4.1: shares of body mass, of
# height, of segment length.
_LEG_MASS, _LEG_LENGTH, _LEG_CENTRE, _LEG_GYRATION = 0.061, 0.246, 0.606, 0.735
_THIGH_MASS, _THIGH_LENGTH, _THIGH_GYRATION = 0.100, 0.245, 0.540

#: Apparent inertia of the closed chain in stance, share of the leg's about the knee: from loading
#: response to push-off (0.43 to 0.17 kg*m^2 of 0.42).
_STANCE_SHARES = (1.0, 0.4)
_STANCE_CYCLES = 0.62
_CHANGE_CYCLES = 0.04  # between stance and swing
_HALF_WINDOW_PCT = 4.5
# The thigh over the cycle, one cosine: flexion at heel strike, extension at push-off.
_THIGH_MEAN, _THIGH_SWING, _THIGH_PEAK = radians(8.0), radians(18.0), 0.92


@dataclass(frozen=True, slots=True)
class Leg:
    """Shank and foot of a person."""

    mass_kg: float  # mass of shank and foot
    centre_m: float  # distance of the centre of shank and foot from the knee
    inertia: float  # kg*m^2, of shank and foot about the knee
    thigh_inertia: float  # kg*m^2, of the thigh alone, about the hip
    thigh_length_m: float

    @property
    def gravity_nm(self) -> float:
        """Weight times distance of shank and foot, N*m."""
        return self.mass_kg * _GRAVITY * self.centre_m

    def free_inertia(self, knee: np.ndarray) -> np.ndarray:
        """Return the inertia that the knee feels when the hip is free, kg*m^2.

        Two links, torque between them: with A = thigh inertia + m L^2 and C =
        m L l cos(knee), J = (A I - C^2) / (A + I + 2 C).
        """
        above = self.thigh_inertia + self.mass_kg * self.thigh_length_m**2
        coupling = self.mass_kg * self.thigh_length_m * self.centre_m * np.cos(knee)
        return np.asarray(
            (above * self.inertia - coupling**2) / (above + self.inertia + 2.0 * coupling)
        )


def leg_of(person: Person) -> Leg:
    """Return the leg of a person by the proportions of an average body."""
    length, mass = _LEG_LENGTH * person.height_m, _LEG_MASS * person.mass_kg
    thigh = _THIGH_LENGTH * person.height_m
    return Leg(
        mass_kg=mass,
        centre_m=_LEG_CENTRE * length,
        inertia=mass * (_LEG_GYRATION * length) ** 2,
        thigh_inertia=_THIGH_MASS * person.mass_kg * (_THIGH_GYRATION * thigh) ** 2,
        thigh_length_m=thigh,
    )


def frame_gravity(mass_kg: float, distance_m: float) -> float:
    """Return weight times distance, N*m."""
    return mass_kg * _GRAVITY * distance_m


def impedance_over_cycle(
    person: Person, preset: Preset, cycles: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return stiffness, damping, inertia and the thigh's flexion at phases.

    Parameters
    ----------
    person : Person
        Whose.
    preset : Preset
        Whether K and B have plateaus, and what the inertia is.
    cycles : (n,) float
        Phase in cycles, 0 to 1.

    Returns
    -------
    stiffness, damping, inertia, thigh : (n,) float
        N*m/rad, N*m*s/rad, kg*m^2 (of the joint's side, without the rotor), rad.
    """
    curve = _smooth_curve if preset.joint.smooth else impedance_curve
    stiffness = person.mass_kg * curve(person.stiffness_per_mass, cycles)
    damping = person.mass_kg * curve(person.damping_per_mass, cycles)
    if preset.body is None:
        inertia = np.full(cycles.shape, person.inertia)
    else:
        inertia = _leg_inertia(person, cycles)
    inertia = inertia * (1.0 + preset.joint.inertia_variation * np.cos(2.0 * pi * cycles))
    thigh = _THIGH_MEAN + _THIGH_SWING * np.cos(2.0 * pi * (cycles - _THIGH_PEAK))
    return stiffness, damping, inertia, thigh


def packed_curves(person: Person, preset: Preset) -> np.ndarray:
    """Return stiffness, damping, inertia, thigh and moment as cubics, piece by piece of the cycle.

    The plateaus of K and B begin and end where pieces do, so that these two are
    exact; the others are cubic splines through the pieces' ends.
    """
    # Three inner points of every piece give its cubic, whatever the curve is between pieces.
    inner = np.array([0.0, 1.0, 2.0, 3.0]) / 3.0
    at = (np.arange(CURVE_PIECES)[:, None] + inner) / CURVE_PIECES
    impedance = impedance_over_cycle(person, preset, at.ravel())
    values = (*impedance, internal_moment(person, at.ravel()))
    to_powers = np.linalg.inv(np.vander(inner, increasing=True))
    return np.hstack([v.reshape(at.shape) @ to_powers.T for v in values])


def _smooth_curve(per_point: Mapping[str, float], cycles: np.ndarray) -> np.ndarray:
    """Interpolate values without plateaus; stays positive.

    A value of table 4.1 belongs to the window of 100 ms behind its onset: it is met in the middle.
    """
    knots = (np.array(list(TIMING_POINTS.values())) + _HALF_WINDOW_PCT) / 100.0
    values = np.log([per_point[name] for name in TIMING_POINTS])
    spline = CubicSpline(
        np.append(knots, knots[0] + 1.0), np.append(values, values[0]), bc_type="periodic"
    )
    return np.asarray(np.exp(spline(knots[0] + np.mod(cycles - knots[0], 1.0))))


def _leg_inertia(person: Person, cycles: np.ndarray) -> np.ndarray:
    """Return the inertia that the knee feels: a closed chain in stance, two links in swing."""
    leg = leg_of(person)
    first, last = _STANCE_SHARES
    share = np.clip(cycles / _STANCE_CYCLES, 0.0, 1.0)
    stance = leg.inertia * (last + (first - last) * 0.5 * (1.0 + np.cos(pi * share)))
    begin = _ramp((cycles - _STANCE_CYCLES) / _CHANGE_CYCLES)
    end = _ramp((cycles - (1.0 - _CHANGE_CYCLES)) / _CHANGE_CYCLES)
    swing = begin * (1.0 - end)
    # Towards the next heel strike the closed chain is that of loading response again.
    stance = np.where(cycles > 0.5 * (1.0 + _STANCE_CYCLES), first * leg.inertia, stance)
    return np.asarray(swing * leg.free_inertia(knee_angle(cycles)) + (1.0 - swing) * stance)


def _ramp(share: np.ndarray) -> np.ndarray:
    u = np.clip(share, 0.0, 1.0)
    return np.asarray(u * u * (3.0 - 2.0 * u))
