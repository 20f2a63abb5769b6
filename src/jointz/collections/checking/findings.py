"""Findings about entries of a collection, and the results that list them."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pandas as pd

from jointz.results.base import Result
from jointz.results.figure_style import axes_or_new, in_figure_style
from jointz.results.series.frequency_response_curve import INK, MODEL

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, slots=True)
class Finding:
    """A problem that ``collect check`` found."""

    entry: str  # folder of the entry
    code: str  # stable code; docs/collections.md lists all
    where: str  # key of ``entry.toml``, or file and column
    expected: str  # expected value or state
    found: str = ""  # value or state that was found; "" if there is none

    def __str__(self) -> str:
        """Return one sentence."""
        found = f"; found {self.found.rstrip('.')}" if self.found else ""
        return f"{self.entry}: {self.where}: expected {self.expected}{found}. [{self.code}]"


@dataclass(frozen=True, slots=True, repr=False)
class CollectionCheck(Result):
    """All findings about a collection."""

    SCHEMA: ClassVar[str] = "jointz.CollectionCheck/2"

    entries: tuple[str, ...]  # folders that were checked
    findings: tuple[Finding, ...]  # in the order of the entries

    @property
    def clean(self) -> bool:
        """Whether there is no finding."""
        return not self.findings

    def of(self, entry: str) -> tuple[Finding, ...]:
        """Return the findings about an entry."""
        return tuple(finding for finding in self.findings if finding.entry == entry)

    def to_frame(self) -> pd.DataFrame:
        """Return one row a finding."""
        rows = [asdict(finding) for finding in self.findings]
        return pd.DataFrame(rows, columns=list(Finding.__dataclass_fields__), dtype=object)

    def summary(self) -> str:
        """Return the number of problems, and a line for each finding."""
        broken = len({finding.entry for finding in self.findings})
        problems = f"{_counted(len(self.findings), 'problem')} in {broken} of them."
        head = f"{_counted(len(self.entries), 'entry')}: {problems if broken else 'no problems.'}"
        return "\n".join([head, *(f"  {finding}" for finding in self.findings)])

    @in_figure_style
    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the number of problems of each entry."""
        return _drawn({name: len(self.of(name)) for name in self.entries}, ax)


@dataclass(frozen=True, slots=True, repr=False)
class CatalogBuild(Result):
    """A catalog that was written."""

    SCHEMA: ClassVar[str] = "jointz.CatalogBuild/2"
    JSON_PROPERTIES: ClassVar[tuple[str, ...]] = ("skipped_entries",)

    catalog: str  # path of the file
    entries: tuple[str, ...]  # folders of the entries in it
    skipped: tuple[Finding, ...]  # findings that keep other entries out of it
    rows: int  # number of estimates and printed values
    people: int  # number of participants of all entries

    @property
    def skipped_entries(self) -> tuple[str, ...]:
        """Folders of entries that are not in the catalog."""
        return tuple(dict.fromkeys(finding.entry for finding in self.skipped))

    def _problems(self) -> dict[str, int]:
        count = dict.fromkeys((*self.entries, *self.skipped_entries), 0)
        for finding in self.skipped:
            count[finding.entry] += 1
        return count

    def to_frame(self) -> pd.DataFrame:
        """Return one row an entry: whether it is in the catalog, and how many problems it has."""
        rows = [(name, name in self.entries, n) for name, n in self._problems().items()]
        return pd.DataFrame(rows, columns=["entry", "in_catalog", "problems"])

    def summary(self) -> str:
        """Return the size of the catalog, and the entries that were skipped with the reasons."""
        if not self.entries:
            head = f"{self.catalog}: not written, no entry is without problems"
        else:
            head = f"{self.catalog}: {_counted(len(self.entries), 'entry')}, {self.people} people, "
            head += f"{self.rows} rows"
        head += f"; {_counted(len(self.skipped_entries), 'entry')} skipped."
        return "\n".join([head, *(f"  {finding}" for finding in self.skipped)])

    @in_figure_style
    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the number of problems of each entry; entries with problems are skipped."""
        return _drawn(self._problems(), ax)


def _counted(n: int, noun: str) -> str:
    if n != 1:
        noun = f"{noun.removesuffix('y')}ies" if noun.endswith("y") else f"{noun}s"
    return f"{n} {noun}"


def _drawn(problems: Mapping[str, int], ax: "Axes | None") -> "Axes":
    axes = axes_or_new(ax, (6.0, 4.0))
    at = np.arange(len(problems))
    colours = [MODEL if n else INK for n in problems.values()]
    axes.barh(at, list(problems.values()), color=colours)
    axes.set_yticks(at, [f"{name}: {n or 'none'}" for name, n in problems.items()])
    axes.invert_yaxis()
    axes.set_xlim(0, max([1, *problems.values()]))
    axes.set_xlabel("problems")
    axes.set_ylabel("entry")
    return axes
