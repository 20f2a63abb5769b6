"""What result types have in common: JSON, a short ``repr``, and the parameters of a fit."""

from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

import numpy as np
import pandas as pd
from pydantic import BeforeValidator, InstanceOf, TypeAdapter

if TYPE_CHECKING:
    from jointz.results.estimates import ParameterEstimate

_SYMBOLS = {"stiffness": "K", "damping": "B", "inertia": "J"}
_PLAIN = {bool, int, float, str, type(None)}
_REPR_LINES = 10


def _as_array(value: Any) -> Any:
    return np.asarray(value, dtype=float) if isinstance(value, list) else value


#: An array of numbers, which JSON has as lists.
Array = Annotated[InstanceOf[np.ndarray], BeforeValidator(_as_array)]


class Result:
    """Base of result types, which are frozen data classes.

    ``SCHEMA`` names a type and its version in files; ``SHOWN`` lists properties that JSON holds
    beside the fields.
    """

    __slots__ = ()
    SCHEMA: ClassVar[str] = ""
    SHOWN: ClassVar[tuple[str, ...]] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for JSON."""
        head: dict[str, Any] = {"schema": self.SCHEMA} if self.SCHEMA else {}
        return head | _fields_of(self) | {name: plain(getattr(self, name)) for name in self.SHOWN}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Rebuild from :meth:`to_dict`; raise ValueError for another schema or wrong values."""
        values = checked_values(data, cls.SCHEMA) if cls.SCHEMA else dict(data)
        made: Self = _adapter(cls).validate_python(values)  # type: ignore[arg-type]
        return made

    def summary(self) -> str:
        """Return a short text."""
        return ", ".join(f"{name}={value!r}"[:60] for name, value in _fields_of(self).items())[:300]

    def __repr__(self) -> str:
        lines = [f"{type(self).__name__}:", *self.summary().splitlines()]
        return "\n".join(lines[: _REPR_LINES - 1] + ["..."] * (len(lines) >= _REPR_LINES))


class Fit(Result):
    """Base of fits with parameters, which JSON holds by name."""

    __slots__ = ()
    if TYPE_CHECKING:
        parameters: "tuple[ParameterEstimate, ...]"

    def parameter(self, name: str) -> "ParameterEstimate":
        """Return a parameter by name; raise KeyError where the fit has none of this name."""
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        known = ", ".join(p.name for p in self.parameters)
        raise KeyError(f"no parameter {name!r} in this fit; it has {known}")

    @property
    def stiffness(self) -> "ParameterEstimate":
        """The stiffness K."""
        return self.parameter("stiffness")

    @property
    def damping(self) -> "ParameterEstimate":
        """The damping B."""
        return self.parameter("damping")

    @property
    def inertia(self) -> "ParameterEstimate":
        """The inertia J."""
        return self.parameter("inertia")

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for JSON."""
        by_name = {}
        for entry in (_fields_of(p) for p in self.parameters):
            name, low, high = (entry.pop(key) for key in ("name", "ci_low", "ci_high"))
            unit = self.parameter(name).unit
            by_name[name] = entry | {"unit": unit, "ci": [low, high]}
        return super().to_dict() | {"parameters": by_name}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Rebuild from :meth:`to_dict`; raise ValueError for another schema or wrong values."""
        parameters = [
            {**entry, "name": name, "ci_low": entry["ci"][0], "ci_high": entry["ci"][1]}
            for name, entry in checked_values(data, cls.SCHEMA)["parameters"].items()
        ]
        return super().from_dict({**data, "parameters": parameters})


def checked_values(data: Mapping[str, Any], schema: str) -> dict[str, Any]:
    """Return a saved result without its schema, after checking it."""
    if data.get("schema") != schema:
        raise ValueError(f"expected schema {schema!r}, got {data.get('schema')!r}")
    return {name: value for name, value in data.items() if name != "schema"}


def plain(value: Any) -> Any:
    """Return a value as JSON has it: data classes as dictionaries, tuples and arrays as lists."""
    if type(value) in _PLAIN:
        return value
    if isinstance(value, Result):
        return value.to_dict()
    if is_dataclass(value):
        return _fields_of(value)
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return value.tolist()
    return str(value) if isinstance(value, Path) else value


def _fields_of(made: Any) -> dict[str, Any]:
    return {f.name: plain(getattr(made, f.name)) for f in fields(made)}


@cache
def _adapter(kind: type) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


def parameter_frame(parameters: "Sequence[ParameterEstimate]", **same: Any) -> pd.DataFrame:
    """Return one row a parameter, and columns that are the same in all rows."""
    columns = ("value", "unit", "ci_low", "ci_high", "ci_level", "status")
    rows = [{"parameter": p.name} | {c: getattr(p, c) for c in columns} | same for p in parameters]
    return pd.DataFrame(rows)


def parameter_line(parameter: "ParameterEstimate") -> str:
    """Return a line of a summary."""
    if parameter.value is None:
        return f"{parameter.name:<10} {parameter.status}"
    interval = f"{parameter.ci_low:.4g} to {parameter.ci_high:.4g}"
    measure = f"{parameter.name:<10} {parameter.value:.4g} {parameter.unit}"
    return f"{measure} ({parameter.ci_level:.0%} interval {interval}; {parameter.status})"


def parameter_label(parameter: "ParameterEstimate") -> str:
    """Return a short label for a figure."""
    symbol = _SYMBOLS[parameter.name]
    if parameter.value is None:
        return f"{symbol} {parameter.status}"
    return f"{symbol} = {parameter.value:.3g} {parameter.unit}"
