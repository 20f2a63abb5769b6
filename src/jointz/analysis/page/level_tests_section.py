"""Section of the report with the tests between timing points, sessions and sides."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from jointz.analysis.device_effect import stored_device_effect
from jointz.report.wording import format_number, parameter_name
from jointz.results.study_analysis import StudyAnalysis

_FACTORS: Final = {"timing_point": "Timing point", "session": "Session", "side": "Side"}
_ALPHA: Final = 0.05
_SMALLEST_P: Final = 1e-3
#: More pairs than these would hide the result.
_MOST_PAIRS: Final = 6


def level_tests_section(statistics: Mapping[str, Any]) -> list[dict[str, str]]:
    """Return a row for each test."""
    return [
        {
            "factor": _FACTORS[test["factor"]],
            "parameter": parameter_name(test["parameter"]),
            "f": f"F({test['df_num']:.0f}, {test['df_den']:.3g}) = {format_number(test['F'])}",
            "p": format_p(test["p"]),
            "pairs": _pairs(test),
            "n": f"{test['n_participants']} ({test['n_values']})",
            "missing": str(test["n_without_value"]),
        }
        for test in statistics.get("level_tests") or ()
    ]


def format_p(p: float) -> str:
    """Write a probability."""
    if not np.isfinite(p):
        return "not available"
    return f"{p:.3f}" if p >= _SMALLEST_P else f"< {_SMALLEST_P:g}"


def device_effect_section(analysis: StudyAnalysis) -> dict[str, Any] | None:
    """Return the test of the device's effect on the angle; None without mean strides or test."""
    test = stored_device_effect(analysis.statistics)
    if test is None:
        return {"tested": False} if analysis.mean_strides else None
    nodes = len(test.t) - 1
    return {
        "tested": True,
        "n": test.n_a,
        "joint": analysis.settings.get("joint", "joint"),
        "spans": [
            f"{100 * c.start_node / nodes:.0f} to {100 * c.end_node / nodes:.0f} % "
            f"(p {_with_sign(format_p(c.p))})"
            for c in test.clusters
        ],
    }


def _with_sign(p: str) -> str:
    return p if p.startswith("<") else f"= {p}"


def _pairs(test: Mapping[str, Any]) -> str:
    """Name the pairs that differ, the larger level first."""
    if len(test["levels"]) == 2:
        return _pair(test["pairs"][0]) if test["p"] < _ALPHA else "none"
    different = [p for p in test["pairs"] if p["p_adjusted"] < _ALPHA]
    if not different:
        return "none"
    if len(different) > _MOST_PAIRS:
        return f"{len(different)} of {len(test['pairs'])}"
    return ", ".join(map(_pair, different))


def _pair(pair: Mapping[str, Any]) -> str:
    names = (pair["first"], pair["second"])
    larger, smaller = names if pair["difference"] > 0 else reversed(names)
    return f"{larger} > {smaller}"
