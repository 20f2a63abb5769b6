"""Spread of numbers that a few strangers among them do not move."""

import numpy as np

_TO_SD = 1.4826  # of the median deviation of normal numbers


def robust_sd(values: np.ndarray) -> np.ndarray:
    """Return the standard deviation that the median deviation from the median stands for.

    Parameters
    ----------
    values : (n, ...) float
        Numbers.

    Returns
    -------
    (...) float
        Along the first axis.

    Examples
    --------
    >>> float(robust_sd(np.array([1.0, 2.0, 3.0, 4.0, 1000.0])))
    1.4826
    """
    middle = np.median(values, axis=0)
    return np.asarray(_TO_SD * np.median(np.abs(values - middle), axis=0))
