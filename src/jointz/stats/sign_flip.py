"""The max-t test of paired curves by flipping signs: exact, without a model of the noise."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from jointz.core.errors import DataError
from jointz.kernels.statistics.sign_flip_distribution import (
    all_signs,
    cosine_to_t,
    cosines,
    critical_cosine,
    drawn_signs,
    flip_p_values,
    largest_cosines,
)
from jointz.kernels.statistics.threshold_clusters import threshold_clusters
from jointz.results.statistics.waveform_test import WaveformCluster, WaveformTest
from jointz.stats.waveform_curves import (
    checked_level,
    compare_paired,
    curve_scale,
    paired_differences,
    waveform_test,
)

_WHERE = "sign_flip_max_t"
_FEWEST_PAIRS = 3


@dataclass(frozen=True, slots=True)
class _Flips:
    """Signs of the flips, whether they are complete, and their number."""

    signs: np.ndarray
    exact: bool
    count: int
    seed: int | None

    @property
    def label(self) -> str:
        """How they were made."""
        return f"all {self.count} sign flips" if self.exact else f"{self.count} drawn sign flips"


def sign_flip_max_t(
    a: Any,
    b: Any,
    *,
    alpha: float = 0.05,
    equivalence_margin: float | None = None,
    n_flips: int = 2**14,
    seed: int = 0,
) -> WaveformTest:
    """Return the paired two-tailed max-t test over a curve, by flipping signs of differences.

    Parameters
    ----------
    a, b : (n_participant, n_node) array-like
        One mean curve a participant, row by row of the same one; at least 3 participants and
        5 nodes. Tables whose rows are named must name them alike.
    alpha : float
        Chance of any false finding on the curve.
    equivalence_margin : float, optional
        Largest difference of no importance, in the unit of the curves.
    n_flips : int
        Most flips to look at: where there are no more (14 participants by default) all are,
        else as many are drawn.
    seed : int
        Of the draw.

    Returns
    -------
    WaveformTest
        t, threshold, p adjusted over nodes, clusters with the p of their peak, and the band of
        the difference; nothing of a width or of resels.

    Raises
    ------
    DataError
        When shapes differ, a value is not finite, there are too few participants or nodes, or a
        node has the same difference, other than zero, in everybody.

    Notes
    -----
    If conditions can be swapped within a person, differences with flipped signs are as likely
    as those observed. The threshold is the largest t over nodes that no more than a share alpha
    of flips exceed (Nichols and Holmes 2002, doi:10.1002/hbm.1058), so the chance of any false
    finding is at most alpha, however smooth the curves and however they are distributed about
    zero, as long as that is symmetric. Fewer than 6 participants cannot reach 0.05.

    The band is difference +- t * standard error at all nodes at once, where t is the larger of
    that threshold and the one of the flipped residuals; it never leaves out 0 where the test
    finds nothing. Unlike the test it is approximate, and near 95 % in simulation from 6
    participants on.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> phase = np.linspace(0, 2 * np.pi, 101)
    >>> waves = np.array([np.ones(101), np.sin(phase), np.cos(phase), np.sin(2 * phase)])
    >>> a = rng.standard_normal((10, 4)) @ waves
    >>> test = sign_flip_max_t(a, rng.standard_normal((10, 4)) @ waves)
    >>> test.verdict, test.threshold_from
    ('undecided', 'all 1024 sign flips')
    """
    checked_level(alpha, equivalence_margin, _WHERE)
    differences = paired_differences(a, b, where=_WHERE, fewest=_FEWEST_PAIRS)
    compared = compare_paired(differences, scale=curve_scale(a, b), where=_WHERE)
    flips = _flips(compared.n_a, n_flips, seed)
    observed = cosines(differences[:, compared.tested])
    largest = largest_cosines(observed, flips.signs)
    p = np.ones(compared.tested.size)
    p[compared.tested] = flip_p_values(observed.sum(axis=0), largest)
    threshold = _critical_t(largest, alpha, compared.n_a)
    left = largest_cosines(cosines(compared.residuals[:, compared.tested]), flips.signs)
    half = max(threshold, _critical_t(left, alpha, compared.n_a)) * compared.se
    return waveform_test(
        compared,
        half,
        alpha,
        settings={"n_flips": flips.count, "exact": flips.exact, "seed": flips.seed},
        warnings=_too_few(flips, alpha),
        method="sign_flip",
        design="paired",
        threshold=threshold,
        threshold_from=flips.label,
        p=tuple(p.tolist()),
        clusters=_clusters(compared.t, threshold, p.tolist()),
        equivalence_margin=equivalence_margin,
    )


def _flips(n: int, n_flips: int, seed: int) -> _Flips:
    if n_flips < 2:
        raise DataError(f"{_WHERE}: expected n_flips of at least 2, got {n_flips}. Try 10000.")
    if seed < 0:
        raise DataError(f"{_WHERE}: expected a seed of 0 or more, got {seed}.")
    if n < n_flips.bit_length() and 1 << n <= n_flips:
        return _Flips(all_signs(n), exact=True, count=1 << n, seed=None)
    signs = drawn_signs(n, n_flips, np.random.default_rng(seed))
    return _Flips(signs, exact=False, count=n_flips, seed=seed)


def _critical_t(largest: np.ndarray, alpha: float, n: int) -> float:
    return float(cosine_to_t(np.asarray(critical_cosine(largest, alpha)), n))


def _clusters(t: np.ndarray, threshold: float, p: Sequence[float]) -> tuple[WaveformCluster, ...]:
    return tuple(
        WaveformCluster(c.start_node, c.end_node, None, c.peak_node, c.peak, p[c.peak_node])
        for c in threshold_clusters(t, threshold)
    )


def _too_few(flips: _Flips, alpha: float) -> tuple[str, ...]:
    smallest = 1.0 / flips.signs.shape[0]
    if smallest <= alpha:
        return ()
    return (
        f"no p can be below {smallest:.3g} with these flips: at alpha {alpha:g} nothing can be "
        "found, and the band is not as sure as it says",
    )
