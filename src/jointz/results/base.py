"""The parameters of a fit: found, tabulated, told and saved alike by every result class."""

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from jointz.results.estimates import ParameterEstimate

_SYMBOLS = {"stiffness": "K", "damping": "B", "inertia": "J"}
_SAME_IN_DICT = ("value", "status", "ci_level", "ci_method", "share_at_bound", "unbounded")


def checked_values(data: Mapping[str, Any], schema: str) -> dict[str, Any]:
    """Return a saved result without its schema, after checking it."""
    if data.get("schema") != schema:
        raise ValueError(f"expected schema {schema!r}, got {data.get('schema')!r}")
    return {name: value for name, value in data.items() if name != "schema"}


def find_parameter(parameters: Sequence[ParameterEstimate], name: str) -> ParameterEstimate:
    """Return a parameter by name."""
    for parameter in parameters:
        if parameter.name == name:
            return parameter
    known = ", ".join(p.name for p in parameters)
    raise KeyError(f"no parameter {name!r} in this fit; it has {known}")


def parameter_frame(parameters: Sequence[ParameterEstimate], **same: Any) -> pd.DataFrame:
    """Return one row a parameter, and columns that are the same in all rows."""
    columns = ("value", "unit", "ci_low", "ci_high", "ci_level", "status")
    rows = [{"parameter": p.name} | {c: getattr(p, c) for c in columns} | same for p in parameters]
    return pd.DataFrame(rows)


def parameters_to_dict(parameters: Sequence[ParameterEstimate]) -> dict[str, dict[str, Any]]:
    """Return parameters by name, as ``--json`` prints them."""
    return {
        p.name: {name: getattr(p, name) for name in _SAME_IN_DICT}
        | {"unit": p.unit, "ci": [p.ci_low, p.ci_high]}
        for p in parameters
    }


def parameters_from_dict(data: Mapping[str, Mapping[str, Any]]) -> tuple[ParameterEstimate, ...]:
    """Rebuild from :func:`parameters_to_dict`."""
    return tuple(
        ParameterEstimate(
            name=name,
            ci_low=entry["ci"][0],
            ci_high=entry["ci"][1],
            **{key: entry[key] for key in _SAME_IN_DICT},
        )
        for name, entry in data.items()
    )


def parameter_line(parameter: ParameterEstimate) -> str:
    """Return a line of a summary."""
    if parameter.value is None:
        return f"{parameter.name:<10} {parameter.status}"
    interval = f"{parameter.ci_low:.4g} to {parameter.ci_high:.4g}"
    measure = f"{parameter.name:<10} {parameter.value:.4g} {parameter.unit}"
    return f"{measure} ({parameter.ci_level:.0%} interval {interval}; {parameter.status})"


def parameter_label(parameter: ParameterEstimate) -> str:
    """Return a short label for a figure."""
    symbol = _SYMBOLS[parameter.name]
    if parameter.value is None:
        return f"{symbol} {parameter.status}"
    return f"{symbol} = {parameter.value:.3g} {parameter.unit}"
