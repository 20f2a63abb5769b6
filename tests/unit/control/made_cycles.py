"""Profiles that are unsafe and profiles that are safe, with the load that decides.

A profile is unsafe if a passive load, an inertia of 0.2 to 0.8 kg*m^2 with a spring of 0 to 10
times the mean stiffness to ground, has free deviations that grow from stride to stride at a stride
time within 20 % of the mean. The evidence is from :mod:`free_deviations`: of all such loads the one
with the largest growth factor a stride. No other load exceeds that factor by more than 0.002 on the
grids that were searched.
"""

from dataclasses import dataclass

import numpy as np
from tests.unit.control.cycle_shapes import KNEE_B, KNEE_K, flat, steps, waves
from tests.unit.control.free_deviations import Load


@dataclass(frozen=True, slots=True)
class MadeCycle:
    """A profile over one cycle and the evidence for its safety."""

    name: str
    stride_s: float  # mean
    stiffness: np.ndarray  # (100,) float, N*m/rad, linear between nodes, periodic
    damping: np.ndarray  # (100,) float, N*m*s/rad
    worst: Load  # with the largest growth factor
    growth: float  # of the energy norm, a stride, between strides 30 and 60

    @property
    def unsafe(self) -> bool:
        """Whether the free deviations of the worst load grow."""
        return self.growth > 1.0


def unsafe_cycles() -> tuple[MadeCycle, ...]:
    """Return 20 profiles with a load whose free deviations grow."""
    return (
        MadeCycle("knee, low damping", 1.1, KNEE_K, 0.246 * KNEE_B, Load(0.776367, 0, 1.32),
                  1.0506),
        MadeCycle("knee, hardly any damping", 1.14, KNEE_K, 0.0124 * KNEE_B,
                  Load(0.799357, 0, 1.34648), 1.8999),
        MadeCycle("knee, twice as stiff", 1.1, 2.0 * KNEE_K, 0.254 * KNEE_B,
                  Load(0.8, 0, 0.952585), 1.2507),
        MadeCycle("knee, half as stiff, flat damping", 1.05, 0.5 * KNEE_K, flat(1.5),
                  Load(0.8, 0, 0.938178), 1.0367),
        MadeCycle("first tongue, 3 % modulation", 1.1, waves(100.0, {5: 0.03}), flat(0.0903),
                  Load(0.706194, 0, 1.32), 1.0330),
        MadeCycle("first tongue, 20 % modulation", 1.1, waves(90.0, {4: 0.2}), flat(0.714),
                  Load(0.8, 0, 1.18702), 1.1011),
        MadeCycle("first tongue, 50 % modulation", 1.15, waves(80.0, {4: 0.5}, 0.3), flat(1.47),
                  Load(0.8, 0, 1.2718), 1.5037),
        MadeCycle("first tongue, 80 % modulation", 1.1, waves(60.0, {3: 0.8}), flat(1.41),
                  Load(0.8, 0, 1.12444), 2.5040),
        MadeCycle("second tongue, 80 % modulation", 1.1, waves(200.0, {3: 0.8}), flat(1.84),
                  Load(0.8, 0, 1.26198), 1.1557),
        MadeCycle("second tongue, 50 % modulation", 1.1, waves(200.0, {3: 0.5}, 0.15), flat(0.733),
                  Load(0.8, 0, 1.21772), 1.0444),
        MadeCycle("stiffness steps, half of the cycle", 1.1, steps(40.0, 120.0, (0.1, 0.6)),
                  flat(0.446), Load(0.8, 0, 1.29923), 1.2002),
        MadeCycle("stiffness steps, twice a cycle", 1.1,
                  steps(30.0, 130.0, (0.0, 0.2), (0.5, 0.7)), flat(0.715), Load(0.681147, 0, 1.32),
                  1.0382),
        MadeCycle("one short stiff window", 1.08, steps(35.0, 160.0, (0.05, 0.17)), flat(1.21),
                  Load(0.8, 0, 0.864), 1.0774),
        MadeCycle("damping vanishes in swing", 1.1, KNEE_K, 1.32 * steps(1.0, 0.002, (0.6, 1.0)),
                  Load(0.778554, 0, 1.32), 1.0587),
        MadeCycle("damping vanishes twice, stiffness steps", 1.2, steps(45.0, 95.0, (0.3, 0.55)),
                  0.1 * steps(1.0, 0.001, (0.2, 0.5), (0.7, 0.9)), Load(0.468514, 0, 1.44),
                  1.3005),
        MadeCycle("three harmonics", 1.1, waves(70.0, {2: 0.25, 3: 0.3, 5: 0.2}, 0.1),
                  0.98 * waves(1.0, {1: 0.4}), Load(0.8, 0, 1.01886), 1.1221),
        MadeCycle("five harmonics", 1.0,
                  waves(85.0, {1: 0.2, 2: 0.15, 4: 0.15, 6: 0.15, 7: 0.15}, 0.4),
                  0.55 * waves(1.0, {2: 0.5}), Load(0.771578, 0, 1.2), 1.0398),
        MadeCycle("only with a spring", 1.1, waves(40.0, {9: 0.6}), flat(0.516),
                  Load(0.2, 51.5382, 1.32), 1.1006),
        MadeCycle("only with the heaviest load in short strides", 1.1, waves(90.0, {3: 0.15}),
                  flat(0.546), Load(0.8, 0, 0.890267), 1.0503),
        MadeCycle("only with the lightest load in long strides", 1.1, waves(30.0, {16: 0.8}),
                  flat(0.272), Load(0.2, 259.955, 1.32), 1.0593),
    )  # fmt: skip


def safe_cycles() -> tuple[MadeCycle, ...]:
    """Return 20 profiles without such a load; most are near the border."""
    return (
        MadeCycle("knee", 1.1, KNEE_K, KNEE_B, Load(0.8, 92.4318, 0.88), 0.2328),
        MadeCycle("knee, twice as stiff, half the damping", 1.14, 2.0 * KNEE_K, 0.5 * KNEE_B,
                  Load(0.8, 0, 0.954932), 0.8094),
        MadeCycle("knee, near the border", 1.1, KNEE_K, 0.282 * KNEE_B, Load(0.776828, 0, 1.32),
                  0.9593),
        MadeCycle("knee, twice as stiff, near the border", 1.1, 2.0 * KNEE_K, 0.441 * KNEE_B,
                  Load(0.8, 0, 0.952585), 0.9000),
        MadeCycle("knee, half as stiff, more flat damping", 1.05, 0.5 * KNEE_K, flat(1.69),
                  Load(0.8, 0, 0.938178), 0.9295),
        MadeCycle("constant stiffness, little damping", 1.1, flat(80.0), flat(0.0648),
                  Load(0.8, 4.19645, 0.88), 0.9650),
        MadeCycle("first tongue, 5 % modulation, more damping", 1.1, waves(100.0, {5: 0.05}),
                  flat(0.252), Load(0.8, 13.2877, 1.32), 0.9646),
        MadeCycle("first tongue, 20 % modulation, more damping", 1.1, waves(90.0, {4: 0.2}),
                  flat(0.912), Load(0.8, 0, 1.18702), 0.9511),
        MadeCycle("first tongue, 50 % modulation, more damping", 1.15, waves(80.0, {4: 0.5}, 0.3),
                  flat(2.04), Load(0.8, 0, 1.27125), 0.9625),
        MadeCycle("first tongue, 80 % modulation, more damping", 1.1, waves(60.0, {3: 0.8}),
                  flat(3.0), Load(0.8, 0, 1.12417), 0.8550),
        MadeCycle("second tongue, 80 % modulation, more damping", 1.1, waves(200.0, {3: 0.8}),
                  flat(2.09), Load(0.8, 0, 1.26198), 0.9524),
        MadeCycle("second tongue, 50 % modulation, more damping", 1.1,
                  waves(200.0, {3: 0.5}, 0.15), flat(0.952), Load(0.8, 0, 1.21877), 0.8844),
        MadeCycle("stiffness steps, half of the cycle, more damping", 1.1,
                  steps(40.0, 120.0, (0.1, 0.6)), flat(0.747), Load(0.8, 0, 1.29923), 0.9402),
        MadeCycle("one short stiff window, more damping", 1.08, steps(35.0, 160.0, (0.05, 0.17)),
                  flat(1.44), Load(0.8, 0, 0.864), 0.9579),
        MadeCycle("damping vanishes in swing, more damping", 1.1, KNEE_K,
                  1.62 * steps(1.0, 0.002, (0.6, 1.0)), Load(0.779741, 0, 1.32), 0.9209),
        MadeCycle("damping vanishes twice, stiffness steps, more damping", 1.2,
                  steps(45.0, 95.0, (0.3, 0.55)), 1.16 * steps(1.0, 0.001, (0.2, 0.5), (0.7, 0.9)),
                  Load(0.8, 20.9696, 0.96), 0.8204),
        MadeCycle("three harmonics, more damping", 1.1,
                  waves(70.0, {2: 0.25, 3: 0.3, 5: 0.2}, 0.1), 1.24 * waves(1.0, {1: 0.4}),
                  Load(0.8, 0, 1.02106), 0.9511),
        MadeCycle("largest with a spring", 1.1, waves(40.0, {9: 0.6}), flat(0.601),
                  Load(0.8, 327.025, 1.32), 0.9552),
        MadeCycle("slow modulation, ample damping", 1.1, waves(90.0, {1: 0.6}), flat(2.5),
                  Load(0.8, 8.24135, 0.88), 0.2905),
        MadeCycle("resonance only with a heavier load", 1.1, waves(110.0, {3: 0.12}), flat(0.0947),
                  Load(0.8, 3.81629, 0.88), 0.9503),
    )  # fmt: skip


def made_cycles() -> tuple[MadeCycle, ...]:
    """Return 20 unsafe and 20 safe profiles."""
    return unsafe_cycles() + safe_cycles()
