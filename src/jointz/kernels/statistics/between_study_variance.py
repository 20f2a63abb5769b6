r"""Studies together: random-effects meta-analysis of one outcome with known errors.

:math:`y_i \sim N(\mu, V_i + T)` over studies :math:`i` with known :math:`V_i`; the variance
between studies :math:`T` is found by restricted maximum likelihood (REML), 0 included.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.special import chdtrc, chdtri, stdtrit

_FEWEST = 2
_GRID = 400
#: Of the largest tau^2 that can be: where the grid of the score begins.
_FINEST = 1e-9
_XTOL, _RTOL = 1e-300, 8.9e-16


@dataclass(frozen=True, slots=True, eq=False)
class RandomEffectsFit:
    """Mean and spread over studies of one outcome.

    ``mean``, ``se``, ``low``, ``high``: mean over studies, its standard error with the scale of
    Knapp and Hartung, and ends of the interval; ``prediction_low``, ``prediction_high``: ends of
    the interval of the true value of one more study; ``tau2``, ``tau2_low``, ``tau2_high``:
    variance between studies and ends of its interval (Q-profile); ``i2_pct``: I^2 of Higgins and
    Thompson, %; ``q``, ``q_p``: Cochran's Q and its p; ``weights`` (k,): shares of the studies in
    the mean.
    """

    mean: float
    se: float
    low: float
    high: float
    prediction_low: float
    prediction_high: float
    tau2: float
    tau2_low: float
    tau2_high: float
    i2_pct: float
    q: float
    q_p: float
    weights: np.ndarray


def random_effects(
    values: np.ndarray, variances: np.ndarray, *, level: float = 0.95, modified: bool = False
) -> RandomEffectsFit:
    """Estimate the mean over studies and their spread from values with known variances.

    ``values``, ``variances`` (k,), two studies or more. tau^2: REML, or 0 (Viechtbauer 2005, J.
    Educ. Stat. 30, 261), interval by Q-profile (2007, Stat. Med. 26, 37); mean: Knapp and Hartung
    2003, Stat. Med. 22, 2693, if ``modified`` never narrower than the variances say (Rover et al.
    2015, BMC Med. Methodol. 15, 99); prediction: Higgins et al. 2009, J. R. Stat. Soc. A 172, 137.
    Misleads where variances are poorly known or errors are shared.
    """
    y, v = np.asarray(values, dtype=float), np.asarray(variances, dtype=float)
    _check_one(y, v, level)
    # Of order 1 in the fit: squares of what is tiny or huge are no numbers any more.
    unit = float(np.sqrt(np.mean(v)) + np.ptp(y))
    y, v = y / unit, v / unit**2
    tau2 = _reml_tau2(y, v)
    w = 1.0 / (v + tau2)
    mean = float(w @ y / w.sum())
    scale = float(w @ (y - mean) ** 2 / (y.size - 1))
    se = float(np.sqrt((max(1.0, scale) if modified else scale) / w.sum()))
    reach = float(stdtrit(y.size - 1, 0.5 + level / 2.0))
    wide = reach * float(np.hypot(se, np.sqrt(tau2)))
    q = float(_q(y, v, 0.0))
    tau2_low, tau2_high = _q_profile(y, v, level)
    typical = (y.size - 1) / _trace_p(1.0 / v)
    return RandomEffectsFit(
        mean=mean * unit,
        se=se * unit,
        low=(mean - reach * se) * unit,
        high=(mean + reach * se) * unit,
        prediction_low=(mean - wide) * unit,
        prediction_high=(mean + wide) * unit,
        tau2=tau2 * unit**2,
        tau2_low=tau2_low * unit**2,
        tau2_high=tau2_high * unit**2,
        i2_pct=100.0 * tau2 / (tau2 + typical),
        q=q,
        q_p=float(chdtrc(y.size - 1, q)),
        weights=w / w.sum(),
    )


def _check_one(y: np.ndarray, v: np.ndarray, level: float) -> None:
    if y.ndim != 1 or y.shape != v.shape or y.size < _FEWEST or not 0.0 < level < 1.0:
        raise ValueError(
            f"expected values and variances of 2 studies or more, got {y.shape}, {v.shape} and "
            f"{level}."
        )
    if not (np.isfinite(y).all() and np.isfinite(v).all() and (v > 0.0).all()):
        raise ValueError("expected finite values with positive variances.")


def _trace_p(w: np.ndarray) -> float:
    return float(w.sum() - (w**2).sum() / w.sum())


def _q(y: np.ndarray, v: np.ndarray, tau2: float) -> float:
    w = 1.0 / (v + tau2)
    return float(w @ (y - w @ y / w.sum()) ** 2)


def _likelihood(y: np.ndarray, v: np.ndarray, tau2: float) -> float:
    w = 1.0 / (v + tau2)
    logs = np.log(w).sum() - np.log(w.sum()) + np.log(y.size) - _q(y, v, tau2)
    return float(0.5 * (logs - (y.size - 1) * np.log(2.0 * np.pi)))


def _score(y: np.ndarray, v: np.ndarray, tau2: float) -> float:
    """Return the slope of the restricted likelihood, times 2."""
    w = 1.0 / (v + tau2)
    return float(((w * (y - w @ y / w.sum())) ** 2).sum()) - _trace_p(w)


def _reml_tau2(y: np.ndarray, v: np.ndarray) -> float:
    # Beyond range^2 + the largest variance the score is negative: nothing can lie there.
    highest = float(np.ptp(y) ** 2 + v.max())
    grid = np.concatenate([[0.0], highest * np.geomspace(_FINEST, 1.0, _GRID)])
    w = 1.0 / (v + grid[:, None])
    total, squares = w.sum(axis=1), (w**2).sum(axis=1)
    off = y - ((w @ y) / total)[:, None]
    scores = ((w * off) ** 2).sum(axis=1) - total + squares / total
    falls = np.flatnonzero((scores[:-1] > 0.0) & (scores[1:] <= 0.0))
    maxima = [
        float(brentq(lambda t: _score(y, v, t), grid[k], grid[k + 1], xtol=_XTOL, rtol=_RTOL))
        for k in falls
    ]
    return max([0.0, *maxima], key=lambda t: _likelihood(y, v, t))


def _q_profile(y: np.ndarray, v: np.ndarray, level: float) -> tuple[float, float]:
    """Return the values of tau^2 at which Q is as large as chi-squared's quantiles."""

    def reached(tail: float) -> float:
        quantile = float(chdtri(y.size - 1, tail))
        if _q(y, v, 0.0) <= quantile:
            return 0.0
        high = float(v.max() + np.ptp(y) ** 2)
        while _q(y, v, high) > quantile:
            high *= 4.0
        return float(brentq(lambda t: _q(y, v, t) - quantile, 0.0, high, xtol=_XTOL, rtol=_RTOL))

    return reached(0.5 - level / 2.0), reached(0.5 + level / 2.0)
