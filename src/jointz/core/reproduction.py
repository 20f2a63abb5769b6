"""A chapter of the dissertation, printed beside ours."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import pandas as pd

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SCHEMA = "jointz.Reproduction/1"
_DASH = "-"


@dataclass(frozen=True, slots=True)
class Compared:
    """One quantity: as printed, by the dissertation's method, by the recommended one.

    Parameters
    ----------
    quantity, unit : str
        What is compared; the unit of all numbers, empty for a count.
    printed, dissertation, recommended, truth : float or None
        As printed; by the dissertation's method and by the recommended one on the simulated
        bench; the simulation's truth. None where there is none.
    printed_sd, dissertation_sd : float or None
        What stands after the plus-minus sign.
    recommended_low, recommended_high : float or None
        95 % interval.
    note : str
        What a reader should know.
    """

    quantity: str
    unit: str = ""
    printed: float | None = None
    dissertation: float | None = None
    recommended: float | None = None
    truth: float | None = None
    printed_sd: float | None = None
    dissertation_sd: float | None = None
    recommended_low: float | None = None
    recommended_high: float | None = None
    note: str = ""


@dataclass(frozen=True, slots=True)
class ComparedTable:
    """A table of a chapter.

    Parameters
    ----------
    name : str
        For files: letters, digits and ``_``.
    title, caption : str
        Heading, and what stands below it.
    rows : tuple of Compared
        Its rows.
    """

    name: str
    title: str
    caption: str
    rows: tuple[Compared, ...]


@dataclass(frozen=True, slots=True)
class Reproduction:
    """A chapter reproduced.

    Parameters
    ----------
    chapter : int
        Its number.
    title : str
        In short.
    tables : tuple of ComparedTable
        In the order of the page.
    curves : mapping of str to mapping
        What the figures draw, plain values.
    notes : tuple of str
        What a reader must know.
    provenance : mapping
        Versions, seed, settings.
    """

    chapter: int
    title: str
    tables: tuple[ComparedTable, ...]
    curves: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def table(self, name: str) -> ComparedTable:
        """Return a table by name.

        Parameters
        ----------
        name : str
            Such as ``stiffness_errors``.

        Raises
        ------
        KeyError
            When there is none.
        """
        for table in self.tables:
            if table.name == name:
                return table
        raise KeyError(f"no table {name!r}; there are {', '.join(t.name for t in self.tables)}")

    def to_frame(self) -> pd.DataFrame:
        """Return one row a quantity, with the name of its table."""
        columns = ["table", *Compared.__slots__]
        rows = [{"table": t.name, **asdict(row)} for t in self.tables for row in t.rows]
        return pd.DataFrame(rows, columns=columns)

    def summary(self) -> str:
        """Return the tables as text."""
        lines = [f"Chapter {self.chapter}: {self.title}"]
        for table in self.tables:
            lines += ["", table.title]
            lines += [f"  {_sentence(row)}" for row in table.rows]
        lines += [f"Note: {note}" for note in self.notes]
        return "\n".join(lines)

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw what is printed against what comes out, where units are percent.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
            The axes drawn on.
        """
        import matplotlib.pyplot as plt

        axes = ax if ax is not None else plt.subplots(layout="constrained")[1]
        rows = [r for t in self.tables for r in t.rows if r.unit == "%" and r.printed is not None]
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
            "tables": [
                {
                    "name": t.name,
                    "title": t.title,
                    "caption": t.caption,
                    "rows": [asdict(row) for row in t.rows],
                }
                for t in self.tables
            ],
            "curves": dict(self.curves),
            "notes": list(self.notes),
            "provenance": dict(self.provenance),
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Reproduction":
        """Rebuild from :meth:`to_dict`.

        Parameters
        ----------
        data : mapping
            What :meth:`to_dict` returned.

        Raises
        ------
        ValueError
            When the schema is not one this version reads.
        """
        if data.get("schema") != SCHEMA:
            raise ValueError(f"expected schema {SCHEMA!r}, got {data.get('schema')!r}")
        tables = tuple(
            ComparedTable(
                t["name"], t["title"], t["caption"], tuple(Compared(**row) for row in t["rows"])
            )
            for t in data["tables"]
        )
        return cls(
            chapter=data["chapter"],
            title=data["title"],
            tables=tables,
            curves=data["curves"],
            notes=tuple(data["notes"]),
            provenance=data["provenance"],
        )


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
