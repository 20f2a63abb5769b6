"""Reference stride, muscle excitations that follow it, and the variation between strides."""

import mujoco
import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.signal import lfilter

from . import leg as lg
from . import muscles as mu
from .person import Person

ROWS = 1000
PHASE = np.arange(ROWS) / ROWS
TOE_OFF = 0.62
# Published curves: % of the cycle and degrees or shares (Winter 1991; Perry and Burnfield 2010)
_KNEE = (
    (0, 5), (5, 11), (10, 17), (14, 19), (20, 17), (30, 10), (39, 6.5), (45, 8), (50, 13),
    (55, 24), (60, 38), (65, 52), (70, 61), (73, 62), (80, 51), (85, 35), (90, 18), (95, 6.5),
)  # fmt: skip
_HIP = (
    (0, 28), (10, 25), (20, 17), (30, 7), (40, -3), (50, -11), (55, -11), (60, -6), (70, 12),
    (80, 26), (85, 30), (90, 31), (95, 30),
)  # fmt: skip
_ANKLE = (
    (0, 0), (6, -5), (15, 1), (30, 6), (45, 10), (50, 7), (55, -4), (60, -14), (64, -17),
    (70, -9), (80, 0), (90, 1),
)  # fmt: skip
_FORCE_Z = (
    (0, 0), (3, 0.35), (8, 0.9), (13, 1.1), (20, 0.97), (30, 0.76), (40, 0.9), (48, 1.08),
    (53, 0.85), (58, 0.35), (62, 0), (70, 0), (80, 0), (90, 0),
)  # fmt: skip
_FORCE_X = (
    (0, 0), (4, -0.08), (10, -0.18), (17, -0.13), (32, 0), (42, 0.12), (51, 0.2), (57, 0.1),
    (62, 0), (70, 0), (80, 0), (90, 0),
)  # fmt: skip
_EXTENSION_MOMENT = (
    (0, -0.25), (4, 0.0), (10, 0.5), (14, 0.62), (20, 0.5), (28, 0.2), (38, -0.03), (46, -0.04),
    (52, 0.04), (57, 0.15), (62, 0.1), (70, 0.1), (80, 0), (90, -0.2),
)  # fmt: skip
# Centre, width (% of the cycle) and height of bursts of the EMG (Perry; Winter and Yack 1987)
_BURSTS = {
    "vasti": ((6, 7, 0.28), (98, 5, 0.12)),
    "rectus": ((5, 6, 0.15), (60, 6, 0.14)),
    "hamstrings": ((94, 7, 0.30), (3, 6, 0.14)),
    "gastrocnemius": ((40, 9, 0.42), (25, 8, 0.15)),
    "biceps_short": ((68, 7, 0.20), (95, 5, 0.12)),
}


def _curve(points: tuple, harmonics: int = 14) -> np.ndarray:
    at, value = np.array([*points, (100, points[0][1])], dtype=float).T
    spectrum = np.fft.rfft(CubicSpline(at / 100, value, bc_type="periodic")(PHASE))
    spectrum[harmonics:] = 0
    return np.fft.irfft(spectrum, ROWS)


def _slope(values: np.ndarray, harmonics: int = 60) -> np.ndarray:
    """Return the derivative of a periodic curve by phase."""
    spectrum = np.fft.rfft(values, axis=0)
    spectrum[harmonics:] = 0
    order = 2j * np.pi * np.arange(len(spectrum))
    return np.fft.irfft(spectrum * order.reshape(-1, *[1] * (values.ndim - 1)), ROWS, axis=0)


def _smooth(values: np.ndarray, harmonics: int) -> np.ndarray:
    spectrum = np.fft.rfft(values, axis=0)
    spectrum[harmonics:] = 0
    return np.fft.irfft(spectrum, ROWS, axis=0)


def _reference(person: Person) -> np.ndarray:
    knee = _curve(_KNEE)
    knee = knee.mean() + person.knee_gain * (knee - knee.mean())
    bob = 0.018 * np.cos(4 * np.pi * (PHASE - 0.30))
    angles = np.radians(np.column_stack([_curve(_HIP), knee, _curve(_ANKLE)]))
    return np.column_stack([np.zeros(ROWS), bob, angles])


def _load() -> np.ndarray:
    """Return the vertical ground force over body weight."""
    return np.where(PHASE < TOE_OFF + 0.02, np.maximum(_curve(_FORCE_Z, 25), 0), 0)


def _inverse_dynamics(person: Person, q: np.ndarray) -> np.ndarray:
    """Return generalised forces of the reference motion without ground, arm beside the shank."""
    model = lg.build_model(person)
    data = mujoco.MjData(model)
    full = np.column_stack([q, q[:, lg.KNEE]])
    pace = 1.0 / person.stride_s
    v = _slope(full) * pace
    a = _slope(v) * pace
    forces = np.empty_like(full)
    for i in range(ROWS):
        data.qpos[:], data.qvel[:], data.qacc[:] = full[i], v[i], a[i]
        mujoco.mj_inverse(model, data)
        forces[i] = data.qfrc_inverse
    return forces


def _centre_of_pressure(person: Person, q: np.ndarray, need: np.ndarray, grf: np.ndarray):
    """Return the point of the foot where the ground force gives the published knee moment."""
    size = person.height / 1.75
    usual = np.interp(
        PHASE, [0, 0.05, 0.2, 0.5, TOE_OFF, 1], np.array([-4, -3, 5, 13, 16, -4]) / 100
    )
    cx, cz = usual * size, np.full(ROWS, -0.039 * person.height)
    trust = np.clip(grf[:, 1] / (0.5 * person.mass * 9.81), 0, 1)
    lengths, zero = np.array([person.thigh.length, person.shank.length]), np.zeros(5)
    for _ in range(8):
        for i in np.flatnonzero(trust > 0.05):
            have = lg.ground_forces(lengths, q[i], zero, cx[i], cz[i], *grf[i])[lg.KNEE]
            cx[i] -= trust[i] * (need[i] - have) / grf[i, 1]
        cx = np.clip(cx, -0.06 * size, 0.20 * size)
    return np.column_stack([_smooth(cx, 12), cz])


def _share_forces(person: Person, q: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """Return muscle forces near EMG patterns with a knee moment of `moment` (static optimum)."""
    pace = 1.0 / person.stride_s
    v = _slope(q) * pace
    capacity, arms = np.empty((ROWS, mu.N_MUSCLES)), np.empty((ROWS, mu.N_MUSCLES))
    pattern = np.full((ROWS, mu.N_MUSCLES), person.co_contraction)
    for m, par in enumerate(person.muscles):
        for centre, width, height in _BURSTS[mu.MUSCLES[m]]:
            away = (PHASE - centre / 100 + 0.5) % 1 - 0.5
            pattern[:, m] += height * np.exp(-((away * 100 / width) ** 2))
        for i in range(ROWS):
            length, arm = mu.path(par, q[i, 2], q[i, 3], q[i, 4])
            rate = arm * v[i, 3] + par[mu.ARM_HIP] * v[i, 2] + par[mu.ARM_ANKLE] * v[i, 4]
            fibre = (length - 1.02 * par[mu.L_SLACK]) / par[mu.L_OPT] / par[mu.COS_PENNATION]
            factor = mu.force_velocity(max(rate / par[mu.L_OPT] / par[mu.V_MAX], -0.8))[0]
            capacity[i, m] = par[mu.F_MAX] * mu.force_length(fibre) * max(factor, 0.1)
            arms[i, m] = -arm
    # Muscles on both sides of the knee stiffen it under load
    pattern += 2.0 * person.co_contraction * np.minimum(_load(), 1)[:, None]
    activation, strength = pattern.copy(), arms * capacity
    floor = 0.6 * pattern.min(axis=1, keepdims=True)
    for _ in range(40):
        miss = moment - (strength * activation).sum(axis=1)
        movable = np.where((activation > floor) | (strength * miss[:, None] > 0), strength, 0)
        gain = miss / np.maximum((movable**2).sum(axis=1), 1.0)
        activation = np.clip(activation + movable * gain[:, None], floor, 0.9)
    return _smooth(activation * capacity, 16)


def _invert_muscle(par: np.ndarray, length: np.ndarray, force: np.ndarray, pace: float):
    """Return excitation and states of a muscle that give a periodic force at a periodic length."""
    share = np.maximum(force / par[mu.F_MAX], 0.004)
    strains = np.linspace(0, 0.15, 3000)
    forces = np.array([mu.tendon_force(s, par[mu.TENDON_STRAIN]) for s in strains])
    tendon = par[mu.L_SLACK] * (1 + np.interp(share, forces, strains))
    fibre = _smooth((length - tendon) / par[mu.L_OPT] / par[mu.COS_PENNATION], 40)
    speed = _slope(fibre) * pace / par[mu.V_MAX]
    moved, bristle, epsilon = speed * par[mu.V_MAX], np.empty(ROWS), 0.0
    loss = np.abs(moved) / par[mu.SRS_YIELD] + 1 / mu.SRS_DETACH_S
    kept = np.exp(-loss / pace / ROWS)
    for i in [*range(ROWS), *range(ROWS)]:
        epsilon = epsilon * kept[i] + moved[i] / loss[i] * (1 - kept[i])
        bristle[i] = epsilon
    factor = np.array([mu.force_velocity(max(s, -0.9))[0] for s in speed])
    passive = np.array([mu.passive_force(x) for x in fibre])
    active = share / par[mu.COS_PENNATION] - passive - mu.FIBRE_DAMPING * speed
    capacity = mu.force_length(fibre) * np.maximum(factor + par[mu.SRS_GAIN] * bristle, 0.1)
    activation = _smooth(np.clip(active / capacity, 0.02, 0.95), 16).clip(0.015, 0.95)
    change = _slope(activation, 20) * pace
    tau = np.where(change > 0, par[mu.RISE_S], par[mu.DECAY_S])
    excitation = np.clip(activation + tau * change, 0.01, 1)
    return excitation, np.column_stack([activation, fibre, speed, bristle])


def build_table(person: Person) -> tuple[np.ndarray, np.ndarray]:
    """Return the table over the gait cycle and the muscle states at heel strike."""
    q, pace = _reference(person), 1.0 / person.stride_s
    inverse = _inverse_dynamics(person, q)
    weight = person.mass * 9.81
    load = _load()
    grf = weight * np.column_stack([np.where(load > 0, _curve(_FORCE_X, 25), 0), load])
    moment = -_curve(_EXTENSION_MOMENT) * person.mass
    knee = inverse[:, lg.KNEE] + inverse[:, lg.ARM]
    cop = _centre_of_pressure(person, q, knee - moment, grf)
    table = np.zeros((ROWS, lg.N_COLUMNS))
    table[:, lg.C_Q : lg.C_Q + 5], table[:, lg.C_QP : lg.C_QP + 5] = q, _slope(q)
    lengths, zero = np.array([person.thigh.length, person.shank.length]), np.zeros(5)
    for i in range(ROWS):
        forces = lg.ground_forces(lengths, q[i], zero, *cop[i], *grf[i])
        table[i, lg.C_FF : lg.C_FF + 5] = inverse[i, :5] - forces
        table[i, lg.C_POINT : lg.C_POINT + 2] = lg.foot_point(lengths, q[i], zero, *cop[i])[:2]
        # Velocity of the material point of the foot, not of the moving centre of pressure
        velocity = lg.foot_point(lengths, q[i], table[i, lg.C_QP : lg.C_QP + 5], *cop[i])[2:4]
        table[i, lg.C_POINT_P : lg.C_POINT_P + 2] = velocity
    moment = table[:, lg.C_FF + lg.KNEE] + inverse[:, lg.ARM]
    table[:, lg.C_FF + lg.KNEE] = 0
    table[:, lg.C_GRF : lg.C_GRF + 2], table[:, lg.C_COP : lg.C_COP + 2] = grf, cop
    table[:, lg.C_PAD] = np.sqrt(np.clip(load, 0, 1))
    table[:, lg.C_FLAT] = load * np.interp(
        PHASE, [0, 0.06, 0.12, 0.33, 0.42, 1], [0, 0, 1, 1, 0, 0]
    )
    other = np.clip(np.abs((PHASE - 0.31 + 0.5) % 1 - 0.5) / 0.19, 0, 1) ** 4
    table[:, lg.C_PELVIS] = 5000 + 15000 * other
    passive = np.array([mu.passive_knee(x, 0.0, *person.passive) for x in q[:, 3]])
    passive -= person.passive[1] * table[:, lg.C_QP + lg.KNEE] * pace
    forces = _share_forces(person, q, moment - passive)
    start = np.empty((mu.N_MUSCLES, 4))
    for m, par in enumerate(person.muscles):
        paths = np.array([mu.path(par, *x) for x in q[:, 2:5]])
        excitation, states = _invert_muscle(par, paths[:, 0], forces[:, m], pace)
        start[m], table[:, lg.C_U + m] = states[0], excitation
        drive = np.array([mu.spindle(par, s) for s in states])
        gate = np.minimum(1, 0.2 + excitation / 0.25)
        late = (PHASE - person.reflex_delay_s * pace) % 1
        table[:, lg.C_S + m] = np.interp(late, PHASE, drive, period=1) * gate
        # Hip and ankle muscles supply what the two-joint muscles do not
        table[:, lg.C_FF + lg.HIP] += par[mu.ARM_HIP] * forces[:, m]
        table[:, lg.C_FF + lg.ANKLE] += par[mu.ARM_ANKLE] * forces[:, m]
    return table, start


def _coloured(rng: np.random.Generator, n: int, times_s: tuple, step: float) -> np.ndarray:
    """Return a sum of Ornstein-Uhlenbeck processes of unit SD in total."""
    total = np.zeros(n)
    for tau in times_s:
        keep = np.exp(-step / tau)
        noise = rng.standard_normal(n) * np.sqrt(1 - keep**2)
        noise[0] = rng.standard_normal()
        total += lfilter([1], [1, -keep], noise)
    return total / np.sqrt(len(times_s))


def make_strides(person: Person, n_strides: int, rng: np.random.Generator) -> np.ndarray:
    """Return heel-strike times of strides with long-range correlation (SD 2 % of the stride)."""
    wander = _coloured(rng, n_strides, (1.0, 5.0, 30.0), 1.0)
    durations = person.stride_s * (1 + 0.018 * wander)
    return np.concatenate([[0], np.cumsum(durations)])


def make_inputs(person: Person, strikes: np.ndarray, rng: np.random.Generator) -> tuple:
    """Return phase, its rate, noise of excitations, shift of the hip, and an empty command."""
    n = int((strikes[-1] - 0.01) / lg.DT)
    time = np.arange(n) * lg.DT
    phase = PchipInterpolator(strikes, np.arange(len(strikes)))(time)
    rate = np.gradient(phase, lg.DT)
    size = person.variability
    noise = np.column_stack(
        [0.11 * size * _coloured(rng, n, (0.08, 0.6, 8.0), lg.DT) for _ in range(mu.N_MUSCLES)]
    )
    slow = np.arange(0, time[-1] + 0.1, 0.05)
    wander = np.radians(2.0) * size * _coloured(rng, len(slow), (0.7, 5.0, 40.0), 0.05)
    spline = CubicSpline(slow, lfilter([0.25] * 4, [1], wander))
    shift = np.column_stack([spline(time), spline(time, 1)])
    return phase, rate, np.maximum(noise, -0.9), shift, np.zeros(n)
