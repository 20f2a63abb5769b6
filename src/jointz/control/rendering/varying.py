"""Stability of a stiffness and damping that change over the gait cycle, with passive loads."""

from dataclasses import dataclass
from typing import Final

import numpy as np

#: Loads: inertias by the load's, springs to ground by the mean stiffness; and stride times.
INERTIA_RANGE: Final = (0.5, 2.0)
SPRING_RANGE: Final = (0.0, 10.0)
STRIDE_RANGE: Final = (0.8, 1.2)
#: Points of the grid of inertias, springs and stride times.
GRID: Final = (13, 121, 13)
SMALL_GRID: Final = (3, 41, 3)
#: Profiles that are searched at once.
_AT_ONCE = 40
#: Rounds of refinement: of all seeds, of those that are kept; of draws.
_ROUNDS, _ROUNDS_OF_DRAWS = (3, 12), 8
#: What the steps shrink by in each, and how many seeds are kept.
_SHRINK, _KEPT = 0.7, 12
#: Ends of the grid: logarithm of the inertia, root of 1 + spring / mean stiffness, stride time.
#: Even steps of the root are even in frequency: instabilities lie near where a stride holds a
#: whole number of half swings.
_LOW = np.array([np.log(INERTIA_RANGE[0]), 1.0, STRIDE_RANGE[0]])
_HIGH = np.array([np.log(INERTIA_RANGE[1]), np.sqrt(1.0 + SPRING_RANGE[1]), STRIDE_RANGE[1]])
_NEIGHBOURS = np.stack(np.meshgrid(*3 * [[-1.0, 0.0, 1.0]], indexing="ij"), -1).reshape(-1, 3)


@dataclass(frozen=True, slots=True)
class LargestMultiplier:
    """The load and stride time with which free deviations grow most from stride to stride."""

    multiplier: float  # deviations grow by this factor a stride; above 1 the profile is unsafe
    inertia: float  # kg*m^2
    spring: float  # N*m/rad, to ground
    stride_s: float


def floquet_multipliers(
    stiffness: np.ndarray,
    damping: np.ndarray,
    inertia: np.ndarray,
    spring: np.ndarray,
    stride_s: np.ndarray,
) -> np.ndarray:
    """Return the largest Floquet multiplier of J x'' + B(t) x' + (K(t) + K_e) x = 0.

    It is the growth of a deviation from stride to stride. ``stiffness``, ``damping`` (..., n): at n
    phases, evenly over the cycle, linear in between; the others broadcast with each other and with
    ``stiffness[..., 0]``.
    """
    step = stride_s / stiffness.shape[-1]
    shape = np.broadcast_shapes(stiffness.shape[:-1], inertia.shape, spring.shape, step.shape)
    product = np.zeros((2, 2, *shape))
    product[0, 0] = product[1, 1] = 1.0
    following = np.roll(stiffness, -1, axis=-1), np.roll(damping, -1, axis=-1)
    for k in range(stiffness.shape[-1]):
        ends = (
            (stiffness[..., k], following[0][..., k]),
            (damping[..., k], following[1][..., k]),
        )
        product = _step(product, ends, inertia, spring, step)
    half_trace = 0.5 * (product[0, 0] + product[1, 1])
    determinant = product[0, 0] * product[1, 1] - product[0, 1] * product[1, 0]
    root = np.sqrt((half_trace**2 - determinant).astype(complex))
    return np.asarray(np.maximum(np.abs(half_trace + root), np.abs(half_trace - root)))


def _step(
    product: np.ndarray,
    ends: tuple[tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]],
    inertia: np.ndarray,
    spring: np.ndarray,
    step: np.ndarray,
) -> np.ndarray:
    """Return the transition matrix after one more segment: Magnus's method of fourth order."""
    (k0, k1), (b0, b1) = ends
    # For matrices that are linear in time: mean, and step^2 / 12 times [slope, mean].
    a = 0.5 * (k0 + k1 + 2.0 * spring) / inertia
    c = 0.5 * (b0 + b1) / inertia
    da, dc = (k1 - k0) / inertia, (b1 - b0) / inertia
    factor = step**2 / 12.0
    m11, m12 = factor * da, step + factor * dc
    m21, m22 = -step * a + factor * (da * c - dc * a), -step * c - factor * da
    half_trace = 0.5 * (m11 + m22)
    p = 0.5 * (m11 - m22)
    root = np.sqrt((p**2 + m12 * m21).astype(complex))
    grow = np.exp(half_trace)
    even = grow * np.cosh(root).real
    small = np.abs(root) < 1e-8
    odd = grow * np.where(small, 1.0, np.sinh(root) / np.where(small, 1.0, root)).real
    e11, e12, e21, e22 = even + odd * p, odd * m12, odd * m21, even - odd * p
    first, second = product[0], product[1]
    return np.stack([e11 * first + e12 * second, e21 * first + e22 * second])


def largest_multiplier(
    stiffness: np.ndarray, damping: np.ndarray, stride_s: float, load_inertia: float
) -> LargestMultiplier:
    """Return the load with which free deviations grow most, over passive loads and stride times.

    A profile is unsafe if the multiplier exceeds 1 with an inertia between 0.5 and 2 times the
    load's, a spring to ground between 0 and 10 times the mean stiffness, at a stride time within
    20 % of the mean. A grid is searched and refined near its
    largest values.
    """
    search = _Search(stiffness[None], damping[None], stride_s, load_inertia)
    points, cell = _grid(GRID)
    worst = np.argmax(search.multipliers(points.reshape(-1, 3)).reshape(GRID), axis=1)
    # Of every inertia and stride time of the grid, the spring that is worst.
    seeds = np.take_along_axis(points, worst[:, None, :, None], axis=1).reshape(-1, 3)
    for rounds in _ROUNDS:
        seeds, values, cell = search.climb(seeds, cell, rounds)
        best = np.argsort(values)[::-1][:_KEPT]
        seeds, values = seeds[best], values[best]
    load = search.loads(seeds[0], float(stiffness.mean()))
    return LargestMultiplier(float(values[0]), *map(float, load))


def drawn_multipliers(
    stiffness: np.ndarray, damping: np.ndarray, stride_s: float, load_inertia: float
) -> np.ndarray:
    """Return the largest multiplier of many profiles (m, n), (m,), by a coarser search."""
    points, cell = _grid(SMALL_GRID)
    points = points.reshape(-1, 3)
    multipliers = []
    for k in range(0, len(stiffness), _AT_ONCE):  # in parts whose arrays stay in the cache
        part = slice(k, k + _AT_ONCE)
        search = _Search(stiffness[part], damping[part], stride_s, load_inertia)
        seeds = points[np.argmax(search.multipliers(points), axis=1)]
        multipliers.append(search.climb(seeds, cell, _ROUNDS_OF_DRAWS)[1])
    return np.concatenate(multipliers)


def _grid(counts: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Return points, (*counts, 3), and the distances between them."""
    axes = [np.linspace(*ends) for ends in zip(_LOW, _HIGH, counts, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    return points, (_HIGH - _LOW) / (np.array(counts) - 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class _Search:
    """Search for the loads with which deviations from curves, (m, n), grow most."""

    stiffness: np.ndarray
    damping: np.ndarray
    stride_s: float
    load_inertia: float

    def multipliers(self, points: np.ndarray) -> np.ndarray:
        """Return the multipliers of all curves, or of one for each row, at points (..., 3)."""
        stiffness, damping = self.stiffness[:, None], self.damping[:, None]
        return floquet_multipliers(stiffness, damping, *self.loads(points, stiffness.mean(axis=-1)))

    def loads(
        self, points: np.ndarray, mean: np.ndarray | float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return inertias, springs and stride times at points of the grid, (..., 3)."""
        inertia = self.load_inertia * np.exp(points[..., 0])
        spring = mean * (points[..., 1] ** 2 - 1.0)
        return inertia, spring, self.stride_s * points[..., 2]

    def climb(
        self, seeds: np.ndarray, cell: np.ndarray, rounds: int
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return where seeds climb to in shrinking steps, multipliers there, and the step.

        Every seed has its own curves, or all have one.
        """
        values = np.zeros(len(seeds))
        for _ in range(rounds):
            near = np.clip(seeds[:, None] + cell * _NEIGHBOURS, _LOW, _HIGH)
            around = self.multipliers(near)
            each, best = np.arange(len(seeds)), np.argmax(around, axis=1)
            seeds, values, cell = near[each, best], around[each, best], _SHRINK * cell
        return seeds, values, cell


def is_surely_stable(
    stiffness: np.ndarray, damping: np.ndarray, stride_s: float, load_inertia: float
) -> bool:
    """Return whether the condition of Kronander and Billard (2016) holds.

    It holds if, at every stride time, there is an alpha > 0 with alpha J <= B and
    K' + alpha B' <= 2 alpha K throughout, J the largest inertia of the loads; springs to ground
    only help. It is sufficient, not necessary: profiles that fail it may be safe.
    """
    rise = np.roll(stiffness, -1) - stiffness, np.roll(damping, -1) - damping
    largest = damping.min() / (INERTIA_RANGE[1] * load_inertia)
    return all(
        _has_alpha(stiffness, rise, share * stride_s / stiffness.size, largest)
        for share in np.linspace(*STRIDE_RANGE, GRID[2])
    )


def _has_alpha(
    stiffness: np.ndarray, rise: tuple[np.ndarray, np.ndarray], step_s: float, largest: float
) -> bool:
    """Return whether an alpha up to ``largest`` meets the condition at both ends of segments."""
    slope = rise[0] / step_s
    least = 0.0
    for start in (stiffness, np.roll(stiffness, -1)):
        factor = 2.0 * start - rise[1] / step_s  # slope <= alpha * factor
        if (slope[factor == 0.0] > 0.0).any():
            return False
        with np.errstate(divide="ignore", invalid="ignore"):
            bound = slope / factor
        least = max(least, float(np.max(bound[factor > 0.0], initial=0.0)))
        largest = min(largest, float(np.min(bound[factor < 0.0], initial=largest)))
    return largest > 0.0 and least <= largest
