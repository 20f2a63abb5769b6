"""People whose knee answers pulses with known K, B and J, and their recordings."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
import pandas as pd
from benchmarks.worlds import gait, make, protocols, sensors
from benchmarks.worlds import leg as lg
from benchmarks.worlds.person import Person, draw_person
from numba import njit

POINTS = ("LRE", "TST", "MSW")
WINDOW_S = protocols.WINDOW_S["doublets"]
#: Mass (kg), centre (m) and inertia (kg m^2) of the arm of the device.
DEVICE = (0.9, 0.18, 0.04)
Truth = dict[str, dict[str, float]]  # timing point -> parameter -> value


@dataclass(frozen=True)
class Joint:
    """Impedance of a person's knee, and the strap."""

    inertia: float
    stiffness: np.ndarray  # over the gait cycle, with gravity
    damping: np.ndarray
    half_rad: float  # displacement at which K is half
    reflex: tuple[float, float, float]  # share of K, latency and twitch time in s
    strap: tuple[float, float]


@dataclass(frozen=True)
class Walker:
    """A person with both recordings, the pulse table and the true values."""

    person: Person
    unperturbed: pd.DataFrame
    perturbed: pd.DataFrame
    pulses: pd.DataFrame
    calibration: dict[str, tuple[float, float]]
    truth: Truth


def draw_joint(person: Person, rng: np.random.Generator) -> Joint:
    """Draw impedance that fits the body: damping ratio 0.15 to 0.35, K highest at loading."""
    shank, foot = person.shank, person.foot
    body = shank.inertia + shank.mass * shank.centre**2
    body += foot.inertia + foot.mass * (shank.length + 0.04) ** 2
    inertia = 0.65 * body * np.exp(rng.normal(0, 0.25))
    level = 1.1 * person.mass * np.exp(rng.normal(0, 0.3))
    swing = np.cos(2 * np.pi * (gait.PHASE - rng.uniform(0.05, 0.25)))
    more = np.cos(4 * np.pi * (gait.PHASE - rng.uniform(0, 0.5)))
    stiffness = level * np.exp(rng.uniform(0.35, 0.65) * swing + 0.15 * more)
    damping = 2 * rng.uniform(0.15, 0.35) * np.sqrt(stiffness * inertia)
    reflex = rng.uniform(0.03, 0.15), rng.uniform(0.035, 0.06), rng.uniform(0.03, 0.05)
    strap = 1.7 * person.cuff[0], person.cuff[2]
    return Joint(inertia, stiffness, damping, np.radians(rng.uniform(20, 45)), reflex, strap)


@njit
def respond(motor, stiffness, damping, arm_velocity, pars):
    """Return the changes of knee and arm: angle, velocity of both, torque of the sensor, softness.

    `pars`: inertias of leg and arm, strap (2), half angle, reflex (3), friction that the torque
    sensor sees (Coulomb, viscous) and does not see.
    """
    inertia, arm, strap, strap_b, half, gain, latency, twitch, coulomb, viscous, unseen = pars
    out, dt, late = np.zeros((len(motor), 6)), 0.0005, int(latency / 0.0005)
    x, v, y, w, first, second = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(len(motor)):
        soft = 1.0 / (1.0 + (abs(x) / half) ** 1.5)
        if i >= late:
            old = out[i - late]
            drive = gain * stiffness[i - late] * (0.5 * old[0] + 0.025 * old[1])
            first += dt / twitch * (drive - first)
            second += dt / twitch * (first - second)
        before, now = np.tanh(arm_velocity[i] / 0.1), np.tanh((arm_velocity[i] + w) / 0.1)
        torque = motor[i] - coulomb * (now - before) - viscous * w
        pull = strap * (y - x) + strap_b * (w - v)
        out[i] = x, v, y, w, torque, soft
        v += dt / inertia * (pull - stiffness[i] * soft * x - damping[i] * v - second)
        w += dt / arm * (torque - unseen * (now - before) - pull)
        x += dt * v
        y += dt * w
    return out


def _motor(command: np.ndarray, hz: float) -> np.ndarray:
    keep = np.exp(-2 * np.pi * hz * lg.DT)
    return gait.lfilter([1 - keep], [1, -keep], command)


def _plan(per_point: int, rng: np.random.Generator) -> list[protocols.Pulse]:
    """Return doublets of two lengths, sizes and signs, every third or fourth stride."""
    planned = protocols.plan_pulses("doublets", per_point, rng)
    chosen = [pulse for pulse in planned if pulse.timing_point in POINTS]
    first = protocols.WARM_UP_STRIDES
    strides = first + np.concatenate([[0], np.cumsum(rng.integers(3, 5, len(chosen) - 1))])
    return [replace(p, stride=int(n)) for p, n in zip(chosen, strides, strict=True)]


def _perturb(
    person: Person, joint: Joint, motion: np.ndarray, command: np.ndarray, strikes: np.ndarray
) -> np.ndarray:
    """Add the response to a command to an unperturbed motion; return changes at all steps."""
    time = np.arange(len(command)) * lg.DT
    cycle = np.interp(time, strikes, np.arange(len(strikes))) % 1
    k, b = (np.interp(cycle, gait.PHASE, c, period=1) for c in (joint.stiffness, joint.damping))
    arm_velocity = np.repeat(motion[:, lg.O_ARM_V], sensors.DEC)[: len(command)]
    bandwidth, *friction = person.actuator
    pars = (joint.inertia, person.device[2], *joint.strap, joint.half_rad, *joint.reflex, *friction)
    change = respond(_motor(command, bandwidth), k, b, arm_velocity, pars)
    columns = [lg.O_KNEE, lg.O_KNEE_V, lg.O_ARM, lg.O_ARM_V, lg.O_MOTOR]
    motion[:, columns] += change[:: sensors.DEC, :5]
    return np.column_stack([k * change[:, 5], b])


def _truth(
    joint: Joint, impedance: np.ndarray, onsets: Sequence[int], pulses: list[protocols.Pulse]
) -> Truth:
    """Return means over pulses and window: secant stiffness, damping; inertia of the leg."""
    n, truth = round(WINDOW_S / lg.DT), {}
    for name in POINTS:
        own = [i for i, p in zip(onsets, pulses, strict=True) if p.timing_point == name]
        k, b = np.mean([impedance[i : i + n].mean(axis=0) for i in own], axis=0)
        truth[name] = {"stiffness": float(k), "damping": float(b), "inertia": joint.inertia}
    return truth


@lru_cache(maxsize=64)
def walk(
    seed: int, number: int, per_point: int = 40, stride: float = 1.0, excursion: float = 1.0,
    minutes: float = 3.0, skin_hz: float | None = None,
) -> Walker:  # fmt: skip
    """Simulate a person; equal arguments give the same one.

    `stride` and `excursion` multiply the duration of strides and the motion of the knee;
    `skin_hz` is the resonance of the skin beneath the goniometer.
    """
    person = replace(draw_person(seed, number), device=DEVICE)
    if skin_hz:
        person = replace(person, sensors=person.sensors | {"angle_mount_hz": skin_hz})
    person = replace(
        person, stride_s=stride * person.stride_s, knee_gain=excursion * person.knee_gain
    )
    joint = draw_joint(person, np.random.default_rng([seed, number, 7]))
    rng = np.random.default_rng([seed, number, 8])

    def motion_of(strides: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        strikes = gait.make_strides(person, strides, rng)
        motion, command, _, _ = make._walk(person, strikes, rng, [], 0.0)
        return motion, command, strikes

    motion, command, strikes = motion_of(int(minutes * 60 / person.stride_s))
    unperturbed = sensors.record(person, motion, command, strikes, rng)
    pulses = _plan(per_point, rng)
    motion, command, strikes = motion_of(pulses[-1].stride + 6)
    onsets = [protocols.onset_step(p, strikes) // 4 * 4 for p in pulses]
    for pulse, i in zip(pulses, onsets, strict=True):
        samples = pulse.samples()
        command[i : i + len(samples)] = samples
    impedance = _perturb(person, joint, motion, command, strikes)
    perturbed = sensors.record(person, motion, command, strikes, rng)
    rows: list[dict[str, Any]] = [
        {
            "onset_s": round(i * lg.DT, 4),
            "duration_s": round(p.duration_s, 4),
            "amplitude_nm": p.amplitude,
            "timing_point": p.timing_point,
        }
        for p, i in zip(pulses, onsets, strict=True)
    ]
    calibration = sensors.calibration(person, rng)
    truth = _truth(joint, impedance, onsets, pulses)
    return Walker(person, unperturbed, perturbed, pd.DataFrame(rows), calibration, truth)
