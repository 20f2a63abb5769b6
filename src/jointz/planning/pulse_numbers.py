"""Half-widths of drawn legs over the number of pulses at a timing point."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from jointz.identify.preparation.cell_data import PARAMETERS
from jointz.identify.walking.estimands import LogMoments
from jointz.kernels.statistics.power import smallest_effect
from jointz.planning.laboratory import Laboratory
from jointz.planning.plan_result import PlannedPeople
from jointz.planning.predicted_estimates import ENDLESS, LegEstimates, PlannedLeg
from jointz.planning.predicted_responses import Design
from jointz.results.estimates import relative_half_width
from jointz.stats.expected_people import ExpectedPeople

#: Rounds of all variants at which legs are computed; between them half-widths are interpolated.
_ROUNDS = (1, 4, 12, 30)
#: Fewest and most pulses of a timing point.
_FEWEST, MOST = 6, 240


@dataclass(frozen=True, slots=True, eq=False)
class HalfWidths:
    """Half-widths of a typical leg and of drawn legs, by number of pulses."""

    legs: tuple[PlannedLeg, ...]
    step: int  # pulses in a round of all variants
    counts: np.ndarray  # (count,) pulses of a timing point
    typical: np.ndarray  # (count, parameter, point)
    drawn: np.ndarray  # (leg, count, parameter, point)

    def assured(self, count: float, share: float) -> np.ndarray:
        """Return the half-widths that a share of legs does not exceed, (parameter, point).

        Few legs are drawn: the ratio of their half-widths to the typical ones is taken to be the
        same at all timing points.
        """
        over = self.drawn / self.typical
        ratio = np.quantile(
            over.swapaxes(0, 1).swapaxes(1, 2).reshape(*over.shape[1:3], -1), share, axis=2
        )
        at, logs = np.log(self.counts), np.log(self.typical * ratio[:, :, None])
        where = float(np.clip(np.log(count), at[0], at[-1]))
        upper = int(np.clip(np.searchsorted(at, where), 1, at.size - 1))
        part = (where - at[upper - 1]) / (at[upper] - at[upper - 1])
        return np.asarray(np.exp((1.0 - part) * logs[upper - 1] + part * logs[upper]))

    def of_legs(self, counts: Mapping[str, float]) -> list[LegEstimates]:
        """Return what is expected of every leg with numbers of pulses, two legs at a time."""
        with ThreadPoolExecutor(max_workers=2) as pool:
            return list(pool.map(lambda leg: leg.estimates(counts), self.legs))

    def fewest(self, parameters: Sequence[int], share: float, wish: float) -> dict[str, int]:
        """Return the fewest pulses that keep a wish, of the timing points where some do."""
        kept = zip(self.points, (self._widest(parameters, share) <= wish).T, strict=True)
        return {name: allowed(self.step)[at.argmax()] for name, at in kept if at.any()}

    def most_precise(
        self,
        parameters: Sequence[int],
        share: float,
        fits: Callable[[Mapping[str, int]], bool],
    ) -> tuple[dict[str, int], float]:
        """Return the pulses that fit and make the widest half-width smallest, and that half-width.

        Rounds are added where the half-width is widest; the fewest pulses need not fit.
        """
        rounds, widest = allowed(self.step), self._widest(parameters, share)
        counts = dict.fromkeys(self.points, rounds[0])
        width = dict(zip(self.points, widest[0], strict=True))
        growing = list(self.points)
        while growing:
            name = max(growing, key=width.__getitem__)
            more = counts | {name: counts[name] + self.step}
            if more[name] in rounds and fits(more):
                counts = more
                width[name] = widest[rounds.index(more[name]), self.points.index(name)]
            else:
                growing.remove(name)
        return counts, float(max(width.values()))

    @property
    def points(self) -> list[str]:
        """Names of the timing points."""
        return [point.label for point in self.legs[0].model.points]

    def _widest(self, parameters: Sequence[int], share: float) -> np.ndarray:
        """Return the widest half-width of parameters, (allowed number of pulses, point)."""
        rows = [self.assured(n, share)[list(parameters)].max(axis=0) for n in allowed(self.step)]
        return np.stack(rows)


def allowed(step: int) -> range:
    """Return numbers of pulses of a timing point: whole rounds of all variants."""
    first = step * -(-_FEWEST // step)
    return range(first, max(MOST, first) + 1, step)


def half_widths(
    lab: Laboratory,
    design: Design,
    middle: PlannedLeg,
    legs: Sequence[np.ndarray],
    *,
    tell: Callable[[], None] = lambda: None,
) -> HalfWidths:
    """Compute the typical leg, and legs of these parameters, two at a time."""
    points, step = list(lab.walking[0]), len(design.variants)
    counts = np.array([step * -(-r * 8 // step) for r in _ROUNDS])

    def one(number: int) -> tuple[PlannedLeg, np.ndarray]:
        leg = PlannedLeg(lab, design, number, legs[number])
        rows = [leg.estimates(dict.fromkeys(points, float(n))).half_width for n in counts]
        return leg, np.stack(rows)

    results = []
    with ThreadPoolExecutor(max_workers=2) as pool:
        for result in pool.map(one, range(len(legs))):
            results.append(result)
            tell()
    planned, half = zip(*results, strict=True)
    # The ratio of legs to the typical one hardly changes from here to endless pulses.
    drawn = np.stack([np.concatenate([h, h[-1:]]) for h in half])
    counts = np.append(counts, ENDLESS)
    typical = [middle.estimates(dict.fromkeys(points, float(n))).half_width for n in counts]
    drawn[:, -1] *= typical[-1] / typical[-2]
    return HalfWidths(tuple(planned), step, counts, np.stack(typical), drawn)


#: Directions without information keep their matrix regular.
_LEAST_PRECISION = 1e-6


def expected_people(
    moments: LogMoments, decided: np.ndarray, gain_sd: float
) -> ExpectedPeople | None:
    """Return people who are all measured as a leg with these moments; None if nothing is decided.

    ``decided`` (parameter, point): others have no mean that an analysis would give.
    """
    kept = np.flatnonzero(decided.ravel())
    if not kept.size:
        return None
    square = np.ix_(kept, kept)
    shares = moments.shares[kept]
    relative = np.outer(shares, shares)
    inverse = np.linalg.inv(moments.covariance[square] / relative)
    prior_inverse = np.linalg.inv(moments.prior_covariance[square] / relative)
    values, vectors = np.linalg.eigh(inverse - prior_inverse)
    n_points = decided.shape[1]
    return ExpectedPeople(
        parameters=kept // n_points,
        places=kept % n_points,
        precision=(vectors * values.clip(_LEAST_PRECISION)) @ vectors.T,
        own_sd=np.sqrt(np.diag(moments.covariance)[kept]) / shares,
        gain_sd=gain_sd,
    )


def people_rows(expected: ExpectedPeople | None, n: int, power: float) -> list[PlannedPeople]:
    """Return half-widths and detectable differences of K, B and J, as far as decided."""
    if expected is None:
        return []
    mean, difference, own = expected.mean_sd(n), expected.difference_sd(), expected.person_sd()
    paired, groups = smallest_effect(n, power), smallest_effect(n, power, design="groups")
    rows = []
    for number in np.unique(expected.parameters):
        at = expected.parameters == number
        rows.append(
            PlannedPeople(
                participants=n,
                parameter=PARAMETERS[number],
                mean_pct=100.0 * relative_half_width(float(np.median(mean[at]))),
                paired_pct=100.0 * float(np.expm1(paired * np.median(difference[at]))),
                groups_pct=100.0 * float(np.expm1(groups * np.median(own[at]))),
                difference_half_width_pct=100.0
                * relative_half_width(float(np.median(difference[at])) / np.sqrt(n)),
            )
        )
    return rows
