"""Scores of estimates against the truth: coverage, errors, limits and failures."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import pandas as pd

from jointz.results.estimates import CellEstimate, ParameterEstimate

#: Participant -> timing point -> parameter -> true value, SI.
Truths = Mapping[str, Mapping[str, Mapping[str, float]]]

PARAMETERS = ("stiffness", "damping", "inertia", "stiffness_onset", "damping_onset")
#: Status of a parameter that other cells of the same analysis have and this one lacks.
MISSING = "failed:missing"
_FAR_PCT = 30.0


@dataclass(frozen=True, slots=True)
class Row:
    """One estimate and its truth.

    Parameters
    ----------
    study : str
        Study or preset.
    participant, timing_point, parameter : str
        Identify the estimate.
    status : str
        ``ok``, ``at_bound``, ``undecided`` or ``failed:CODE``.
    truth : float
        True value, SI.
    value, ci_low, ci_high : float or None
        Estimate and its interval, SI. In undecided rows the ends are one-sided 95 % limits.
    """

    study: str
    participant: str
    timing_point: str
    parameter: str
    status: str
    truth: float
    value: float | None = None
    ci_low: float | None = None
    ci_high: float | None = None

    @property
    def decided(self) -> bool:
        """Whether the estimate has a value to use."""
        return self.status in ("ok", "at_bound") and self.value is not None

    @property
    def covered(self) -> bool | None:
        """Whether the interval of a decided row holds the truth; None if it has no interval."""
        if not self.decided or self.ci_low is None or self.ci_high is None:
            return None
        return self.ci_low <= self.truth <= self.ci_high

    @property
    def error_pct(self) -> float:
        """Error of a decided row, % of truth; nan otherwise."""
        if not self.decided or self.value is None:
            return np.nan
        return 100.0 * (self.value - self.truth) / abs(self.truth)

    @property
    def half_width_pct(self) -> float:
        """Half the width of a decided row's interval, % of truth; nan if it has no interval."""
        if not self.decided or self.ci_low is None or self.ci_high is None:
            return np.nan
        return 50.0 * (self.ci_high - self.ci_low) / abs(self.truth)

    @property
    def upper_limit_true(self) -> bool | None:
        """Whether the truth is below the upper limit; None if there is no such limit."""
        if self.status != "undecided" or self.ci_high is None:
            return None
        return self.truth < self.ci_high

    @property
    def lower_limit_true(self) -> bool | None:
        """Whether the truth is above the lower limit; None if there is no such limit."""
        if self.status != "undecided" or self.ci_low is None:
            return None
        return self.ci_low < self.truth


@dataclass(frozen=True, slots=True)
class Share:
    """A share of rows with its Monte-Carlo standard error.

    The error treats rows as independent. Rows of one participant are not, so that the true error
    is larger; at a share of 0 or 1 the formula gives 0.
    """

    count: int
    n: int

    @property
    def rate(self) -> float:
        """The share; nan without rows."""
        return self.count / self.n if self.n else np.nan

    @property
    def error(self) -> float:
        """Monte-Carlo standard error sqrt(p(1-p)/n)."""
        return float(np.sqrt(self.rate * (1.0 - self.rate) / self.n)) if self.n else np.nan

    def __str__(self) -> str:
        if not self.n:
            return "-"
        return f"{self.rate:.2f}±{self.error:.2f} ({self.count}/{self.n})"


@dataclass(frozen=True, slots=True)
class Score:
    """Scores of one parameter in one study; errors in % of truth are over decided rows."""

    parameter: str
    rows: int
    decided: Share  # of all rows
    coverage: Share  # of decided rows with an interval
    rmse_pct: float
    bias_pct: float
    far: Share  # of decided rows: off by more than 30 %
    half_width_pct: float  # median
    upper_limits: Share  # of undecided rows with an upper limit: the limit is true
    lower_limits: Share  # of undecided rows with a lower limit: the limit is true
    failures: Mapping[str, int]  # rows by code


def rows_of(study: str, cells: Sequence[CellEstimate], truths: Truths) -> list[Row]:
    """Return the rows of an analysis: every parameter that has a truth and that some cell has.

    Parameters
    ----------
    study : str
        Study or preset.
    cells : sequence of CellEstimate
        Estimates of all participants and timing points.
    truths : mapping
        Participant -> timing point -> parameter -> true value.

    Notes
    -----
    A cell may lack a parameter that others have, for example where it failed. It gets a row all
    the same, because leaving it out would raise the share decided.
    """
    names = [name for name in PARAMETERS if any(cell.parameter(name) for cell in cells)]
    rows = []
    for cell in cells:
        truth = truths[cell.participant][cell.timing_point]
        where = (study, cell.participant, cell.timing_point)
        rows += [_row(where, name, cell, truth[name]) for name in names if name in truth]
    return rows


def _row(where: tuple[str, str, str], name: str, cell: CellEstimate, truth: float) -> Row:
    estimate = cell.parameter(name) or ParameterEstimate(name, None, None, None, MISSING)
    return Row(
        *where, name, estimate.status, truth, estimate.value, estimate.ci_low, estimate.ci_high
    )


def score(parameter: str, rows: Sequence[Row]) -> Score:
    """Return the scores of one parameter.

    Parameters
    ----------
    parameter : str
        Name of the parameter.
    rows : sequence of Row
        Its rows.
    """
    decided = [row for row in rows if row.decided]
    errors = np.array([row.error_pct for row in decided])
    widths = np.array([row.half_width_pct for row in decided])
    widths = widths[np.isfinite(widths)]
    codes = (row.status.partition(":") for row in rows)
    return Score(
        parameter=parameter,
        rows=len(rows),
        decided=Share(len(decided), len(rows)),
        coverage=_share(row.covered for row in rows),
        rmse_pct=float(np.sqrt(np.mean(errors**2))) if decided else np.nan,
        bias_pct=float(errors.mean()) if decided else np.nan,
        far=_share(abs(error) > _FAR_PCT for error in errors),
        half_width_pct=float(np.median(widths)) if len(widths) else np.nan,
        upper_limits=_share(row.upper_limit_true for row in rows),
        lower_limits=_share(row.lower_limit_true for row in rows),
        failures=dict(sorted(Counter(code for head, _, code in codes if head == "failed").items())),
    )


def _share(answers: Iterable[bool | None]) -> Share:
    """Return the share of yes; None is no answer."""
    known = [bool(answer) for answer in answers if answer is not None]
    return Share(sum(known), len(known))


def scores(rows: Sequence[Row]) -> list[Score]:
    """Return the scores of every parameter that has rows.

    Parameters
    ----------
    rows : sequence of Row
        Rows of one study.
    """
    groups = {name: [row for row in rows if row.parameter == name] for name in PARAMETERS}
    return [score(name, group) for name, group in groups.items() if group]


def score_table(entries: Sequence[Score]) -> pd.DataFrame:
    """Return scores as a table of text, one line a parameter.

    Parameters
    ----------
    entries : sequence of Score
        Scores of one study.
    """
    return pd.DataFrame([_line(entry) for entry in entries])


def _line(entry: Score) -> dict[str, Any]:
    failures = ", ".join(f"{code} {count}" for code, count in entry.failures.items())
    return {
        "parameter": entry.parameter,
        "rows": entry.rows,
        "decided": str(entry.decided),
        "coverage": str(entry.coverage),
        "RMSE %": _number(entry.rmse_pct),
        "bias %": _number(entry.bias_pct),
        "off > 30 %": str(entry.far),
        "half-width %": _number(entry.half_width_pct),
        "upper limit true": str(entry.upper_limits),
        "lower limit true": str(entry.lower_limits),
        "failed": failures or "-",
    }


def _number(value: float) -> str:
    return "-" if np.isnan(value) else f"{value:.1f}"


def row_table(rows: Sequence[Row]) -> pd.DataFrame:
    """Return every row with its error and whether its interval holds the truth.

    Parameters
    ----------
    rows : sequence of Row
        Rows of one study.
    """
    more = [{"error_pct": row.error_pct, "covered": row.covered} for row in rows]
    return pd.DataFrame([asdict(row) | extra for row, extra in zip(rows, more, strict=True)])
