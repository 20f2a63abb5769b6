"""The impulse response between two sampled records, by Wiener-Hopf with a pseudo-inverse.

A perturbation moves little at high frequency, so its correlation matrix is
nearly singular and plain inversion returns noise. Only the directions that the
output supports are inverted.
"""

from dataclasses import dataclass

import numpy as np
from scipy import fft, linalg

#: Share of the largest singular value below which a direction is rounding error.
_RANK = 1e-10


@dataclass(frozen=True, slots=True)
class ImpulseEstimate:
    """An impulse response and the equations it came from.

    ``lags`` (m,) samples: lags of the response; ``response`` (m,): output unit over input unit, for
    one sample; ``sd`` (m,): sd of ``response`` by noise alone; ``basis`` (m, r): the directions
    that were inverted; ``singular`` (r,): their singular values; ``residual``
    (k,): output minus prediction; ``measured`` (k,): the output, mean removed.
    """

    lags: np.ndarray
    response: np.ndarray
    sd: np.ndarray
    basis: np.ndarray
    singular: np.ndarray
    residual: np.ndarray
    measured: np.ndarray

    @property
    def vaf_pct(self) -> float:
        """Variance accounted for (2.7) by the response, %."""
        return 100.0 * (1.0 - float(np.sum(self.residual**2) / np.sum(self.measured**2)))


def estimate_response(
    x: np.ndarray,
    y: np.ndarray,
    *,
    first_lag: int,
    last_lag: int,
    input_noise: np.ndarray | None = None,
) -> ImpulseEstimate:
    """Return the impulse response from x to y that best predicts y.

    ``x``, ``y`` (n,); lags in samples, both ends included; ``input_noise`` (m,): autocovariance of
    the noise in ``x`` at lags 0, 1, ... Solves Wiener-Hopf (1.4), r_yx(k) = sum h(s) r_xx(k - s),
    over the samples whose inputs are all recorded, along the directions of smallest description
    length (Westwick and Kearney 1997, doi:10.1007/BF02534135).
    """
    X, y_kept = _lagged(x, y, first_lag, last_lag)
    n, m = X.shape
    centre = X.mean(axis=0)
    normal = X.T @ X / n - np.outer(centre, centre)
    if input_noise is not None:
        normal -= linalg.toeplitz(np.asarray(input_noise, dtype=float)[:m])
    right = X.T @ y_kept / n
    floor = 0.0 if input_noise is None else float(input_noise[0])
    order, singular, vectors = supported_directions(
        normal, right, power=float(y_kept @ y_kept) / n, n=n, floor=floor
    )
    basis, kept = vectors[:, order], singular[order]
    response = basis @ (basis.T @ right / kept)
    residual = y_kept - (X @ response - centre @ response)
    inside = X[:, -first_lag if first_lag < 0 else 0]
    covariance = basis.T @ _score_covariance(inside, residual, m) @ basis
    scaled = basis / kept
    return ImpulseEstimate(
        lags=np.arange(first_lag, last_lag + 1),
        response=response,
        sd=np.sqrt(np.einsum("ij,jk,ik->i", scaled, covariance, scaled)),
        basis=basis,
        singular=kept,
        residual=residual,
        measured=y_kept,
    )


def _lagged(
    x: np.ndarray, y: np.ndarray, first_lag: int, last_lag: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the inputs (n, m) at all lags of each output, and the outputs (n,)."""
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    m = last_lag - first_lag + 1
    if x.ndim != 1 or x.shape != y.shape or m < 1 or last_lag < 0 or first_lag > 0:
        raise ValueError(
            "estimate_response: expected two 1-d records of one length and first_lag <= 0 <= "
            f"last_lag, got {x.shape}, {y.shape}, {first_lag}, {last_lag}"
        )
    if x.size < 3 * m:
        raise ValueError(
            f"estimate_response: expected a record of at least {3 * m} samples for a response of "
            f"{m}, got {x.size}"
        )
    X = np.ascontiguousarray(np.lib.stride_tricks.sliding_window_view(x, m)[:, ::-1])
    y_kept = y[last_lag : last_lag + X.shape[0]]
    return X, y_kept - y_kept.mean()


def supported_directions(
    normal: np.ndarray, right: np.ndarray, *, power: float, n: int, floor: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return which directions of the input to invert, by the smallest description length.

    ``normal`` (m, m): mean product of the input at all pairs of lags; ``right`` (m,): with the
    output; ``power``: mean square of the output; singular values up to ``floor`` are noise. Returns
    ``order`` (r,): columns of ``vectors`` to invert; ``singular`` (m,), ascending; ``vectors`` (m,
    m). As many as make (1 + r log(n)/n) * residual variance smallest: Westwick and Kearney 1997,
    doi:10.1007/BF02534135.
    """
    singular, vectors = linalg.eigh(normal)
    usable = np.flatnonzero(singular > max(_RANK * singular[-1], floor))
    if not usable.size or power <= 0.0:
        raise ValueError("estimate_response: input or output is constant")
    explained = (vectors[:, usable].T @ right) ** 2 / singular[usable]
    left = np.maximum(power - np.cumsum(explained[::-1]), 0.0)
    length = (1.0 + np.arange(1, usable.size + 1) * np.log(n) / n) * left
    return usable[::-1][: int(np.argmin(length)) + 1], singular, vectors


def _score_covariance(x: np.ndarray, residual: np.ndarray, m: int) -> np.ndarray:
    """Return the covariance (m, m) of the mean of input at m lags times residual."""
    n = x.size
    product = np.abs(fft.rfft(x)) ** 2 * np.abs(fft.rfft(residual - residual.mean())) ** 2
    return np.asarray(linalg.toeplitz(fft.irfft(product, n)[:m] / n**3))
