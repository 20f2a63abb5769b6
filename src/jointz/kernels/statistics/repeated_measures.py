"""Repeated-measures analysis of variance of a complete table."""

from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from jointz.kernels.statistics.anova import FTest


@dataclass(frozen=True, slots=True)
class RepeatedMeasures:
    """Analysis of variance of participants by levels.

    ``test``: levels against the interaction with participants, exact under sphericity; ``epsilon``:
    Greenhouse and Geisser's, 1 / (levels - 1) to 1; ``p_epsilon``: p with both degrees of freedom
    multiplied by ``epsilon``.
    """

    test: FTest
    epsilon: float
    p_epsilon: float


def repeated_measures_anova(values: np.ndarray) -> RepeatedMeasures:
    """Return the F test of the levels of a complete table, with Greenhouse and Geisser's p.

    ``values`` (n, k): a row a participant, a column a level, none missing. Greenhouse and Geisser
    1959, doi:10.1007/BF02289823; epsilon is biased low in small groups, so its p is somewhat
    cautious.
    """
    Y = np.asarray(values, dtype=float)
    if Y.ndim != 2 or min(Y.shape) < 2 or not np.isfinite(Y).all():
        raise ValueError(
            f"repeated_measures_anova: expected finite values of two participants and two levels "
            f"at least, got {Y.shape}"
        )
    n, k = Y.shape
    centred = Y - Y.mean()
    levels = centred.mean(axis=0)
    rest = centred - centred.mean(axis=1, keepdims=True) - levels
    between, error = n * float(levels @ levels), float((rest**2).sum())
    if error <= 1e-20 * float((centred**2).sum()) or error == 0:
        raise ValueError(
            "repeated_measures_anova: expected values that vary beside participants and levels"
        )
    df_num, df_den = float(k - 1), float((n - 1) * (k - 1))
    f = between / df_num / (error / df_den)
    # rest is doubly centred: its cross products are the doubly centred covariance.
    cross = rest.T @ rest
    epsilon = min(float(np.trace(cross) ** 2 / (df_num * (cross**2).sum())), 1.0)
    return RepeatedMeasures(
        test=FTest(f, df_num, df_den, float(fdtrc(df_num, df_den, f))),
        epsilon=epsilon,
        p_epsilon=float(fdtrc(epsilon * df_num, epsilon * df_den, f)),
    )
