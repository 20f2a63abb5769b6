"""Cells of a comparison: the values of each parameter, timing point, source and participant."""

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from jointz.comparison.comparison_sources import Results
from jointz.core.channels import PARAMETER_UNITS
from jointz.core.codes import Failure
from jointz.core.errors import DataError
from jointz.core.gait_phases import ALL_POINTS, phase_difference
from jointz.report.wording import ABSOLUTE, PER_MASS
from jointz.results.estimates import FEWEST_PEOPLE, REACH_95
from jointz.results.statistics.comparison_labels import alike_labels, label_key
from jointz.results.statistics.comparison_rows import GROUPS, PAIRED, PersonValue, SourceMean

LEVEL = 0.95
#: Onsets of one timing point that are further apart are noted, or refused.
NOTED_PCT, REFUSED_PCT = 0.5, 2.0

#: Values of one source, by participant.
PersonValues = Mapping[str, PersonValue]
#: Parameter and timing point.
Place = tuple[str, str]
#: The values of every source at each place; empty for a source without this timing point.
Cells = Mapping[Place, Sequence[PersonValues]]
#: Design of the comparison of two sources, by their names.
Designs = Mapping[tuple[str, str], str]


class OnsetGap(NamedTuple):
    """A timing point with different onsets in two results, in % of the gait cycle."""

    point: str  # name of the timing point
    first: str  # name of the first source
    first_pct: float
    second: str  # name of the second source
    second_pct: float
    gap_pct: float  # distance on the cyclic gait cycle

    def __str__(self) -> str:
        return (
            f"{self.point} at {self.first_pct:.1f} % in {self.first} and at "
            f"{self.second_pct:.1f} % in {self.second}"
        )


def onset_gaps(results: Sequence[Results]) -> list[OnsetGap]:
    """Return the timing points of one name with different onsets on the cyclic gait cycle."""
    gaps = []
    for a, b in combinations(results, 2):
        for point, first in a.onsets_pct.items():
            if point not in b.onsets_pct:
                continue
            second = b.onsets_pct[point]
            gap = abs(phase_difference(first, second))
            if gap > NOTED_PCT:
                gaps.append(OnsetGap(point, a.source.name, first, b.source.name, second, gap))
    return gaps


def check_onsets(results: Sequence[Results]) -> None:
    """Refuse timing points of one name that are not the same event."""
    gaps = [gap for gap in onset_gaps(results) if gap.gap_pct > REFUSED_PCT]
    if gaps:
        raise DataError(
            f"compare: timing points of one name are more than {REFUSED_PCT:g} % of the gait cycle "
            f"apart: {'; '.join(map(str, gaps))}. Give both studies the same timing_points, or "
            "different names to different events."
        )


def pair_designs(results: Sequence[Results], *, paired: bool | None) -> dict[tuple[str, str], str]:
    """Return the design of each pair of sources: paired if their people are the same."""
    return {
        (a.source.name, b.source.name): PAIRED if _same_people(a, b, paired=paired) else GROUPS
        for a, b in combinations(results, 2)
    }


def _same_people(first: Results, second: Results, *, paired: bool | None) -> bool:
    a, b = first.source, second.source
    if a.published or b.published:
        return False
    ids, other_ids = set(a.participants), set(b.participants)
    shared, lone = ids & other_ids, ids ^ other_ids
    if paired is None and lone:
        if {label_key(label) for label in ids} == {label_key(label) for label in other_ids}:
            alike = ", ".join(" and ".join(group) for group in alike_labels(sorted(lone)))
            raise DataError(
                f"compare: participants of {a.name} and {b.name} are the same except for case, "
                f"leading zeros or the format of numbers ({alike}). Write equal ids in study.toml "
                "if they are the same people, or add --groups if they are not."
            )
        if shared:
            raise DataError(
                f"compare: {a.name} and {b.name} share {len(shared)} of {len(ids | other_ids)} "
                f"participants ({', '.join(sorted(lone))} in one only). Add --paired to compare "
                "those in both with themselves, or --groups if equal ids are different people."
            )
        return False
    if (paired is None or paired) and len(shared) < 2:
        raise DataError(
            f"compare: --paired needs two participants in both {a.name} and {b.name}, found "
            f"{len(shared)}. Give the same person the same id, or leave --paired out."
        )
    return paired is None or paired


def comparison_cells(results: Sequence[Results]) -> dict[Place, list[PersonValues]]:
    """Return the values of every parameter and timing point."""
    points = list(dict.fromkeys(point for result in results for point in result.points))
    if not any(all(point in result.points for result in results) for point in points):
        raise DataError(
            "compare: no timing point in common: "
            + "; ".join(f"{r.source.name} has {', '.join(r.points) or 'none'}" for r in results)
            + ". Analyse both with the same timing_points."
        )
    shared = any(result.shares_inertia for result in results)
    cells = {}
    for parameter in _parameters(results):
        one_value = parameter == "inertia" and shared
        for point in (ALL_POINTS,) if one_value else points:
            cells[parameter, point] = [_person_values(r, parameter, point) for r in results]
    return cells


def _parameters(results: Sequence[Results]) -> tuple[str, ...]:
    """Return the comparable parameters: values per kg if all studies have masses."""
    if all(result.per_mass for result in results):
        return (*PER_MASS, "inertia")
    if any(result.source.published for result in results):
        return ("inertia",)
    return ABSOLUTE


def _person_values(result: Results, parameter: str, point: str) -> PersonValues:
    people = result.source.participants
    if point == ALL_POINTS:
        return {person: result.shared_inertia(person) for person in people}
    if point not in result.points:
        return {}
    return {person: result.value(parameter, point, person) for person in people}


def available(values: PersonValues) -> dict[str, float]:
    """Return the available values, by participant."""
    return {person: v.value for person, v in values.items() if v.value is not None}


def source_mean(values: PersonValues, place: Place) -> SourceMean:
    """Return the mean over people with its t interval."""
    y = np.array(list(available(values).values()))
    n = y.size
    mean = sd = low = high = None
    if n >= FEWEST_PEOPLE:
        mean, sd = float(y.mean()), float(y.std(ddof=1))
        half = float(stdtrit(n - 1, (1.0 + LEVEL) / 2.0)) * sd / float(np.sqrt(n))
        low, high = mean - half, mean + half
    errors = [
        (v.ci_high - v.ci_low) / (2.0 * REACH_95)
        for v in values.values()
        if v.status == "ok" and v.ci_low is not None and v.ci_high is not None
    ]
    return SourceMean(
        source=next(iter(values.values())).source,
        parameter=place[0],
        unit=PARAMETER_UNITS[place[0]],
        timing_point=place[1],
        n=n,
        n_missing=len(values) - n,
        n_at_bound=sum(v.at_bound for v in values.values()),
        mean=mean,
        sd=sd,
        ci_low=low,
        ci_high=high,
        error_sd=float(np.sqrt(np.mean(np.square(errors)))) if errors else None,
        status=Failure.TOO_FEW_PARTICIPANTS.status if n < FEWEST_PEOPLE else "",
    )
