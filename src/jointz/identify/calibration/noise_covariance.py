r"""Covariance of noise from few realisations of many samples.

The sample covariance of n samples from m realisations has directions without noise where m is
not several times n, and an estimate weighted with its inverse believes them. It is drawn towards
a covariance of few parameters, as far as the data do not speak against it.
"""

import numpy as np
from scipy.special import gammaln

#: Samples back that a sample is predicted from.
_ORDER = 12
#: Innovations are as large as those of so many neighbours on each side.
_NEIGHBOURS = 4
_RIDGE = 1e-8
_STRENGTHS = np.geomspace(1.0, 1e4, 25)


def steady_covariance(sample: np.ndarray) -> np.ndarray:
    """Return the covariance of an autoregressive process that changes slowly.

    ``sample`` (n, n): of any rank. Returns L D L' with the inverse of L banded and its neighbouring
    rows alike: modified Cholesky decomposition (Pourahmadi 1999, Biometrika 86, 677), coefficients
    and variances averaged over neighbouring times; a sample is predicted from up to 12 before it.
    """
    root = _steady_root(sample)
    return np.asarray(root @ root.T)


def _steady_root(sample: np.ndarray) -> np.ndarray:
    """Return the lower triangle whose product with itself is the steady covariance.

    Where samples hardly say anything new - a record without noise - the product cannot be
    factored again.
    """
    n = len(sample)
    order = min(_ORDER, n - 1)
    products = _products(sample, order)
    innovation = np.eye(n)  # rows: a sample minus its prediction
    for t in range(1, order):
        innovation[t, :t] = -_coefficients(products[t, : t + 1, : t + 1])[::-1]
    later = _coefficients(products[order:])
    for t in range(order, n):
        innovation[t, t - order : t] = -later[t - order, ::-1]
    left = ((innovation @ sample) * innovation).sum(axis=1)
    level = np.trace(sample) / n
    variances = np.maximum(_smoothed(left, start=order), _RIDGE * level + 1e-300)
    return np.asarray(np.linalg.solve(innovation, np.diag(np.sqrt(variances))))


def shrunk_covariance(sample: np.ndarray, count: int) -> np.ndarray:
    """Return a covariance between the sample's and a steady one, by their evidence.

    ``sample`` (n, n) from ``count`` independent realisations. Returns the mean of the posterior
    under an inverse Wishart prior about :func:`steady_covariance`. Chen 1979, Journal of the Royal
    Statistical Society B 41, 235.
    """
    if count < 2:
        raise ValueError(f"shrunk_covariance: expected two realisations or more, got {count}.")
    n, m = len(sample), count - 1
    # In units of the prior's mean, all determinants are those of its eigenvalues.
    root = _steady_root(sample)
    scaled = np.linalg.solve(root, np.linalg.solve(root, sample).T)
    values = np.linalg.eigvalsh(0.5 * (scaled + scaled.T)).clip(0.0)
    strengths = _STRENGTHS * n
    best = float(strengths[int(np.argmax(_log_evidence(values, m, strengths)))])
    return np.asarray((best * root @ root.T + m * sample) / (best + m))


def _log_evidence(values: np.ndarray, m: int, strengths: np.ndarray) -> np.ndarray:
    """Return those of priors worth so many realisations, (k,), up to a constant."""
    n = values.size
    each = strengths[:, None]
    prior, after = each + n + 1.0, each + n + 1.0 + m
    places = np.arange(n)
    turns = (gammaln((after - places) / 2.0) - gammaln((prior - places) / 2.0)).sum(axis=1)
    own = 0.5 * prior[:, 0] * n * np.log(strengths)
    spread = np.log(each + m * values).sum(axis=1)
    return np.asarray(turns + own - 0.5 * after[:, 0] * spread)


def _products(sample: np.ndarray, order: int) -> np.ndarray:
    """Return mean products of samples i and j before one, over times near it, (n, k, k).

    Near is a quarter of the record on each side, as far as there are so many samples before.
    """
    n = len(sample)
    sums = np.zeros((order + 1, n + 1))
    for lag in range(order + 1):
        sums[lag, lag + 1 :] = np.cumsum(np.diagonal(sample, -lag))
    t = np.arange(n)
    first = np.maximum(t - n // 4, np.minimum(t, order))[:, None, None]
    last = np.minimum(t + n // 4, n - 1)[:, None, None] + 1
    back = np.arange(order + 1)
    nearer, lag = np.minimum(back[:, None], back), np.abs(back[:, None] - back)
    # Beyond the beginning there is nothing, and nobody asks.
    return np.asarray(
        (sums[lag, (last - nearer).clip(0)] - sums[lag, (first - nearer).clip(0)]) / (last - first)
    )


def _coefficients(products: np.ndarray) -> np.ndarray:
    """Return how a sample is predicted from those before it, the last first, (..., k)."""
    k = products.shape[-1] - 1
    among = products[..., 1:, 1:] + _RIDGE * products[..., :1, :1] * np.eye(k)
    return np.asarray(np.linalg.solve(among, products[..., 1:, :1])[..., 0])


def _smoothed(left: np.ndarray, *, start: int) -> np.ndarray:
    """Average innovations over neighbours, where all are predicted from as many samples."""
    near = np.ones(2 * _NEIGHBOURS + 1)
    later = left[start:]
    sums, counts = (
        np.convolve(values, near)[_NEIGHBOURS:-_NEIGHBOURS]
        for values in (later, np.ones(later.size))
    )
    return np.concatenate([left[:start], sums / counts])
