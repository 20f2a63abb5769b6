"""From estimates and truth to bias, RMSE, coverage, width, share undecided and ratio to the bound.

Errors are ``estimate / truth - 1`` over decided cells: status ``ok`` or ``at_bound`` with a value.
"""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import pandas as pd
from benchmarks.accuracy.rows import PARAMETERS
from scipy import stats

LEVEL = 0.95
#: Timing point of what holds for all of them, in results and tables.
ALL = "all"


@dataclass(frozen=True, slots=True)
class Coverage:
    """How often intervals hold the truth.

    Parameters
    ----------
    rate : float or None
        Share of decided cells; None without any.
    low, high : float or None
        Band that a true rate of 0.95 stays in with probability 0.95.
    design_effect : float or None
        Variance of the rate over that of as many independent cells.
    """

    rate: float | None
    low: float | None
    high: float | None
    design_effect: float | None

    @property
    def met(self) -> bool:
        """Whether the rate lies in the band."""
        if self.rate is None or self.low is None or self.high is None:
            return False
        return self.low <= self.rate <= self.high


@dataclass(frozen=True, slots=True)
class Score:
    """How good one method is in one parameter, at one timing point or over all.

    Parameters
    ----------
    method, parameter, timing_point : str
        Of what; ``all`` is every timing point.
    n : int
        Cells.
    undecided_pct, failed_pct : float
        Share of cells.
    bias_pct, rmse_pct, width_pct : float or None
        Mean and root mean square error, median width of the interval; % of truth.
    rmse : float or None
        Root mean square error, SI; also where the truth is zero.
    coverage : Coverage
        Of the intervals.
    zero_width : int
        Decided cells whose interval has no width.
    one_sided_pct : float
        Share of decided cells at a bound.
    bound_pct, ratio : float or None
        Root mean square of the bound over the same cells, % of truth, and RMSE over it.
    """

    method: str
    parameter: str
    timing_point: str
    n: int
    undecided_pct: float
    failed_pct: float
    bias_pct: float | None
    rmse_pct: float | None
    width_pct: float | None
    rmse: float | None
    coverage: Coverage
    zero_width: int
    one_sided_pct: float
    bound_pct: float | None
    ratio: float | None

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for JSON."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Score":
        """Rebuild from :meth:`to_dict`.

        Parameters
        ----------
        data : mapping
            What :meth:`to_dict` returned.
        """
        return cls(**{**data, "coverage": Coverage(**data["coverage"])})


def coverage_of(inside: np.ndarray, cluster: np.ndarray) -> Coverage:
    """Return the rate and the band of a true 0.95, clustered by participant.

    Parameters
    ----------
    inside : (n,) bool
        Whether each interval holds the truth.
    cluster : (n,) int
        Participant of each.

    Notes
    -----
    The design effect is the variance of the rate as a ratio of participants' sums (Cochran,
    Sampling Techniques, 6.3) over the binomial one; the band is the central 95 % of a binomial
    with ``n / design effect`` draws. Below 1 it counts as 1: few participants cannot show that
    cells of one person disagree.
    """
    n = inside.size
    if n == 0:
        return Coverage(None, None, None, None)
    rate = float(inside.mean())
    effect = 1.0
    sums = pd.Series(inside - rate).groupby(cluster).sum().to_numpy()
    binomial = rate * (1.0 - rate) / n
    if sums.size > 1 and binomial > 0.0:
        clustered = sums.size / (sums.size - 1) * float(sums @ sums) / n**2
        effect = max(1.0, clustered / binomial)
    draws = max(1, round(n / effect))
    low, high = stats.binom.interval(LEVEL, draws, LEVEL)
    return Coverage(rate, float(low) / draws, float(high) / draws, effect)


def cells_of(
    truths: Iterable[Mapping[str, Any]], results: Iterable[Mapping[str, Any]]
) -> pd.DataFrame:
    """Put estimates beside truth and bound, a row a cell and parameter.

    Parameters
    ----------
    truths : iterable of mapping
        ``number``, ``truth`` and ``bound`` of participants.
    results : iterable of mapping
        ``number``, ``method`` and ``estimates`` of participants.

    Returns
    -------
    pandas.DataFrame
        Columns ``method, number, timing_point, parameter, value, low, high, status, truth,
        bound, shared``. An inertia of all timing points stands once beside their mean and,
        ``shared``, once beside each.
    """
    by_number = {entry["number"]: entry for entry in truths}
    rows: list[dict[str, Any]] = []
    for result in results:
        entry = by_number.get(result["number"])
        if entry is not None:
            for estimate in result["estimates"]:
                rows += _placed({**estimate, "method": result["method"]}, entry)
    columns = ["method", "number", "timing_point", "parameter", "value", "low", "high", "status"]
    table = pd.DataFrame(rows, columns=[*columns, "truth", "bound", "shared"])
    numeric = ["value", "low", "high", "truth", "bound"]
    table[numeric] = table[numeric].astype(float)
    return table


def _placed(estimate: dict[str, Any], entry: Mapping[str, Any]) -> list[dict[str, Any]]:
    name, point = estimate["parameter"], estimate["timing_point"]
    truth, bound = entry["truth"], entry["bound"]
    if name not in PARAMETERS:
        return []
    estimate["number"] = entry["number"]
    if point != ALL:
        own = {"truth": truth[point][name], "bound": bound[point][name], "shared": False}
        return [estimate | own]
    mean = float(np.mean([values[name] for values in truth.values()]))
    least = bound.get(ALL, {}).get(name, np.nan)
    first = estimate | {"truth": mean, "bound": least, "shared": False}
    return [first] + [
        estimate
        | {"timing_point": p, "truth": truth[p][name], "bound": bound[p][name], "shared": True}
        for p in truth
    ]


def scores_of(cells: pd.DataFrame) -> list[Score]:
    """Score every method, parameter and timing point, and each over all timing points.

    Parameters
    ----------
    cells : pandas.DataFrame
        Of :func:`cells_of`.
    """
    scores = []
    for (method, parameter), mine in cells.groupby(["method", "parameter"], sort=False):
        overall = mine[~mine["shared"]]
        # One J for all stands for itself, unless the person's timing points have their own.
        own = overall[overall["timing_point"] != ALL]["number"].unique()
        overall = overall[(overall["timing_point"] != ALL) | ~overall["number"].isin(own)]
        scores.append(score(overall, str(method), str(parameter), ALL))
        for point, here in mine[mine["timing_point"] != ALL].groupby("timing_point", sort=False):
            ranked = here.sort_values("shared").drop_duplicates("number")
            scores.append(score(ranked, str(method), str(parameter), str(point)))
    return scores


def decided(cells: pd.DataFrame) -> pd.DataFrame:
    """Return the cells with a value that stands.

    Parameters
    ----------
    cells : pandas.DataFrame
        Of :func:`cells_of`.
    """
    return cells[cells["status"].isin(["ok", "at_bound"]) & cells["value"].notna()]


def score(cells: pd.DataFrame, method: str, parameter: str, timing_point: str) -> Score:
    """Score one group of cells.

    Parameters
    ----------
    cells : pandas.DataFrame
        Of one method and parameter.
    method, parameter, timing_point : str
        As printed.
    """
    fine = decided(cells)
    truth, value = fine["truth"].to_numpy(), fine["value"].to_numpy()
    low, high = fine["low"].to_numpy(), fine["high"].to_numpy()
    error, real = value - truth, truth != 0.0
    share = error[real] / truth[real]
    least = fine["bound"].to_numpy()[real] / truth[real]
    bound = _rms(least[np.isfinite(least)])
    rmse = _rms(share)
    return Score(
        method=method,
        parameter=parameter,
        timing_point=timing_point,
        n=len(cells),
        undecided_pct=100.0 * float((cells["status"] == "undecided").mean()),
        failed_pct=100.0 * float(cells["status"].str.startswith("failed").mean()),
        bias_pct=100.0 * float(share.mean()) if share.size else None,
        rmse_pct=None if rmse is None else 100.0 * rmse,
        width_pct=100.0 * float(np.median((high - low)[real] / truth[real]))
        if share.size
        else None,
        rmse=_rms(error),
        coverage=coverage_of((low <= truth) & (truth <= high), fine["number"].to_numpy()),
        zero_width=int((high - low <= 0.0).sum()),
        one_sided_pct=100.0 * float((fine["status"] == "at_bound").mean()) if len(fine) else 0.0,
        bound_pct=None if bound is None else 100.0 * bound,
        ratio=rmse / bound if rmse is not None and bound else None,
    )


def _rms(values: np.ndarray) -> float | None:
    return float(np.sqrt(np.mean(values**2))) if values.size else None
