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

    Parameters
    ----------
    fwhm_nodes : float
        Full width at half maximum of the Gaussian kernel that makes white noise as smooth.
    resels : float
        Resolution elements: length of the region in widths, gaps left out.
    n_nodes : int
        Nodes in the region.
    n_pieces : int
        Runs of neighbouring nodes: the region's Euler characteristic.
    """

    fwhm_nodes: float
    resels: float
    n_nodes: int
    n_pieces: int = 1


def search_region(residuals: np.ndarray, tested: np.ndarray) -> SearchRegion:
    """Return smoothness and size of the field that left these residuals.

    Parameters
    ----------
    residuals : (n_curve, n_node) float
        Residuals about the group means; what they are measured in does not matter.
    tested : (n_node,) bool
        Nodes of the region; residuals must vary at each.

    Returns
    -------
    SearchRegion
        Width, resels and pieces.

    Raises
    ------
    ValueError
        When no two neighbouring nodes are tested, or residuals do not change over nodes.

    Notes
    -----
    At each node the resels per node are sqrt(v / (4 log 2)), where v is the sum over curves of
    squared central differences over the sum of squared residuals; their mean is one over the
    width (Kiebel et al. 1999, doi:10.1006/nimg.1999.0508; Pataky 2010,
    doi:10.1016/j.jbiomech.2010.03.008). Unlike Kiebel's, residuals are not scaled to unit length
    before the slope is taken, as in spm1d: with few curves resels read large by
    gamma((df + 1)/2) gamma((df - 1)/2) / gamma(df/2)^2, 6 % at 9 degrees of freedom, which
    makes the test a little strict.

    Examples
    --------
    A cosine and a sine, one period over 100 nodes: v is the square of 2 pi / 100.

    >>> angle = 2 * np.pi * np.arange(101) / 100
    >>> waves = np.array([np.cos(angle), np.sin(angle)])
    >>> round(search_region(waves, np.ones(101, dtype=bool)).fwhm_nodes, 1)
    26.5
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

    Parameters
    ----------
    height : float
        The height, at least 0.
    df : float
        Degrees of freedom of the t field.
    region : SearchRegion
        Where.

    Notes
    -----
    Sum over dimensions of the region's resels times the field's density (Worsley et al. 1996,
    doi:10.1002/(SICI)1097-0193(1996)4:1<58::AID-HBM4>3.0.CO;2-O).
    High up it is the
    expected number of clusters.
    """
    point, line = _densities(height, df)
    return region.n_pieces * point + region.resels * line


def crossing_probability(height: float, *, df: float, region: SearchRegion) -> float:
    """Return the probability that a t field of no effect goes above a height anywhere.

    Parameters
    ----------
    height : float
        The height, at least 0.
    df : float
        Degrees of freedom, at least 2.
    region : SearchRegion
        Where.

    Returns
    -------
    float
        One tail: 1 - exp(-expected crossings), or Bonferroni's bound over the nodes where that
        is smaller, as in fields about as rough as their nodes are apart.

    Notes
    -----
    Clusters of noise come like events of a Poisson process (Friston et al. 1994,
    doi:10.1002/hbm.460010306). :func:`critical_height` is the inverse.
    """
    field = -expm1(-expected_crossings(height, df=df, region=region))
    return min(field, region.n_nodes * float(stdtr(df, -height)))


def critical_height(p: float, *, df: float, region: SearchRegion) -> float:
    """Return the height that a t field of no effect goes above with a given probability.

    Parameters
    ----------
    p : float
        Probability of one tail, 0 to 0.25; half of it for two tails.
    df : float
        Degrees of freedom, at least 2.
    region : SearchRegion
        Where.

    Returns
    -------
    float
        The height; never above Bonferroni's over the nodes.

    Raises
    ------
    ValueError
        When the probability or the degrees of freedom are outside their range.

    Examples
    --------
    Ten people in pairs, 101 nodes, width 12.534 nodes, two tails of 5 %:

    >>> region = SearchRegion(12.534, 100 / 12.534, 101)
    >>> round(critical_height(0.025, df=9, region=region), 3)
    4.299
    """
    if not 0.0 < p <= 0.25:
        raise ValueError(f"critical_height: expected a probability of 0 to 0.25, got {p:g}")
    if df < _FEWEST_DF:
        raise ValueError(f"critical_height: expected {_FEWEST_DF} degrees of freedom, got {df:g}")
    bonferroni = float(-stdtrit(df, p / region.n_nodes))
    wanted = -log1p(-p)

    def excess(height: float) -> float:
        return expected_crossings(height, df=df, region=region) - wanted

    if excess(bonferroni) >= 0.0:
        return bonferroni
    return float(brentq(excess, 0.0, bonferroni, xtol=1e-12, rtol=1e-14))


def cluster_probability(
    extent_resels: float, height: float, *, df: float, region: SearchRegion
) -> float:
    """Return the probability of a cluster as wide anywhere, in a t field of no effect.

    Parameters
    ----------
    extent_resels : float
        Width of the cluster at the height, over the field's.
    height : float
        The height.
    df : float
        Degrees of freedom, at least 2.
    region : SearchRegion
        Where.

    Returns
    -------
    float
        One tail.

    Notes
    -----
    A cluster is at least k resels wide with probability exp(-(gamma(3/2) k / m)^2), where m, its
    mean, is the ratio of the field's densities of dimension 0 and 1 (Friston et al. 1994; in this
    form Pataky 2016, doi:10.18637/jss.v071.i07).
    """
    return -expm1(-_wide_clusters(extent_resels, height, df, region))


def set_probability(
    extents_resels: Sequence[float], height: float, *, df: float, region: SearchRegion
) -> float:
    """Return the probability of as many clusters, each as wide as the narrowest of these.

    Parameters
    ----------
    extents_resels : sequence of float
        Widths of the clusters, over the field's; at least one.
    height : float
        The height they were cut at.
    df : float
        Degrees of freedom, at least 2.
    region : SearchRegion
        Where.

    Returns
    -------
    float
        One tail (Friston et al. 1996, doi:10.1006/nimg.1996.0074).
    """
    expected = _wide_clusters(min(extents_resels), height, df, region)
    return float(pdtrc(len(extents_resels) - 1, expected))


def _wide_clusters(extent: float, height: float, df: float, region: SearchRegion) -> float:
    point, line = _densities(height, df)
    crossings = region.n_pieces * point + region.resels * line
    return crossings * exp(-((float(gamma(1.5)) * extent * line / point) ** 2))
