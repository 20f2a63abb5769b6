"""A chapter of the dissertation, printed beside ours."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import pandas as pd

from jointz.reproduction.reproduction_tables import (
    ClaimTable,
    Compared,
    ComparedTable,
    Table,
    table_from_dict,
    table_to_dict,
)
from jointz.results.base import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SCHEMA = "jointz.Reproduction/2"
_DASH = "-"


@dataclass(frozen=True, slots=True, repr=False)
class Reproduction(Result):
    """A chapter reproduced."""

    chapter: int  # its number
    title: str  # in short
    tables: tuple[Table, ...]  # ClaimTable or ParticipantGrid: in the order of the page
    curves: Mapping[str, Any] = field(default_factory=dict)  # what the figures draw, plain values
    notes: tuple[str, ...] = ()  # what a reader must know
    provenance: Mapping[str, Any] = field(default_factory=dict)  # versions, seed, settings

    def table(self, name: str) -> Table:
        """Return a table by name."""
        for table in self.tables:
            if table.name == name:
                return table
        raise KeyError(f"no table {name!r}; there are {', '.join(t.name for t in self.tables)}")

    @property
    def compared(self) -> tuple[ComparedTable, ...]:
        """The tables that set number beside number."""
        return tuple(table for table in self.tables if isinstance(table, ComparedTable))

    def to_frame(self) -> pd.DataFrame:
        """Return one row a compared number, with the name of its table."""
        columns = ["table", *Compared.__slots__]
        rows = [{"table": t.name, **asdict(row)} for t in self.compared for row in t.rows]
        return pd.DataFrame(rows, columns=columns)

    def summary(self) -> str:
        """Return the tables as text."""
        lines = [f"Chapter {self.chapter}: {self.title}"]
        for table in self.tables:
            lines += ["", table.title]
            lines += [f"  {line}" for line in _lines(table)]
        lines += [f"Note: {note}" for note in self.notes]
        return "\n".join(lines)

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw what is printed against what comes out, where units are percent."""
        import matplotlib.pyplot as plt

        axes = ax if ax is not None else plt.subplots(layout="constrained")[1]
        rows = [r for t in self.compared for r in t.rows if r.unit == "%" and r.printed is not None]
        for name, marker in (("dissertation", "o"), ("recommended", "s")):
            found = [r for r in rows if getattr(r, name) is not None]
            printed = [float(r.printed or 0.0) for r in found]
            ours = [float(getattr(r, name)) for r in found]
            axes.plot(printed, ours, marker, linestyle="", label=name)
        axes.set_xlabel("printed (%)")
        axes.set_ylabel("reproduced (%)")
        axes.legend()
        return axes

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for JSON."""
        return {
            "schema": SCHEMA,
            "chapter": self.chapter,
            "title": self.title,
            "tables": [table_to_dict(table) for table in self.tables],
            "curves": dict(self.curves),
            "notes": list(self.notes),
            "provenance": dict(self.provenance),
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Reproduction":
        """Rebuild from :meth:`to_dict`."""
        if data.get("schema") != SCHEMA:
            raise ValueError(f"expected schema {SCHEMA!r}, got {data.get('schema')!r}")
        return cls(
            chapter=data["chapter"],
            title=data["title"],
            tables=tuple(table_from_dict(table) for table in data["tables"]),
            curves=data["curves"],
            notes=tuple(data["notes"]),
            provenance=data["provenance"],
        )


def _lines(table: Table) -> list[str]:
    if isinstance(table, ComparedTable):
        return [_sentence(row) for row in table.rows]
    if isinstance(table, ClaimTable):
        return [
            f"{r.where}, {r.claim}: {r.printed}; here {r.ours}: {r.verdict}" for r in table.rows
        ]
    return [
        f"{block.label}, {point}: {', '.join(map(_number, row))}; average "
        f"{_number(block.average[point])} {table.unit}"
        for block in table.blocks
        for point, row in block.cells.items()
    ]


def _sentence(row: Compared) -> str:
    unit = f" {row.unit}" if row.unit else ""
    ours = _number(row.recommended)
    if row.recommended_low is not None and row.recommended_high is not None:
        ours += f" [{row.recommended_low:.4g}, {row.recommended_high:.4g}]"
    truth = f"; truth {row.truth:.4g}" if row.truth is not None else ""
    return (
        f"{row.quantity}: printed {_number(row.printed, row.printed_sd)}, dissertation's method "
        f"{_number(row.dissertation, row.dissertation_sd)}, recommended {ours}{unit}{truth}"
        f"{f' ({row.note})' if row.note else ''}"
    )


def _number(value: float | None, sd: float | None = None) -> str:
    if value is None:
        return _DASH
    return f"{value:.4g}" if sd is None else f"{value:.4g} +- {sd:.2g}"
