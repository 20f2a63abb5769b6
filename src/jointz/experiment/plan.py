"""The plan of a condition: which pulse fires where in the gait cycle, and how far apart.

Made once from the protocol and a seed, and written down: what was planned can
be compared with what was done, and an interrupted session goes on with the rest.
"""

from dataclasses import dataclass

import numpy as np

from jointz.core.protocols.protocol_models import PerturbationPlan, PulseSpec


@dataclass(frozen=True, slots=True)
class PlannedPulse:
    """A pulse of the plan."""

    number: int  # position in the plan, from 1
    timing_point: str  # name of the timing point
    gait_pct: float  # onset of the timing point, % of the gait cycle
    amplitude_nm: float  # signed height; 0 for a sham
    gap_strides: int  # accepted strides to wait after the previous pulse

    @property
    def sham(self) -> bool:
        """Whether nothing is to be felt."""
        return self.amplitude_nm == 0.0


def make_plan(
    perturbations: PerturbationPlan, pulse: PulseSpec, rng: np.random.Generator
) -> tuple[PlannedPulse, ...]:
    """Lay out the pulses of a walking condition.

    ``balanced`` shuffles rounds in which every timing point occurs once, so that the
    plan is balanced wherever it is broken off; ``random`` shuffles all pulses;
    ``sequential`` takes one timing point after the other; ``cyclic`` takes them round
    after round as the protocol lists them. Where pulses go both ways,
    every other round turns the directions of the one before, which are drawn for each
    timing point: nobody can tell them in advance. A round of shams is one of all
    timing points, too.
    """
    points = perturbations.timing_points or {}
    order = ordered_pulses(perturbations, pulse, rng)
    fewest, most = perturbations.gap_strides or (1, 1)
    gaps = rng.integers(fewest, most + 1, size=len(order))
    return tuple(
        PlannedPulse(i + 1, point, points[point], amplitude, int(gap))
        for i, ((point, amplitude), gap) in enumerate(zip(order, gaps, strict=True))
    )


def ordered_pulses(
    perturbations: PerturbationPlan, pulse: PulseSpec, rng: np.random.Generator
) -> list[tuple[str, float]]:
    """Return timing point and signed amplitude of every pulse, in their order."""
    points = list(perturbations.timing_points or {"": 0.0})
    count = perturbations.count_per_point or perturbations.count or 0
    cyclic = perturbations.order == "cyclic"
    amplitudes = _amplitudes(pulse, count, len(points), rng, alternating=cyclic)
    amplitudes = _spread_shams(amplitudes, perturbations.shams(count), rng)
    rounds = [list(zip(points, row, strict=True)) for row in amplitudes]
    if perturbations.order == "sequential":
        return [entry for column in zip(*rounds, strict=True) for entry in column]
    if perturbations.order == "random":
        entries = [entry for row in rounds for entry in row]
        return [entries[i] for i in rng.permutation(len(entries))]
    if cyclic:
        return [entry for row in rounds for entry in row]
    return [row[i] for row in rounds for i in rng.permutation(len(row))]


def _amplitudes(
    pulse: PulseSpec,
    rounds: int,
    points: int,
    rng: np.random.Generator,
    *,
    alternating: bool,
) -> list[list[float]]:
    """Return the signed amplitudes of every round, a number a timing point."""
    if pulse.direction != "both":
        sign = 1.0 if pulse.direction == "positive" else -1.0
        return [[sign * pulse.amplitude_nm] * points for _ in range(rounds)]
    rows: list[list[float]] = []
    row = np.zeros(points)
    for _ in range(0, rounds, 2):
        if not (alternating and rows):
            row = pulse.amplitude_nm * rng.choice((1.0, -1.0), size=points)
        rows += [row.tolist(), (-row).tolist()]
    return rows[:rounds]


def _spread_shams(
    amplitudes: list[list[float]], shams: int, rng: np.random.Generator
) -> list[list[float]]:
    """Insert rounds of shams at random places."""
    if not shams:
        return amplitudes
    places = rng.permutation(len(amplitudes) + shams) < shams
    remaining = iter(amplitudes)
    return [[0.0] * len(amplitudes[0]) if sham else next(remaining) for sham in places]
