"""Section of a bench report on effects of type and direction of pulses (2.2.4)."""

from collections.abc import Mapping
from typing import Any, Final

from jointz.report.wording import DASH, format_number

_METHODS: Final = {
    "dissertation": "least squares over the response (2.2.3)",
    "pulse_likelihood": "errors-in-variables likelihood over 250 ms",
}
_SMALLEST_P: Final = 1e-4
_EFFECTS: Final = {
    "type": "type",
    "direction": "direction",
    "joint": "type or direction",
}


def effects_section(statistics: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return rows and notes of the table, None if pulses had one direction only."""
    effects = statistics.get("pulse_effects")
    if not effects:
        return None
    tests: dict[tuple[str, ...], dict[str, Mapping[str, Any]]] = {}
    for test in effects["tests"]:
        if test["effect"] in _EFFECTS:
            key = tuple(str(test[k]) for k in ("case", "trajectory", "response", "effect"))
            tests.setdefault(key, {})[test["analysis"]] = test
    methods = effects.get("methods") or ["dissertation"]
    return {
        "rows": [_row(key, pair, effects["alpha"]) for key, pair in tests.items()],
        "methods": " and ".join(_METHODS.get(name, name) for name in methods),
        "notes": effects["notes"],
    }


def _row(
    key: tuple[str, ...], tests: Mapping[str, Mapping[str, Any]], alpha: float
) -> dict[str, Any]:
    case, trajectory, response, effect = key
    p_holm = tests.get("mixed", {}).get("p_holm")
    return {
        "case": case,
        "trajectory": trajectory,
        "response": response,
        "effect": _EFFECTS[effect],
        **{name: _test(tests.get(name, {})) for name in ("one_way", "mixed")},
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
