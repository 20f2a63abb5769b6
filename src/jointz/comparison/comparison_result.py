"""Result of a comparison of conditions, groups, days, timing points or published tables."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, ClassVar

import pandas as pd

from jointz.core.grouping import by_key
from jointz.results.base import Axes, PlottedResult
from jointz.results.statistics.comparison_rows import (
    UNDECIDED,
    Difference,
    FactorTest,
    PersonValue,
    ReferenceRange,
    Repeatability,
    Source,
    SourceMean,
    difference_text,
)


@dataclass(frozen=True, slots=True, repr=False)
class Comparison(PlottedResult):
    """Results compared over people; replicates and pulses do not count as people.

    Parameters
    ----------
    sources : tuple of Source
        The compared results.
    values : tuple of PersonValue
        One for each source, participant, parameter and timing point, missing ones included.
    means : tuple of SourceMean
        Means over people.
    differences : tuple of Difference
        Between sources; for one source, between its timing points.
    tests : tuple of FactorTest
        Mixed models over timing points, or over three and more sources.
    repeatability : tuple of Repeatability
        If the sources are days of the same people.
    references : tuple of ReferenceRange
        Published values for the same timing points.
    margin_pct : float or None
        Margin of equivalence, % of the second mean.
    adjust : str
        Adjustment of p over the differences of a parameter: ``holm``, ``bonferroni``, ``none``.
    ci_level : float
        Level of all intervals.
    settings : mapping
        Chosen options.
    notes : tuple of str
        Notes that a reader of the numbers should know.
    provenance : mapping
        Versions, and hashes of the files that were read.
    """

    SCHEMA: ClassVar[str] = "jointz.Comparison/1"
    FIGURE_SIZE: ClassVar[tuple[float, float]] = (6.0, 4.0)

    sources: tuple[Source, ...]
    values: tuple[PersonValue, ...]
    means: tuple[SourceMean, ...]
    differences: tuple[Difference, ...]
    tests: tuple[FactorTest, ...] = ()
    repeatability: tuple[Repeatability, ...] = ()
    references: tuple[ReferenceRange, ...] = ()
    margin_pct: float | None = None
    adjust: str = "holm"
    ci_level: float = 0.95
    settings: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def available(self) -> bool:
        """Whether at least one difference is available; for one source, a mean."""
        if len(self.sources) < 2 and any(m.mean is not None for m in self.means):
            return True
        return any(d.available for d in self.differences)

    @property
    def adjusted(self) -> str:
        """Adjustment of p in words."""
        return "not adjusted" if self.adjust == "none" else f"adjusted by {self.adjust.title()}"

    @property
    def parameters(self) -> tuple[str, ...]:
        """The compared parameters, in the order of the means."""
        return tuple(dict.fromkeys(m.parameter for m in self.means))

    @property
    def missing(self) -> tuple[PersonValue, ...]:
        """Participants without a value who do not count, by source, parameter and timing point.

        Undecided people count where all people are looked at together.
        """
        lacking = (v for v in self.values if v.value is None)
        without = by_key(((v.source, v.parameter, v.timing_point), v) for v in lacking)
        missing = []
        for m in self.means:
            values = without.get((m.source, m.parameter, m.timing_point), [])
            failed = [v for v in values if v.status != UNDECIDED]
            missing += failed if m.n_missing == len(failed) else values
        return tuple(missing)

    @property
    def n_missing(self) -> int:
        """Number of values that do not count, as the table of the means has them."""
        return sum(m.n_missing for m in self.means)

    @property
    def at_bound(self) -> tuple[PersonValue, ...]:
        """Values at their bound, which are used as they are, and means that include such values."""
        return tuple(v for v in self.values if v.at_bound)

    def to_frame(self) -> pd.DataFrame:
        """Return one row for each difference."""
        return _frame(self.differences, Difference)

    def means_frame(self) -> pd.DataFrame:
        """Return one row for each source, parameter and timing point."""
        return _frame(self.means, SourceMean)

    def repeatability_frame(self) -> pd.DataFrame:
        """Return one row for each parameter and timing point."""
        return _frame(self.repeatability, Repeatability)

    def summary(self) -> str:
        """Return a short text with sources, significant differences and notes."""
        named = (f"{s.name} ({len(s.participants)} people)" for s in self.sources)
        lines = [f"Compared: {', '.join(named) or 'nothing'}"]
        for parameter in self.parameters:
            tested = [d for d in self.differences if d.parameter == parameter and d.available]
            below = [d for d in tested if (d.p_adjusted or 0.0) < 1.0 - self.ci_level]
            count = f"{len(below)} of {len(tested)} differences"
            lines.append(f"  {parameter}: {count}, {self.adjusted}")
            lines += [f"    {difference_text(d)}" for d in below]
        return "\n".join([*lines, *(f"  Note: {note}" for note in self.notes)])

    def _draw(self, axes: "Axes") -> None:
        """Draw the mean of every source with its interval, for the first parameter."""
        parameter = next(iter(self.parameters), "")
        shown = [m for m in self.means if m.parameter == parameter and m.mean is not None]
        points = list(dict.fromkeys(m.timing_point for m in shown))
        for k, source in enumerate(self.sources):
            means = [m for m in shown if m.source == source.name]
            at = [points.index(m.timing_point) + 0.15 * k for m in means]
            mean = [float(m.mean or 0.0) for m in means]
            half = [float(m.ci_high or 0.0) - float(m.mean or 0.0) for m in means]
            axes.errorbar(at, mean, yerr=half, fmt="o", capsize=4, label=source.name)
        axes.set_xticks(range(len(points)), points)
        unit = shown[0].unit if shown else ""
        axes.set_ylabel(f"{parameter} ({unit}), mean and {100 * self.ci_level:g} % interval")
        if shown:
            axes.legend()


def _frame(rows: Sequence[Any], kind: type[Any]) -> pd.DataFrame:
    columns = list(kind.__dataclass_fields__)
    return pd.DataFrame([asdict(row) for row in rows], columns=columns)
