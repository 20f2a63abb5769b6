"""Base classes of results, and their conversion to JSON, tables, figures and text."""

from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Generic, Protocol, Self, TypeVar

import numpy as np
import pandas as pd
from pydantic import BeforeValidator, InstanceOf, TypeAdapter

from jointz.results.figure_style import Axes as Axes
from jointz.results.figure_style import axes_or_new, in_figure_style

_JSON_SCALARS = {bool, int, float, str, type(None)}
_REPR_LINES = 10
_HTML_ROWS = 10
#: Longest text of one field, and of a summary that is made of all fields.
_FIELD_CHARACTERS = 60
_SUMMARY_CHARACTERS = 300


def _as_array(value: Any) -> Any:
    try:
        return np.asarray(value, dtype=float) if isinstance(value, list) else value
    except (TypeError, OverflowError) as exc:  # a table in a list, an endless integer
        raise ValueError(f"expected numbers ({exc})") from exc


#: Type of a field with an array of numbers, which JSON holds as a list.
Array = Annotated[InstanceOf[np.ndarray], BeforeValidator(_as_array)]


class Result:
    """Base of all results.

    A subclass is a ``dataclass(frozen=True, slots=True)``, with ``eq=False`` if it has arrays. It
    overrides :meth:`summary`, and adds ``to_frame`` if it has a table. ``SCHEMA`` is its name and
    version in JSON; ``JSON_PROPERTIES`` are properties that JSON holds beside the fields.
    """

    __slots__ = ()
    SCHEMA: ClassVar[str] = ""
    JSON_PROPERTIES: ClassVar[tuple[str, ...]] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for JSON."""
        head: dict[str, Any] = {"schema": self.SCHEMA} if self.SCHEMA else {}
        properties = {name: plain(getattr(self, name)) for name in self.JSON_PROPERTIES}
        return head | record_fields(self) | properties

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Rebuild from :meth:`to_dict`; raise ValueError for another schema or wrong values."""
        values = checked_values(data, cls.SCHEMA) if cls.SCHEMA else dict(data)
        result: Self = _adapter(cls).validate_python(values)  # type: ignore[arg-type]
        return result

    def __eq__(self, other: object) -> bool:
        # For classes with arrays (eq=False), which have no single truth value.
        if not isinstance(other, type(self)):
            return NotImplemented
        return self.to_dict() == other.to_dict()

    def summary(self) -> str:
        """Return a short text."""
        texts = [f"{name}={value!r}" for name, value in record_fields(self).items()]
        return ", ".join(text[:_FIELD_CHARACTERS] for text in texts)[:_SUMMARY_CHARACTERS]

    def __repr__(self) -> str:
        lines = [f"{type(self).__name__}:", *self.summary().splitlines()]
        if len(lines) > _REPR_LINES:
            lines[_REPR_LINES - 1 :] = ["..."]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        title = escape(self.summary().partition("\n")[0])
        if hasattr(self, "to_frame"):
            table = self.to_frame()
        else:
            values = {k: str(v)[:_FIELD_CHARACTERS] for k, v in record_fields(self).items()}
            table = pd.Series(values).to_frame()
        html = table.to_html(max_rows=_HTML_ROWS, max_cols=12, border=0, na_rep="")
        return f"<p>{title}</p>\n{html}"


class PlottedResult(Result):
    """Base of results with a figure; a subclass draws it in ``_draw``."""

    __slots__ = ()
    FIGURE_SIZE: ClassVar[tuple[float, float]] = (8.0, 4.0)  # width and height

    @in_figure_style
    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the result on the axes, or a new figure, and return the axes."""
        axes = axes_or_new(ax, self.FIGURE_SIZE)
        self._draw(axes)
        return axes

    def _draw(self, axes: "Axes") -> None:
        raise NotImplementedError


class _HasName(Protocol):
    @property
    def name(self) -> str: ...


_ParameterT = TypeVar("_ParameterT", bound=_HasName)


class ParameterResult(PlottedResult, Generic[_ParameterT]):
    """Base of results with parameters, such as ``fit.stiffness``."""

    __slots__ = ()
    if TYPE_CHECKING:
        parameters: tuple[_ParameterT, ...]

    def parameter(self, name: str) -> _ParameterT:
        """Return a parameter by name; raise KeyError if the fit has no such parameter."""
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        known = ", ".join(p.name for p in self.parameters)
        raise KeyError(f"no parameter {name!r} in this fit; it has {known}")

    @property
    def stiffness(self) -> _ParameterT:
        """The stiffness K."""
        return self.parameter("stiffness")

    @property
    def damping(self) -> _ParameterT:
        """The damping B."""
        return self.parameter("damping")

    @property
    def inertia(self) -> _ParameterT:
        """The inertia J."""
        return self.parameter("inertia")


# --- JSON --------------------------------------------------------------------------------------


def checked_values(data: Mapping[str, Any], schema: str) -> dict[str, Any]:
    """Return a saved result without its schema; raise ValueError for another schema."""
    if data.get("schema") != schema:
        raise ValueError(f"expected schema {schema!r}, got {data.get('schema')!r}")
    return {name: value for name, value in data.items() if name != "schema"}


def plain(value: Any) -> Any:
    """Return a value for JSON: data classes as dictionaries, tuples and arrays as lists."""
    if type(value) in _JSON_SCALARS:
        return value
    if isinstance(value, Result):
        return value.to_dict()
    if is_dataclass(value):
        return record_fields(value)
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return value.tolist()
    return str(value) if isinstance(value, Path) else value


def record_fields(record: Any) -> dict[str, Any]:
    """Return the fields of a record as plain values."""
    return {f.name: plain(getattr(record, f.name)) for f in fields(record)}


@cache
def _adapter(kind: type) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


# --- tables, figures and text ------------------------------------------------------------------


def record_frame(records: Iterable[Any], columns: Iterable[str]) -> pd.DataFrame:
    """Return a table with one row per record and one column per attribute."""
    names = list(columns)
    return pd.DataFrame([[getattr(r, name) for name in names] for r in records], columns=names)


def summary_text(title: str, lines: Iterable[str], notes: Iterable[str] = ()) -> str:
    """Return a summary: a title, indented lines, notes."""
    indented = [f"  {line}" for line in lines] + [f"  Note: {note}" for note in notes]
    return "\n".join([title, *indented])
