"""Random field theory in one dimension: smoothness, and how often smooth noise crosses a height.

All probabilities are of one tail; nodes are counted from 0.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, expm1, log, log1p, pi, sqrt

import numpy as np
from scipy.optimize import brentq
from scipy.special import gamma, pdtrc, stdtr, stdtrit

_FOUR_LOG_2 = 4.0 * log(2.0)
#: Resels below which residuals count as not changing over the nodes.
_NO_CHANGE = 1e-6
#: Degrees of freedom from which a crossing of a t field gets rarer with its height.
_FEWEST_DF = 2


@dataclass(frozen=True, slots=True)
class SearchRegion:
    """Where a field is looked at, and how smooth it is there.

    ``fwhm_nodes``: full width at half maximum of the Gaussian kernel that makes white noise as
    smooth; ``resels``: resolution elements; ``n_nodes``: nodes in the region; ``n_pieces``: number
    of runs of neighbouring nodes.
    """

    fwhm_nodes: float
    resels: float
    n_nodes: int
    n_pieces: int = 1


def search_region(residuals: np.ndarray, tested: np.ndarray) -> SearchRegion:
    """Return smoothness and size of the field that left these residuals.

    ``residuals`` (n_curve, n_node): about the group means; ``tested`` (n_node,). Resels per node
    are sqrt(v / (4 log 2)), v the squared central differences over the squared residuals, summed
    over curves (Kiebel et al. 1999, doi:10.1006/nimg.1999.0508; Pataky 2010,
    doi:10.1016/j.jbiomech.2010.03.008). Residuals are not scaled to unit length first, as in spm1d:
    with few curves the test is a little strict.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], tested, [False]])))
    pieces = list(zip(edges[::2], edges[1::2], strict=True))
    length = sum(stop - start - 1 for start, stop in pieces)
    if not length:
        raise ValueError("search_region: expected neighbouring nodes to test, found none")
    roughness = [_resels_per_node(residuals[:, i:j]) for i, j in pieces if j - i > 1]
    per_node = float(np.concatenate(roughness).mean())
    resels = length * per_node
    if resels < _NO_CHANGE:
        raise ValueError(
            "search_region: expected residuals that change over the nodes, found the same at all. "
            "Such curves are single values: use a t test."
        )
    return SearchRegion(1.0 / per_node, resels, int(tested.sum()), len(pieces))


def _resels_per_node(residuals: np.ndarray) -> np.ndarray:
    slope = np.gradient(residuals, axis=1)
    squares = np.einsum("ij,ij->j", slope, slope) / np.einsum("ij,ij->j", residuals, residuals)
    return np.asarray(np.sqrt(squares / _FOUR_LOG_2))


def _densities(height: float, df: float) -> tuple[float, float]:
    """Return the Euler characteristic densities of dimension 0 and 1 of a t field."""
    line = sqrt(_FOUR_LOG_2) / (2.0 * pi) * (1.0 + height * height / df) ** (-0.5 * (df - 1.0))
    return float(stdtr(df, -height)), line


def expected_crossings(height: float, *, df: float, region: SearchRegion) -> float:
    """Return the expected Euler characteristic of what a t field has above a height.

    Resels times density, summed over dimensions; high up the expected number of clusters. Worsley
    et al. 1996, doi:10.1002/(SICI)1097-0193(1996)4:1<58::AID-HBM4>3.0.CO;2-O.
    """
    point, line = _densities(height, df)
    return region.n_pieces * point + region.resels * line


def crossing_probability(height: float, *, df: float, region: SearchRegion) -> float:
    """Return the probability that a t field of no effect goes above a height anywhere.

    One tail: 1 - exp(-expected crossings), or Bonferroni's bound over the nodes where that is
    smaller. Clusters of noise come like events of a Poisson process (Friston et al. 1994,
    doi:10.1002/hbm.460010306). :func:`critical_height` is the inverse.
    """
    field = -expm1(-expected_crossings(height, df=df, region=region))
    return min(field, region.n_nodes * float(stdtr(df, -height)))


def critical_height(p: float, *, df: float, region: SearchRegion) -> float:
    """Return the height that a t field of no effect goes above with a given probability.

    ``p``: of one tail, 0 to 0.25 (half of it for two tails); ``df`` at least 2. Never above
    Bonferroni's height over the nodes.
    """
    if not 0.0 < p <= 0.25:
        raise ValueError(f"critical_height: expected a probability of 0 to 0.25, got {p:g}")
    if df < _FEWEST_DF:
        raise ValueError(f"critical_height: expected {_FEWEST_DF} degrees of freedom, got {df:g}")
    bonferroni = float(-stdtrit(df, p / region.n_nodes))
    allowed = -log1p(-p)  # expected crossings

    def excess(height: float) -> float:
        return expected_crossings(height, df=df, region=region) - allowed

    if excess(bonferroni) >= 0.0:
        return bonferroni
    return float(brentq(excess, 0.0, bonferroni, xtol=1e-12, rtol=1e-14))


def cluster_probability(
    extent_resels: float, height: float, *, df: float, region: SearchRegion
) -> float:
    """Return the probability of a cluster as wide anywhere, in a t field of no effect.

    One tail. A cluster is at least k resels wide with probability exp(-(gamma(3/2) k / m)^2), where
    its mean m is the ratio of the field's densities of dimension 0 and 1 (Friston et al. 1994; in
    this form Pataky 2016, doi:10.18637/jss.v071.i07).
    """
    return -expm1(-_wide_clusters(extent_resels, height, df, region))


def set_probability(
    extents_resels: Sequence[float], height: float, *, df: float, region: SearchRegion
) -> float:
    """Return the probability of as many clusters, each as wide as the narrowest of these.

    ``extents_resels``: widths of the clusters cut at ``height``, at least one. One tail. Friston et
    al. 1996, doi:10.1006/nimg.1996.0074.
    """
    expected = _wide_clusters(min(extents_resels), height, df, region)
    return float(pdtrc(len(extents_resels) - 1, expected))


def _wide_clusters(extent: float, height: float, df: float, region: SearchRegion) -> float:
    point, line = _densities(height, df)
    crossings = region.n_pieces * point + region.resels * line
    return crossings * exp(-((float(gamma(1.5)) * extent * line / point) ** 2))
