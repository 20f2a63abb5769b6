"""What is asked of a catalog, and the rows that it returns."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from jointz.collections.catalog_columns import CATALOG_COLUMNS
from jointz.core.plain_tables import plain_rows, typed_table
from jointz.results.base import Result, checked_values

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SCHEMA = "jointz.QueryResult/1"
#: Status of a row whose value can be used.
STANDING = ("ok", "at_bound")
#: A legend of more studies hides the figure.
_MOST_NAMED = 10


@dataclass(frozen=True, slots=True)
class CatalogFilter:
    """What is wanted of a catalog; what is empty or None asks for everything.

    Parameters
    ----------
    joint, parameter, condition, activity, entry, method : tuple of str
        One of these. ``entry`` is a folder or a study's id.
    phase_pct : tuple of float or None
        Onsets from the first to the second, % of the gait cycle; (90, 10) goes over heel strike.
    speed_m_s : tuple of float or None
        Walking speeds from the first to the second.
    kind : str
        ``estimates`` or ``printed``: never both in one result.
    standing : bool
        Only rows with a value to use (status ``ok`` or ``at_bound``).
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

    def told(self) -> dict[str, Any]:
        """Return what narrows the question, as plain values; the kind of values does not."""
        asked = {name: value for name, value in asdict(self).items() if name != "kind" and value}
        return {k: list(v) if isinstance(v, tuple) else v for k, v in asked.items()}


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class QueryResult(Result):
    """Rows of a catalog."""

    table: pd.DataFrame  # in the columns of the catalog; texts may be categories
    asked: CatalogFilter  # what for
    # rows of the other kind of values that the same question would find: printed beside estimates,
    # or the other way
    also: int = 0
    cites: Mapping[str, str] = field(default_factory=dict)  # study -> how to cite it
    # rows that are not in it for want of an onset, where phases were asked for: failures, and
    # values that all timing points share
    without_onset: int = 0

    def __eq__(self, other: object) -> bool:
        # Tables have no single truth; their plain values do, categories or not.
        if not isinstance(other, QueryResult):
            return NotImplemented
        return self.to_dict() == other.to_dict()

    __hash__ = None  # type: ignore[assignment]

    def to_frame(self) -> pd.DataFrame:
        """Return the rows, texts as texts."""
        return typed_table(self.table, CATALOG_COLUMNS)

    def groups(self) -> pd.DataFrame:
        """Return one row a joint, condition, timing point and parameter: how much there is."""
        keys = ["joint", "condition", "timing_point", "parameter", "unit", "statistic"]
        held = self._standing()
        who = held["study"].astype(object) + "/" + held["participant"].astype(object)
        return (
            held.assign(_who=who, onset_gait_pct=_near_their_mean(held, keys))
            .groupby(keys, sort=False, observed=True)
            .agg(
                onset_gait_pct=("onset_gait_pct", "median"),
                studies=("study", "nunique"),
                people=("_who", "nunique"),
                estimates=("value", "size"),
                median=("value", "median"),
            )
            .reset_index()
            # Rounded: what lies a hair before heel strike would be 100 and come last.
            .assign(onset_gait_pct=lambda groups: groups["onset_gait_pct"].round(9) % 100.0)
            .sort_values(["joint", "condition", "parameter", "onset_gait_pct"], ignore_index=True)
        )

    def _standing(self) -> pd.DataFrame:
        held: pd.DataFrame = self.table[self.table["status"].isin(STANDING)]
        return held

    def summary(self) -> str:
        """Return how much was found, and where it is from."""
        kind = "printed values" if self.asked.kind == "printed" else "estimates"
        other = "estimates" if self.asked.kind == "printed" else "printed values"
        named = self.table[self.table["participant"] != ""]  # a mean is nobody's
        people = len(named[["study", "participant"]].drop_duplicates())
        n = self.table["study"].nunique()
        studies = f"{n} {'study' if n == 1 else 'studies'}"
        lines = [
            f"{len(self.table)} {kind} of {people} people in {studies}; "
            f"{self.also} {other} would fit too and are kept apart."
        ]
        if self.without_onset:
            lines.append(f"  {without_onset_told(self.without_onset)}")
        return "\n".join(lines + [f"  cite: {text}" for text in self.cites.values()])

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the parameter with the most values, over the gait cycle if that is known."""
        import matplotlib.pyplot as plt

        axes = ax if ax is not None else plt.subplots(figsize=(6.0, 4.0), layout="constrained")[1]
        held = typed_table(self._standing(), CATALOG_COLUMNS)
        held = held.assign(shown=held["parameter"] + " (" + held["unit"] + ")")
        most = str(held["shown"].mode().get(0, "nothing found"))
        held = held[held["shown"] == most]
        in_gait = held["onset_gait_pct"].notna().any()
        for study, own in held.groupby("study", sort=False):
            at = own["onset_gait_pct"] if in_gait else own["timing_point"]
            axes.plot(at, own["value"], "o", markersize=4, alpha=0.7, label=str(study))
        axes.set_xlabel("onset (% of the gait cycle)" if in_gait else "timing point")
        axes.set_ylabel(most)
        if 0 < held["study"].nunique() <= _MOST_NAMED:
            axes.legend(frameon=False)
        return axes

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for JSON."""
        asked = {k: list(v) if isinstance(v, tuple) else v for k, v in asdict(self.asked).items()}
        return {
            "schema": SCHEMA,
            "asked": asked,
            "rows": plain_rows(self.to_frame()),
            "also": self.also,
            "cites": dict(self.cites),
            "without_onset": self.without_onset,
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "QueryResult":
        """Rebuild from :meth:`to_dict`."""
        held = checked_values(data, SCHEMA)
        asked: dict[str, Any] = {
            k: tuple(v) if isinstance(v, list) else v for k, v in held["asked"].items()
        }
        table = typed_table(held["rows"], CATALOG_COLUMNS)
        cites, without_onset = dict(held["cites"]), held.get("without_onset", 0)
        return cls(table, CatalogFilter(**asked), held["also"], cites, without_onset)


def without_onset_told(n: int) -> str:
    """Return a sentence on rows that a range of phases leaves out for want of an onset."""
    rows = "1 row" if n == 1 else f"{n} rows"
    return f"--phase leaves out {rows} without an onset: failures, and what timing points share."


def _near_their_mean(rows: pd.DataFrame, keys: list[str]) -> pd.Series:
    """Return onsets within half a cycle of the mean of their group: 1 % beside 99 % is 101 %."""
    onset = rows["onset_gait_pct"].astype(float)
    turn = 2.0 * np.pi * onset / 100.0
    parts = pd.DataFrame({"sine": np.sin(turn), "cosine": np.cos(turn)})
    means = parts.groupby([rows[key] for key in keys], observed=True).transform("mean")
    angle = np.arctan2(means["sine"].to_numpy(), means["cosine"].to_numpy())
    mean = pd.Series(angle, rows.index) * 100.0 / (2.0 * np.pi)
    turns = ((mean - onset) / 100.0).round()
    return onset + 100.0 * turns
