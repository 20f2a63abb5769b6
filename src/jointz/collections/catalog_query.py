"""Filters and results of a query of a catalog."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import pandas as pd
from pydantic import TypeAdapter

from jointz.collections.catalog_columns import CATALOG_COLUMNS
from jointz.core.plain_tables import plain_rows, typed_table
from jointz.results.base import Result, checked_values, plain
from jointz.results.figure_style import axes_or_new, in_figure_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Status of a row whose value can be used.
STANDING = ("ok", "at_bound")
#: A legend of more studies hides the figure.
_LARGEST_LEGEND = 10


@dataclass(frozen=True, slots=True)
class CatalogFilter:
    """Filter of the rows of a catalog; empty fields and None match everything.

    Parameters
    ----------
    joint, parameter, condition, activity, entry, method : tuple of str
        Names that match. ``entry`` is a folder or a study's id.
    phase_pct : tuple of float or None
        First and last onset, % of the gait cycle; (90, 10) is a range around heel strike.
    speed_m_s : tuple of float or None
        Lowest and highest walking speed.
    kind : str
        ``estimates`` or ``printed``: never both in one result.
    standing : bool
        Only rows with a usable value (status ``ok`` or ``at_bound``).
    """

    joint: tuple[str, ...] = ()
    parameter: tuple[str, ...] = ()
    condition: tuple[str, ...] = ()
    activity: tuple[str, ...] = ()
    entry: tuple[str, ...] = ()
    method: tuple[str, ...] = ()
    phase_pct: tuple[float, float] | None = None
    speed_m_s: tuple[float, float] | None = None
    kind: str = "estimates"
    standing: bool = False

    def settings(self) -> dict[str, Any]:
        """Return the fields that narrow the query, as plain values; the kind does not."""
        fields = plain(self)
        return {name: value for name, value in fields.items() if name != "kind" and value}


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class QueryResult(Result):
    """Rows of a catalog."""

    SCHEMA: ClassVar[str] = "jointz.QueryResult/1"

    table: pd.DataFrame  # in the columns of the catalog; texts may be categories
    asked: CatalogFilter
    also: int = 0  # number of matching rows of the other kind: printed values or estimates
    cites: Mapping[str, str] = field(default_factory=dict)  # study -> how to cite it
    # number of rows that a range of phases leaves out because they have no onset: failures, and
    # values that all timing points share
    without_onset: int = 0

    def __eq__(self, other: object) -> bool:
        # Plain values are compared: texts of a table may be categories or not.
        if not isinstance(other, QueryResult):
            return NotImplemented
        return self.to_dict() == other.to_dict()

    __hash__ = None  # type: ignore[assignment]

    def to_frame(self) -> pd.DataFrame:
        """Return the rows, texts as texts."""
        return typed_table(self.table, CATALOG_COLUMNS)

    def groups(self) -> pd.DataFrame:
        """Count studies, people and estimates by joint, condition, timing point and parameter."""
        keys = ["joint", "condition", "timing_point", "parameter", "unit", "statistic"]
        rows = self._standing()
        people = rows["study"].astype(object) + "/" + rows["participant"].astype(object)
        return (
            rows.assign(_people=people, onset_gait_pct=_near_their_mean(rows, keys))
            .groupby(keys, sort=False, observed=True)
            .agg(
                onset_gait_pct=("onset_gait_pct", "median"),
                studies=("study", "nunique"),
                people=("_people", "nunique"),
                estimates=("value", "size"),
                median=("value", "median"),
            )
            .reset_index()
            # Rounded: an onset just before heel strike would be 100 and come last.
            .assign(onset_gait_pct=lambda groups: groups["onset_gait_pct"].round(9) % 100.0)
            .sort_values(["joint", "condition", "parameter", "onset_gait_pct"], ignore_index=True)
        )

    def _standing(self) -> pd.DataFrame:
        rows: pd.DataFrame = self.table[self.table["status"].isin(STANDING)]
        return rows

    def summary(self) -> str:
        """Return the numbers of rows, people and studies, and what to cite."""
        kinds = ["estimates", "printed values"]
        kind, other = kinds[::-1] if self.asked.kind == "printed" else kinds
        named = self.table[self.table["participant"] != ""]  # a mean is nobody's
        n_people = len(named[["study", "participant"]].drop_duplicates())
        people = f"{n_people} {'person' if n_people == 1 else 'people'}"
        n = self.table["study"].nunique()
        studies = f"{n} {'study' if n == 1 else 'studies'}"
        lines = [
            f"{len(self.table)} {kind} of {people} in {studies}; "
            f"{self.also} {other} match too and are kept apart."
        ]
        if self.without_onset:
            lines.append(f"  {without_onset_note(self.without_onset)}")
        return "\n".join(lines + [f"  cite: {text}" for text in self.cites.values()])

    @in_figure_style
    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the parameter with the most values, over the gait cycle if phases are known."""
        axes = axes_or_new(ax, (6.0, 4.0))
        rows = typed_table(self._standing(), CATALOG_COLUMNS)
        rows = rows.assign(label=rows["parameter"] + " (" + rows["unit"] + ")")
        label = str(rows["label"].mode().get(0, "nothing found"))
        rows = rows[rows["label"] == label]
        in_gait = rows["onset_gait_pct"].notna().any()
        for study, values in rows.groupby("study", sort=False):
            x = values["onset_gait_pct"] if in_gait else values["timing_point"]
            axes.plot(x, values["value"], "o", markersize=4, alpha=0.7, label=str(study))
        axes.set_xlabel("onset (% of the gait cycle)" if in_gait else "timing point")
        axes.set_ylabel(label)
        if 0 < rows["study"].nunique() <= _LARGEST_LEGEND:
            axes.legend(frameon=False)
        return axes

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for JSON."""
        return {
            "schema": self.SCHEMA,
            "asked": plain(self.asked),
            "rows": plain_rows(self.to_frame()),
            "also": self.also,
            "cites": dict(self.cites),
            "without_onset": self.without_onset,
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "QueryResult":
        """Rebuild from :meth:`to_dict`."""
        values = checked_values(data, cls.SCHEMA)
        table = typed_table(values.pop("rows"), CATALOG_COLUMNS)
        asked = TypeAdapter(CatalogFilter).validate_python(values.pop("asked"))
        return cls(table, asked, **values)


def without_onset_note(n: int) -> str:
    """Return a sentence on rows that a range of phases leaves out because they have no onset."""
    rows = "1 row" if n == 1 else f"{n} rows"
    shared = "values that all timing points share"
    return f"--phase leaves out {rows} without an onset: failures, and {shared}."


def _near_their_mean(rows: pd.DataFrame, keys: list[str]) -> pd.Series:
    """Return onsets within half a cycle of their group's mean: 1 % becomes 101 % near 99 %."""
    onset = rows["onset_gait_pct"].astype(float)
    turn = 2.0 * np.pi * onset / 100.0
    parts = pd.DataFrame({"sine": np.sin(turn), "cosine": np.cos(turn)})
    means = parts.groupby([rows[key] for key in keys], observed=True).transform("mean")
    angle = np.arctan2(means["sine"].to_numpy(), means["cosine"].to_numpy())
    mean = pd.Series(angle, rows.index) * 100.0 / (2.0 * np.pi)
    turns = ((mean - onset) / 100.0).round()
    return onset + 100.0 * turns
