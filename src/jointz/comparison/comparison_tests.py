"""Tests between sources, between timing points, and how well people repeat."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd

from jointz.comparison.comparison_cells import Cells, Own, standing
from jointz.comparison.comparison_sources import Results
from jointz.core.channels import PARAMETER_UNITS
from jointz.core.codes import Failure
from jointz.core.errors import DataError, EstimationError
from jointz.core.gait_phases import ALL_POINTS
from jointz.kernels.statistics.anova import holm
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
from jointz.stats.mixed_model import mixed_model

_TOO_FEW = Failure.TOO_FEW_PARTICIPANTS.status
_NO_SPREAD = "no_spread"
Designs = Mapping[tuple[str, str], str]


def between_sources(
    read: Sequence[Results],
    cells: Cells,
    designs: Designs,
    margin_pct: float | None,
) -> tuple[Difference, ...]:
    """Return every pair of sources at every parameter and timing point, first minus second."""
    rows = [
        _difference(place, row[i], row[j], design=designs[names], margin_pct=margin_pct)
        for place, row in cells.items()
        for i, j in combinations(range(len(read)), 2)
        if row[i] and row[j] and (names := (read[i].source.name, read[j].source.name))
    ]
    return _adjusted(rows, "holm")


def _difference(
    place: tuple[str, str],
    first: Own,
    second: Own,
    *,
    design: str,
    margin_pct: float | None,
) -> Difference:
    mine, theirs = standing(first), standing(second)
    if design == PAIRED:
        both = [person for person in mine if person in theirs]
        mine, theirs = {p: mine[p] for p in both}, {p: theirs[p] for p in both}
    a, b = np.array(list(mine.values())), np.array(list(theirs.values()))
    used = [*(first[p] for p in mine), *(second[p] for p in theirs)]
    made = Difference(
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
    if min(a.size, b.size) < 2:
        return replace(made, status=_TOO_FEW)
    test: Callable[[np.ndarray, np.ndarray], MeanDifference] = (
        paired_difference if design == PAIRED else group_difference
    )
    try:
        found = test(a, b)
    except NoSpreadError:
        return replace(made, difference=float(a.mean() - b.mean()), status=_NO_SPREAD)
    margin = None if margin_pct is None else abs(float(b.mean())) * margin_pct / 100.0
    numbers = {name: getattr(found, name) for name in MeanDifference.__slots__ if name != "se"}
    return replace(
        made,
        **numbers,
        effect="" if found.effect_size is None else ("g_z" if design == PAIRED else "g"),
        margin=margin,
        p_equivalence=None if margin is None else found.equivalence_p(margin),
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
    tests: Sequence[FactorTest], cells: Cells, *, adjust: str, error: str
) -> tuple[Difference, ...]:
    """Return the pairs of timing points of one source."""
    rows: list[Difference] = []
    for test in tests:
        if test.fit is None:
            continue
        pairs = _paired_points if error == PAIRED else _pooled_points
        made, sphericity = pairs(test, test.fit, cells), test.fit.repeated_measures
        if sphericity is not None:
            numbers: dict[str, Any] = {
                "epsilon": sphericity.epsilon,
                "p_epsilon": sphericity.p_epsilon,
            }
            made = [replace(row, **numbers) for row in made]
        rows += made
    return _adjusted(rows, adjust)


def _paired_points(test: FactorTest, fit: MixedModelFit, cells: Cells) -> list[Difference]:
    own = {point: cells[test.parameter, point][0] for point in fit.levels}
    return [
        replace(
            _difference((test.parameter, ""), own[a], own[b], design=PAIRED, margin_pct=None),
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
        numbers: dict[str, Any] = {key: float(pair[key]) for key in
                   ("difference", "ci_low", "ci_high", "t", "df", "p")}  # fmt: skip
        rows.append(
            Difference(
                parameter=test.parameter,
                unit=test.unit,
                timing_point="",
                first=pair["first"],
                second=pair["second"],
                design=POOLED,
                n_first=first.n_participants,
                n_second=second.n_participants,
                n_at_bound=at_bound[first.level] + at_bound[second.level],
                mean_first=first.mean,
                mean_second=second.mean,
                **numbers,
            )
        )
    return rows


# --- mixed models and repeatability --------------------------------------------------------------


def factor_tests(
    read: Sequence[Results], cells: Cells, designs: Designs, *, df: str
) -> tuple[FactorTest, ...]:
    """Return a mixed model over timing points of one source, or over three and more sources."""
    if len(read) == 1:
        tests = []
        for parameter in dict.fromkeys(parameter for parameter, _ in cells):
            levels = {point: row[0] for (name, point), row in cells.items() if name == parameter}
            tests.append(_factor((parameter, "timing_point", read[0].source.name), levels, df=df))
        return tuple(tests)
    if len(read) < 3 or GROUPS in designs.values():
        return ()
    return tuple(
        _factor((parameter, "condition", point),
                {r.source.name: own for r, own in zip(read, row, strict=True)}, df=df)
        for (parameter, point), row in cells.items()
        if all(row)
    )  # fmt: skip


def _factor(of: tuple[str, str, str], levels: Mapping[str, Own], *, df: str) -> FactorTest:
    parameter, factor, where = of
    made = FactorTest(parameter, PARAMETER_UNITS[parameter], factor, where, None)
    if set(levels) == {ALL_POINTS}:
        return replace(made, reason="one value a participant, of all timing points")
    rows = [
        (person, level, value)
        for level, own in levels.items()
        for person, value in standing(own).items()
    ]
    if not rows:
        return replace(made, reason="nobody has a value")
    table = pd.DataFrame(rows, columns=["participant", factor, parameter])
    try:
        fit = mixed_model(
            table, response=parameter, within=factor, participant="participant", df=df
        )
    except (DataError, EstimationError) as exc:
        return replace(made, reason=str(exc).removeprefix("mixed_model: "))
    return replace(made, fit=fit)


def repeats_at(place: tuple[str, str], row: Sequence[Own]) -> Repeatability:
    """Return how well the people repeat who have a value in every source."""
    held = [standing(own) for own in row]
    people = [person for person in held[0] if all(person in own for own in held)]
    made = Repeatability(place[0], PARAMETER_UNITS[place[0]], place[1], len(people), len(held))
    if len(people) < 2:
        return replace(made, status=_TOO_FEW)
    try:
        found = repeatability(np.array([[own[p] for own in held] for p in people]))
    except NoSpreadError:
        return replace(made, status=_NO_SPREAD)
    numbers: dict[str, Any] = {}
    for name in ("icc_agreement", "icc_consistency", "sem", "mdc"):
        value, low, high = getattr(found, name)
        numbers |= {name: value, f"{name}_low": low, f"{name}_high": high}
    return replace(made, **numbers)
