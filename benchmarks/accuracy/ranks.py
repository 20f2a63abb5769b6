"""Where the truth stands in the intervals: simulation-based calibration.

The interval is read as that of a normal distribution on either side of the estimate; the
probability integral transform of the truth is then uniform where the method knows its errors
(Talts et al. 2018, with the interval for posterior draws).
"""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import pandas as pd
from benchmarks.accuracy.scores import LEVEL, coverage_of, decided
from scipy import stats

BINS = 20
_HALF = float(stats.norm.ppf(0.5 + LEVEL / 2.0))


@dataclass(frozen=True, slots=True)
class Ranks:
    """Histogram of the transform of one parameter.

    Parameters
    ----------
    method, parameter : str
        Of what.
    counts : tuple of int
        Cells in each of the equal bins of 0..1.
    n_effective : float
        Independent cells that tell as much: cells over the design effect of coverage.
    ks, ks_limit : float
        Kolmogorov-Smirnov distance to the uniform distribution, and what 95 % of uniform
        samples of the effective size stay below.
    chi2_p : float
        Of the histogram, scaled to the effective size.
    """

    method: str
    parameter: str
    counts: tuple[int, ...]
    n_effective: float
    ks: float
    ks_limit: float
    chi2_p: float

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for JSON."""
        return asdict(self)


def transform(
    truth: np.ndarray, value: np.ndarray, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """Return the share of each estimate's distribution below the truth.

    Parameters
    ----------
    truth, value, low, high : (n,) float
        Truth, estimate and ends of its 95 % interval.

    Returns
    -------
    (n,) float
        0 to 1; 0 or 1 where there is no width on the side of the truth.

    Examples
    --------
    >>> one = np.ones(3)
    >>> transform(np.array([0.0, 1.0, 2.0]), one, 0 * one, 2 * one).round(3)
    array([0.025, 0.5  , 0.975])
    """
    side = np.where(truth >= value, high - value, value - low)
    with np.errstate(divide="ignore", invalid="ignore"):
        z = np.where(truth == value, 0.0, (truth - value) / np.maximum(side, 0.0) * _HALF)
    return np.asarray(stats.norm.cdf(z))


def ranks_of(cells: pd.DataFrame) -> list[Ranks]:
    """Return the histogram of every method and parameter; cells at a bound have none.

    Parameters
    ----------
    cells : pandas.DataFrame
        Of :func:`benchmarks.accuracy.scores.cells_of`.
    """
    found = decided(cells[~cells["shared"]])
    found = found[found["status"] == "ok"]
    return [
        _ranks(mine, str(method), str(parameter))
        for (method, parameter), mine in found.groupby(["method", "parameter"], sort=False)
    ]


def _ranks(cells: pd.DataFrame, method: str, parameter: str) -> Ranks:
    truth, value, low, high = (cells[c].to_numpy() for c in ("truth", "value", "low", "high"))
    u = transform(truth, value, low, high)
    counts, _ = np.histogram(u, bins=BINS, range=(0.0, 1.0))
    inside = (low <= truth) & (truth <= high)
    n_effective = u.size / (coverage_of(inside, cells["number"].to_numpy()).design_effect or 1.0)
    expected = u.size / BINS
    chi2 = float(((counts - expected) ** 2 / expected).sum()) * n_effective / u.size
    return Ranks(
        method=method,
        parameter=parameter,
        counts=tuple(int(c) for c in counts),
        n_effective=n_effective,
        ks=float(stats.kstest(u, "uniform").statistic),
        ks_limit=float(stats.kstwo.ppf(LEVEL, max(1, round(n_effective)))),
        chi2_p=float(stats.chi2.sf(chi2, BINS - 1)),
    )
