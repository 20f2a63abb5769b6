"""The quasi-stiffness of people whom nobody perturbed, as the report shows it."""

from typing import Any, Final

from jointz.core.analysis import StudyAnalysis
from jointz.core.quasi_stiffness_fit import Doubt
from jointz.report.wording import DASH, format_interval

_MEASURES: Final = ("slope", "local_slope", "secant")


def quasi_stiffness_section(analysis: StudyAnalysis) -> dict[str, Any] | None:
    """Return what the page says of quasi-stiffness, None where there is none.

    Parameters
    ----------
    analysis : StudyAnalysis
        The analysis.
    """
    found = list(analysis.statistics.get("quasi_stiffness") or ())
    if not found:
        return None
    cells = {
        (row["participant"], row["side"], row["timing_point"]): row["n_strides"] for row in found
    }
    values = {
        (row["participant"], row["side"], row["timing_point"], row["measure"]): row for row in found
    }
    doubts = list(dict.fromkeys(d for row in found for d in row["doubts"].split()))
    return {
        "rows": [
            {
                "participant": f"{participant} {side}".strip(),
                "point": point,
                "n": n,
                "cells": [_cell(values[participant, side, point, m]) for m in _MEASURES],
            }
            for (participant, side, point), n in cells.items()
        ],
        "unit": found[0]["unit"],
        "level": f"{100 * found[0]['ci_level']:g} %",
        "doubts": [(_spoken(code), Doubt(code).meaning) for code in doubts],
    }


def _cell(row: dict[str, Any]) -> dict[str, str]:
    said = ", ".join(map(_spoken, row["doubts"].split()))
    if row["value"] is None:
        return {"text": DASH, "note": said}
    return {"text": format_interval(row["value"], row["ci_low"], row["ci_high"]), "note": said}


def _spoken(code: str) -> str:
    return code.replace("_", " ")
