"""Mean over the people of a study, with the error of a random-effects model."""

from typing import Final

import numpy as np

_FEWEST: Final = 2


def mean_over_people(
    values: np.ndarray, errors: np.ndarray, *, shared_sd: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    r"""Return the mean of a study's people and the covariance of its error.

    With S the covariance between people, E the mean of their own errors,

    .. math:: V = (E + [S - E]_+) / n + s^2 m m^T

    where :math:`[.]_+` keeps the positive eigenvalues: few people can look more alike than their
    errors allow, and a study must not gain weight by that. S holds the people's own errors
    already, so E adds nothing where people differ enough. The shared part does not average out.
    Misleads for very few people, of whose covariance little is known.
    """
    n = values.shape[0] if values.ndim == 2 else 0
    if n < _FEWEST or errors.shape != (*values.shape, values.shape[-1]):
        shapes = f"got {values.shape} and {errors.shape}."
        raise ValueError(f"expected values and errors of {_FEWEST} people or more, {shapes}")
    if not (np.isfinite(values).all() and np.isfinite(errors).all()):
        raise ValueError("expected values and errors without gaps.")
    mean = values.mean(axis=0)
    between = np.atleast_2d(np.cov(values, rowvar=False))
    mean_error = errors.mean(axis=0)
    size = np.sqrt(np.diag(between) + np.diag(mean_error))
    size[size == 0.0] = 1.0  # nobody differs and nothing is known of errors: it stays 0
    excess, axes = np.linalg.eigh((between - mean_error) / np.outer(size, size))
    kept = (axes * np.maximum(excess, 0.0)) @ axes.T * np.outer(size, size)
    return mean, (mean_error + kept) / n + shared_sd**2 * np.outer(mean, mean)
