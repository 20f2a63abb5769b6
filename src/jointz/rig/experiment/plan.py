"""The plan of a condition: which pulse fires where in the gait cycle, and how far apart.

Made once from the protocol and a seed, and written down: what was planned can
be compared with what was done, and an interrupted session goes on with the rest.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from jointz.core.protocols.protocol_models import PerturbationPlan
from jointz.core.protocols.pulse_models import Pulse, PulseSpec, PulseVariant, variants_of


@dataclass(frozen=True, slots=True)
class PlannedPulse:
    """A pulse of the plan."""

    number: int  # position in the plan, from 1
    timing_point: str  # name of the timing point
    gait_pct: float  # onset of the timing point, % of the gait cycle
    amplitude_nm: float  # signed height; 0 for a sham
    gap_strides: int  # accepted strides to wait after the previous pulse
    shape: str = ""  # name of its shape; "" for the only pulse of a protocol

    @property
    def variant(self) -> tuple[str, str, float]:
        """Timing point, shape and amplitude."""
        return self.timing_point, self.shape, self.amplitude_nm

    @property
    def sham(self) -> bool:
        """Whether nothing is to be felt."""
        return self.amplitude_nm == 0.0


def written_pulse(pulse: Any) -> dict[str, Any]:
    """Return a planned pulse as plans have always held it, with a shape only where it has one."""
    return {key: value for key, value in asdict(pulse).items() if (key, value) != ("shape", "")}


def make_plan(
    perturbations: PerturbationPlan, pulses: tuple[Pulse, ...], rng: np.random.Generator
) -> tuple[PlannedPulse, ...]:
    """Lay out the pulses of a walking condition.

    ``balanced`` shuffles rounds in which every timing point occurs once, so that the
    plan is balanced wherever it is broken off; ``random`` shuffles all pulses;
    ``sequential`` takes one timing point after the other; ``cyclic`` takes them round
    after round as the protocol lists them. Shapes, sizes and directions are balanced at
    every timing point: each comes once in as many rounds as there are of them, in an order
    that is drawn for each timing point, so that nobody can tell them in advance. A round of
    shams is one of all timing points, too.
    """
    points = perturbations.timing_points or {}
    order = ordered_pulses(perturbations, pulses, rng)
    fewest, most = perturbations.gap_strides or (1, 1)
    gaps = rng.integers(fewest, most + 1, size=len(order))
    return tuple(
        PlannedPulse(i + 1, point, points[point], variant.amplitude_nm, int(gap), variant.shape)
        for i, ((point, variant), gap) in enumerate(zip(order, gaps, strict=True))
    )


def ordered_pulses(
    perturbations: PerturbationPlan, pulses: tuple[Pulse, ...], rng: np.random.Generator
) -> list[tuple[str, PulseVariant]]:
    """Return timing point and variant of every pulse, in their order."""
    counts = perturbations.counts
    points, count = list(counts), max(counts.values(), default=0)
    cyclic = perturbations.order == "cyclic"
    variants = _variants(pulses, count, len(points), rng, alternating=cyclic)
    sham = PulseVariant(variants_of(pulses)[0].shape, 0.0)
    shams = perturbations.shams
    none = [[sham] * len(points)] * max(shams.values(), default=0)
    rounds = _spread_shams(_rounds(variants, counts), _rounds(none, shams), rng)
    if perturbations.order == "sequential":
        return sorted((e for row in rounds for e in row), key=lambda e: points.index(e[0]))
    if perturbations.order == "random":
        entries = [entry for row in rounds for entry in row]
        return [entries[i] for i in rng.permutation(len(entries))]
    if cyclic:
        return [entry for row in rounds for entry in row]
    return [row[i] for row in rounds for i in rng.permutation(len(row))]


def _rounds(
    variants: Sequence[Sequence[PulseVariant]], counts: Mapping[str, int]
) -> list[list[tuple[str, PulseVariant]]]:
    """Return the pulses of every round; a point with fewer pulses is in evenly spread rounds."""
    n = len(variants)
    rounds: list[list[tuple[str, PulseVariant]]] = [[] for _ in range(n)]
    for column, (point, count) in enumerate(counts.items()):
        taken = [i for i in range(n) if (i + 1) * count // n > i * count // n]
        for k, i in enumerate(taken):
            rounds[i].append((point, variants[k][column]))
    return rounds


def _variants(
    pulses: tuple[Pulse, ...],
    rounds: int,
    points: int,
    rng: np.random.Generator,
    *,
    alternating: bool,
) -> list[list[PulseVariant]]:
    """Return the variants of every round, one a timing point."""
    variants = variants_of(pulses)
    if len(variants) == 1:
        return [[variants[0]] * points for _ in range(rounds)]
    rows: list[list[PulseVariant]] = []
    block: list[list[PulseVariant]] = []
    for _ in range(0, rounds, len(variants)):
        if not (alternating and rows):
            orders = _orders(pulses, len(variants), points, rng)
            block = [[variants[k] for k in row] for row in orders]
        rows += block
    return rows[:rounds]


def _orders(
    pulses: tuple[Pulse, ...], count: int, points: int, rng: np.random.Generator
) -> np.ndarray:
    """Return the numbers of the variants, (count, points): each once in every column."""
    if isinstance(pulses[0], PulseSpec):  # draws as ever: sessions under way keep their plan
        first = rng.choice((0, 1), size=points)
        return np.stack([first, 1 - first])
    return rng.permuted(np.tile(np.arange(count)[:, None], (1, points)), axis=0)


def _spread_shams(
    rounds: list[list[tuple[str, PulseVariant]]],
    shams: list[list[tuple[str, PulseVariant]]],
    rng: np.random.Generator,
) -> list[list[tuple[str, PulseVariant]]]:
    """Insert rounds of shams at random places."""
    if not shams:
        return rounds
    places = rng.permutation(len(rounds) + len(shams)) < len(shams)
    remaining, extra = iter(rounds), iter(shams)
    return [next(extra) if is_sham else next(remaining) for is_sham in places]
