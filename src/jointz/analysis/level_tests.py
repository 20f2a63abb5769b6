"""Tests whether timing points, sessions or sides differ, of the decided values of people."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import pandas as pd

from jointz.core.errors import DataError, EstimationError
from jointz.core.gait_phases import ALL_POINTS
from jointz.results.estimates import CellEstimate
from jointz.stats.mixed_models import mixed_model

_PARAMETERS: Final = ("stiffness", "damping", "inertia")
#: Fewer participants have no test.
_FEWEST_PEOPLE: Final = 3
#: Factors of which the levels are compared within a participant.
_FACTORS: Final = ("timing_point", "session", "side")


@dataclass(frozen=True, slots=True)
class _Value:
    """A decided value of a participant at a level."""

    participant: str
    level: str
    point: str
    value: float


def level_tests(cells: Sequence[CellEstimate]) -> dict[str, Any]:
    """Return the tests of each parameter and factor, as statistics; empty if none is possible.

    K, B and J with status ``ok`` enter as rows of ``value ~ level + (1 | participant)`` with the
    degrees of freedom of Kenward and Roger; pairs are adjusted by Holm.
    """
    tests = [
        test
        for factor in _FACTORS
        for parameter in _PARAMETERS
        for test in _tests(cells, factor, parameter)
    ]
    return {"level_tests": tests} if tests else {}


def _tests(cells: Sequence[CellEstimate], factor: str, parameter: str) -> Iterator[dict[str, Any]]:
    values = list(_values(cells, factor, parameter))
    levels = list(dict.fromkeys(v.level for v in values))
    people = {v.participant for v in values}
    if len(levels) < 2 or len(people) < _FEWEST_PEOPLE:
        return
    table = pd.DataFrame([(v.participant, v.level, v.point, v.value) for v in values],
                         columns=["participant", "level", "point", "value"])  # fmt: skip
    if factor != "timing_point":
        table = _over_common_points(table, len(levels))
    table["level"] = pd.Categorical(table["level"], categories=levels)
    try:
        fit = mixed_model(table, response="value", within="level", participant="participant")
        pairs = fit.pairs("holm")
    except (DataError, EstimationError):  # too few values, or no spread
        return
    planned = len({c.participant for c in cells}) * len(levels)
    yield {
        "factor": factor,
        "parameter": parameter,
        "levels": levels,
        "n_participants": fit.n_participants,
        "n_values": fit.n_rows,
        "n_without_value": planned - fit.n_rows,
        "F": fit.f_test.F,
        "df_num": fit.f_test.df_num,
        "df_den": fit.f_test.df_den,
        "p": fit.f_test.p,
        "pairs": pairs.to_dict("records"),
    }


def _values(cells: Sequence[CellEstimate], factor: str, parameter: str) -> Iterator[_Value]:
    for cell in cells:
        estimate = cell.parameter(parameter)
        level = str(getattr(cell, factor))
        if estimate is None or estimate.status != "ok" or estimate.value is None or not level:
            continue
        if factor == "timing_point" and level == ALL_POINTS:
            continue
        yield _Value(cell.participant, level, cell.timing_point, estimate.value)


def _over_common_points(table: pd.DataFrame, n_levels: int) -> pd.DataFrame:
    """Average a participant's levels over the timing points that have a value at each level."""
    counts = table.groupby(["participant", "point"])["level"].transform("nunique")
    common = table[counts == n_levels].groupby(["participant", "level"], sort=False)["value"]
    return common.mean().reset_index()
