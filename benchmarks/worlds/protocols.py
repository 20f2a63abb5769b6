"""Schedules of torque pulses: the long hold and the doublets."""

from dataclasses import dataclass

import numpy as np

from . import leg as lg

TIMING_POINTS = {"LRE": 7.0, "MST": 21.5, "TST": 40.5, "PSW": 56.0, "ISW": 68.5, "MSW": 81.0}
WINDOW_S = {"hold": 0.10, "doublets": 0.15}
WARM_UP_STRIDES = 12
_HOLD = [("hold", ((0.25, 1.0),), 17.0)]
_SHAPES = {"short": ((0.039, 1.0), (0.021, -1.0)), "long": ((0.091, 1.0), (0.049, -1.0))}
_DOUBLETS = [
    (name, shape, sign * size)
    for name, shape in _SHAPES.items()
    for size in (12.0, 17.0)
    for sign in (1.0, -1.0)
]
KINDS = {"hold": _HOLD, "doublets": _DOUBLETS}


@dataclass(frozen=True)
class Pulse:
    """A commanded pulse: timing point, stride, shape as pairs of duration and level, and size."""

    timing_point: str
    stride: int
    shape: tuple[tuple[float, float], ...]
    amplitude: float

    @property
    def duration_s(self) -> float:
        """Return the whole duration."""
        return sum(length for length, _ in self.shape)

    def samples(self) -> np.ndarray:
        """Return the commanded torque at the steps of the simulation."""
        parts = [np.full(round(s / lg.DT), level * self.amplitude) for s, level in self.shape]
        return np.concatenate(parts)


def plan_pulses(protocol: str, per_point: int, rng: np.random.Generator) -> list[Pulse]:
    """Return pulses in random order, one every third or fourth stride."""
    kinds = KINDS[protocol]
    jobs = [(name, kinds[i % len(kinds)]) for name in TIMING_POINTS for i in range(per_point)]
    stride, pulses = WARM_UP_STRIDES, []
    for j in rng.permutation(len(jobs)):
        name, (_, shape, amplitude) = jobs[j]
        pulses.append(Pulse(name, stride, shape, amplitude))
        stride += int(rng.integers(3, 5))
    return pulses


def onset_step(pulse: Pulse, strikes: np.ndarray) -> int:
    """Return the step of the onset: predicted from the last five strides, as a controller does."""
    mean = (strikes[pulse.stride] - strikes[pulse.stride - 5]) / 5
    return round((strikes[pulse.stride] + TIMING_POINTS[pulse.timing_point] / 100 * mean) / lg.DT)
