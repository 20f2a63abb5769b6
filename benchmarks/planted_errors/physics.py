"""A joint with impedance, pushed by a motor: walking, on a bench, and under random torque.

Everything is stepped at 2 kHz and recorded at a fraction of that. SI throughout.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.signal import butter, lfilter, sosfilt

Array = NDArray[np.float64]
Truth = dict[str, dict[str, float]]  # timing point, or "*" for any: quantity: value
STEP_HZ = 2000
CLIP = 0.6  # of the largest command
POINTS = {"LRE": 7.0, "MST": 21.5, "TST": 40.5, "PSW": 56.0, "ISW": 68.5, "MSW": 81.0}
# Knee flexion (deg) over a stride, read off textbook curves.
_KNEE = CubicSpline(
    [0.0, 0.13, 0.4, 0.5, 0.6, 0.72, 0.85, 0.95, 1.0],
    np.radians([6.0, 19.0, 6.0, 10.0, 34.0, 62.0, 34.0, 5.0, 6.0]),
    bc_type="periodic",
)


@dataclass
class Recording:
    """What one file holds, and the pulses that were planned in it."""

    rate: int
    angle: Array
    torque: Array
    command: Array
    contact: Array | None = None
    pulses: list[dict[str, Any]] = field(default_factory=list)


def respond(torque: Array, k: Array, b: Array, j: float) -> Array:
    """Return the angle of J*a + B(t)*v + K(t)*x = torque, by the trapezoidal rule."""
    h = 1.0 / STEP_HZ
    x = v = a = 0.0
    out = np.empty(torque.size)
    steps = zip(torque.tolist(), k.tolist(), b.tolist(), strict=True)
    for n, (tau, stiffness, damping) in enumerate(steps):
        ahead_v, ahead_x = v + h / 2 * a, x + h * v + h * h / 4 * a
        a = (tau - damping * ahead_v - stiffness * ahead_x) / (
            j + h / 2 * damping + h * h / 4 * stiffness
        )
        v, x = ahead_v + h / 2 * a, ahead_x + h * h / 4 * a
        out[n] = x
    return out


def actuate(command: Array, tau_s: float) -> Array:
    """First-order torque loop, exact for commands that are held between steps."""
    keep = np.exp(-1.0 / STEP_HZ / tau_s)
    return lfilter([1.0 - keep], [1.0, -keep], command)


def slow_noise(rng: np.random.Generator, n: int, hz: float, sd: float, order: int = 2) -> Array:
    """Noise below a frequency."""
    noise = sosfilt(butter(order, hz, fs=STEP_HZ, output="sos"), rng.normal(size=n + 4 * STEP_HZ))
    noise = noise[4 * STEP_HZ :]  # the filter has settled
    return sd * noise / noise.std()


def rectangles(n: int, pulses: list[dict[str, Any]]) -> Array:
    """Commanded torque: each pulse held, 0 between."""
    command = np.zeros(n)
    for pulse in pulses:
        first = round(pulse["onset_s"] * STEP_HZ)
        command[first : first + round(pulse["duration_s"] * STEP_HZ)] = pulse["amplitude_nm"]
    return command


def motor(command: Array, p: dict[str, Any]) -> tuple[Array, Array]:
    """Return torque that reaches the joint, and torque that the motor believes it makes."""
    believed = actuate(command, p["motor_s"])
    if p["fault"] != "clip_applied":
        return believed, believed
    limit = CLIP * np.abs(command).max()
    return actuate(np.clip(command, -limit, limit), p["motor_s"]), believed


def _recorded(
    rng: np.random.Generator, p: dict[str, Any], angle: Array, torque: Array, command: Array
) -> Recording:
    """Sample, delay the angle and add the sensors' noise."""
    every, late = STEP_HZ // p["rate"], round(p["angle_lag_s"] * STEP_HZ)
    angle = np.concatenate([np.full(late, angle[0]), angle[: angle.size - late]])[::every]
    return Recording(
        p["rate"],
        angle + rng.normal(scale=p["angle_noise"], size=angle.size),
        torque[::every] + rng.normal(scale=p["torque_noise"], size=angle.size),
        command[::every],
    )


def _amplitudes(rng: np.random.Generator, p: dict[str, Any], n: int) -> Array:
    """Sizes and signs of pulses, each combination equally often, in random order."""
    kinds = [s * size * p["amplitude"] for size in p["sizes"] for s in p["signs"]]
    return rng.permutation(np.resize(kinds, n))


def bench(rng: np.random.Generator, p: dict[str, Any]) -> tuple[Recording, Truth]:
    """Pulses on a joint or load at rest."""
    n = round((p["pulses"] * p["every_s"] + 2.0) * STEP_HZ)
    late = rng.uniform(0.0, p["jitter_s"], p["pulses"])  # people must not foresee a pulse
    onsets = np.round((1.0 + p["every_s"] * np.arange(p["pulses"]) + late) * 500) / 500
    pulses = [
        {"onset_s": o, "duration_s": p["hold_s"], "amplitude_nm": a, "timing_point": "rest"}
        for o, a in zip(onsets, _amplitudes(rng, p, p["pulses"]), strict=True)
    ]
    command = rectangles(n, pulses)
    applied, believed = motor(command, p)
    own = slow_noise(rng, n, 2.0, p["muscle_nm"]) if p["muscle_nm"] else 0.0
    angle = p["posture"] + respond(applied + own, np.full(n, p["k"]), np.full(n, p["b"]), p["j"])
    recording = _recorded(rng, p, angle, believed, command)
    recording.pulses = pulses
    return recording, {"*": {"stiffness": p["k"], "damping": p["b"], "inertia": p["j"]}}


def held_joint(rng: np.random.Generator, p: dict[str, Any]) -> tuple[Recording, Truth]:
    """Random torque onto a held joint, or a random angle that a servo imposes."""
    n = round(p["seconds"] * STEP_HZ)
    own = slow_noise(rng, n, 2.0, p["muscle_nm"])
    if p["input"] == "torque":
        command = slow_noise(rng, n, p["band_hz"], p["amplitude"])
        applied, believed = motor(command, p)
        angle = respond(applied + own, np.full(n, p["k"]), np.full(n, p["b"]), p["j"])
    else:
        angle = slow_noise(rng, n, p["band_hz"], 0.03, order=4)
        speed = np.gradient(angle, 1.0 / STEP_HZ)
        believed = p["k"] * angle + p["b"] * speed + p["j"] * np.gradient(speed, 1.0 / STEP_HZ)
        believed, command = believed - own, np.zeros(n)
    recording = _recorded(rng, p, p["posture"] + angle, believed, command)
    return recording, {"*": {"stiffness": p["k"], "damping": p["b"], "inertia": p["j"]}}


def _wander(rng: np.random.Generator, strikes: Array) -> CubicSpline:
    """A number of sd 1 that differs from stride to stride, smooth in time."""
    values = lfilter([np.sqrt(1 - 0.5**2)], [1.0, -0.5], rng.normal(size=strikes.size))
    return CubicSpline(strikes, values)


def _gait(rng: np.random.Generator, p: dict[str, Any], strides: int) -> tuple[Array, Array, Array]:
    """Return heel strikes, phase (strides) and unperturbed knee angle."""
    lengths = p["stride_s"] * (1 + 0.02 * rng.normal(size=strides + 2))
    strikes = np.concatenate([[-0.4 * p["stride_s"]], np.cumsum(lengths)])
    strikes[1:] += strikes[0]
    time = np.arange(round(strikes[-2] * STEP_HZ)) / STEP_HZ
    phase = PchipInterpolator(strikes, np.arange(strikes.size))(time)
    wander = [_wander(rng, strikes)(time) for _ in range(4)]
    turn = 2 * np.pi * phase
    mean = _KNEE(phase % 1.0)
    own = 0.03 * wander[0] * mean + 0.015 * wander[1] + slow_noise(rng, time.size, 3.0, 0.004)
    own = own + 0.012 * (wander[2] * np.sin(turn) + wander[3] * np.cos(2 * turn))
    return strikes[1:-2], phase, mean + p["sway"] * own


def _plan(rng: np.random.Generator, p: dict[str, Any]) -> list[tuple[int, str]]:
    """Strides and timing points of the pulses: every round holds each timing point once."""
    order = [name for _ in range(p["pulses"]) for name in rng.permutation(p["points"])]
    strides = 9 + np.cumsum(rng.integers(4, 7, size=len(order)))
    return list(zip(strides.tolist(), map(str, order), strict=True))


def _curves(p: dict[str, Any], phase: Array) -> tuple[Array, Array]:
    """K and B over the stride."""
    swing = np.cos(2 * np.pi * (phase - p["stiffest"]))
    return p["k"] * (1 + 0.3 * swing), p["b"] * (1 + 0.15 * swing)


def walk(
    rng: np.random.Generator, p: dict[str, Any], *, perturbed: bool
) -> tuple[Recording, Truth]:
    """One recording of a person who walks."""
    plan = _plan(rng, p) if perturbed else []
    strikes, phase, angle = _gait(rng, p, plan[-1][0] + 6 if plan else 60)
    amplitudes = _amplitudes(rng, p, len(plan))
    pulses = []
    for (stride, name), amplitude in zip(plan, amplitudes, strict=True):
        recent = (strikes[stride] - strikes[stride - 3]) / 3  # a device cannot know this stride's
        onset = strikes[stride] + POINTS[name] / 100 * recent
        onset = round(onset * p["rate"]) / p["rate"]
        pulse = {"onset_s": onset, "duration_s": p["hold_s"], "amplitude_nm": amplitude}
        pulses.append(pulse | {"timing_point": name})
    command = rectangles(phase.size, pulses)
    applied, believed = motor(command, p)
    k, b = _curves(p, phase)
    interaction = 0.3 * np.sin(2 * np.pi * phase + 1.0)  # the device is not quite transparent
    recording = _recorded(
        rng, p, angle + respond(applied, k, b, p["j"]), believed + interaction, command
    )
    recording.contact = (phase % 1.0 < 0.62).astype(float)[:: STEP_HZ // p["rate"]]
    recording.pulses = pulses
    return recording, _walking_truth(p, pulses, k, b)


def _walking_truth(p: dict[str, Any], pulses: list[dict[str, Any]], k: Array, b: Array) -> Truth:
    """Means over the first 100 ms of the pulses at each timing point."""
    truth: Truth = {"*": {"inertia": p["j"]}}
    for name in {pulse["timing_point"] for pulse in pulses}:
        starts = [round(q["onset_s"] * STEP_HZ) for q in pulses if q["timing_point"] == name]
        at = np.concatenate([np.arange(s, s + STEP_HZ // 10) for s in starts])
        truth[name] = {"stiffness": float(k[at].mean()), "damping": float(b[at].mean())}
        truth[name]["stiffness_per_mass"] = truth[name]["stiffness"] / p["mass"]
        truth[name]["damping_per_mass"] = truth[name]["damping"] / p["mass"]
        truth[name]["inertia"] = p["j"]
    return truth
