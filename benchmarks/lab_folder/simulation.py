"""Simulated people walking with torque pulses at a joint that is linear at each timing point."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.signal import cont2discrete, lfilter

Array = NDArray[np.float64]
TORQUE_CONSTANT = 4.2  # N*m/A at the joint
PARAMETERS = ("stiffness", "damping", "inertia")
POINTS = {"early_stance": 21.5, "push_off": 56.0, "swing": 81.0}  # % of the cycle
PULSE_NM, PULSE_S = 10.0, 0.1
RATE_HZ = 4000  # of the simulation; the instruments sample from it
LAG_S, LAG_SD_S = 0.0045, 0.001  # of the angle: what the lab measured, and how well
# Flexion of the knee: mean and (cosine, sine) of the first harmonics of the cycle, degrees
MEAN_DEG = 24.0
HARMONICS = ((-3.2, -19.3), (-14.4, 7.1), (-0.5, 4.2), (-0.4, 0.2), (-0.5, 0.4))

Truth = dict[str, dict[str, float]]  # timing point: parameter: value


@dataclass(frozen=True)
class Trial:
    """Recordings of one trial, in the signs and units of the lab (extension positive)."""

    angle_deg: Callable[[Array], Array]  # measured angle without noise, at times of the DAQ's clock
    angle_noise_deg: float
    end_s: float  # the angle is known up to here
    daq_s: Array
    current_a: Array
    trigger_v: Array
    strikes_s: Array
    angle_rate_error: float = 0.0  # the stamps of the angle run faster by this share
    angle_offset_s: float = 0.0  # and are late by this

    def sample_angle(self, rate_hz: float, rng: np.random.Generator) -> tuple[Array, Array]:
        """Return stamps (s) and noisy samples (deg) of the angle."""
        stamps = np.arange(0, self.end_s - 0.1, 1 / rate_hz)
        times = np.clip((stamps - self.angle_offset_s) / (1 + self.angle_rate_error), 0, self.end_s)
        noise = self.angle_noise_deg * rng.standard_normal(stamps.size)
        return stamps, self.angle_deg(times) + noise


@dataclass(frozen=True)
class Person:
    """A participant: mass, truth of each timing point, and a trial of each condition."""

    id: str
    mass_kg: float
    truth: Truth
    lag_s: float = LAG_S
    trials: dict[str, Trial] = field(default_factory=dict)


def find_edges(times: Array, volts: Array, threshold: float = 2.5) -> tuple[Array, Array]:
    """Return times of the rising edges of a clean trigger, and the durations of its pulses."""
    high = np.r_[False, volts > threshold, False].astype(int)
    up, down = np.flatnonzero(np.diff(high) == 1), np.flatnonzero(np.diff(high) == -1)
    return times[up], (down - up) * (times[1] - times[0])


def draw_people(seed: int, count: int = 2, pulses_a_point: int = 24) -> list[Person]:
    """Return people with an unperturbed and a perturbed trial each."""
    rng = np.random.default_rng([seed, 2026])
    people = []
    for number in range(count):
        stiffness, damping = rng.uniform(45, 95), rng.uniform(1.4, 2.8)
        inertia = rng.uniform(0.12, 0.24)
        truth = {}
        for point, share in zip(POINTS, (1.25, 0.9, 0.65), strict=True):
            share *= rng.uniform(0.9, 1.1)
            values = (stiffness * share, damping * share**0.5, inertia)
            truth[point] = dict(zip(PARAMETERS, values, strict=True))
        lag = LAG_S + LAG_SD_S * rng.standard_normal()
        person = Person(f"S{seed:02d}{'AB'[number]}", round(rng.uniform(55, 92), 1), truth, lag)
        person.trials["unperturbed"] = walk(rng, person, 0)
        person.trials["perturbed"] = walk(rng, person, pulses_a_point)
        people.append(person)
    return people


def walk(rng: np.random.Generator, person: Person, pulses_a_point: int) -> Trial:
    """Simulate one trial; without pulses it has 60 strides."""
    plan = [(p, s) for p in POINTS for s in (1, -1) for _ in range(pulses_a_point // 2)]
    plan = [plan[k] for k in rng.permutation(len(plan))]
    gaps = rng.choice([3, 3, 4], len(plan))  # at most 255 strides: more C3D events there cannot be
    strides = 7 + int(gaps.sum()) + 3 if plan else 60
    period = rng.uniform(1.0, 1.12) + 0.02 * rng.standard_normal(strides)
    strikes = 0.7 + np.r_[0, np.cumsum(period)]
    t = np.arange(0, strikes[-1] + 1, 1 / RATE_HZ)
    flexion = _gait(rng, t, strikes)
    moved, motor, trigger = np.zeros((3, t.size))
    commands = {point: np.zeros_like(t) for point in POINTS}
    for (point, sign), stride in zip(plan, 7 + np.r_[0, np.cumsum(gaps[:-1])], strict=False):
        recent = np.diff(strikes[stride - 3 : stride + 1]).mean()
        onset = strikes[stride] + (POINTS[point] / 100 + 0.006 * rng.standard_normal()) * recent
        on = slice(*np.ceil(np.array([onset, onset + PULSE_S]) * RATE_HZ).astype(int))
        commands[point][on], trigger[on] = sign * PULSE_NM, 5.0
    for point, command in commands.items():
        torque = _respond([2.5e-5, 0.0095, 1.0], command)  # the motor's current control
        joint = person.truth[point]
        moved += _respond([joint[name] for name in reversed(PARAMETERS)], torque)
        motor += torque
    angle, daq = -(flexion + np.degrees(moved)), slice(None, None, RATE_HZ // 1000)
    return Trial(
        angle_deg=lambda times: np.interp(times - person.lag_s, t, angle),
        angle_noise_deg=0.06,
        end_s=t[-1],
        daq_s=t[daq],
        current_a=-motor[daq] / TORQUE_CONSTANT + 0.015 * rng.standard_normal(t[daq].size),
        trigger_v=trigger[daq] + 0.02 * rng.standard_normal(t[daq].size),
        strikes_s=np.round(strikes[:-1], 3),
    )


def _gait(rng: np.random.Generator, t: Array, strikes: Array) -> Array:
    """Return flexion (deg) whose speed, size and shape change from stride to stride."""
    numbers = np.arange(strikes.size)
    phase = PchipInterpolator(strikes, numbers)(t)  # extrapolated at both ends
    inside = np.clip(phase, 0, numbers[-1])

    def vary(sd: float) -> Array:
        return PchipInterpolator(numbers, sd * rng.standard_normal(numbers.size))(inside)

    flexion = MEAN_DEG + vary(0.6)
    for order, (cosine, sine) in enumerate(HARMONICS, 1):
        own = 1 + 0.05 * rng.standard_normal()
        turn = 2 * np.pi * order * phase
        flexion += own * (1 + vary(0.02)) * (cosine * np.cos(turn) + sine * np.sin(turn))
    return flexion


def _respond(denominator: list[float], drive: Array) -> Array:
    b, a, _ = cont2discrete(([1.0], denominator), 1 / RATE_HZ, method="foh")
    return lfilter(np.squeeze(b), a, drive)
