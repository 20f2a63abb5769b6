"""Tests between sources and between timing points, and repeatability."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd

from jointz.comparison.comparison_cells import Cells, Designs, PersonValues, Place, available
from jointz.comparison.comparison_sources import Results
from jointz.comparison.people_comparison import ComparedPeople
from jointz.core.channels import PARAMETER_UNITS
from jointz.core.codes import Failure
from jointz.core.errors import DataError, EstimationError
from jointz.core.gait_phases import ALL_POINTS
from jointz.kernels.statistics.anova import holm
from jointz.results.estimates import FEWEST_PEOPLE
from jointz.results.statistics.comparison_rows import (
    GROUPS,
    PAIRED,
    POOLED,
    Difference,
    FactorTest,
    Repeatability,
)
from jointz.results.statistics.mixed_model_fit import MixedModelFit
from jointz.stats.comparison import (
    MeanDifference,
    NoSpreadError,
    group_difference,
    paired_difference,
    repeatability,
)
from jointz.stats.mixed_models import mixed_model

_TOO_FEW = Failure.TOO_FEW_PARTICIPANTS.status
_NO_SPREAD = "no_spread"


def between_sources(
    results: Sequence[Results],
    cells: Cells,
    designs: Designs,
    people: ComparedPeople,
    *,
    margin_pct: float | None,
) -> tuple[Difference, ...]:
    """Return the differences of all pairs of sources at each place, first minus second."""
    rows = [
        people.between_sources(place, a, b, design=designs[names], margin_pct=margin_pct)
        or _difference(place, a, b, design=designs[names], margin_pct=margin_pct)
        for place, row in cells.items()
        for (first, a), (second, b) in combinations(zip(results, row, strict=True), 2)
        if a and b and (names := (first.source.name, second.source.name))
    ]
    return _adjusted(rows, "holm")


def _difference(
    place: Place,
    first: PersonValues,
    second: PersonValues,
    *,
    design: str,
    margin_pct: float | None = None,
) -> Difference:
    values, others = available(first), available(second)
    if design == PAIRED:
        shared = [person for person in values if person in others]
        values, others = ({p: own[p] for p in shared} for own in (values, others))
    a, b = np.array(list(values.values())), np.array(list(others.values()))
    used = [*(first[p] for p in values), *(second[p] for p in others)]
    row = Difference(
        parameter=place[0],
        unit=PARAMETER_UNITS[place[0]],
        timing_point=place[1],
        first=next(iter(first.values())).source,
        second=next(iter(second.values())).source,
        design=design,
        n_first=a.size,
        n_second=b.size,
        n_at_bound=sum(v.at_bound for v in used),
        mean_first=float(a.mean()) if a.size else None,
        mean_second=float(b.mean()) if b.size else None,
    )
    if min(a.size, b.size) < FEWEST_PEOPLE:
        return replace(row, status=_TOO_FEW)
    try:
        test = paired_difference(a, b) if design == PAIRED else group_difference(a, b)
    except NoSpreadError:
        return replace(row, difference=float(a.mean() - b.mean()), status=_NO_SPREAD)
    margin = None if margin_pct is None else abs(float(b.mean())) * margin_pct / 100.0
    numbers = {name: getattr(test, name) for name in MeanDifference.__slots__ if name != "se"}
    return replace(
        row,
        **numbers,
        effect="" if test.effect_size is None else ("g_z" if design == PAIRED else "g"),
        margin=margin,
        p_equivalence=None if margin is None else test.equivalence_p(margin),
    )


_ADJUST: Mapping[str, Callable[[np.ndarray], np.ndarray]] = {
    "holm": holm,
    "bonferroni": lambda p: np.minimum(p * p.size, 1.0),
    "none": lambda p: p,
}


def _adjusted(rows: Sequence[Difference], adjust: str) -> tuple[Difference, ...]:
    """Adjust p over all differences of a parameter."""
    adjusted: dict[int, float] = {}
    for parameter in dict.fromkeys(row.parameter for row in rows):
        tested = [(i, row.p) for i, row in enumerate(rows)
                  if row.parameter == parameter and row.p is not None]  # fmt: skip
        p = _ADJUST[adjust](np.array([p for _, p in tested]))
        adjusted |= {i: float(value) for (i, _), value in zip(tested, p, strict=True)}
    return tuple(replace(row, p_adjusted=adjusted.get(i)) for i, row in enumerate(rows))


def between_points(
    tests: Sequence[FactorTest], cells: Cells, people: ComparedPeople, *, adjust: str, error: str
) -> tuple[Difference, ...]:
    """Return the differences of all pairs of timing points of one source."""
    pairs = _paired_points if error == PAIRED else _pooled_points
    rows: list[Difference] = []
    for test in tests:
        points = [point for parameter, point in cells if parameter == test.parameter]
        if (
            error == PAIRED
            and (together := people.between_points(test.parameter, points, cells)) is not None
        ):
            differences = together
        elif test.fit is not None:
            differences = pairs(test, test.fit, cells)
        else:
            continue
        sphericity = None if test.fit is None else test.fit.repeated_measures
        if sphericity is not None:
            epsilon, p_epsilon = sphericity.epsilon, sphericity.p_epsilon
            differences = [replace(d, epsilon=epsilon, p_epsilon=p_epsilon) for d in differences]
        rows += differences
    return _adjusted(rows, adjust)


def _paired_points(test: FactorTest, fit: MixedModelFit, cells: Cells) -> list[Difference]:
    values = {point: cells[test.parameter, point][0] for point in fit.levels}
    return [
        replace(
            _difference((test.parameter, ""), values[a], values[b], design=PAIRED),
            first=a,
            second=b,
        )
        for a, b in combinations(fit.levels, 2)
    ]


def _pooled_points(test: FactorTest, fit: MixedModelFit, cells: Cells) -> list[Difference]:
    means = {m.level: m for m in fit.means}
    at_bound = {
        point: sum(v.at_bound for v in cells[test.parameter, point][0].values()) for point in means
    }
    rows = []
    for pair in fit.pairs("none").to_dict("records"):
        first, second = means[pair["first"]], means[pair["second"]]
        numbers: dict[str, Any] = {
            key: float(pair[key]) for key in ("difference", "ci_low", "ci_high", "t", "df", "p")
        }
        row = Difference(
            parameter=test.parameter,
            unit=test.unit,
            timing_point="",
            first=first.level,
            second=second.level,
            design=POOLED,
            n_first=first.n_participants,
            n_second=second.n_participants,
            n_at_bound=at_bound[first.level] + at_bound[second.level],
            mean_first=first.mean,
            mean_second=second.mean,
            **numbers,
        )
        rows.append(row)
    return rows


# --- mixed models and repeatability --------------------------------------------------------------


def factor_tests(
    results: Sequence[Results], cells: Cells, designs: Designs, *, df: str
) -> tuple[FactorTest, ...]:
    """Return mixed models over timing points of one source, or over three and more sources."""
    if len(results) == 1:
        levels: dict[str, dict[str, PersonValues]] = {}
        for (parameter, point), (values,) in cells.items():
            levels.setdefault(parameter, {})[point] = values
        name = results[0].source.name
        return tuple(
            _factor_test(parameter, "timing_point", name, values, df=df)
            for parameter, values in levels.items()
        )
    if len(results) < 3 or GROUPS in designs.values():
        return ()
    names = [result.source.name for result in results]
    return tuple(
        _factor_test(parameter, "condition", point, dict(zip(names, row, strict=True)), df=df)
        for (parameter, point), row in cells.items()
        if all(row)
    )


def _factor_test(
    parameter: str, factor: str, where: str, levels: Mapping[str, PersonValues], *, df: str
) -> FactorTest:
    test = FactorTest(parameter, PARAMETER_UNITS[parameter], factor, where, None)
    if set(levels) == {ALL_POINTS}:
        return replace(test, reason="one value for each participant, of all timing points")
    rows = [
        (person, level, value)
        for level, values in levels.items()
        for person, value in available(values).items()
    ]
    if not rows:
        return replace(test, reason="no participant has a value")
    table = pd.DataFrame(rows, columns=["participant", factor, parameter])
    try:
        fit = mixed_model(
            table, response=parameter, within=factor, participant="participant", df=df
        )
    except (DataError, EstimationError) as exc:
        return replace(test, reason=str(exc).removeprefix("mixed_model: "))
    return replace(test, fit=fit)


def repeats_at(place: Place, row: Sequence[PersonValues]) -> Repeatability:
    """Return the repeatability over the people with a value in every source."""
    sources = [available(values) for values in row]
    people = [person for person in sources[0] if all(person in values for values in sources)]
    result = Repeatability(place[0], PARAMETER_UNITS[place[0]], place[1], len(people), len(sources))
    if len(people) < 2:
        return replace(result, status=_TOO_FEW)
    try:
        statistics = repeatability(np.array([[values[p] for values in sources] for p in people]))
    except NoSpreadError:
        return replace(result, status=_NO_SPREAD)
    numbers: dict[str, Any] = {}
    for name in ("icc_agreement", "icc_consistency", "sem", "mdc"):
        value, low, high = getattr(statistics, name)
        numbers |= {name: value, f"{name}_low": low, f"{name}_high": high}
    return replace(result, **numbers)
