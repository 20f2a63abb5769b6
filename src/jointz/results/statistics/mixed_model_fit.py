"""The mixed model of one response: participants as a random factor, levels as a fixed one."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar

import pandas as pd

from jointz.core.errors import DataError
from jointz.results.base import Axes, PlottedResult, record_frame, summary_text

ADJUSTMENTS = ("bonferroni", "holm", "none")
ERRORS = ("pooled", "paired")

_METHODS = {"kenward-roger": "Kenward-Roger", "satterthwaite": "Satterthwaite"}


@dataclass(frozen=True, slots=True)
class EffectTest:
    """An F test."""

    F: float  # F statistic; scaled if by the method of Kenward and Roger
    df_num: float  # numerator degrees of freedom
    df_den: float  # denominator degrees of freedom
    p: float  # probability of as large an F under the null


@dataclass(frozen=True, slots=True)
class Variances:
    """Variances of the random parts, in the unit of the response squared."""

    participant: float  # between participants
    residual: float  # of the rows
    cell: float | None = None  # of the cells about participant and level; None without replicates


@dataclass(frozen=True, slots=True)
class RepeatedMeasuresTest(EffectTest):
    """The analysis of variance of a complete table; its p is exact under sphericity."""

    epsilon: float  # Greenhouse and Geisser's epsilon
    p_epsilon: float  # p with both degrees of freedom multiplied by ``epsilon``


@dataclass(frozen=True, slots=True)
class RandomEffectTest:
    """The test that a variance is above 0."""

    effect: str  # ``participant`` or ``cell``
    # -2 log of the ratio of the restricted likelihoods, without and with the variance
    likelihood_ratio: float
    # by chi-squared with 1 degree of freedom; conservative, because 0 is at the bound
    p_chi2: float
    # by the 50:50 mixture of chi-squared with 1 degree of freedom and a point at 0
    p_mixture: float
    F: float | None = None  # statistic of the exact F test; None where there is none
    df_num: float | None = None  # numerator degrees of freedom of the exact F test
    df_den: float | None = None  # denominator degrees of freedom of the exact F test
    p: float | None = None  # of the exact F test


@dataclass(frozen=True, slots=True)
class IntraclassCorrelation:
    """The share of participants in the variance of one value of a cell."""

    value: float  # from the REML variances, 0..1
    ci_low: float  # lower end of the interval from the F distribution
    ci_high: float  # upper end of the interval from the F distribution
    exact: bool  # whether the interval is exact: not with different numbers of replicates a cell


@dataclass(frozen=True, slots=True)
class LevelMean:
    """The estimated mean of a level over participants."""

    level: str
    mean: float  # estimate by the model
    se: float  # standard error by the model
    df: float  # degrees of freedom by the model
    ci_low: float  # lower end of the interval by the model
    ci_high: float  # upper end of the interval by the model
    n_participants: int  # participants with a value at the level


@dataclass(frozen=True, slots=True)
class LevelPair:
    """Two levels compared, not adjusted."""

    first: str  # first level
    second: str  # second level
    # ``pooled``: error of the model; ``paired``: error of a paired t test of these two levels alone
    error: str
    difference: float | None  # first minus second; by the model, or over complete pairs
    # standard error of ``difference``; None below two differences or without their variation
    se: float | None
    df: float | None  # degrees of freedom of ``t``; None likewise
    t: float | None  # ``difference`` over ``se``; None likewise
    p: float | None  # two-sided p of ``t``, not adjusted; None likewise
    n_participants: int  # participants with a value at both levels


@dataclass(frozen=True, slots=True, repr=False)
class MixedModelFit(PlottedResult):
    """A mixed model of one response on the levels of one factor within participants.

    Parameters
    ----------
    response, within, participant : str
        Columns of the table.
    levels : tuple of str
        Levels of ``within``, in order.
    nested : bool
        Whether the rows were replicates of participant and level.
    df_method : str
        ``kenward-roger`` or ``satterthwaite``.
    f_test : EffectTest
        Are all levels equal?
    variances : Variances
        REML estimates, 0 at the bound.
    random_effects : tuple of RandomEffectTest
        Of participants, and of cells where rows are replicates.
    icc : IntraclassCorrelation
        How much of the variance is between participants.
    repeated_measures : RepeatedMeasuresTest or None
        Where the table is complete and balanced.
    means : tuple of LevelMean
        Of the levels.
    comparisons : tuple of LevelPair
        Of all pairs, with either error; see :meth:`pairs`.
    n_rows, n_participants : int
        What entered.
    missing : tuple of (str, str)
        Participant and level without a value; the others of the participant are used.
    ci_level : float
        Of all intervals.
    settings : mapping
        What was chosen, and the version of jointz.
    notes : tuple of str
        What a reader of the numbers must know.
    """

    SCHEMA: ClassVar[str] = "jointz.MixedModelFit/1"
    FIGURE_SIZE: ClassVar[tuple[float, float]] = (6.0, 4.0)

    response: str
    within: str
    participant: str
    levels: tuple[str, ...]
    nested: bool
    df_method: str
    f_test: EffectTest
    variances: Variances
    random_effects: tuple[RandomEffectTest, ...]
    icc: IntraclassCorrelation
    repeated_measures: RepeatedMeasuresTest | None
    means: tuple[LevelMean, ...]
    comparisons: tuple[LevelPair, ...]
    n_rows: int
    n_participants: int
    missing: tuple[tuple[str, str], ...]
    ci_level: float = 0.95
    settings: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def formula(self) -> str:
        """The model, as lme4 writes it."""
        cell = f" + (1 | {self.participant}:{self.within})" if self.nested else ""
        return f"{self.response} ~ {self.within} + (1 | {self.participant}){cell}"

    def pairs(self, adjust: str = "bonferroni", *, error: str = "pooled") -> pd.DataFrame:
        """Return all pairs of levels, compared.

        Parameters
        ----------
        adjust : str
            Of p: ``bonferroni`` (as published), ``holm`` (never less powerful), ``none``.
        error : str
            ``pooled``: the model's error for every pair, as published; ``paired``: a paired
            t test each, which needs no equal variances but has few degrees of freedom.

        Returns
        -------
        pandas.DataFrame
            One row a pair: ``first``, ``second``, ``difference`` (first minus second),
            ``se``, ``df``, ``t``, ``p``, ``p_adjusted``, ``ci_low``, ``ci_high``,
            ``n_participants``, ``adjust``, ``error``. Intervals hold together at
            ``ci_level`` by Bonferroni, those of Holm too (it has none of its own); with
            ``none`` each holds alone. NaN where a pair has no test; it does not count in
            the adjustment.

        Raises
        ------
        DataError
            When ``adjust`` or ``error`` is none of these.
        """
        for name, value, choices in (("adjust", adjust, ADJUSTMENTS), ("error", error, ERRORS)):
            if value not in choices:
                raise DataError(
                    f"MixedModelFit.pairs: expected {name} {', '.join(choices)}, got {value!r}"
                )
        chosen = [pair for pair in self.comparisons if pair.error == error]
        columns = [f.name for f in fields(LevelPair) if f.name != "error"]
        frame = record_frame(chosen, columns)
        numbers = ["difference", "se", "df", "t", "p"]
        frame[numbers] = frame[numbers].astype(float)
        n_tests = int(frame["p"].notna().sum())
        frame.insert(columns.index("p") + 1, "p_adjusted", _adjusted(frame["p"], adjust))
        half = frame["se"] * _t_limit(
            frame["df"], self.ci_level, 1 if adjust == "none" else n_tests
        )
        frame.insert(columns.index("p") + 2, "ci_low", frame["difference"] - half)
        frame.insert(columns.index("p") + 3, "ci_high", frame["difference"] + half)
        return frame.assign(adjust=adjust, error=error)

    def to_frame(self) -> pd.DataFrame:
        """Return one row a level: mean, interval, participants."""
        return record_frame(self.means, LevelMean.__slots__)

    def summary(self) -> str:
        """Return a short text: the tests, the variances, the pairs, the notes."""
        f, icc = self.f_test, self.icc
        title = f"{self.formula}: {self.n_rows} rows of {self.n_participants} participants"
        lines = [f"{self.within}: {_f_text(f)} ({_METHODS[self.df_method]})"]
        if self.repeated_measures is not None:
            rm = self.repeated_measures
            lines.append(
                f"repeated-measures ANOVA: {_f_text(rm)}; Greenhouse-Geisser epsilon "
                f"{rm.epsilon:.3f}, p {rm.p_epsilon:.3g}"
            )
        lines += map(_random_text, self.random_effects)
        cell = "" if self.variances.cell is None else f", cell {self.variances.cell:.4g}"
        lines += [
            f"variances: participant {self.variances.participant:.4g}{cell}, "
            f"residual {self.variances.residual:.4g}",
            f"intraclass correlation {icc.value:.3f} ({icc.ci_low:.3f} to {icc.ci_high:.3f}, "
            f"{'exact' if icc.exact else 'approximate'})",
            f"pairs, pooled error, Bonferroni: {self._pairs_text()}",
        ]
        if self.missing:
            cells = ", ".join(f"{who} at {level}" for who, level in self.missing)
            lines.append(f"no value: {cells}; their other values are used")
        return summary_text(title, lines, self.notes)

    def _pairs_text(self) -> str:
        table = self.pairs()
        below = table[table["p_adjusted"] < 1.0 - self.ci_level]
        shown = [
            f"{first} and {second} (p {p:.2g})"
            for first, second, p in zip(
                below["first"], below["second"], below["p_adjusted"], strict=True
            )
        ]
        return f"{', '.join(shown) or 'none'} differ, of {len(table)}"

    def _draw(self, axes: "Axes") -> None:
        """Draw the mean of every level with its interval."""
        at = list(range(len(self.means)))
        mean = [m.mean for m in self.means]
        half = [m.ci_high - m.mean for m in self.means]
        axes.errorbar(at, mean, yerr=half, fmt="o", capsize=4)
        axes.set_xticks(at, list(self.levels))
        axes.set_xlabel(self.within)
        axes.set_ylabel(f"{self.response}, mean and {100 * self.ci_level:g} % interval")
        axes.set_title(f"{_f_text(self.f_test)} ({_METHODS[self.df_method]})", fontsize="medium")


def _adjusted(p: "pd.Series[float]", adjust: str) -> "pd.Series[float]":
    known = p.notna()
    if adjust == "bonferroni":
        return (p * known.sum()).clip(upper=1.0)
    if adjust == "holm":
        from jointz.kernels.statistics.anova import holm

        return pd.Series(holm(p[known].to_numpy()), index=p.index[known]).reindex(p.index)
    return p


def _t_limit(df: "pd.Series[float]", level: float, n_intervals: int) -> Any:
    from scipy.special import stdtrit

    return stdtrit(df.to_numpy(), 1.0 - (1.0 - level) / 2.0 / max(n_intervals, 1))


def _f_text(test: EffectTest) -> str:
    return f"F({test.df_num:g}, {test.df_den:.4g}) = {test.F:.5g}, p {test.p:.3g}"


def _random_text(test: RandomEffectTest) -> str:
    exact = "" if test.p is None else f"; exact F({test.df_num:g}, {test.df_den:g}) = {test.F:.4g}"
    exact += "" if test.p is None else f", p {test.p:.3g}"
    return (
        f"variance of {test.effect}: likelihood ratio {test.likelihood_ratio:.4g}, "
        f"p {test.p_chi2:.3g} (chi-squared), {test.p_mixture:.3g} (50:50 mixture){exact}"
    )
