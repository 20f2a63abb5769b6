"""The table of a bench report that says whether type and direction of pulses matter (2.2.4)."""

from collections.abc import Mapping
from typing import Any, Final

from jointz.report.wording import DASH, format_number

_METHODS: Final = {
    "dissertation": "least squares over the response (2.2.3)",
    "pulse_likelihood": "errors-in-variables likelihood over 250 ms",
}
_SMALLEST_P: Final = 1e-4
_EFFECTS: Final = ("type", "direction", "joint")


def effects_section(statistics: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return rows and notes of the table, None where no pulse went another way."""
    found = statistics.get("pulse_effects")
    if not found:
        return None
    tests: dict[tuple[str, ...], dict[str, Mapping[str, Any]]] = {}
    for test in found["tests"]:
        if test["effect"] in _EFFECTS:
            key = tuple(str(test[k]) for k in ("case", "trajectory", "response", "effect"))
            tests.setdefault(key, {})[test["analysis"]] = test
    methods = found.get("methods") or ["dissertation"]
    return {
        "rows": [_row(key, pair, found["alpha"]) for key, pair in tests.items()],
        "methods": " and ".join(_METHODS.get(name, name) for name in methods),
        "notes": found["notes"],
    }


def _row(
    key: tuple[str, ...], tests: Mapping[str, Mapping[str, Any]], alpha: float
) -> dict[str, Any]:
    one_way, mixed = tests.get("one_way", {}), tests.get("mixed", {})
    p_holm = mixed.get("p_holm")
    return {
        "case": key[0],
        "trajectory": key[1],
        "response": key[2],
        "effect": "type or direction" if key[3] == "joint" else key[3],
        "one_way": _test(one_way),
        "mixed": _test(mixed),
        "p_holm": _p(p_holm),
        "matters": p_holm is not None and p_holm < alpha,
    }


def _test(test: Mapping[str, Any]) -> dict[str, str]:
    if not test:
        return {"f": "", "p": ""}
    if test.get("p") is None:
        return {"f": str(test.get("code", "")).replace("_", " "), "p": DASH}
    degrees = f"({test['df_num']:.0f}, {test['df_den']:.3g})"
    return {"f": f"{format_number(test['statistic'])} {degrees}", "p": _p(test["p"])}


def _p(value: float | None) -> str:
    if value is None:
        return DASH
    return f"{value:.2g}" if value >= _SMALLEST_P else f"< {_SMALLEST_P:.4f}"
