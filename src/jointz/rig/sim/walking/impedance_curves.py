"""Impedance of a person's knee over the gait cycle, and the leg as two links."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import pi, radians

import numpy as np
from scipy.interpolate import CubicSpline

from jointz.core.gait_phases import TIMING_POINTS
from jointz.rig.sim.people import Person, personal_preset
from jointz.rig.sim.presets import BodySettings, Preset
from jointz.rig.sim.walking.internal_moment import internal_moment
from jointz.rig.sim.walking.knee_joint import impedance_curve, knee_angle
from jointz.rig.sim.walking.known_addition import GRAVITY, KnownAddition
from jointz.rig.sim.walking.layout import CURVE_PIECES

_TINY = 1e-4  # of differences, cycles or rad

# Winter, Biomechanics and Motor Control of Human Movement, table 4.1: shares of body mass, of
# height, of segment length.
_LEG_MASS, _LEG_LENGTH, _LEG_CENTRE, _LEG_GYRATION = 0.061, 0.246, 0.606, 0.735
_THIGH_MASS, _THIGH_LENGTH, _THIGH_GYRATION, _THIGH_CENTRE = 0.100, 0.245, 0.540, 0.433

#: Apparent inertia of the closed chain in stance, share of the leg's about the knee: from loading
#: response to push-off (0.43 to 0.17 kg*m^2 of 0.42).
_STANCE_SHARES = (1.0, 0.4)
_STANCE_CYCLES = 0.62
_CHANGE_CYCLES = 0.04  # between stance and swing
# The thigh's share of a deviation changes more slowly, as its rate is measured.
_UNLOADING_CYCLES = ((0.54, 0.68), (0.86, 1.0))
_HALF_WINDOW_PCT = 4.5
_CHANGE_S = 0.1  # to which the settings of the change of K and B belong
# The thigh over the cycle, one cosine: flexion at heel strike, extension at push-off.
_THIGH_MEAN, _THIGH_SWING, _THIGH_PEAK = radians(8.0), radians(18.0), 0.92


@dataclass(frozen=True, slots=True)
class _Segment:
    """A segment by de Leva's table 4; the radius is that about the mediolateral axis."""

    mass: float  # share of body mass
    length: float  # share of height: mean length of the segment over mean height
    centre: float  # share of the segment's length, from its proximal end
    gyration: float  # share of the segment's length, about the centre


# de Leva 1996, J Biomech 29:1223-1230, doi 10.1016/0021-9290(95)00178-6, table 4: thigh from hip
# to knee, shank from knee to ankle joint centre, foot from heel to toe. Mean heights 1.735 m
# (female) and 1.741 m (male).
_DE_LEVA = {
    "female": {
        "thigh": _Segment(0.1478, 0.3685 / 1.735, 0.3612, 0.364),
        "shank": _Segment(0.0481, 0.4386 / 1.735, 0.4352, 0.263),
        "foot": _Segment(0.0129, 0.2283 / 1.735, 0.4014, 0.279),
    },
    "male": {
        "thigh": _Segment(0.1416, 0.4222 / 1.741, 0.4095, 0.329),
        "shank": _Segment(0.0433, 0.4403 / 1.741, 0.4395, 0.246),
        "foot": _Segment(0.0137, 0.2581 / 1.741, 0.4415, 0.245),
    },
}
# Place of the ankle joint in the foot, which de Leva does not give: shares of the foot's length
# from the heel and above the line from heel to toe. Rounded; 1 cm changes the leg's inertia by 3 %.
_ANKLE_AHEAD, _ANKLE_ABOVE = 0.22, 0.15


@dataclass(frozen=True, slots=True)
class Leg:
    """Shank and foot of a person."""

    mass_kg: float  # mass of shank and foot
    centre_m: float  # distance of the centre of shank and foot from the knee
    inertia: float  # kg*m^2, of shank and foot about the knee
    thigh_inertia: float  # kg*m^2, of the thigh alone, about the hip
    thigh_length_m: float
    thigh_moment: float  # kg*m, mass of the thigh times distance of its centre from the hip
    shank_length_m: float

    @property
    def gravity_nm(self) -> float:
        """Weight times distance of shank and foot, N*m."""
        return self.mass_kg * GRAVITY * self.centre_m

    def free_inertia(self, knee: np.ndarray) -> np.ndarray:
        """Return the inertia that the knee feels when the hip is free, kg*m^2.

        Two links, torque between them: with A = thigh inertia + m L^2 and C =
        m L l cos(knee), J = (A I - C^2) / (A + I + 2 C).
        """
        above, coupling = self._above, self._coupling * np.cos(knee)
        return np.asarray(
            (above * self.inertia - coupling**2) / (above + self.inertia + 2.0 * coupling)
        )

    def free_share(self, knee: np.ndarray) -> np.ndarray:
        """Return the thigh's rotation over the knee's when the hip is free.

        Flexing the knee flexes the hip by this share: (I + C) / (A + I + 2 C), with the symbols
        of :meth:`free_inertia`.
        """
        coupling = self._coupling * np.cos(knee)
        return np.asarray((self.inertia + coupling) / self.whole_inertia(knee))

    def whole_inertia(self, knee: np.ndarray) -> np.ndarray:
        """Return the inertia of the whole leg about the hip, A + I + 2 C, kg*m^2."""
        return np.asarray(self._above + self.inertia + 2.0 * self._coupling * np.cos(knee))

    def standing_share(self, knee: np.ndarray) -> np.ndarray:
        """Return the thigh's rotation over the knee's when the foot stands.

        The trunk is so heavy that the hip moves only along its line to the ankle.
        """
        L, S = self.thigh_length_m, self.shank_length_m
        cosine = np.cos(knee)
        return np.asarray(S * (S + L * cosine) / (L**2 + S**2 + 2.0 * L * S * cosine))

    def free_gravity(self, knee: np.ndarray, thigh: np.ndarray) -> np.ndarray:
        """Return the stiffness by gravity when the thigh follows by its free share, N*m/rad."""
        share = self.free_share(knee)
        above = GRAVITY * (self.thigh_moment + self.mass_kg * self.thigh_length_m)
        below = (1.0 - share) ** 2 * self.gravity_nm * np.cos(knee - thigh)
        return np.asarray(below + share**2 * above * np.cos(thigh))

    def with_load(self, load: KnownAddition | None) -> "Leg":
        """Return the leg with a known addition fixed to the shank."""
        if load is None:
            return self
        mass = self.mass_kg + load.mass_kg
        centre = (self.mass_kg * self.centre_m + load.mass_kg * load.distance_m) / mass
        inertia = self.inertia + load.inertia
        return replace(self, mass_kg=mass, centre_m=centre, inertia=inertia)

    @property
    def _above(self) -> float:
        return self.thigh_inertia + self.mass_kg * self.thigh_length_m**2

    @property
    def _coupling(self) -> float:
        return self.mass_kg * self.thigh_length_m * self.centre_m


def leg_of(person: Person, body: BodySettings | None = None) -> Leg:
    """Return the leg of a person by the body's proportions; by Winter's without a body."""
    if body is not None and body.segments == "de_leva":
        return _leg_by_sex(person)
    length, mass = _LEG_LENGTH * person.height_m, _LEG_MASS * person.mass_kg
    thigh = _THIGH_LENGTH * person.height_m
    return Leg(
        mass_kg=mass,
        centre_m=_LEG_CENTRE * length,
        inertia=mass * (_LEG_GYRATION * length) ** 2,
        thigh_inertia=_THIGH_MASS * person.mass_kg * (_THIGH_GYRATION * thigh) ** 2,
        thigh_length_m=thigh,
        thigh_moment=_THIGH_MASS * person.mass_kg * _THIGH_CENTRE * thigh,
        shank_length_m=length,
    )


def _leg_by_sex(person: Person) -> Leg:
    """Return the leg by de Leva's table, with the foot at a right angle to the shank."""
    mass, height = person.mass_kg, person.height_m
    thigh, shank, foot = (_DE_LEVA[person.sex][name] for name in ("thigh", "shank", "foot"))
    shank_m, foot_m, thigh_m = (one.length * height for one in (shank, foot, thigh))
    shank_kg, foot_kg = shank.mass * mass, foot.mass * mass
    below = shank_m + _ANKLE_ABOVE * foot_m
    ahead = (foot.centre - _ANKLE_AHEAD) * foot_m
    inertia = shank_kg * shank_m**2 * (shank.centre**2 + shank.gyration**2)
    inertia += foot_kg * (below**2 + ahead**2 + (foot.gyration * foot_m) ** 2)
    # The centre of shank and foot is 1 to 2 cm ahead of the shank; the leg is taken as straight.
    centre = (shank_kg * shank.centre * shank_m + foot_kg * below) / (shank_kg + foot_kg)
    return Leg(
        mass_kg=shank_kg + foot_kg,
        centre_m=centre,
        inertia=inertia,
        thigh_inertia=thigh.mass * mass * thigh_m**2 * (thigh.centre**2 + thigh.gyration**2),
        thigh_length_m=thigh_m,
        thigh_moment=thigh.mass * mass * thigh.centre * thigh_m,
        shank_length_m=shank_m,
    )


def frame_gravity(mass_kg: float, distance_m: float) -> float:
    """Return weight times distance, N*m."""
    return mass_kg * GRAVITY * distance_m


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
    preset = personal_preset(person, preset)
    joint, stride_s = preset.joint, person.stride_time_s

    def curve(per_mass: Mapping[str, float], change: float | None) -> np.ndarray:
        if not joint.smooth:
            return person.mass_kg * impedance_curve(per_mass, cycles)
        slope = None if change is None else change * stride_s / _CHANGE_S
        return person.mass_kg * _smooth_curve(per_mass, cycles, slope=slope)

    stiffness = curve(person.stiffness_per_mass, joint.stiffness_change)
    damping = curve(person.damping_per_mass, joint.damping_change)
    if preset.body is None:
        inertia = np.full(cycles.shape, person.inertia)
    else:
        inertia = _leg_inertia(leg_of(person, preset.body), cycles)
    inertia = inertia * (1.0 + preset.joint.inertia_variation * np.cos(2.0 * pi * cycles))
    return stiffness, damping, inertia, _thigh_angle(cycles)


@dataclass(frozen=True, slots=True)
class ChainTerms:
    """Stiffness and rate of inertia of the chain of thigh and leg, for small deviations.

    Estimates of K contain gravity and ``stiffness``; estimates of B do not contain
    ``inertia_rate``, which belongs to d(J v)/dt.
    """

    inertia_rate: np.ndarray  # N*m*s/rad: change of the inertia, kg*m^2 per s
    stiffness: np.ndarray  # N*m/rad: by inertia, and by the thigh's part in gravity


def chain_terms(
    person: Person, preset: Preset, cycles: np.ndarray, load: KnownAddition | None = None
) -> ChainTerms:
    r"""Return the terms of the chain at the person's mean stride; zero unless the preset has them.

    In stance there is no stiffness: the inertia there is a curve over phase, not one of posture.

    Notes
    -----
    In swing the thigh turns about a fixed hip, shank and foot about the knee; the hip's moment is
    that of the unperturbed stride. Flexion of the knee is :math:`q`, of the thigh
    :math:`\varphi`; the shank is :math:`q - \varphi` behind the vertical. Shank and foot have mass
    m, centre l and inertia I about the knee; the thigh has length L, mass :math:`m_t`, centre
    :math:`l_t`, and inertia A about the hip, :math:`m L^2` included. With
    :math:`C = m L l \cos q` and the inertia of the whole leg about the hip,
    :math:`D = A + I + 2C`, the energies are

    .. math:: T = \tfrac12 D \dot\varphi^2 - (I + C)\,\dot\varphi\dot q + \tfrac12 I \dot q^2,
        \quad V = -g\,(m_t l_t + m L)\cos\varphi - g\,m l \cos(q - \varphi).

    The momentum about the hip is :math:`p = D\,(\dot\varphi - s\,\dot q)` with the thigh's share
    :math:`s = (I + C)/D`. With :math:`J = (A I - C^2)/D` and derivatives by q as index, Lagrange's
    equation of the knee is

    .. math:: J \ddot q + \tfrac12 J_q \dot q^2 - s\,\dot p + \tfrac12 (1/D)_q\,p^2 + V_q = \tau.

    A short torque on the knee does not change p, apart from gravity. For a deviation x of the knee
    from its path this gives :math:`J\ddot x + \dot J\,\dot x + (K_i + K_g)\,x = \tau` with

    .. math:: K_i = J_q\ddot q + \tfrac12 J_{qq}\dot q^2 - s_q\dot p + \tfrac12 (1/D)_{qq}\,p^2,
        \quad K_g = (1-s)^2\,m g l\cos(q-\varphi) + s^2 g\,(m_t l_t + m L)\cos\varphi.

    The thigh flexes by s x; over 100 ms this share drifts up by 15 %. In stance the trunk is so
    heavy that the hip only moves along its line to the ankle. With the shank's length S, the thigh
    turns by :math:`s = S (S + L\cos q) / (L^2 + S^2 + 2 L S \cos q)` of the knee. The inertia is
    close to that of the chain with 83 % of the body in the hip at LRE, MST and TST (0.46, 0.28 and
    0.22 kg*m^2), but not at PSW (1.5), where the other leg takes over the trunk.
    """
    cycles = np.asarray(cycles, dtype=float)
    if preset.body is None or not preset.body.chain:
        return ChainTerms(np.zeros(cycles.shape), np.zeros(cycles.shape))

    def inertia(c: np.ndarray) -> np.ndarray:
        own = impedance_over_cycle(person, preset, np.mod(c, 1.0))[2]
        return np.asarray(own + added_inertia(person, preset, load, np.mod(c, 1.0)))

    slope = _slope(inertia, cycles)
    leg = leg_of(person, preset.body).with_load(load)
    gravity = leg.free_gravity(knee_angle(cycles), _thigh_angle(cycles))
    gravity -= leg.gravity_nm * np.cos(knee_angle(cycles) - _thigh_angle(cycles))
    stiffness = _inertial_stiffness(leg, cycles, stride_s=person.stride_time_s) + gravity
    return ChainTerms(slope / person.stride_time_s, _swing(np.mod(cycles, 1.0)) * stiffness)


def added_inertia(
    person: Person, preset: Preset, load: KnownAddition | None, cycles: np.ndarray
) -> np.ndarray:
    """Return the inertia that the knee feels of a known addition, kg*m^2.

    In full without a body, whose thigh is held. Else the thigh follows as for the leg itself: in
    swing two links, in stance a shank that turns about the ankle by less than the knee does.
    """
    if load is None or preset.body is None:
        return np.full(cycles.shape, 0.0 if load is None else load.inertia)
    leg, knee, swing = leg_of(person, preset.body), knee_angle(cycles), _swing(cycles)
    free = leg.with_load(load).free_inertia(knee) - leg.free_inertia(knee)
    about_ankle = load.inertia - load.mass_kg * load.distance_m**2
    about_ankle += load.mass_kg * (leg.shank_length_m - load.distance_m) ** 2
    standing = (1.0 - leg.standing_share(knee)) ** 2 * about_ankle
    return np.asarray(swing * free + (1.0 - swing) * standing)


def added_terms(
    person: Person, preset: Preset, load: KnownAddition | None, cycles: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what a known addition gives the knee: inertia, its rate, and stiffness.

    The stiffness is that of spring, gravity and chain, for small deviations; ``cycles`` are 0 to 1.
    """
    inertia = added_inertia(person, preset, load, cycles)
    if load is None:
        return inertia, inertia, inertia  # zeros
    own, loaded = (chain_terms(person, preset, cycles, one) for one in (None, load))
    gravity = load.gravity_nm * np.cos(knee_angle(cycles) - _thigh_angle(cycles))
    stiffness = load.stiffness + gravity + loaded.stiffness - own.stiffness
    return inertia, loaded.inertia_rate - own.inertia_rate, stiffness


def _inertial_stiffness(leg: Leg, cycles: np.ndarray, *, stride_s: float) -> np.ndarray:
    """Return the stiffness that a free leg has because it moves, N*m/rad: K_i of `chain_terms`."""

    def momentum(c: np.ndarray) -> np.ndarray:
        knee = knee_angle(c)
        turning = _slope(_thigh_angle, c) - leg.free_share(knee) * _slope(knee_angle, c)
        return np.asarray(leg.whole_inertia(knee) * turning / stride_s)

    knee = knee_angle(cycles)
    rate = _slope(knee_angle, cycles) / stride_s
    bend = _slope(lambda c: _slope(knee_angle, c), cycles) / stride_s**2
    push = _slope(momentum, cycles) / stride_s
    own = _slope(leg.free_inertia, knee) * bend
    own += 0.5 * _slope(lambda q: _slope(leg.free_inertia, q), knee) * rate**2
    mobility = _slope(lambda q: _slope(lambda r: 1.0 / leg.whole_inertia(r), q), knee)
    shared = 0.5 * mobility * momentum(cycles) ** 2 - _slope(leg.free_share, knee) * push
    return np.asarray(own + shared)


def _slope(curve: Callable[[np.ndarray], np.ndarray], at: np.ndarray) -> np.ndarray:
    """Return the derivative of a smooth curve, by central differences."""
    return np.asarray((curve(at + _TINY) - curve(at - _TINY)) / (2.0 * _TINY))


def _thigh_angle(cycles: np.ndarray) -> np.ndarray:
    """Return the thigh's flexion, rad."""
    angle = _THIGH_MEAN + _THIGH_SWING * np.cos(2.0 * pi * (cycles - _THIGH_PEAK))
    return np.asarray(angle)


def thigh_share(
    person: Person, preset: Preset, cycles: np.ndarray, load: KnownAddition | None = None
) -> np.ndarray:
    """Return by how much the thigh turns back when the knee turns, 0 to 1, at phases in cycles.

    When the knee's flexion deviates from the path by x, the thigh's flexion deviates by share * x
    and the shank's angle from the vertical by (1 - share) * x, backwards. Zero for presets without
    a body.
    """
    if preset.body is None:
        return np.zeros(np.shape(cycles))
    leg, knee = leg_of(person, preset.body).with_load(load), knee_angle(np.asarray(cycles))
    swing = _unloaded(np.asarray(cycles))
    share = swing * leg.free_share(knee) + (1.0 - swing) * leg.standing_share(knee)
    return np.asarray(share)


def packed_curves(person: Person, preset: Preset, load: KnownAddition | None = None) -> np.ndarray:
    """Return stiffness, damping, inertia, thigh and moment as cubics, piece by piece of the cycle.

    The plateaus of K and B begin and end where pieces do, so that these two are
    exact; the others are cubic splines through the pieces' ends. The stiffness of the chain comes
    last, for presets that have it.
    """
    # Three inner points of every piece give its cubic, whatever the curve is between pieces.
    inner = np.array([0.0, 1.0, 2.0, 3.0]) / 3.0
    at = (np.arange(CURVE_PIECES)[:, None] + inner) / CURVE_PIECES
    K, B, J, thigh = impedance_over_cycle(person, preset, at.ravel())
    J = J + added_inertia(person, preset, load, at.ravel())
    values = [K, B, J, thigh, internal_moment(person, at.ravel())]
    if preset.body is not None and preset.body.chain:
        values.append(chain_terms(person, preset, at.ravel(), load).stiffness)
    to_powers = np.linalg.inv(np.vander(inner, increasing=True))
    return np.hstack([v.reshape(at.shape) @ to_powers.T for v in values])


def _smooth_curve(
    per_point: Mapping[str, float], cycles: np.ndarray, *, slope: float | None = None
) -> np.ndarray:
    """Interpolate values without plateaus; stays positive.

    A value of table 4.1 belongs to the window of 100 ms behind its onset: it is met in the middle.
    ``slope`` limits the median over the cycle of the relative change per cycle: the logarithms
    shrink towards their mean over the cycle, and are never stretched. The largest values of the
    table are then met too low and the smallest too high.
    """
    knots = (np.array(list(TIMING_POINTS.values())) + _HALF_WINDOW_PCT) / 100.0
    values = np.log([per_point[name] for name in TIMING_POINTS])
    spline = CubicSpline(
        np.append(knots, knots[0] + 1.0), np.append(values, values[0]), bc_type="periodic"
    )
    level = spline(knots[0] + np.mod(cycles - knots[0], 1.0))
    if slope is not None:
        whole = knots[0] + np.arange(CURVE_PIECES) / CURVE_PIECES
        share = min(1.0, slope / float(np.median(np.abs(spline(whole, 1)))))
        mean = float(spline(whole).mean())
        level = mean + share * (level - mean)
    return np.asarray(np.exp(level))


def _leg_inertia(leg: Leg, cycles: np.ndarray) -> np.ndarray:
    """Return the inertia that the knee feels: a closed chain in stance, two links in swing."""
    first, last = _STANCE_SHARES
    share = np.clip(cycles / _STANCE_CYCLES, 0.0, 1.0)
    stance = leg.inertia * (last + (first - last) * 0.5 * (1.0 + np.cos(pi * share)))
    swing = _swing(cycles)
    # Towards the next heel strike the closed chain is that of loading response again.
    stance = np.where(cycles > 0.5 * (1.0 + _STANCE_CYCLES), first * leg.inertia, stance)
    return np.asarray(swing * leg.free_inertia(knee_angle(cycles)) + (1.0 - swing) * stance)


def _swing(cycles: np.ndarray) -> np.ndarray:
    """Return how much the leg is free: 0 in stance, 1 in swing."""
    begin = _ramp((cycles - _STANCE_CYCLES) / _CHANGE_CYCLES)
    end = _ramp((cycles - (1.0 - _CHANGE_CYCLES)) / _CHANGE_CYCLES)
    return np.asarray(begin * (1.0 - end))


def _unloaded(cycles: np.ndarray) -> np.ndarray:
    """Return how much the thigh moves as that of a free leg: over pre-swing and terminal swing."""
    begin, end = (
        np.clip((cycles - first) / (last - first), 0.0, 1.0) for first, last in _UNLOADING_CYCLES
    )
    rise, fall = (u**3 * (10.0 + u * (6.0 * u - 15.0)) for u in (begin, end))
    return np.asarray(rise * (1.0 - fall))


def _ramp(share: np.ndarray) -> np.ndarray:
    u = np.clip(share, 0.0, 1.0)
    return np.asarray(u * u * (3.0 - 2.0 * u))
