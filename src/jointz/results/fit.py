"""Base of fits, and their parameters as text."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self

import pandas as pd

from jointz.core.channels import PARAMETER_NAMES
from jointz.results.base import ParameterResult, checked_values, record_fields, record_frame
from jointz.results.estimates import ParameterEstimate

#: Impedance parameter -> its symbol.
SYMBOLS = {name: PARAMETER_NAMES[name][1] for name in ("stiffness", "damping", "inertia")}


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class Fit(ParameterResult[ParameterEstimate]):
    """Base of fits; JSON holds their parameters by name. A subclass describes the fields."""

    #: Properties of the fit that every row of its table repeats.
    COLUMNS: ClassVar[tuple[str, ...]] = ("vaf_pct", "n_samples", "model", "estimator")

    parameters: tuple[ParameterEstimate, ...]
    vaf_pct: float
    settings: Mapping[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    def to_frame(self) -> pd.DataFrame:
        """Return one row per parameter."""
        names = ("value", "unit", "ci_low", "ci_high", "ci_level", "status")
        table = record_frame(self.parameters, ("name", *names)).rename(
            columns={"name": "parameter"}
        )
        return table.assign(**{name: getattr(self, name) for name in self.COLUMNS})

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for JSON."""
        by_name = {}
        for entry in (record_fields(p) for p in self.parameters):
            name, low, high = (entry.pop(key) for key in ("name", "ci_low", "ci_high"))
            unit = self.parameter(name).unit
            by_name[name] = entry | {"unit": unit, "ci": [low, high]}
        # Without arguments, super means the class before ``slots`` made it anew.
        return super(Fit, self).to_dict() | {"parameters": by_name}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Rebuild from :meth:`to_dict`; raise ValueError for another schema or wrong values."""
        parameters = [
            {**entry, "name": name, "ci_low": entry["ci"][0], "ci_high": entry["ci"][1]}
            for name, entry in checked_values(data, cls.SCHEMA)["parameters"].items()
        ]
        return super(Fit, cls).from_dict({**data, "parameters": parameters})


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class RecordFit(Fit):
    """Base of fits of one record of a joint."""

    model: str
    estimator: str
    input: str
    vaf_of: str
    status: str
    n_samples: int
    rate_hz: float
    cutoff_hz: float
    condition_number: float
    covariance: tuple[tuple[float, ...], ...]
    ci_method: str


def parameter_line(
    parameter: ParameterEstimate, *, name: str = "", width: int = 10, digits: int = 4
) -> str:
    """Return a parameter with its interval, as a line of a summary."""
    p, name = parameter, name or parameter.name
    if p.value is None:
        limits = f" (in {_ends(p, digits)} {p.unit})" if None not in p.ci else ""
        return f"{name:<{width}} {p.status}{limits}"
    measure = f"{name:<{width}} {p.value:.{digits}g} {p.unit}"
    if p.ci_low is None or p.ci_high is None:
        return f"{measure} ({p.ci_method if p.status == 'ok' else f'no interval; {p.status}'})"
    return f"{measure} ({p.ci_level:.0%} interval {_ends(p, digits)}; {p.status})"


def _ends(parameter: ParameterEstimate, digits: int) -> str:
    return f"{parameter.ci_low:.{digits}g} to {parameter.ci_high:.{digits}g}"


def parameter_label(parameter: ParameterEstimate, *, symbol: str = "", digits: int = 3) -> str:
    """Return a parameter as a short label of a figure; its symbol is K, B or J by default."""
    symbol = symbol or SYMBOLS[parameter.name]
    if parameter.value is None:
        return f"{symbol} {parameter.status}"
    return f"{symbol} = {parameter.value:.{digits}g} {parameter.unit}"
