"""Counts of an analysis, as its csv files have them, for every page and message."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from jointz.core.codes import Exclusion
from jointz.core.gait_phases import ALL_POINTS
from jointz.results.certificate_result import PARAMETERS

if TYPE_CHECKING:
    from jointz.results.study_analysis import StudyAnalysis


@dataclass(frozen=True, slots=True)
class StudyCounts:
    """Counts of people, estimates, pulses and means; each thing counts once."""

    people: int  # participants of ``estimates.csv``
    statuses: Counter[str]  # K, B and J of ``estimates.csv`` by status
    available: int  # K, B and J with a value
    used: int  # pulses of ``pulses.csv`` without a code
    exclusions: Counter[str]  # pulses of ``excluded.csv`` by code, without aborted ones
    aborted: int  # pulses of ``excluded.csv`` that were broken off and done again
    means: Mapping[str, tuple[int, int]]  # parameter -> decided and all means of ``population.csv``

    @property
    def excluded(self) -> int:
        """Number of excluded pulses, without aborted ones."""
        return self.exclusions.total()

    @property
    def failed(self) -> int:
        """Number of K, B and J that failed."""
        return sum(n for status, n in self.missing.items() if status.startswith("failed"))

    @property
    def missing(self) -> Counter[str]:
        """K, B and J without a value by status."""
        return Counter({s: n for s, n in self.statuses.items() if s not in ("ok", "at_bound")})

    @property
    def pulses_text(self) -> str:
        """Pulses used, excluded and aborted in words."""
        aborted = f", {self.aborted:,} broken off and done again" if self.aborted else ""
        return f"{self.used:,} used, {self.excluded:,} excluded{aborted}"


def study_counts(analysis: "StudyAnalysis") -> StudyCounts:
    """Count what an analysis has; values per kg and at the onset repeat K and B."""
    estimates = [p for c in analysis.cells for p in c.parameters if p.name in PARAMETERS]
    codes = Counter(p.code for p in analysis.pulses)
    if not analysis.pulses:
        # The row of a shared value repeats the pulses of the timing points that share it.
        cells = [c for c in analysis.cells if c.timing_point != ALL_POINTS]
        codes = Counter({"": sum(c.n_used for c in cells), "?": sum(c.n_excluded for c in cells)})
    used, aborted = codes.pop("", 0), codes.pop(Exclusion.ABORTED.value, 0)
    every = Counter(m.parameter for m in analysis.population)
    decided = Counter(m.parameter for m in analysis.population if m.value is not None)
    return StudyCounts(
        people=len({c.participant for c in analysis.cells}),
        statuses=Counter(p.status for p in estimates),
        available=sum(p.available for p in estimates),
        used=used,
        exclusions=codes,
        aborted=aborted,
        means={name: (decided[name], n) for name, n in every.items()},
    )
