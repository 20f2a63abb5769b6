"""Bootstrap resamples: their weights, and products of the averages they make."""

import numpy as np
from numba import njit

_N_CHANNELS = 4  # angle, velocity, acceleration, torque
# Channel pairs behind a fit: the upper triangle of the gram matrix, then the moment.
_PAIRS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2), (0, 3), (1, 3), (2, 3))
_LANES = 256  # resamples that run side by side in vector registers and fit the cache
_STEP = 5  # trials a loop takes at once


def resample_weights(
    n_trials: int, n_resamples: int, rng: np.random.Generator, *, block: int = 1
) -> np.ndarray:
    """Return the weights with which each bootstrap resample averages the trials.

    Returns (n_resamples, n_trials): how often each trial was drawn, with replacement, over the
    number of trials; ``weights @ trials`` are the resampled averages. ``block``: draw runs of so
    many neighbours, the last joined to the first. Efron 1979, doi:10.1214/aos/1176344552; blocks:
    Politis and Romano 1992, A circular block-resampling procedure for stationary data.
    """
    if n_trials < 1 or n_resamples < 0:
        raise ValueError(
            f"resample_weights: expected n_trials >= 1 and n_resamples >= 0, got {n_trials} and "
            f"{n_resamples}. Give at least one trial."
        )
    block = min(block, n_trials)
    n_runs = -(-n_trials // block)
    drawn = rng.integers(0, n_trials, size=(n_resamples, n_runs), dtype=np.int64)
    if block > 1:
        runs = (drawn[:, :, np.newaxis] + np.arange(block)) % n_trials
        drawn = runs.reshape(n_resamples, -1)[:, :n_trials]
    # One flat count: trial t of resample r is bin r * n_trials + t.
    drawn += n_trials * np.arange(n_resamples, dtype=np.int64)[:, np.newaxis]
    counts = np.bincount(drawn.ravel(), minlength=n_resamples * n_trials)
    return counts.reshape(n_resamples, n_trials) / n_trials


def trial_products(trials: np.ndarray) -> np.ndarray:
    """Return the products of every two trials, for :func:`resampled_normal_equations`.

    ``trials`` (P, 4, T): angle, velocity, acceleration, torque. Returns (P, Q, 9): for trials i <=
    j the sum of their products both ways round (once for i = j), for each pair of channels.
    """
    if trials.ndim != 3 or trials.shape[1] != _N_CHANNELS:
        raise ValueError(
            "trial_products: expected shape (P, 4, T) with channels angle, velocity, "
            f"acceleration, torque, got {trials.shape}."
        )
    n = len(trials)
    channels = np.ascontiguousarray(trials.transpose(1, 0, 2), dtype=np.float64)
    products = np.zeros((n, -(-n // _STEP) * _STEP, len(_PAIRS)))
    once = np.triu(np.ones((n, n))) - 0.5 * np.eye(n)
    for k, (first, second) in enumerate(_PAIRS):
        one_way = channels[first] @ channels[second].T
        products[:, :n, k] = (one_way + one_way.T) * once
    return products


def resampled_normal_equations(
    weights: np.ndarray, products: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the normal equations of weighted averages without making the averages.

    ``weights`` (R, P); ``products`` (P, Q, 9): of :func:`trial_products`. Returns ``gram`` (R, 3,
    3) and ``moment`` (R, 3) of the averages. A product of averages is a quadratic form of the
    weights: 9 P^2 / 2 multiplications a resample instead of 4 P T for averaging.
    """
    check_weights("resampled_normal_equations", weights, len(products))
    gram, moment = np.empty((len(weights), 3, 3)), np.empty((len(weights), 3))
    weights = np.ascontiguousarray(weights, dtype=np.float64)
    lanes, sums = _aligned_rows(products.shape[1]), _aligned_rows(products.shape[2])
    for start in range(0, len(weights), _LANES):
        rows = slice(start, start + _LANES)
        _quadratic_forms(weights[rows], products, lanes, sums)
        _unpack(sums, gram[rows], moment[rows])
    return gram, moment


def check_weights(where: str, weights: np.ndarray, n_trials: int) -> None:
    """Raise ValueError unless there is a column of weights for each trial."""
    if weights.ndim != 2 or weights.shape[1] != n_trials:
        raise ValueError(
            f"{where}: expected weights of shape (R, {n_trials}), one column a trial, "
            f"got {weights.shape}."
        )


def _aligned_rows(n: int) -> np.ndarray:
    """Return zeros (n, _LANES) on cache lines: across their borders loads take twice as long."""
    room = np.zeros(n * _LANES + 8)
    first = -room.ctypes.data % 64 // room.itemsize
    return room[first : first + n * _LANES].reshape(n, _LANES)


@njit(cache=True, nogil=True)
def _unpack(sums: np.ndarray, gram: np.ndarray, moment: np.ndarray) -> None:
    for r in range(len(gram)):
        out = gram[r]
        out[0, 0], out[1, 1], out[2, 2] = sums[0, r], sums[3, r], sums[5, r]
        out[0, 1] = out[1, 0] = sums[1, r]
        out[0, 2] = out[2, 0] = sums[2, r]
        out[1, 2] = out[2, 1] = sums[4, r]
        moment[r, 0], moment[r, 1], moment[r, 2] = sums[6, r], sums[7, r], sums[8, r]


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def _quadratic_forms(
    weights: np.ndarray, products: np.ndarray, lanes: np.ndarray, sums: np.ndarray
) -> None:
    """Fill ``sums`` (9, n) for weights (n, P); ``lanes`` is scratch for their transpose."""
    n = len(weights)
    for p in range(weights.shape[1]):
        for r in range(n):
            lanes[p, r] = weights[r, p]
    sums[:] = 0.0
    # Five trials and three channel pairs a pass: more would leave the registers.
    for i in range(len(products)):
        w = lanes[i]
        for j in range(i // _STEP * _STEP, products.shape[1], _STEP):
            w0, w1, w2, w3, w4 = lanes[j], lanes[j + 1], lanes[j + 2], lanes[j + 3], lanes[j + 4]
            for k in range(0, products.shape[2], 3):
                m = products[i, j : j + _STEP, k : k + 3]
                a0, a1, a2, a3, a4 = m[0, 0], m[1, 0], m[2, 0], m[3, 0], m[4, 0]
                b0, b1, b2, b3, b4 = m[0, 1], m[1, 1], m[2, 1], m[3, 1], m[4, 1]
                c0, c1, c2, c3, c4 = m[0, 2], m[1, 2], m[2, 2], m[3, 2], m[4, 2]
                a, b, c = sums[k], sums[k + 1], sums[k + 2]
                for r in range(n):
                    x0, x1, x2, x3, x4 = w0[r], w1[r], w2[r], w3[r], w4[r]
                    a[r] += w[r] * (a0 * x0 + a1 * x1 + a2 * x2 + a3 * x3 + a4 * x4)
                    b[r] += w[r] * (b0 * x0 + b1 * x1 + b2 * x2 + b3 * x3 + b4 * x4)
                    c[r] += w[r] * (c0 * x0 + c1 * x1 + c2 * x2 + c3 * x3 + c4 * x4)
