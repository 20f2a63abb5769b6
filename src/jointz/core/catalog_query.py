"""What is asked of a catalog, and the rows that it returns."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import pandas as pd

from jointz.core.collection_tables import CATALOG_COLUMNS
from jointz.core.fit_parameters import checked_values
from jointz.core.plain_tables import plain_rows, typed_table

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


@dataclass(frozen=True, slots=True, eq=False)
class QueryResult:
    """Rows of a catalog.

    Parameters
    ----------
    table : pandas.DataFrame
        In the columns of the catalog; texts may be categories.
    asked : CatalogFilter
        What for.
    also : int
        Rows of the other kind of values that the same question would find: printed beside
        estimates, or the other way.
    cites : mapping of str to str
        Study -> how to cite it.
    """

    table: pd.DataFrame
    asked: CatalogFilter
    also: int = 0
    cites: Mapping[str, str] = field(default_factory=dict)

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
        """Return one row a joint, condition, timing point and parameter: how much there is.

        Returns
        -------
        pandas.DataFrame
            ``joint``, ``condition``, ``timing_point``, ``parameter``, ``unit``, ``statistic``,
            ``onset_gait_pct`` (median), ``studies``, ``people``, ``estimates`` (that stand),
            ``median`` (of those: to look at, not pooled), in the order of the gait cycle.
        """
        keys = ["joint", "condition", "timing_point", "parameter", "unit", "statistic"]
        held = self._standing()
        who = held["study"].astype(object) + "/" + held["participant"].astype(object)
        return (
            held.assign(_who=who)
            .groupby(keys, sort=False, observed=True)
            .agg(
                onset_gait_pct=("onset_gait_pct", "median"),
                studies=("study", "nunique"),
                people=("_who", "nunique"),
                estimates=("value", "size"),
                median=("value", "median"),
            )
            .reset_index()
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
        return "\n".join(lines + [f"  cite: {text}" for text in self.cites.values()])

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the values of the parameter with most of them, over the gait cycle where it is told.

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
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "QueryResult":
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
        held = checked_values(data, SCHEMA)
        asked: dict[str, Any] = {
            k: tuple(v) if isinstance(v, list) else v for k, v in held["asked"].items()
        }
        table = typed_table(held["rows"], CATALOG_COLUMNS)
        return cls(table, CatalogFilter(**asked), held["also"], dict(held["cites"]))
