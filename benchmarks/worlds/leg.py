"""Planar leg in MuJoCo, stepped from numba with its muscles, reflexes, ground and device."""

import ctypes
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numba import njit

from . import muscles as mu
from .person import GRAVITY, Person

DT = 0.0005
PELVIS_X, PELVIS_Z, HIP, KNEE, ANKLE, ARM = range(6)
# Columns of a recording
(O_KNEE, O_KNEE_V, O_ARM, O_ARM_V, O_HIP, O_HIP_V, O_ANKLE, O_ANKLE_V, O_MUSCLE, O_MOTOR, O_CUFF,
 O_ACTIVATION) = range(12)  # fmt: skip
N_OUT = O_ACTIVATION + mu.N_MUSCLES
# Columns of the table over the gait cycle (module `gait` fills it)
C_Q, C_QP, C_FF, C_GRF, C_COP, C_PAD, C_POINT, C_POINT_P, C_PELVIS, C_U, C_S, C_FLAT = (
    0, 5, 10, 15, 17, 19, 20, 22, 24, 25, 30, 35)  # fmt: skip
N_COLUMNS = 36


def _find_mj_step() -> Any:
    package = Path(mujoco.__file__).parent
    libraries = [p for p in package.iterdir() if "mujoco" in p.name and p.suffix != ".py"]
    names = [
        p for p in libraries if p.is_file() and any(s in p.name for s in (".so", ".dll", ".dylib"))
    ]
    library = ctypes.CDLL(str(next(p for p in names if "plugin" not in p.name)))
    library.mj_step.argtypes, library.mj_step.restype = [ctypes.c_void_p, ctypes.c_void_p], None
    return library.mj_step


_mj_step = _find_mj_step()


def build_model(person: Person, *, with_arm: bool = True) -> mujoco.MjModel:
    """Return the rigid bodies: pelvis on two slides, thigh, shank, foot and the device's arm."""
    thigh, shank, foot = person.thigh, person.shank, person.foot
    trunk = person.mass - thigh.mass - shank.mass - foot.mass
    mass, centre, inertia = person.device if with_arm else (1e-6, 0.1, 2e-8)

    def inertial(x: float, z: float, m: float, i: float) -> str:
        return f'<inertial pos="{x} 0 {z}" mass="{m}" diaginertia="{i} {i} {i}"/>'

    xml = f"""
<mujoco><compiler boundmass="0" balanceinertia="true"/>
<option timestep="{DT}" gravity="0 0 -{GRAVITY}" integrator="Euler">
<flag contact="disable" constraint="disable" warmstart="disable" actuation="disable"/></option>
<worldbody><body>{inertial(0, 0, trunk, 1.0)}
<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>
<body>{inertial(0, -thigh.centre, thigh.mass, thigh.inertia)}<joint axis="0 -1 0"/>
<body pos="0 0 {-thigh.length}">{inertial(0, -shank.centre, shank.mass, shank.inertia)}
<joint axis="0 1 0"/>
<body pos="0 0 {-shank.length}">{inertial(0.3 * foot.length, -0.04, foot.mass, foot.inertia)}
<joint axis="0 -1 0"/></body></body>
<body pos="0 0 {-thigh.length}">
{inertial(0, -centre, mass, max(inertia - mass * centre**2, 1e-9))}<joint axis="0 1 0"/></body>
</body></body></worldbody></mujoco>"""
    return mujoco.MjModel.from_xml_string(xml)


@njit
def foot_point(lengths, q, v, cx, cz):
    """Return position and velocity of a point of the foot and its derivatives by three angles."""
    alpha, beta, gamma = q[2], q[2] - q[3], q[2] - q[3] + q[4]
    da, db, dg = v[2], v[2] - v[3], v[2] - v[3] + v[4]
    ax, az = lengths[0] * np.cos(alpha), lengths[0] * np.sin(alpha)
    bx, bz = lengths[1] * np.cos(beta), lengths[1] * np.sin(beta)
    gx = -cx * np.sin(gamma) - cz * np.cos(gamma)
    gz = cx * np.cos(gamma) - cz * np.sin(gamma)
    # A derivative by an angle is the vector turned by 90 degrees
    x, z = q[0] + az + bz + gz, q[1] - ax - bx - gx
    vx, vz = v[0] + ax * da + bx * db + gx * dg, v[1] + az * da + bz * db + gz * dg
    return x, z, vx, vz, ax, az, bx, bz, gx, gz


@njit
def ground_forces(lengths, q, v, cx, cz, fx, fz):
    """Return the generalised forces (five coordinates) of a force on a point of the foot."""
    _, _, _, _, ax, az, bx, bz, gx, gz = foot_point(lengths, q, v, cx, cz)
    qa, qb, qg = fx * ax + fz * az, fx * bx + fz * bz, fx * gx + fz * gz
    return np.array([fx, fz, qa + qb + qg, -(qb + qg), qg])


@njit
def advance(  # noqa: C901, PLR0913
    pointers, views, body, pars, table, states, ring, late, memory, inputs, frozen, out, dec
):
    """Advance the leg by `len(phase)` steps; write every `dec`-th step to `out`.

    `body`: lengths (2), hip, ankle, pad, cuff (3), actuator (4), passive (2), inhibition,
    correction. `ring` and `late` hold spindle drives and knee errors of the past. `memory`: motor
    torque, contact, offsets of the foot (2), places in `ring` and `late`, tilt of the foot.
    """
    qpos, qvel, qfrc = views
    phases, phase_rates, noises, hip_shifts, commands = inputs
    lengths, n_rows = body[:2], len(table)
    row, afferent = np.empty(table.shape[1]), np.empty(len(pars))
    for i in range(len(phases)):
        place = (phases[i] - np.floor(phases[i])) * n_rows
        low = int(place)
        part, low = place - low, low % n_rows
        high = (low + 1) % n_rows
        for c in range(len(row)):
            row[c] = (1.0 - part) * table[low, c] + part * table[high, c]
        pace = phase_rates[i]
        q, v = qpos, qvel
        # Ground: the recorded force and an elastic sole that holds the foot where it landed
        load, cx, cz = row[C_PAD], row[C_COP], row[C_COP + 1]
        x, z, vx, vz, _, _, _, _, _, _ = foot_point(lengths, q, v, cx, cz)
        ex, ez = x - row[C_POINT], z - row[C_POINT + 1]
        if load > 0.02:
            if memory[1] == 0.0:
                memory[1], memory[2], memory[3] = 1.0, ex, ez
            fx = row[C_GRF] - load * (
                body[6] * (ex - memory[2]) + body[7] * (vx - row[C_POINT_P] * pace)
            )
            fz = row[C_GRF + 1] - load * (
                body[6] * (ez - memory[3]) + body[7] * (vz - row[C_POINT_P + 1] * pace)
            )
        else:
            memory[1], fx, fz = 0.0, row[C_GRF], row[C_GRF + 1]
        force = ground_forces(lengths, q, v, cx, cz, fx, max(fz, 0.0))
        # While heel and ball are loaded, the sole resists rotation of the foot (pads 0.1 m off)
        flat = row[C_FLAT]
        if flat > 0.01:
            tilt = q[2] - q[3] + q[4] - row[C_Q + 2] + row[C_Q + 3] - row[C_Q + 4]
            turn = v[2] - v[3] + v[4]
            turn -= (row[C_QP + 2] - row[C_QP + 3] + row[C_QP + 4]) * pace
            if memory[6] == 9.0:
                memory[6] = tilt
            twist = -0.01 * flat * (body[6] * (tilt - memory[6]) + body[7] * turn)
            force[2] += twist
            force[3] -= twist
            force[4] += twist
        else:
            memory[6] = 9.0
        # Trunk and other leg, hip and ankle: feedforward and impedance around their references
        kz = row[C_PELVIS]
        force[0] += row[C_FF] - 3000.0 * (q[0] - row[C_Q]) - 265.0 * (v[0] - row[C_QP] * pace)
        force[1] += row[C_FF + 1] - kz * (q[1] - row[C_Q + 1])
        force[1] -= 0.5 * np.sqrt(kz * 60.0) * (v[1] - row[C_QP + 1] * pace)
        force[2] += row[C_FF + 2] - (1.0 + load) * body[2] * (
            q[2] - row[C_Q + 2] - hip_shifts[i, 0]
        )
        force[2] -= body[3] * (v[2] - row[C_QP + 2] * pace - hip_shifts[i, 1])
        cycle = phases[i] - np.floor(phases[i])
        ankle_k = body[4] * (0.1 + load * (0.4 + 1.2 * cycle))
        force[4] += row[C_FF + 4] - ankle_k * (q[4] - row[C_Q + 4])
        force[4] -= body[5] * (v[4] - row[C_QP + 4] * pace)
        # Muscles with delayed spindle feedback, relative to the spindle drive of the nominal stride
        knee = mu.passive_knee(q[3], v[3], body[15], body[16])
        slot = int(memory[4])
        for m in range(len(pars)):
            gate = min(1.0, 0.2 + row[C_U + m] / 0.25)
            excess = ring[slot, m] * gate - row[C_S + m]
            afferent[m] = excess
            ring[slot, m] = mu.spindle(pars[m], states[m])
        memory[4] = (slot + 1) % len(ring)
        # A slow correction of the knee's course, again by muscles only
        slot = int(memory[5])
        aim = late[slot]
        late[slot] = q[3] - row[C_Q + 3] + 0.06 * (v[3] - row[C_QP + 3] * pace)
        memory[5] = (slot + 1) % len(late)
        aim = body[18] * (0.2 + 0.8 * load) * min(max(aim, -0.3), 0.3)
        extensor, flexor = max(afferent[0], 0.0), max(afferent[2], 0.0)
        for m in range(len(pars)):
            against = flexor if m < 2 else extensor
            drive = row[C_U + m] * (1.0 + noises[i, m]) + afferent[m] - body[17] * against
            drive += aim if m < 2 else -aim
            drive = min(max(drive, 0.01), 1.0)
            length, arm = mu.path(pars[m], q[2], q[3], q[4])
            rate = arm * v[3] + pars[m, mu.ARM_HIP] * v[2] + pars[m, mu.ARM_ANKLE] * v[4]
            fixed = frozen[i, m] if len(frozen) else -1.0
            pull = mu.step_muscle(pars[m], states[m], length, rate, drive, fixed, DT)
            knee -= arm * pull
            force[2] -= pars[m, mu.ARM_HIP] * pull
            force[4] -= pars[m, mu.ARM_ANKLE] * pull
        # Device: motor with limited bandwidth and friction, arm, soft cuff that hardens
        memory[0] += DT * 2.0 * np.pi * body[11] * (commands[i] - memory[0])
        motor = memory[0] - body[12] * np.tanh(v[5] / 0.1) - body[13] * v[5]
        slip, slip_v = q[5] - q[3], v[5] - v[3]
        harder = 1.0 + (slip / body[9]) ** 2
        cuff = body[8] * slip * harder + body[10] * np.sqrt(harder) * slip_v
        if i % dec == 0:
            o = out[i // dec]
            o[O_KNEE], o[O_KNEE_V], o[O_ARM], o[O_ARM_V] = q[3], v[3], q[5], v[5]
            o[O_HIP], o[O_HIP_V], o[O_ANKLE], o[O_ANKLE_V] = q[2], v[2], q[4], v[4]
            o[O_MUSCLE], o[O_MOTOR], o[O_CUFF] = knee, motor, cuff
            for m in range(len(pars)):
                o[O_ACTIVATION + m] = states[m, 0]
        qfrc[:5] = force
        qfrc[3] += knee + cuff
        qfrc[5] = motor - cuff - body[14] * np.tanh(v[5] / 0.1)
        _mj_step(pointers[0], pointers[1])


class Leg:
    """A person's leg with device: state, and steps of it."""

    def __init__(self, person: Person, table: np.ndarray, start: np.ndarray) -> None:
        self.person, self.table = person, table
        self.model = build_model(person)
        self.data = mujoco.MjData(self.model)
        self.body = np.array([
            person.thigh.length, person.shank.length, *person.hip, *person.ankle, *person.pad,
            *person.cuff, *person.actuator, *person.passive, person.inhibition,
            person.correction[0],
        ])  # fmt: skip
        self.states = start.copy()
        self.ring = np.zeros((round(person.reflex_delay_s / DT), mu.N_MUSCLES))
        self.late = np.zeros(round(person.correction[1] / DT))
        self.memory = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 9.0])
        pace = 1.0 / person.stride_s
        self.data.qpos[:5], self.data.qvel[:5] = table[0, :5], table[0, 5:10] * pace
        self.data.qpos[ARM], self.data.qvel[ARM] = table[0, KNEE], table[0, 5 + KNEE] * pace

    def run(self, inputs: tuple, frozen: np.ndarray | None = None, dec: int = 1) -> np.ndarray:
        """Advance by all steps of `inputs` and return every `dec`-th step."""
        out = np.empty((-(-len(inputs[0]) // dec), N_OUT))
        data = self.data
        fixed = np.empty((0, mu.N_MUSCLES)) if frozen is None else frozen
        advance(
            (self.model._address, data._address), (data.qpos, data.qvel, data.qfrc_applied),
            self.body, self.person.muscles, self.table, self.states, self.ring, self.late,
            self.memory, inputs, fixed, out, dec,
        )  # fmt: skip
        if not np.isfinite(out[-1]).all() or abs(out[-1, O_KNEE]) > 3.0:
            raise RuntimeError(f"{self.person.name}: the leg fell or broke")
        return out

    def _arrays(self) -> tuple[np.ndarray, ...]:
        data = self.data
        return data.qpos, data.qvel, self.states, self.ring, self.late, self.memory

    def save(self) -> tuple[np.ndarray, ...]:
        """Return a copy of the state."""
        return tuple(np.array(a) for a in self._arrays())

    def load(self, saved: tuple[np.ndarray, ...]) -> None:
        """Return to a saved state."""
        for target, source in zip(self._arrays(), saved, strict=True):
            target[...] = source
