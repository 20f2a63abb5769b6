"""Result of pooling: estimates of all studies, their means, and means over studies."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, ClassVar, Final

import numpy as np
import pandas as pd

from jointz.core.channels import axis_label
from jointz.pooling.conditions import CONDITION_COLUMNS
from jointz.pooling.plain_tables import Kind, plain_rows, typed_table
from jointz.report.wording import ABSOLUTE, format_count, point_name
from jointz.results.base import Axes, Result, checked_values, summary_text
from jointz.results.estimates import ESTIMATE_COLUMNS
from jointz.results.figure_style import axes_or_new, in_figure_style
from jointz.results.series.frequency_response_curve import INK, MODEL

#: Status of the mean of a single study, and of a mean whose interval reaches zero; others are
#: ``ok`` and ``failed:too_few_studies``.
ONE_STUDY: Final = "one_study"
UNDECIDED: Final = "undecided"
_NUMBERS = (
    "onset_gait_pct", "value", "ci_low", "ci_high", "ci_level", "vaf_pct", "walking_speed_m_s",
    "slope_deg", "gain_sd", "prediction_low", "prediction_high", "tau", "tau_low", "tau_high",
    "i2_pct", "q", "q_p", "se", "weight_pct",
)  # fmt: skip
_CELL = ("timing_point", *CONDITION_COLUMNS, "parameter", "unit")
COUNTS: Final = ("n_at_bound", "n_undecided", "n_failed")
_ENDS = ("value", "ci_low", "ci_high")


def _kinds(*names: str) -> Mapping[str, Kind]:
    kinds: dict[str, Kind] = {
        name: "number" if name in _NUMBERS else "count" if name.startswith("n_") else "text"
        for name in names
    }
    return MappingProxyType(kinds)


#: The columns of each table.
COLUMNS: Final[Mapping[str, Mapping[str, Kind]]] = {
    "table": _kinds(
        *_CELL, "method", *_ENDS, "prediction_low", "prediction_high", "tau", "tau_low",
        "tau_high", "i2_pct", "q", "q_p", "n_studies", "n_people", "n_left_out", *COUNTS, "status",
    ),
    "studies": _kinds(
        *_CELL, "study", "method", "n_people", *COUNTS, "value", "se", "ci_low", "ci_high",
        "weight_pct", "status",
    ),
    "estimates": _kinds(
        "results", "study", *CONDITION_COLUMNS, "joint", "kind", "gain_sd", *ESTIMATE_COLUMNS
    ),
}  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PooledStudies(Result):
    """Means over studies, with the studies and the estimates behind them.

    Parameters
    ----------
    table : pandas.DataFrame
        One row a timing point, condition and parameter: the mean over studies, as in
        ``pooled.csv``.
    studies : pandas.DataFrame
        One row a study at each of these, also if it was left out, as in ``studies.csv``.
    estimates : pandas.DataFrame
        The estimates of all results folders with their conditions, as in ``estimates.csv``.
    ci_level : float
        Level of all intervals.
    notes : tuple of str
        What a reader of the numbers should know.
    settings, provenance : mapping
        Folders, study and condition of each; versions and hashes of the files that were read.
    """

    SCHEMA: ClassVar[str] = "jointz.PooledStudies/1"

    table: pd.DataFrame
    studies: pd.DataFrame
    estimates: pd.DataFrame
    ci_level: float = 0.95
    notes: tuple[str, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def available(self) -> bool:
        """True if at least one mean is decided."""
        return not self._available.empty

    @property
    def _available(self) -> pd.DataFrame:
        return self.table[self.table["status"].isin(["ok", ONE_STUDY])]

    def to_frame(self) -> pd.DataFrame:
        """Return the means over studies."""
        return self.table

    def summary(self) -> str:
        """Return a line for each available mean of K, B and J, and the notes."""
        lines = []
        known = self._available
        for row in known[known["parameter"].isin(ABSOLUTE)].to_dict("records"):
            interval = f"{row['ci_low']:.4g} to {row['ci_high']:.4g}"
            studies = format_count(row["n_studies"], "study", "studies")
            lines.append(
                f"{row['parameter']} {cell_text(row)}: {row['value']:.4g} {row['unit']}, "
                f"{interval} ({studies}, {row['n_people']} people)"
            )
        n_studies = format_count(self.studies["study"].nunique(), "study", "studies")
        available = f"{len(known)} of {len(self.table)} means are available"
        title = f"{n_studies}: {available} (those of K, B and J below)"
        return summary_text(title, lines, self.notes)

    @in_figure_style
    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw a forest plot of the mean with most studies."""
        pooled = self.table[self.table["status"] == "ok"]
        if pooled.empty:
            axes = _draw_forest([], dict.fromkeys(COLUMNS["table"], float("nan")), ax)
            axes.set_title("no mean over studies")
            return axes
        row = pooled.sort_values("n_studies", ascending=False, kind="stable").iloc[0].to_dict()
        used = studies_of(self.studies, row)
        axes = _draw_forest(used[used["status"] == "ok"].to_dict("records"), row, ax)
        name, level = axis_label(row["parameter"]), f"{100 * self.ci_level:g} %"
        axes.set(xlabel=f"{name}, {level} intervals", title=cell_text(row))
        return axes

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for JSON."""
        names = ("ci_level", "notes", "settings", "provenance")
        values = {name: getattr(self, name) for name in names} | {"notes": list(self.notes)}
        tables = {name: plain_rows(getattr(self, name)) for name in COLUMNS}
        return {"schema": self.SCHEMA, **values, **tables}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "PooledStudies":
        """Rebuild from :meth:`to_dict`; raise ValueError for another schema."""
        values = checked_values(data, cls.SCHEMA)
        values |= {name: typed_table(values[name], kinds) for name, kinds in COLUMNS.items()}
        return cls(**values | {"notes": tuple(values["notes"])})


def condition_text(row: Mapping[Any, Any]) -> str:
    """Describe the condition of a row; empty if nothing is stated."""
    speed, slope = row["walking_speed_m_s"], row["slope_deg"]
    texts = (
        row["condition"],
        f"{speed:g} m/s" if pd.notna(speed) else "",
        f"{slope:g}\N{DEGREE SIGN}" if pd.notna(slope) else "",
        row["surface"],
        row["group"],
    )
    return ", ".join(text for text in texts if text)


def cell_text(row: Mapping[Any, Any]) -> str:
    """Describe timing point and condition of a row."""
    texts = (point_name(row["timing_point"]), condition_text(row))
    return ", ".join(text for text in texts if text)


def studies_of(studies: pd.DataFrame, row: Mapping[Any, Any]) -> pd.DataFrame:
    """Return the studies of a row of the table of means."""
    columns = list(_CELL)
    cell = pd.Series({name: row[name] for name in columns}, dtype=object)
    both = studies[columns].astype(object)
    is_same = (both == cell) | (both.isna() & pd.isna(cell))
    return studies[is_same.all(axis=1)]


def _draw_forest(
    studies: Sequence[Mapping[Any, Any]], mean: Mapping[Any, Any], ax: "Axes | None" = None
) -> "Axes":
    """Draw a forest plot: the studies, their mean below them."""
    axes = axes_or_new(ax, (6.0, 4.0))
    at, below = np.arange(len(studies)), len(studies) + 0.3
    values = np.array([s["value"] for s in studies])
    axes.hlines(at, [s["ci_low"] for s in studies], [s["ci_high"] for s in studies], color="0.4")
    sizes = [20.0 + 3.0 * s["weight_pct"] for s in studies]
    axes.scatter(values, at, s=sizes, marker="s", color=INK, zorder=2.5)
    axes.hlines(below, mean["prediction_low"], mean["prediction_high"], color=MODEL, lw=1)
    across = [mean["ci_low"], mean["value"], mean["ci_high"], mean["value"]]
    axes.fill(across, [below, below - 0.25, below, below + 0.25], color=MODEL)
    labels = [f"{s['study']} ({int(s['n_people'])})" for s in studies]
    axes.set_yticks([*at, below], [*labels, "mean over studies"])
    axes.invert_yaxis()
    axes.set_ylabel("study (people)")
    return axes
