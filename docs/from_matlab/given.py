"""The data that both snippets of a row start from: made here, the same on every machine.

Noise comes from ``random.Random``, whose stream Python keeps; motion from sums and products.
Values are rounded, so that the text read by Octave and R is exactly what Python holds.
"""

import math
from collections.abc import Callable
from random import Random

import numpy as np

RATE = 500.0
_DIGITS = 9
_SECONDS = 20
_SUBSTEPS = 10
_STIFFNESS, _DAMPING, _INERTIA = 60.0, 1.0, 0.05
_TRIALS, _WINDOW = 12, 50
_PEOPLE, _POINTS, _NODES = 10, 6, 101

Arrays = dict[str, np.ndarray]


def given() -> Arrays:
    """Return name -> array of all that snippets may use."""
    made: Arrays = {"rate": np.array([RATE])}
    for part in (_record, _walking, _white, _actuator, _pulses, _people, _curves, _samples):
        made |= part()
    return {
        name: np.round(np.asarray(values, dtype=float), _DIGITS) for name, values in made.items()
    }


def as_text(values: np.ndarray) -> str:
    """Return an array as comma-separated text that reads back to the same numbers.

    Parameters
    ----------
    values : (n,) or (n, m) float
        One row of the text is one row of the array; a vector is a column.
    """
    rows = np.atleast_2d(values.T).T.tolist()
    return "".join(",".join("NaN" if x != x else repr(x) for x in row) + "\n" for row in rows)


def _normal(rng: Random) -> float:
    """Return nearly normal noise of variance 1, by sums alone."""
    return sum(rng.random() for _ in range(12)) - 6.0


def _motion(torque: Callable[[float], float], n: int) -> np.ndarray:
    """Return (n, 3): angle, velocity, acceleration of the joint that a torque moves from rest.

    Parameters
    ----------
    torque : callable
        Torque, N*m, at a time counted in samples.
    n : int
        Samples.
    """
    step = 1.0 / (RATE * _SUBSTEPS)
    angle = velocity = 0.0
    rows = []
    for k in range(n * _SUBSTEPS):
        acceleration = (torque(k / _SUBSTEPS) - _STIFFNESS * angle - _DAMPING * velocity) / _INERTIA
        if k % _SUBSTEPS == 0:
            rows.append((angle, velocity, acceleration))
        velocity += step * acceleration
        angle += step * velocity
    return np.array(rows)


def _record() -> Arrays:
    """Return 20 s of a joint under a random torque."""
    rng, n = Random(1), int(_SECONDS * RATE)
    command, slow, fast = [], 0.0, 0.0
    for _ in range(n + 1):
        slow += 0.2 * (20.0 * _normal(rng) - slow)
        fast += 0.2 * (slow - fast)
        command.append(fast)
    held = np.array(command)

    def torque(at: float) -> float:
        k = int(at)
        return float(held[k] + (at - k) * (held[k + 1] - held[k]))

    theta = _motion(torque, n)[:, 0]
    noise = np.array([(_normal(rng), _normal(rng)) for _ in range(n)])
    return {
        "t": np.arange(n) / RATE,
        "theta": 0.1 + theta + 1e-4 * noise[:, 0],
        "tau": 2.0 + held[:n] + 0.02 * noise[:, 1],
        "command": held[:n],
    }


def _walking() -> Arrays:
    """Return a footswitch, and the knee's angle and moment, over about 18 strides."""
    rng, n = Random(2), int(_SECONDS * RATE)
    strikes = [-0.6]
    while strikes[-1] < _SECONDS:
        strikes.append(strikes[-1] + 1.1 * (1.0 + 0.02 * _normal(rng)))
    starts = np.array(strikes)
    t = np.arange(n) / RATE
    stride = np.searchsorted(starts, t, side="right") - 1
    phase = (t - starts[stride]) / np.diff(starts)[stride]
    knee = np.array([_knee(p) for p in phase]) + 0.002 * np.array([_normal(rng) for _ in t])
    cycle = np.linspace(0.0, 1.0, _NODES)
    mean = np.array([_knee(p) for p in cycle])
    moment = [
        0.4 * math.sin(4.0 * math.pi * p) - 0.2 + 1.5 * a for p, a in zip(cycle, mean, strict=True)
    ]
    return {
        "contact": phase < 0.62,
        "knee": knee,
        "knee_mean": mean,
        "knee_moment": np.array(moment),
    }


def _knee(phase: float) -> float:
    """Return a knee-like angle, rad, over the gait cycle."""
    return (
        0.37
        - 0.25 * math.cos(2.0 * math.pi * (phase - 0.25))
        + 0.2 * math.sin(4.0 * math.pi * (phase - 0.05))
    )


def _white() -> Arrays:
    """Return white noise and what a short filter makes of it."""
    rng, n = Random(3), 2000
    u = np.array([_normal(rng) for _ in range(n)])
    v = np.zeros(n)
    for k in range(n):
        past = 1.2 * v[k - 1] - 0.5 * v[k - 2] if k > 1 else 0.0
        v[k] = past + (0.4 * u[k - 1] if k else 0.0) + 0.05 * _normal(rng)
    return {"u": u, "v": v}


def _actuator() -> Arrays:
    """Return a bench record of a motor with friction."""
    rng, n = Random(4), 4000
    t = np.arange(n) / RATE
    current = np.array([5.0 * math.sin(1.9 * s) + 2.0 * math.sin(7.3 * s) for s in t])
    speed = np.array([3.0 * math.sin(4.7 * s + 0.4) + math.sin(11.3 * s) for s in t])
    acceleration = np.array([14.1 * math.cos(4.7 * s + 0.4) + 11.3 * math.cos(11.3 * s) for s in t])
    torque = 0.1 + 9.0 * 0.091 * current - (0.38 + 0.09 * np.abs(current)) * np.sign(speed)
    noise = np.array([_normal(rng) for _ in range(n)])
    return {
        "current": current,
        "motor_speed": speed,
        "motor_acceleration": acceleration,
        "sensor_torque": torque - 0.009 * acceleration + 0.2 * noise,
    }


def _pulses() -> Arrays:
    """Return 100 ms of the answer to pulses of 17 N*m, what a soft joint would show, and draws."""
    rng = Random(5)
    ramp = 0.075 * RATE
    motion = _motion(lambda at: 17.0 * min(at / ramp, 1.0), _WINDOW)
    scale = np.array([1.0 + 0.05 * _normal(rng) for _ in range(_TRIALS)])
    noise = np.array([[_normal(rng) for _ in range(_WINDOW)] for _ in range(_TRIALS)])
    angle, velocity, acceleration = (scale[:, None] * column for column in motion.T)
    torque = _STIFFNESS * angle + _DAMPING * velocity + _INERTIA * acceleration
    soft = -2.0 * angle + 0.3 * velocity + 0.06 * acceleration
    draws = [[1 + int(rng.random() * _TRIALS) for _ in range(_TRIALS)] for _ in range(20)]
    return {
        "pulse_theta": angle,
        "pulse_velocity": velocity,
        "pulse_acceleration": acceleration,
        "pulse_tau": torque + 0.3 * noise,
        "soft_tau": soft + 0.1 * noise,
        "draws": np.array(draws),
    }


def _people() -> Arrays:
    """Return one stiffness a participant and timing point, N*m/rad/kg."""
    rng = Random(6)
    level = np.array([2.0, 0.9, 1.2, 1.1, 0.5, 0.6])
    own = np.array([0.3 * _normal(rng) for _ in range(_PEOPLE)])
    rest = np.array([[0.4 * _normal(rng) for _ in level] for _ in own])
    values = level + own[:, None] + rest
    who, point = np.indices(values.shape) + 1
    return {"subject": who.ravel(), "point": point.ravel(), "stiffness": values.ravel()}


def _curves() -> Arrays:
    """Return mean curves of ten people in two conditions, one row a person."""
    rng = Random(7)
    cycle = np.linspace(0.0, 1.0, _NODES)
    waves = [[math.cos(math.pi * k * p) for p in cycle] for k in range(9)]
    own = np.array([[_normal(rng) / (1 + k) for k in range(9)] for _ in range(2 * _PEOPLE)])
    curves = 0.05 * own @ np.array(waves)
    bump = np.array([0.12 * max(0.0, 1.0 - ((p - 0.6) / 0.12) ** 2) for p in cycle])
    return {"curves_a": curves[:_PEOPLE] + bump, "curves_b": curves[_PEOPLE:]}


def _samples() -> Arrays:
    """Return two small samples of the same people, and one with holes."""
    rng = Random(8)
    x = np.array([1.5 + 0.5 * _normal(rng) for _ in range(14)])
    y = 0.6 * x + np.array([0.4 + 0.3 * _normal(rng) for _ in range(14)])
    holes = x.copy()
    holes[[2, 9]] = np.nan
    return {"x": x, "y": y, "x_nan": holes}
