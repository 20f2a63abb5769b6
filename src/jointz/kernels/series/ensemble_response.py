"""A time-varying system at one moment of a cycle, out of many repetitions of it.

A system that changes with a cycle is the same at one phase of every cycle. Short
segments about that phase, one a realisation, are then a sample of one system:
what the realisations have in common (the movement itself) is subtracted, and the
rest is regressed over segments and realisations together.
"""

from dataclasses import dataclass

import numpy as np

from jointz.kernels.series.impulse_response_estimate import supported_directions

#: Share of the mean residual variance added to its covariance before it is inverted: a filter
#: leaves directions almost without residual, which would else take all the weight.
_RIDGE = 0.05
#: Condition number of the scaled equations at which nothing is left of double precision.
_SINGULAR = 1e10
_FEWEST = 4
_TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True, slots=True)
class EnsembleResponse:
    """An impulse response over an ensemble of segments.

    ``response`` (m,): output unit over input unit, for one lag step; ``sd`` (m,): sd of
    ``response`` by the scatter between realisations; ``n_kept``: number of inverted directions of
    the input; ``vaf_pct``: variance accounted for (2.7), ensemble mean removed, %.
    """

    response: np.ndarray
    sd: np.ndarray
    n_kept: int
    vaf_pct: float


@dataclass(frozen=True, slots=True)
class SegmentFit:
    """Coefficients of a linear model over an ensemble of segments.

    ``values`` (p,): coefficients; ``replicates`` (R, p): coefficients of resampled realisations;
    ``vaf_pct``: of the weighted target, %; ``condition_number``: of the equations, scaled to a
    diagonal of one.
    """

    values: np.ndarray
    replicates: np.ndarray
    vaf_pct: float
    condition_number: float


def without_mean(x: np.ndarray) -> np.ndarray:
    """Return an ensemble without what its realisations have in common.

    ``x`` (N, ...): realisations along the first axis.
    """
    return np.asarray(x - x.mean(axis=0))


def ensemble_response(inputs: np.ndarray, output: np.ndarray) -> EnsembleResponse:
    """Return the impulse response of one short segment over all realisations.

    ``inputs`` (N, n, m): input at m lags of each of the n samples of N realisations, ``output`` (N,
    n), ensemble means removed (:func:`without_mean`). The ensemble method (Soechting et al. 1981;
    MacNeil, Kearney and Hunter 1992, IEEE Trans. Biomed. Eng. 39, 1213) with the pseudo-inverse of
    Lortie and Kearney 2001, pooled over a short segment as Ludvig and Perreault 2012,
    doi:10.1109/TBME.2012.2220767: the system is constant over the segment.
    """
    white = _whitening(inputs, output)
    x, y = np.matmul(white, inputs), output @ white.T
    basis, projected = _inverted(x, y)
    response = basis @ projected
    along = x @ basis
    score = np.einsum("it,itr->ir", y - x @ response, along)
    spread = basis @ np.linalg.solve(np.einsum("itr,its->rs", along, along), score.T)
    residual = output - inputs @ response
    return EnsembleResponse(
        response=response,
        sd=np.sqrt(np.sum(spread**2, axis=1)),
        n_kept=basis.shape[1],
        vaf_pct=100.0 * (1.0 - float(np.sum(residual**2) / np.sum(output**2))),
    )


def cross_predicted(inputs: np.ndarray, outputs: np.ndarray) -> np.ndarray:
    """Return what the input explains of each output, learned from other realisations.

    ``inputs`` (N, n, m), ``outputs`` (N, n, p): ensemble means removed. Even realisations are
    predicted with the impulse response of the odd ones and the other way round: the prediction
    holds nothing of a realisation's own noise, which would bias towards least squares. Split-sample
    instruments: Angrist and Krueger 1995, J. Business and Economic Statistics 13, 225.
    """
    predicted = np.empty(outputs.shape)
    for fold in (0, 1):
        others = without_mean(inputs[1 - fold :: 2])
        for k in range(outputs.shape[2]):
            output = without_mean(outputs[1 - fold :: 2, :, k])
            white = _whitening(others, output)
            basis, projected = _inverted(np.matmul(white, others), output @ white.T)
            predicted[fold::2, :, k] = inputs[fold::2] @ (basis @ projected)
    return without_mean(predicted)


def fit_segments(
    regressors: np.ndarray,
    target: np.ndarray,
    instruments: np.ndarray,
    *,
    resampling: np.ndarray,
) -> SegmentFit:
    """Fit target = regressors @ values over all segments, and resample the realisations.

    ``regressors``, ``instruments`` (N, n, p): ensemble means removed; ``target`` (N, n): ensemble
    mean removed; ``resampling`` (R, N): weights of each resample, rows summing to one
    (:func:`jointz.kernels.resampling.resample_weights`). Returns values and replicates.
    """
    if regressors.shape != instruments.shape or regressors.shape[:2] != target.shape:
        raise ValueError(
            "fit_segments: expected regressors and instruments (N, n, p) and a target (N, n), got "
            f"{regressors.shape}, {instruments.shape}, {target.shape}"
        )
    alike = np.stack(2 * [np.eye(target.shape[1])])
    first, _ = _solve(regressors, target, instruments, alike)
    weights = _cross_weights(target - regressors @ first)
    values, condition = _solve(regressors, target, instruments, weights)
    left = target - regressors @ values
    power = np.sum(_weighed(target, weights) * target)
    known = np.concatenate([regressors, target[..., np.newaxis]], axis=2)
    return SegmentFit(
        values=values,
        replicates=_resampled(known, _weighed(instruments, weights), resampling),
        vaf_pct=100.0 * (1.0 - float(np.sum(_weighed(left, weights) * left) / power)),
        condition_number=condition,
    )


def _inverted(inputs: np.ndarray, output: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the directions (m, r) of the input that are kept, and the response along them."""
    if inputs.ndim != 3 or inputs.shape[:2] != output.shape or inputs.shape[0] < _FEWEST:
        raise ValueError(
            f"ensemble_response: expected inputs (N, n, m) and an output (N, n) of at least "
            f"{_FEWEST} realisations, got {inputs.shape} and {output.shape}"
        )
    flat, y = inputs.reshape(-1, inputs.shape[2]), output.ravel()
    right = flat.T @ y / y.size
    order, singular, vectors = supported_directions(
        flat.T @ flat / y.size, right, power=float(y @ y) / y.size, n=y.size, floor=0.0
    )
    basis = vectors[:, order]
    return basis, basis.T @ right / singular[order]


def _whitening(inputs: np.ndarray, output: np.ndarray) -> np.ndarray:
    """Return the matrix (n, n) that makes what the input leaves unexplained white."""
    basis, projected = _inverted(inputs, output)
    weight = _inverse_covariance(output - inputs @ (basis @ projected))
    return np.asarray(np.linalg.cholesky(weight).T)


def _inverse_covariance(residual: np.ndarray, variance: float | None = None) -> np.ndarray:
    """Return the weights (n, n) of samples of a segment, for a residual of the given variance."""
    n = residual.shape[1]
    size = max(float(np.mean(residual**2)) if variance is None else variance, _TINY)
    covariance = residual.T @ residual / (len(residual) * size)
    return np.asarray(np.linalg.inv(covariance + _RIDGE * np.eye(n)))


def _cross_weights(residual: np.ndarray) -> np.ndarray:
    """Return the weights (2, n, n) of a segment's samples in even and in odd realisations."""
    variance = float(np.mean(residual**2))
    return np.stack([_inverse_covariance(residual[1 - f :: 2], variance) for f in (0, 1)])


def _weighed(x: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return x (N, n, ...) times the weights of its realisations."""
    out = np.empty(x.shape)
    for fold in (0, 1):
        out[fold::2] = np.einsum("ts,is...->it...", weights[fold], x[fold::2])
    return out


def _solve(
    regressors: np.ndarray, target: np.ndarray, instruments: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, float]:
    """Return the coefficients, and the condition number of their scaled equations."""
    weighed = _weighed(instruments, weights)
    gram = np.einsum("itk,itl->kl", weighed, regressors)
    moment = np.einsum("itk,it->k", weighed, target)
    rows = np.sqrt(np.einsum("itk,itk->k", weighed, instruments))
    columns = np.sqrt(np.einsum("itk,itk->k", _weighed(regressors, weights), regressors))
    if not (np.all(rows > 0.0) and np.all(columns > 0.0)):
        raise ValueError("fit_segments: a regressor or an instrument does not vary")
    condition = float(np.linalg.cond(gram / np.outer(rows, columns)))
    if not condition < _SINGULAR:
        raise ValueError(f"fit_segments: singular equations, condition number {condition:.2g}")
    return np.linalg.solve(gram, moment), condition


def _resampled(known: np.ndarray, weighed: np.ndarray, resampling: np.ndarray) -> np.ndarray:
    """Return the coefficients (R, p) of every resample, from products of each realisation."""
    count, n, p = weighed.shape
    products = np.einsum("itk,itl->ikl", weighed, known)
    sums = (resampling @ products.reshape(count, -1)).reshape(-1, p, p + 1)
    means = (resampling @ known.reshape(count, -1)).reshape(-1, n, p + 1)
    weighed_means = (resampling @ weighed.reshape(count, -1)).reshape(-1, n, p)
    sums -= np.swapaxes(weighed_means, 1, 2) @ means
    solved: np.ndarray = np.linalg.solve(sums[:, :, :p], sums[:, :, p:])
    return solved[:, :, 0]
