"""Tests whether timing points, sessions or sides differ, of the decided values of people."""

from collections.abc import Sequence
from typing import Any, Final

import pandas as pd

from jointz.core.errors import DataError, EstimationError
from jointz.core.gait_phases import ALL_POINTS
from jointz.results.estimates import CellEstimate
from jointz.results.statistics.mixed_model_fit import MixedModelFit
from jointz.stats.mixed_models import mixed_model

_PARAMETERS: Final = ("stiffness", "damping", "inertia")
#: Levels of fewer participants are not tested.
_FEWEST_PEOPLE: Final = 3
#: Factors of which the levels are compared within a participant.
_FACTORS: Final = ("timing_point", "session", "side")


def level_tests(cells: Sequence[CellEstimate]) -> dict[str, Any]:
    """Return the tests of each parameter and factor, as statistics; empty if none is possible.

    K, B and J with status ``ok`` enter as rows of ``value ~ level + (1 | participant)``. Of a
    participant with several sessions and sides (or, between sessions and sides, timing points),
    those count that have a value at every level that the participant has; they are averaged.
    """
    tests = [
        test
        for factor in _FACTORS
        for parameter in _PARAMETERS
        if (test := _test(cells, factor, parameter)) is not None
    ]
    return {"level_tests": tests} if tests else {}


def _test(cells: Sequence[CellEstimate], factor: str, parameter: str) -> dict[str, Any] | None:
    estimates = _estimates(cells, factor, parameter)
    decided = estimates[estimates["status"] == "ok"]
    levels = _known_levels(decided)
    table = _averaged(decided[decided["level"].isin(levels)])
    if len(levels) < 2 or _known_levels(table) != levels:
        return None
    table["level"] = pd.Categorical(table["level"], categories=levels)
    try:
        fit = mixed_model(table, response="value", within="level", participant="participant")
    except (DataError, EstimationError):  # values that do not vary, or of too few people
        return None
    tested = estimates[estimates["level"].isin(levels)]
    return {
        "factor": factor,
        "parameter": parameter,
        "levels": levels,
        "n_participants": fit.n_participants,
        "n_values": fit.n_rows,
        "n_without_value": int((tested["status"] != "ok").sum()),
        **_f_test(fit),
        "pairs": fit.pairs("holm", error="paired").to_dict("records"),
    }


def _f_test(fit: MixedModelFit) -> dict[str, Any]:
    """Return the F test, with Greenhouse and Geisser's p if no value is missing."""
    test, complete = fit.f_test, fit.repeated_measures
    return {
        "F": test.F,
        "df_num": test.df_num,
        "df_den": test.df_den,
        "p": test.p if complete is None else complete.p_epsilon,
        "p_of": "kenward-roger" if complete is None else "greenhouse-geisser",
    }


def _estimates(cells: Sequence[CellEstimate], factor: str, parameter: str) -> pd.DataFrame:
    """Return level, value and status of each estimate, and what else tells it from others."""
    others = [name for name in _FACTORS if name != factor]
    rows = [
        (
            cell.participant,
            str(getattr(cell, factor)),
            *(str(getattr(cell, name)) for name in others),
            estimate.value,
            estimate.status,
        )
        for cell in cells
        if (estimate := cell.parameter(parameter)) is not None
        and cell.timing_point != ALL_POINTS
        and getattr(cell, factor)
    ]
    names = ["participant", "level", "context_1", "context_2", "value", "status"]
    return pd.DataFrame(rows, columns=names)


def _known_levels(table: pd.DataFrame) -> list[str]:
    """Return the levels with enough participants, in order of appearance."""
    people = table.groupby("level", sort=False)["participant"].nunique()
    enough = set(people.index[people >= _FEWEST_PEOPLE])
    return [level for level in dict.fromkeys(table["level"]) if level in enough]


def _averaged(table: pd.DataFrame) -> pd.DataFrame:
    """Return one value a participant and level, over contexts with all levels of the person."""
    own = table.groupby("participant")["level"].transform("nunique")
    context = ["participant", "context_1", "context_2"]
    complete = table[table.groupby(context)["level"].transform("nunique") == own]
    means = complete.groupby(["participant", "level"], sort=False)["value"].mean()
    return means.reset_index()
