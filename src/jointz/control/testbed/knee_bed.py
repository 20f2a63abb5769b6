r"""Simulated knee of a walking person whose thigh and ground force are prescribed.

One degree of freedom, the flexion :math:`\theta` (rad). Shank and foot are one rigid body that
hangs at the angle :math:`\sigma = \psi - \theta` from the vertical (ankle in front: positive):

.. math::

    J\ddot\theta = J\ddot\psi + mc\,(\ddot x\cos\sigma + (\ddot z + g)\sin\sigma) - G - R + \tau

:math:`\psi` is the angle of the thigh, :math:`(\ddot x, \ddot z)` the acceleration of the knee
(hip and thigh), :math:`\tau` the torque of the joint. The ground force acts on a point under the
foot, and turns with the line from there to the hip. G is its moment about the knee: that of the
intact angle and :data:`LOAD_SHARE` of what the angle changes, so that a leg that bends too much
under load buckles. In stance the horizontal force, in swing the moment R close the balance of the
intact gait: along it the torque of the joint is the profile's moment. Both are functions of phase;
all else moves with the state. A stop holds the knee below its intact range.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit

from jointz.control.impedance_profile import ImpedanceProfile
from jointz.control.leg_body import GRAVITY, HEIGHT_M, LegBody, leg_body
from jointz.core.errors import DataError

_compiled = njit(cache=True, nogil=True, error_model="numpy")

#: End of stance, % of the gait cycle.
TOE_OFF_PCT: Final = 62.0
#: Physics and controller, s.
STEP_S: Final = 0.001
STEPS_PER_SAMPLE: Final = 2
#: Strides from one push to the next.
PUSH_EVERY: Final = 3
#: Nodes of the tables; a multiple of the profile's, so that its corners are nodes.
_NODES = 5000
#: Harmonics of the intact angle; higher ones are noise of the mean stride.
_HARMONICS = 12
#: Thigh: mean, amplitude (rad), phase of the largest flexion (share of the cycle): one harmonic,
#: as in Quintero et al. 2018 (doi 10.1109/TRO.2018.2794536); values of level walking, rounded.
_THIGH: Final = (math.radians(5.0), math.radians(21.0), 0.92)
#: Hip: amplitude of its motion, twice a stride, forward and up, m (assumed).
_HIP_M: Final = (0.01, 0.025)
#: Vertical force, body weights: sines of one and three half waves over stance; peaks of 1.1.
_FORCE: Final = (1.18, 0.38)
#: Point of the force under the foot, from ankle forward, shares of the foot's length (assumed).
_HEEL, _TOE = -0.25, 0.65
#: Tip of the toes, for the clearance.
TIP: Final = 0.75
#: Part of the ground force's change of moment with the angle that acts on the knee (assumed).
LOAD_SHARE: Final = 0.25
#: Stop of extension: this far below the intact range (rad); stiffness and damping, SI (assumed).
STOP_BELOW, STOP_STIFFNESS, STOP_DAMPING = math.radians(2.0), 600.0, 5.0
#: Falls: knee below and above, and above under more than half the body weight, rad.
LIMITS: Final = (math.radians(-10.0), math.radians(90.0), math.radians(60.0))


@dataclass(frozen=True, slots=True, eq=False)
class KneeBed:
    """A person's leg and intact gait; columns of ``tables`` are those of ``_COLUMNS``."""

    body: LegBody
    stride_s: float
    tables: np.ndarray  # (nodes, columns), by phase
    constants: np.ndarray  # of the compiled functions

    def column(self, name: str) -> np.ndarray:
        """Return a column of the tables."""
        return self.tables[:, _COLUMNS.index(name)]

    def toe_m(self) -> np.ndarray:
        """Return the height of the toes' tip over the hip's path in the intact motion, m."""
        thigh, shank = self.column("thigh"), self.column("thigh") - self.column("angle")
        reach = TIP * self.body.foot_m * np.sin(shank) - self.body.sole_m * np.cos(shank)
        return np.asarray(reach - self.body.thigh_m * np.cos(thigh))


# Angles in rad and accelerations per cycle, forces in N.
_COLUMNS = (
    *("thigh", "thigh_rate", "thigh_bend", "hip_forward", "hip_up"),
    *("point", "forward", "up", "line", "residual", "ground"),
    *("angle", "angle_rate", "moment"),
)
_PHYSICS = 11  # columns that the equation of motion reads


def knee_bed(
    profile: ImpedanceProfile,
    *,
    height_m: float = HEIGHT_M,
    speed: float = 1.0,
    load_share: float = LOAD_SHARE,
) -> KneeBed:
    """Return the leg of a profile's person, with the profile's stride as its intact gait.

    Parameters
    ----------
    profile : ImpedanceProfile
        A knee with positive flexion.
    height_m : float, m
        Body height.
    speed : float
        Walking speed over that of the profile. Stride time and the thigh's amplitude go with its
        root, the humps of the force with its square; the closing force and moment
        stay those of the profile's speed.
    load_share : float
        Part of the ground force's change of moment with the angle that acts on the knee: the rest
        is held by hip and other leg, or is in the measured stiffness already.

    Returns
    -------
    KneeBed
        Segments after Winter (Biomechanics and motor control of human movement, table 4.1).

    Raises
    ------
    DataError
        For another joint or positive direction, a mean stride beyond the limits of a fall, or
        settings out of range.
    """
    if not (1.0 <= height_m <= 2.5 and 0.5 <= speed <= 1.5 and 0.0 <= load_share <= 1.0):
        raise DataError(
            f"test bed: expected a height of 1 to 2.5 m, a speed of 0.5 to 1.5 and a share of the "
            f"load of 0 to 1, got {height_m:g} m, {speed:g} and {load_share:g}."
        )
    if (profile.joint, profile.positive) != ("knee", "flexion"):
        raise DataError(
            f"profile of {profile.subject}: expected a knee with positive flexion, got "
            f"{profile.joint} with positive {profile.positive}. The test bed has no other joint."
        )
    least, largest = np.degrees([profile.angle.min(), profile.angle.max()])
    if least <= np.degrees(LIMITS[0]) or largest >= np.degrees(LIMITS[1]):
        raise DataError(
            f"profile of {profile.subject}: the mean stride goes from {least:.0f} to {largest:.0f} "
            "deg; below -10 and above 90 it would count as a fall. See the zero of the goniometer."
        )
    body = leg_body(profile.mass_kg, height_m)
    stop = float(profile.angle.min()) - STOP_BELOW
    constants = np.array(
        [body.inertia, body.mass_centre, body.thigh_m, body.sole_m, load_share, stop]
    )
    tables = _closed(body, _prescribed(profile, body), constants, profile.stride_s)
    root = math.sqrt(speed)
    tables[:, 0] = _THIGH[0] + root * (tables[:, 0] - _THIGH[0])
    tables[:, 1:5] *= root
    flat = _force(_share_of_stance(), 0.0) * body.weight_n
    tables[:, 7] = flat + speed**2 * (tables[:, 7] - flat)
    return KneeBed(body, profile.stride_s / root, tables, constants)


def _share_of_stance() -> np.ndarray:
    """Return the share of stance that is over, 1 in swing."""
    return np.minimum(np.arange(_NODES) / _NODES / (0.01 * TOE_OFF_PCT), 1.0)


def _force(share: np.ndarray, humps: float = _FORCE[1]) -> np.ndarray:
    """Return the vertical force, body weights."""
    force = _FORCE[0] * np.sin(np.pi * share) + humps * np.sin(3.0 * np.pi * share)
    return np.where(share < 1.0, force, 0.0)


def _harmonics(values: np.ndarray, cycle: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a smooth periodic curve and its two derivatives per cycle."""
    found = np.fft.rfft(values)[: _HARMONICS + 1] / values.size
    order = 2j * np.pi * np.arange(found.size)
    waves = np.exp(np.outer(cycle, order)) * np.where(order == 0.0, 1.0, 2.0) * found
    return tuple((waves * order**k).sum(axis=1).real for k in range(3))


def _prescribed(profile: ImpedanceProfile, body: LegBody) -> np.ndarray:
    """Return the tables without the closing force and moment, and the intact acceleration last."""
    cycle = np.arange(_NODES) / _NODES
    mean, amplitude, peak = _THIGH
    turn = 2.0 * np.pi
    wave = amplitude * np.exp(1j * turn * (cycle - peak))
    twice = np.cos(2.0 * turn * cycle) * (2.0 * turn) ** 2
    share = _share_of_stance()
    none = np.zeros(_NODES)
    angle, rate, bend = _harmonics(profile.angle, cycle)
    columns = (
        *(mean + wave.real, -turn * wave.imag, -(turn**2) * wave.real),
        *(_HIP_M[0] * twice, _HIP_M[1] * twice),
        *(body.foot_m * (_HEEL + (_TOE - _HEEL) * share), none, body.weight_n * _force(share)),
        *(none, none, none, angle, rate, profile.at("moment", 100.0 * cycle), bend),
    )
    return np.column_stack(columns)


def _closed(body: LegBody, rows: np.ndarray, constants: np.ndarray, stride_s: float) -> np.ndarray:
    """Return the tables with what makes the intact motion a solution."""
    tables, bend = rows[:, :-1].copy(), rows[:, -1]
    shank = tables[:, 0] - tables[:, _COLUMNS.index("angle")]
    point, forward = tables[:, 5], tables[:, 6]
    away = body.thigh_m * np.sin(tables[:, 0]) + point * np.cos(shank) + body.sole_m * np.sin(shank)
    below = (
        body.thigh_m * np.cos(tables[:, 0]) - point * np.sin(shank) + body.sole_m * np.cos(shank)
    )
    tables[:, _COLUMNS.index("line")] = np.arctan2(away, below)
    up = tables[:, 7].copy()
    tables[:, 7] = 0.0
    excess = np.empty(_NODES)  # moment that is too much without ground
    for n in range(_NODES):
        pull = _pull(constants, tables[n], tables[n, 11], 1.0 / stride_s, (0.0, 0.0, 0.0))
        excess[n] = pull + tables[n, 13] - body.inertia * bend[n] / stride_s**2
    stance = up > 0.0
    lever = body.sole_m * np.cos(shank) - point * np.sin(shank)
    weight = up * (point * np.cos(shank) + body.sole_m * np.sin(shank))
    forward[stance] = ((excess - weight) / lever)[stance]
    tables[:, 7] = up
    tables[:, _COLUMNS.index("ground")] = np.where(stance, excess, 0.0)
    tables[:, _COLUMNS.index("residual")] = np.where(stance, 0.0, excess)
    return tables


@_compiled
def _pull(
    c: np.ndarray, row: np.ndarray, angle: float, rate: float, more: tuple[float, float, float]
) -> float:
    """Return all moments about the knee but the joint's, in flexion, N*m.

    ``more`` is the thigh's variability: rad, and its derivatives over time.
    """
    inertia, mass_centre, thigh_m, sole_m = c[0], c[1], c[2], c[3]
    thigh = row[0] + more[0]
    turning, bend = row[1] * rate + more[1], row[2] * rate * rate + more[2]
    sin_thigh, cos_thigh = math.sin(thigh), math.cos(thigh)
    forward = row[3] * rate * rate + thigh_m * (bend * cos_thigh - turning * turning * sin_thigh)
    up = row[4] * rate * rate + thigh_m * (bend * sin_thigh + turning * turning * cos_thigh)
    shank = thigh - angle
    s, k = math.sin(shank), math.cos(shank)
    pull = inertia * bend + mass_centre * (forward * k + (up + GRAVITY) * s) - row[9]
    if row[7] > 0.0:
        away = thigh_m * sin_thigh + row[5] * k + sole_m * s
        below = thigh_m * cos_thigh - row[5] * s + sole_m * k
        turned = math.atan2(away, below) - row[8]
        st, kt = math.sin(turned), math.cos(turned)
        f_forward, f_up = kt * row[6] - st * row[7], st * row[6] + kt * row[7]
        ground = f_forward * (sole_m * k - row[5] * s) + f_up * (row[5] * k + sole_m * s)
        pull -= row[10] + c[4] * (ground - row[10])
    return float(pull)


@_compiled
def _row(tables: np.ndarray, phase: float, out: np.ndarray) -> None:
    """Fill a row of the tables at a phase (share of the cycle)."""
    nodes = tables.shape[0]
    place = (phase - math.floor(phase)) * nodes
    n = min(int(place), nodes - 1)
    r, after = place - n, (n + 1) % nodes
    for j in range(out.size):
        out[j] = tables[n, j] + r * (tables[after, j] - tables[n, j])


#: Columns of a recording: share of the cycle since the start, rad, rad/s, N*m, m above the hip's
#: path.
RECORD: Final = ("phase", "angle", "velocity", "torque", "toe_m")


def acceleration(
    bed: KneeBed, gait_pct: float, angle: float, velocity: float, torque: float
) -> float:
    """Return the acceleration of the knee (rad/s^2) at the bed's stride time."""
    at = (0.01 * gait_pct, 1.0 / bed.stride_s, angle, velocity, torque)
    return _acceleration(bed.constants, bed.tables, np.zeros(2), np.empty(_PHYSICS), at)


@dataclass(frozen=True, slots=True, eq=False)
class Walk:
    """Strides as they go: what no controller changes."""

    rate_hz: np.ndarray  # (strides,) cycles per second
    phase_error: np.ndarray  # (strides,) of the estimate, share of the cycle
    thigh: np.ndarray  # (strides + 1,) rad, departure of the thigh at heel strikes
    delay_steps: int  # of all that the controller senses, STEP_S
    lag_s: float  # first-order lag of the torque
    limit_nm: float
    push_nm: float = 0.0  # in flexion
    push_at: float = 0.0  # cycles since the start, and every PUSH_EVERY after it
    push_s: float = 0.0


def walk_through(bed: KneeBed, nodes: np.ndarray, walk: Walk) -> tuple[np.ndarray, np.ndarray]:
    """Return samples (n, 5) of 2 ms, columns :data:`RECORD`, and the strides with a fall.

    ``nodes`` holds feedforward, stiffness, damping and equilibrium of the law, (m, 4). After a
    fall somebody holds the person, who starts anew from the intact motion at the next heel strike;
    samples in between are nan.
    """
    steps = int(np.sum(np.ceil(1.0 / walk.rate_hz / STEP_S))) + 1
    record = np.full((steps // STEPS_PER_SAMPLE + 1, len(RECORD)), np.nan)
    fallen = np.zeros(walk.rate_hz.size, dtype=np.bool_)
    kept = math.exp(-0.5 * STEP_S / walk.lag_s) if walk.lag_s > 0.0 else 0.0
    drive = np.array([kept, walk.limit_nm, walk.push_nm, walk.push_at, walk.push_s])
    limits = np.array([*LIMITS, 0.5 * bed.body.weight_n, TIP * bed.body.foot_m])
    strides = (walk.rate_hz, walk.phase_error, walk.thigh)
    n = _run((bed.constants, bed.tables, nodes), (drive, limits), strides, walk.delay_steps,
             (record, fallen))  # fmt: skip
    return record[:n], fallen


@_compiled
def _command(nodes: np.ndarray, phase: float, angle: float, velocity: float) -> float:
    """Return the torque of a law, as :class:`jointz.control.controllers.PhaseController`."""
    m = nodes.shape[0]
    place = (phase - math.floor(phase)) * m
    n = min(int(place), m - 1)
    r, after = place - n, (n + 1) % m
    f = nodes[n, 0] + r * (nodes[after, 0] - nodes[n, 0])
    k = nodes[n, 1] + r * (nodes[after, 1] - nodes[n, 1])
    b = nodes[n, 2] + r * (nodes[after, 2] - nodes[n, 2])
    e = nodes[n, 3] + r * (nodes[after, 3] - nodes[n, 3])
    return float(f + k * (e - angle) - b * velocity)


@_compiled
def _thigh_departure(ends: np.ndarray, phase: float, rate: float) -> tuple[float, float, float]:
    """Return the thigh's departure and its derivatives: quintic steps from stride to stride."""
    n = min(int(phase), ends.size - 2)
    u = min(phase - n, 1.0)
    rise = ends[n + 1] - ends[n]
    step = u * u * u * (10.0 + u * (-15.0 + 6.0 * u))
    speed = 30.0 * u * u * (1.0 + u * (-2.0 + u))
    bend = 60.0 * u * (1.0 + u * (-3.0 + 2.0 * u))
    return ends[n] + rise * step, rise * speed * rate, rise * bend * rate * rate


@_compiled
def _acceleration(
    c: np.ndarray,
    tables: np.ndarray,
    ends: np.ndarray,
    row: np.ndarray,
    at: tuple[float, float, float, float, float],
) -> float:
    """Return the acceleration; ``at`` is phase, rate, angle, velocity and torque."""
    phase, rate, angle, velocity, torque = at
    _row(tables, phase, row)
    more = _thigh_departure(ends, phase, rate)
    torque += _pull(c, row, angle, rate, more)
    if angle < c[5]:
        torque += STOP_STIFFNESS * (c[5] - angle) - STOP_DAMPING * velocity
    return float(torque / c[0])


@_compiled
def _toe(c: np.ndarray, thigh: float, angle: float, tip: float) -> float:
    shank = thigh - angle
    return float(-c[2] * math.cos(thigh) + tip * math.sin(shank) - c[3] * math.cos(shank))


@_compiled
def _restart(
    leg: tuple[np.ndarray, np.ndarray, np.ndarray],
    at: tuple[float, float, float],
    state: np.ndarray,
    sensed: np.ndarray,
) -> None:
    """Fill the intact state, and what was sensed before; ``at`` is phase, rate and its error.

    The torque is the law's.
    """
    _, tables, nodes = leg
    phase, rate, error = at
    row = np.empty(tables.shape[1])
    for back in range(sensed.shape[0] - 1, -1, -1):
        before = phase - back * STEP_S * rate
        _row(tables, before, row)
        sensed[back, 0] = before + error
        sensed[back, 1], sensed[back, 2] = row[11], row[12] * rate
    state[0], state[1] = row[11], row[12] * rate
    state[2] = _command(nodes, sensed[-1, 0], sensed[-1, 1], sensed[-1, 2])


@_compiled
def _advance(
    leg: tuple[np.ndarray, np.ndarray, np.ndarray],
    ends: np.ndarray,
    row: np.ndarray,
    state: np.ndarray,
    drive: tuple[float, float, float, float, float],
) -> None:
    """Advance angle, velocity and torque by a step (Runge and Kutta's fourth-order method).

    ``drive`` is phase, rate, command, what is left of the torque's error after half a step, push.
    """
    c, tables, _ = leg
    phase, rate, command, kept, push = drive
    angle, velocity, h = state[0], state[1], STEP_S
    begin, middle = state[2] + push, command + (state[2] - command) * kept + push
    state[2] = command + (state[2] - command) * kept * kept
    half, full = phase + 0.5 * h * rate, phase + h * rate
    a1 = _acceleration(c, tables, ends, row, (phase, rate, angle, velocity, begin))
    v2 = velocity + 0.5 * h * a1
    at = (half, rate, angle + 0.5 * h * velocity, v2, middle)
    a2 = _acceleration(c, tables, ends, row, at)
    v3 = velocity + 0.5 * h * a2
    a3 = _acceleration(c, tables, ends, row, (half, rate, angle + 0.5 * h * v2, v3, middle))
    v4 = velocity + h * a3
    at = (full, rate, angle + h * v3, v4, state[2] + push)
    a4 = _acceleration(c, tables, ends, row, at)
    state[0] = angle + h / 6.0 * (velocity + 2.0 * v2 + 2.0 * v3 + v4)
    state[1] = velocity + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)


@_compiled
def _run(
    leg: tuple[np.ndarray, np.ndarray, np.ndarray],
    settings: tuple[np.ndarray, np.ndarray],
    strides: tuple[np.ndarray, np.ndarray, np.ndarray],
    delay: int,
    out: tuple[np.ndarray, np.ndarray],
) -> int:
    """Fill the recording; return its length."""
    c, tables, nodes = leg
    drive, limits = settings
    rates, errors, ends = strides
    record, fallen = out
    row, state, sensed = np.empty(_PHYSICS), np.zeros(3), np.empty((delay + 1, 3))
    stride, part, n, step, anew, command = 0, 0.0, 0, 0, True, 0.0
    while stride < rates.size and n < record.shape[0]:
        rate, phase = rates[stride], stride + part
        if anew:
            _restart(leg, (phase, rate, errors[stride]), state, sensed)
            anew = False
        else:
            for back in range(delay, 0, -1):
                sensed[back] = sensed[back - 1]
            sensed[0, 0], sensed[0, 1], sensed[0, 2] = phase + errors[stride], state[0], state[1]
        held = fallen[stride]
        if step % STEPS_PER_SAMPLE == 0:
            command = _command(nodes, sensed[delay, 0], sensed[delay, 1], sensed[delay, 2])
            command = min(max(command, -drive[1]), drive[1])
            record[n, 0] = phase
            if not held:
                _row(tables, phase, row)
                thigh = row[0] + _thigh_departure(ends, phase, rate)[0]
                record[n, 1], record[n, 2], record[n, 3] = state[0], state[1], state[2]
                record[n, 4] = _toe(c, thigh, state[0], limits[4])
            n += 1
        if not held:
            since = (phase - drive[3]) % PUSH_EVERY / rate
            push = drive[2] if phase >= drive[3] and since < drive[4] else 0.0
            _advance(leg, ends, row, state, (phase, rate, command, drive[0], push))
            loaded = row[7] > limits[3] and state[0] > limits[2]
            if loaded or not limits[0] < state[0] < limits[1]:
                fallen[stride] = True
        part += STEP_S * rate
        step += 1
        if part >= 1.0:
            anew = fallen[stride]
            part -= 1.0
            stride += 1
    return n
