"""True impedance of the knee at each pulse, from runs of the same leg with frozen activation."""

import mujoco
import numpy as np

from . import gait
from . import leg as lg
from . import muscles as mu
from .protocols import Pulse

SMALL_RAD, RAMP_S, ONSET_S, LATER_S = np.radians(0.2), 0.010, 0.020, 0.060
DEFINITIONS = {
    "stiffness, damping": (
        "K and B of the least squares fit dT = -K x - B v over the window from the commanded "
        "onset (0.10 s for the hold, 0.15 s for doublets). dT is the flexing knee torque of "
        "muscles, tendons, short-range stiffness and passive tissue with the pulse minus that "
        "without; x and v are the differences of knee angle and velocity of the same two runs. "
        "Both runs start from the same state and have the time course of activation of the run "
        "without pulse (no reflex). No inertia, gravity or ground. Fitted per pulse, mean over "
        "all pulses."
    ),
    "stiffness_with_reflex, damping_with_reflex": (
        "the same with the activation that reflexes give."
    ),
    "stiffness_onset, damping_onset": (
        "the same fit over 20 ms from the onset for an imposed knee displacement of 0.2 deg "
        "(ramp of 10 ms, then held; mean of both directions), hip and ankle as without pulse."
    ),
    "gravity_stiffness": (
        "-d(gravity torque about the knee of shank and foot)/d(knee angle), thigh held, at the "
        "onset."
    ),
    "inertial_stiffness": (
        "d(inertial torque about the knee of shank and foot at the velocities and accelerations "
        "of the stride)/d(knee angle) at the onset, thigh motion held: the motion of the thigh "
        "acts like gravity."
    ),
    "stiffness_with_gravity": "stiffness + gravity_stiffness.",
    "device_gravity_stiffness": "the same for the device's arm.",
    "chain_stiffness, chain_damping, chain_inertia": (
        "least squares fit of cuff torque + dT = J a + B v + K x over the window (frozen "
        "activation): all that is neither muscle nor device, that is inertia, gravity, ground "
        "and the impedance of hip, ankle and trunk, seen from the knee. gravity_stiffness and "
        "inertial_stiffness are parts of chain_stiffness. In stance the chain resonates and is "
        "no second-order system: see chain_fit_vaf."
    ),
    "apparent_stiffness, apparent_damping, apparent_inertia": (
        "the same fit of the cuff torque alone: muscles and chain together, as a second-order "
        "model would describe the leg (without noise, sensors, cuff, device and reflexes)."
    ),
    "fit_vaf, chain_fit_vaf, apparent_fit_vaf": (
        "share of dT, of cuff torque + dT, of cuff torque that the fits explain, %."
    ),
    "inertia": (
        "torque over acceleration at the knee for a brief torque between thigh and shank, all "
        "joints and the pelvis free to move, the loaded point of the foot held by the ground in "
        "stance; without the device's arm; at the onset. inertia_60ms: 60 ms later."
    ),
    "inertia_foot_free": (
        "the same with the foot free, as in the first 2 ms, before the sole is compressed."
    ),
    "inertia_thigh_held": (
        "inertia of shank and foot about the knee with the thigh held and the ankle held."
    ),
    "device_inertia": "inertia of the device's arm about the knee.",
    "displacement_deg": (
        "largest absolute knee displacement within 0.3 s of the onset, with reflexes."
    ),
    "*_sd": "SD over pulses.",
}


def _fit(target: np.ndarray, *columns: np.ndarray) -> np.ndarray:
    matrix = np.column_stack(columns)
    scale = np.sqrt((matrix**2).mean(axis=0))
    return np.linalg.lstsq(matrix / scale, target, rcond=None)[0] / scale


def _vaf(target: np.ndarray, fitted: np.ndarray) -> float:
    return 100 * (1 - ((target - fitted) ** 2).sum() / (target**2).sum())


def _onset_fit(leg: lg.Leg, quiet: np.ndarray) -> np.ndarray:
    n, ramp = round(ONSET_S / lg.DT), round(RAMP_S / lg.DT)
    shape = np.minimum(np.arange(n) / ramp, 1.0)
    joints = quiet[:n, [lg.O_HIP, lg.O_KNEE, lg.O_ANKLE]].copy()
    rates = quiet[:n, [lg.O_HIP_V, lg.O_KNEE_V, lg.O_ANKLE_V]].copy()
    activation = np.ascontiguousarray(quiet[:n, lg.O_ACTIVATION :])
    person, torques = leg.person, {}
    for sign in (0.0, 1.0, -1.0):
        x, v = joints.copy(), rates.copy()
        x[:, 1] += sign * SMALL_RAD * shape
        v[:ramp, 1] += sign * SMALL_RAD / RAMP_S
        states = leg.states.copy()
        torques[sign] = mu.torque_along(
            person.muscles, states, x, v, activation, person.passive, lg.DT
        )
    moving = np.where(np.arange(n) < ramp, SMALL_RAD / RAMP_S, 0.0)
    change = 0.5 * (torques[1.0] - torques[-1.0])
    return -_fit(change, SMALL_RAD * shape, moving)


def _mass_matrix(leg: lg.Leg, q: np.ndarray) -> np.ndarray:
    data = mujoco.MjData(leg.model)
    data.qpos[:] = q
    mujoco.mj_forward(leg.model, data)
    # By M times unit accelerations: independent of the storage of the sparse matrix
    matrix = np.empty((6, 6))
    for k in range(6):
        column = np.zeros(6)
        mujoco.mj_mulM(leg.model, data, column, np.eye(6)[k])
        matrix[:, k] = column
    return matrix


def inertias(leg: lg.Leg, q: np.ndarray, phase: float) -> tuple[float, float, float]:
    """Return knee inertia with the foot on the ground (if loaded), foot free, and thigh held."""
    matrix = _mass_matrix(leg, q)
    mobility = np.linalg.inv(matrix)
    row = leg.table[int(phase % 1 * gait.ROWS)]
    held = mobility
    if row[lg.C_PAD] > np.sqrt(0.05):
        lengths, zero = leg.body[:2], np.zeros(5)
        forces = [
            lg.ground_forces(lengths, q[:5], zero, *row[lg.C_COP : lg.C_COP + 2], fx, 1.0 - fx)
            for fx in (1.0, 0.0)
        ]
        contact = np.column_stack([np.array(forces), np.zeros(2)])
        cross = mobility @ contact.T
        held = mobility - cross @ np.linalg.solve(contact @ cross, cross.T)
    return 1 / held[3, 3], 1 / mobility[3, 3], matrix[3, 3]


def _body_stiffness(leg: lg.Leg, state: tuple[np.ndarray, ...]) -> dict[str, float]:
    """Return derivatives of gravity's and the inertial torque by the knee angle, restoring > 0."""
    data, step = mujoco.MjData(leg.model), 1e-4

    def slope(joint: int, v: np.ndarray, a: np.ndarray) -> float:
        torques = []
        for sign in (1, -1):
            data.qpos[:], data.qvel[:], data.qacc[:] = state[0], v, a
            data.qpos[joint] += sign * step
            mujoco.mj_inverse(leg.model, data)
            torques.append(data.qfrc_inverse[joint])
        return (torques[0] - torques[1]) / (2 * step)

    rest = np.zeros(6)
    gravity = slope(lg.KNEE, rest, rest)
    return {
        "gravity_stiffness": gravity,
        "inertial_stiffness": slope(lg.KNEE, state[1], state[2]) - gravity,
        "device_gravity_stiffness": slope(lg.ARM, rest, rest),
    }


def _slices(inputs: tuple, i: int, n: int, command: np.ndarray | None) -> tuple:
    phase, rate, noise, shift, _ = (a[i : i + n] for a in inputs)
    torque = np.zeros(n)
    if command is not None:
        torque[: min(len(command), n)] = command[:n]
    return phase, rate, noise, shift, torque


def pulse_truth(leg: lg.Leg, inputs: tuple, i: int, pulse: Pulse, window_s: float) -> dict:
    """Return the true values at one pulse; the state of the leg is that of its onset, unchanged."""
    saved, n, n_long = leg.save(), round(window_s / lg.DT), round(0.3 / lg.DT)
    command = pulse.samples()

    def run(torque: np.ndarray | None, steps: int, frozen: np.ndarray | None = None) -> np.ndarray:
        leg.load(saved)
        return leg.run(_slices(inputs, i, steps, torque), frozen)

    free = run(None, n_long)
    reflex = run(command, n_long)
    activation = np.ascontiguousarray(free[:n, lg.O_ACTIVATION :])
    quiet, moved = run(None, n, activation), run(command, n, activation)
    run(None, 1, activation[:1])
    acceleration = leg.data.qacc.copy()
    leg.load(saved)
    values = {}
    for end, a, b in (("", quiet, moved), ("_with_reflex", free[:n], reflex[:n])):
        change = b - a
        fit = _fit(-change[:, lg.O_MUSCLE], change[:, lg.O_KNEE], change[:, lg.O_KNEE_V])
        values |= {f"stiffness{end}": fit[0], f"damping{end}": fit[1]}
    change = moved - quiet
    x, v = change[:, lg.O_KNEE], change[:, lg.O_KNEE_V]
    rest = change[:, lg.O_CUFF] + change[:, lg.O_MUSCLE]
    motion = np.column_stack([x, v, np.gradient(v, lg.DT)])
    chain, apparent = _fit(rest, *motion.T), _fit(change[:, lg.O_CUFF], *motion.T)
    onset = _onset_fit(leg, quiet)
    q = leg.data.qpos.copy()
    later = q.copy()
    ahead = quiet[round(LATER_S / lg.DT)]
    later[2:] = ahead[[lg.O_HIP, lg.O_KNEE, lg.O_ANKLE, lg.O_ARM]]
    held, foot_free, thigh_held = inertias(leg, q, inputs[0][i])
    bodies = _body_stiffness(leg, (q, leg.data.qvel.copy(), acceleration))
    displacement = np.degrees(np.abs((reflex - free)[:, lg.O_KNEE]).max())
    return (
        values
        | bodies
        | {
            "stiffness_onset": onset[0],
            "damping_onset": onset[1],
            "stiffness_with_gravity": values["stiffness"] + bodies["gravity_stiffness"],
            "chain_stiffness": chain[0],
            "chain_damping": chain[1],
            "chain_inertia": chain[2],
            "fit_vaf": _vaf(
                -change[:, lg.O_MUSCLE], values["stiffness"] * x + values["damping"] * v
            ),
            "apparent_stiffness": apparent[0],
            "apparent_damping": apparent[1],
            "apparent_inertia": apparent[2],
            "apparent_fit_vaf": _vaf(change[:, lg.O_CUFF], motion @ apparent),
            "chain_fit_vaf": _vaf(rest, motion @ chain),
            "inertia": held,
            "inertia_60ms": inertias(leg, later, inputs[0][i + round(LATER_S / lg.DT)])[0],
            "inertia_foot_free": foot_free,
            "inertia_thigh_held": thigh_held,
            "device_inertia": leg.person.device[2],
            "displacement_deg": displacement,
        }
    )


def average(values: list[dict]) -> dict:
    """Return means over pulses, and SDs of the muscles' values."""
    mean = {key: float(np.mean([v[key] for v in values])) for key in values[0]}
    for key in ("stiffness", "damping", "inertia", "displacement_deg"):
        mean[f"{key}_sd"] = float(np.std([v[key] for v in values]))
    return mean | {"pulses": len(values)}
