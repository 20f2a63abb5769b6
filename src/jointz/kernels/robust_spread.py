"""Robust median and spread."""

import numpy as np

_TO_SD = 1.4826  # of the median deviation of normal numbers


def robust_sd(values: np.ndarray) -> np.ndarray:
    """Return the standard deviation that the median deviation from the median stands for.

    ``values`` (n, ...). Returns (...): 1.4826 times the median deviation along the first axis.
    """
    return robust_moments(values)[1]


def robust_moments(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the median and the standard deviation that the median deviation stands for.

    ``values`` (n, ...). Returns median and standard deviation along the first axis.
    """
    # Along the last axis numbers that belong together lie together in memory.
    rows = np.ascontiguousarray(np.moveaxis(values, 0, -1))
    middle = _medians(rows)
    return middle, np.asarray(_TO_SD * _medians(np.abs(rows - middle[..., None])))


def _medians(rows: np.ndarray) -> np.ndarray:
    """Return the medians along the last axis: numpy's own, in a fraction of its time.

    numpy's median asks for several ranks at once, which its fast selection cannot do.
    """
    n = rows.shape[-1]
    if n == 0 or not np.isfinite(rows.sum()):
        return np.asarray(np.median(rows, axis=-1))
    parted = np.partition(rows, n // 2, axis=-1)
    upper = parted[..., n // 2]
    return np.asarray(upper if n % 2 else 0.5 * (parted[..., : n // 2].max(axis=-1) + upper))
