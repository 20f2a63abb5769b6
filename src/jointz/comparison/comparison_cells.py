"""The values that are compared: by parameter, timing point, source and participant."""

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np
from scipy.special import stdtrit

from jointz.comparison.comparison_sources import Results
from jointz.core.channels import PARAMETER_UNITS
from jointz.core.errors import DataError
from jointz.core.gait_phases import ALL_POINTS
from jointz.results.estimates import REACH_95
from jointz.results.statistics.comparison_labels import alike_labels, label_key
from jointz.results.statistics.comparison_rows import GROUPS, PAIRED, PersonValue, SourceMean

LEVEL = 0.95

#: Values of one source, by participant.
Own = Mapping[str, PersonValue]
#: Parameter and timing point -> values of every source; empty of one that has no such point.
Cells = Mapping[tuple[str, str], Sequence[Own]]


def pair_designs(read: Sequence[Results], *, paired: bool | None) -> dict[tuple[str, str], str]:
    """Return by names of two sources whether their people are the same."""
    designs = {}
    for one, other in combinations(read, 2):
        a, b = one.source, other.source
        mine, theirs = set(a.participants), set(b.participants)
        both = mine & theirs
        same = mine == theirs if paired is None else paired
        if a.published or b.published:
            same = False
        elif (
            paired is None
            and mine != theirs
            and set(map(label_key, mine)) == set(map(label_key, theirs))
        ):
            raise DataError(
                f"compare: participants of {a.name} and {b.name} are the same but for case, "
                f"leading zeros or how a number is written ({_alike_text(mine ^ theirs)}). Write "
                "ids alike in study.toml where they are the same people, or add --groups where "
                "they are not."
            )
        elif paired is None and both and mine != theirs:
            raise DataError(
                f"compare: {a.name} and {b.name} share {len(both)} of {len(mine | theirs)} "
                f"participants ({', '.join(sorted(mine ^ theirs))} in one only). Add --paired to "
                "compare those in both with themselves, or --groups where equal ids are "
                "different people."
            )
        elif same and len(both) < 2:
            raise DataError(
                f"compare: --paired needs two participants in both {a.name} and {b.name}, found "
                f"{len(both)}. Give the same person the same id, or leave --paired out."
            )
        designs[a.name, b.name] = PAIRED if same else GROUPS
    return designs


def _alike_text(labels: set[str]) -> str:
    return ", ".join(" and ".join(group) for group in alike_labels(sorted(labels)))


def _parameters(read: Sequence[Results]) -> tuple[str, ...]:
    """Return what can be compared: per kg where all have masses."""
    if all(results.per_mass for results in read):
        return ("stiffness_per_mass", "damping_per_mass", "inertia")
    if any(results.source.published for results in read):
        return ("inertia",)
    return ("stiffness", "damping", "inertia")


def comparison_cells(read: Sequence[Results]) -> dict[tuple[str, str], list[Own]]:
    """Return the values of every parameter and timing point: by source, by participant."""
    points = list(dict.fromkeys(point for results in read for point in results.points))
    if not any(all(point in results.points for results in read) for point in points):
        raise DataError(
            "compare: no timing point in common: "
            + "; ".join(f"{r.source.name} has {', '.join(r.points) or 'none'}" for r in read)
            + ". Analyse both with the same timing_points."
        )
    shared = any(results.shares_inertia for results in read)
    cells = {}
    for parameter in _parameters(read):
        one = parameter == "inertia" and shared
        for point in (ALL_POINTS,) if one else points:
            cells[parameter, point] = [_of(r, parameter, point) for r in read]
    return cells


def _of(results: Results, parameter: str, point: str) -> Own:
    people = results.source.participants
    if point == ALL_POINTS:
        return {person: results.shared_inertia(person) for person in people}
    if point not in results.points:
        return {}
    return {person: results.value(parameter, point, person) for person in people}


def standing(own: Own) -> dict[str, float]:
    """Return the values that stand, by participant."""
    return {person: v.value for person, v in own.items() if v.value is not None}


def mean_of(own: Own, place: tuple[str, str]) -> SourceMean:
    """Return the mean over people with Student's interval."""
    y = np.array(list(standing(own).values()))
    n = y.size
    mean = sd = half = None
    if n >= 2:
        mean, sd = float(y.mean()), float(y.std(ddof=1))
        half = float(stdtrit(n - 1, (1.0 + LEVEL) / 2.0)) * sd / float(np.sqrt(n))
    errors = [
        (v.ci_high - v.ci_low) / (2.0 * REACH_95)
        for v in own.values()
        if v.status == "ok" and v.ci_low is not None and v.ci_high is not None
    ]
    return SourceMean(
        source=next(iter(own.values())).source,
        parameter=place[0],
        unit=PARAMETER_UNITS[place[0]],
        timing_point=place[1],
        n=n,
        n_missing=len(own) - n,
        n_at_bound=sum(v.at_bound for v in own.values()),
        mean=mean,
        sd=sd,
        ci_low=None if mean is None or half is None else mean - half,
        ci_high=None if mean is None or half is None else mean + half,
        error_sd=float(np.sqrt(np.mean(np.square(errors)))) if errors else None,
    )
