"""Result of pooling a collection: means over studies at every place, and their studies."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Final

import pandas as pd

from jointz.core.plain_tables import Kind, plain_rows, typed_table
from jointz.results.base import Result, checked_values
from jointz.results.statistics.random_effects_fit import draw_forest

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Columns that may distinguish places: ``phase`` are tenths of the cycle, ``speed`` bands of
#: 0.2 m/s.
BY: Final = (
    "joint", "timing_point", "phase", "condition", "activity", "speed", "slope", "side", "surface",
    "sex", "age_band", "group",
)  # fmt: skip
#: Conditions are free text and differ between labs; these columns hold their meaning.
DEFAULT_BY: Final = ("joint", "timing_point", "activity", "speed", "slope")
#: Status of the mean of a single study; others are ``ok`` and ``failed:too_few_studies``.
ONE_STUDY: Final = "one_study"
#: Columns of the pooled table, after those of the place.
POOLED_COLUMNS: Mapping[str, Kind] = MappingProxyType({
    "parameter": "text", "unit": "text", "methods": "text", "model": "text", "value": "number",
    "ci_low": "number", "ci_high": "number", "prediction_low": "number",
    "prediction_high": "number", "tau": "number", "tau_low": "number", "tau_high": "number",
    "i2_pct": "number", "q": "number", "q_p": "number", "n_studies": "count", "n_people": "count",
    "n_left_out": "count", "n_at_bound": "count", "n_undecided": "count", "n_failed": "count",
    "printed": "text", "status": "text",
})  # fmt: skip
#: Columns of the table of studies. ``status`` is ``ok``, or a code of
#: :class:`~jointz.core.codes.NotPooled`.
STUDY_COLUMNS: Mapping[str, Kind] = MappingProxyType({
    "parameter": "text", "unit": "text", "study": "text", "method": "text", "values": "text",
    "n_people": "count", "n_at_bound": "count", "n_undecided": "count", "n_failed": "count",
    "value": "number", "se": "number", "ci_low": "number", "ci_high": "number",
    "weight_pct": "number", "status": "text",
})  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class CollectionPool(Result):
    """Means over the studies of a collection.

    Parameters
    ----------
    table : pandas.DataFrame
        One row a place, parameter and method: the columns ``by``, then :data:`POOLED_COLUMNS`.
    studies : pandas.DataFrame
        One row a study at a place, including studies that were left out: ``by``, then
        :data:`STUDY_COLUMNS`; ``weight_pct`` is empty if the study was not pooled.
    printed : pandas.DataFrame
        Printed values in the same columns, every study by itself.
    by : tuple of str
        Columns that distinguish places.
    notes : tuple of str
        Remarks that a reader of the numbers must know.
    asked : mapping
        Filters, and rules of pooling that differ from the default, as plain values.
    """

    SCHEMA: ClassVar[str] = "jointz.CollectionPool/1"

    table: pd.DataFrame
    studies: pd.DataFrame
    printed: pd.DataFrame
    by: tuple[str, ...] = DEFAULT_BY
    notes: tuple[str, ...] = ()
    asked: Mapping[str, Any] = field(default_factory=dict)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, CollectionPool):
            return NotImplemented
        return self.to_dict() == other.to_dict()

    __hash__ = None  # type: ignore[assignment]

    @property
    def available(self) -> bool:
        """Whether at least one row has a value."""
        return bool(self.table["value"].notna().any())

    def to_frame(self) -> pd.DataFrame:
        """Return the pooled table."""
        return self.table

    def summary(self) -> str:
        """Return a line for each pooled value, and the notes."""
        n_studies = self.studies["study"].nunique()
        lines = [f"{len(self.table)} rows; studies with estimates: {n_studies}"]
        for row in self.table.to_dict("records"):
            number = str(row["status"])
            if pd.notna(row["value"]):
                number = f"{row['value']:.4g} {row['unit']}, {row['ci_low']:.4g} to "
                number += f"{row['ci_high']:.4g}"
            printed = f"; printed: {row['printed']}" if row["printed"] else ""
            lines.append(
                f"  {', '.join(str(row[key]) for key in self.by)}: {row['parameter']} {number} "
                f"({row['n_studies']} {'study' if row['n_studies'] == 1 else 'studies'}, "
                f"{row['n_people']} people; {row['methods']}{printed})"
            )
        return "\n".join([*lines, *(f"  Note: {note}" for note in self.notes)])

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw a forest plot of the row with most studies.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Axes to draw on; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
            The axes drawn on.
        """
        pooled = self.table[(self.table["status"] == "ok") & (self.table["model"] == "univariate")]
        if pooled.empty:
            axes = draw_forest([], dict.fromkeys(POOLED_COLUMNS, float("nan")), ax)
            axes.set_title("nothing was pooled")
            return axes
        row = pooled.sort_values("n_studies", ascending=False, kind="stable").iloc[0]
        keys = [*self.by, "parameter", "unit"]
        studies = pd.concat([self.studies, self.printed], ignore_index=True)
        pooled_here = (studies[keys] == row[keys]).all(axis=1) & studies["weight_pct"].notna()
        studies = studies_of_row(studies[pooled_here], row.to_dict())
        axes = draw_forest(studies.to_dict("records"), row.to_dict(), ax)
        axes.set_xlabel(f"{row['parameter']} ({row['unit']}), 95 % intervals")
        axes.set_title(", ".join(str(row[key]) for key in self.by))
        return axes

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for JSON."""
        tables = {n: plain_rows(getattr(self, n)) for n in ("table", "studies", "printed")}
        settings = {"by": list(self.by), "asked": dict(self.asked), "notes": list(self.notes)}
        return {"schema": self.SCHEMA, **settings, **tables}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "CollectionPool":
        """Rebuild from :meth:`to_dict`; raise ValueError for another schema."""
        values = checked_values(data, cls.SCHEMA)
        by = tuple(values["by"])
        return cls(
            pooled_table(values["table"], by),
            study_table(values["studies"], by),
            study_table(values["printed"], by),
            by=by,
            notes=tuple(values["notes"]),
            asked=dict(values.get("asked", {})),
        )


def studies_of_row(studies: pd.DataFrame, row: Mapping[Any, Any]) -> pd.DataFrame:
    """Return the studies of a place that belong to a row of the pooled table."""
    # The text of methods is not split: a method's name may hold a comma.
    of_method: pd.DataFrame = studies[studies["method"] == row["methods"]]
    return studies if of_method.empty else of_method


def pooled_table(rows: Any, by: tuple[str, ...]) -> pd.DataFrame:
    """Return rows in the columns of the pooled table."""
    return _table(rows, by, POOLED_COLUMNS)


def study_table(rows: Any, by: tuple[str, ...]) -> pd.DataFrame:
    """Return rows in the columns of the table of studies."""
    return _table(rows, by, STUDY_COLUMNS)


def _table(rows: Any, by: tuple[str, ...], columns: Mapping[str, Kind]) -> pd.DataFrame:
    places: dict[str, Kind] = dict.fromkeys(by, "text")
    return typed_table(rows, places | dict(columns))
