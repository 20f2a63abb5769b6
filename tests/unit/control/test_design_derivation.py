"""Numbers of `jointz control design`, derived a second time from its docstring alone."""

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.stats import norm

import jointz
from jointz.control.design import JointDesign, design_joint
from jointz.control.impedance_profile import ImpedanceProfile

Array = NDArray[np.float64]
Nodes = NDArray[np.int_]
Numbers = dict[str, float]

EFFICIENCY = 0.6
RESISTANCE, SUPPLY, PEAK, CONTINUOUS = 0.2, 36.0, 25.0, 8.0
GEAR, TORQUE_CONSTANT, COULOMB, GEAR_FRICTION, INERTIA = 9.0, 0.11, 0.38, 0.09, 0.0092
LARGEST_RATIO = 200
STRIDE_95 = norm.ppf(0.95)
MINIMA = {"torque_min", "power_min", "negative_work"}


@dataclass(frozen=True)
class Stride:
    angle: Array
    moment: Array
    percent: Array
    step_s: float

    @property
    def velocity(self) -> Array:
        return (np.roll(self.angle, -1) - np.roll(self.angle, 1)) / (2 * self.step_s)

    @property
    def acceleration(self) -> Array:
        around = np.roll(self.angle, -1) + np.roll(self.angle, 1)
        return (around - 2 * self.angle) / self.step_s**2

    @property
    def power(self) -> Array:
        return self.moment * self.velocity


def stride_of(profile: ImpedanceProfile, deviation: float = 0.0) -> Stride:
    moment = np.asarray(profile.moment) + deviation * np.asarray(profile.moment_sd)
    angle = np.asarray(profile.angle)
    return Stride(angle, moment, np.asarray(profile.gait_pct), profile.stride_s / len(angle))


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def requirements(s: Stride) -> Numbers:
    positive = s.step_s * s.power[s.power > 0].sum()
    negative = s.step_s * s.power[s.power < 0].sum()
    return {
        "torque_max": s.moment.max(),
        "torque_min": s.moment.min(),
        "torque_rms": rms(s.moment),
        "power_max": s.power.max(),
        "power_min": s.power.min(),
        "positive_work": positive,
        "negative_work": negative,
        "net_work": positive + negative,
        "regenerated": -EFFICIENCY * negative,
    }


def misfit(s: Stride, torque: Array, spring: Array) -> Numbers:
    needed = np.maximum(s.power, 0) - np.maximum(spring * s.velocity, 0)
    error = rms(s.moment - torque)
    return {
        "error_rms": error,
        "error_share": error / rms(s.moment),
        "missing_work": s.step_s * np.maximum(needed, 0).sum(),
    }


def spring_and_damper(s: Stride) -> Numbers:
    # k (rest - angle) with k >= 0 and |rest| <= pi is a sum of two springs, at rest at pi and -pi.
    columns = np.column_stack([np.pi - s.angle, -np.pi - s.angle, -s.velocity])
    weights, _ = nnls(columns, s.moment)
    stiffness = weights[0] + weights[1]
    values = {
        "stiffness": stiffness,
        "damping": weights[2],
        "rest_angle": np.pi * (weights[0] - weights[1]) / stiffness,
    } | misfit(s, columns @ weights, columns[:, :2] @ weights[:2])
    return {f"passive_{name}": value for name, value in values.items()}


def part_columns(s: Stride, nodes: Nodes) -> Array:
    columns = np.zeros((len(s.angle), 3))
    columns[:, 2] = -s.velocity
    columns[nodes, 2] = 0.0
    columns[nodes, 0] = s.angle[nodes[0]] - s.angle[nodes]
    columns[nodes, 1] = -s.velocity[nodes]
    return columns


def best_part(s: Stride) -> Nodes:
    n = len(s.angle)
    parts = [(start + np.arange(size)) % n for start in range(n) for size in range(2, n)]
    return min(parts, key=lambda nodes: nnls(part_columns(s, nodes), s.moment)[1])


def clutched_spring(s: Stride) -> Numbers:
    nodes = best_part(s)
    columns = part_columns(s, nodes)
    weights, _ = nnls(columns, s.moment)
    energy = weights[0] * (s.angle[nodes] - s.angle[nodes[0]]) ** 2 / 2
    steps = np.diff(energy)
    values = {
        "engaged": s.percent[nodes[0]],
        "released": s.percent[nodes[-1]],
        "stiffness": weights[0],
        "rest_angle": s.angle[nodes[0]],
        "damping_engaged": weights[1],
        "damping_free": weights[2],
        "stored": steps[steps > 0].sum(),
        "returned": -steps[steps < 0].sum(),
        "loss": energy[-1],
    } | misfit(s, columns @ weights, columns[:, 0] * weights[0])
    return {f"clutch_{name}": value for name, value in values.items()}


def motor_at(s: Stride, ratio: int) -> Numbers:
    speed, direction = ratio * s.velocity, np.sign(s.velocity)
    demand = (
        s.moment / ratio + INERTIA / GEAR**2 * ratio * s.acceleration + COULOMB / GEAR * direction
    )
    current = demand / (TORQUE_CONSTANT - GEAR_FRICTION / GEAR * direction * np.sign(demand))
    voltage = RESISTANCE * current + TORQUE_CONSTANT * speed
    power = voltage * current
    return {
        "motor_energy": s.step_s * np.where(power > 0, power, EFFICIENCY * power).sum(),
        "motor_current_max": np.abs(current).max(),
        "motor_current_rms": rms(current),
        "motor_voltage_max": np.abs(voltage).max(),
    }


def within_limits(motor: Numbers) -> bool:
    return bool(
        motor["motor_current_max"] <= PEAK
        and motor["motor_current_rms"] <= CONTINUOUS
        and motor["motor_voltage_max"] <= SUPPLY
    )


def motor_and_gear(s: Stride) -> Numbers:
    motors = {ratio: motor_at(s, ratio) for ratio in range(1, LARGEST_RATIO + 1)}
    feasible = [ratio for ratio, motor in motors.items() if within_limits(motor)]
    best = min(feasible, key=lambda ratio: motors[ratio]["motor_energy"])
    ratios = {"gear_ratio_low": feasible[0], "gear_ratio_high": feasible[-1], "gear_ratio": best}
    return ratios | motors[best]


@pytest.fixture(scope="module")
def profile() -> ImpedanceProfile:
    return jointz.impedance_profile(None, mass_kg=73.39)


@pytest.fixture(scope="module")
def design(profile: ImpedanceProfile) -> JointDesign:
    return design_joint({"knee": profile}, efficiency=EFFICIENCY)


def column(design: JointDesign, name: str) -> Numbers:
    frame = design.to_frame()
    return dict(zip(frame["quantity"], frame[name], strict=True))


def test_every_value_of_the_published_knee_follows_from_the_page(
    profile: ImpedanceProfile, design: JointDesign
) -> None:
    stride = stride_of(profile)
    derived = (
        requirements(stride)
        | spring_and_damper(stride)
        | clutched_spring(stride)
        | motor_and_gear(stride)
    )
    assert column(design, "value") == pytest.approx(derived, rel=1e-6, abs=1e-12)


def test_values_for_95_percent_of_strides_follow_from_the_page(
    profile: ImpedanceProfile, design: JointDesign
) -> None:
    ratio = int(column(design, "value")["gear_ratio"])
    ends = [stride_of(profile, sign * STRIDE_95) for sign in (-1, 1)]
    low, high = (requirements(end) | motor_at(end, ratio) for end in ends)
    # Net work has an interval of its own instead.
    derived = {
        name: (min if name in MINIMA else max)(low[name], high[name])
        for name in low
        if name != "net_work"
    }
    values = {k: v for k, v in column(design, "stride_95").items() if not np.isnan(v)}
    assert values == pytest.approx(derived, rel=1e-6)
