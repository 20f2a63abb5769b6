"""Shapes of pulses: those of one torque over time, sign included."""

from collections.abc import Sequence

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.spatial.distance import squareform

from jointz.identify.preparation.pulses import Pulse

#: Amplitudes that differ by more than this share of the largest are different shapes.
_SAME_AMPLITUDE = 0.05
#: Torques whose difference is larger, as a share of their size (RMS), are different shapes.
_SAME_TORQUE = 0.3
#: More shapes than this at a timing point are noise of the torque: the nearest are joined.
_MOST_SHAPES = 8


def pulse_shapes(torque: np.ndarray, pulses: Sequence[Pulse]) -> np.ndarray:
    """Return the number of the shape of each pulse, from 0.

    ``torque`` (n_pulse, n), N*m, relative to the unperturbed stride.
    """
    groups = _by_amplitude(np.array([p.amplitude for p in pulses], dtype=float))
    shapes = np.empty_like(groups)
    for group in np.unique(groups):
        members = np.flatnonzero(groups == group)
        shapes[members] = _MOST_SHAPES * group + _by_torque(torque[members])
    _, numbers = np.unique(shapes, return_inverse=True)
    if numbers.max(initial=0) < _MOST_SHAPES:
        return np.asarray(numbers)
    means = np.stack([torque[numbers == k].mean(axis=0) for k in range(numbers.max() + 1)])
    return np.asarray(_clusters(means, criterion="maxclust", limit=_MOST_SHAPES)[numbers])


def _by_amplitude(amplitudes: np.ndarray) -> np.ndarray:
    """Return groups of declared amplitudes; unknown ones are one group."""
    known = np.where(np.isfinite(amplitudes), amplitudes, 0.0)
    order = np.argsort(known, kind="stable")
    apart = np.diff(known[order]) > _SAME_AMPLITUDE * np.abs(known).max(initial=0.0)
    groups = np.empty(known.size, dtype=int)
    groups[order] = np.concatenate([[0], np.cumsum(apart)])
    return groups


def _by_torque(torque: np.ndarray) -> np.ndarray:
    clusters = _clusters(torque, criterion="distance", limit=_SAME_TORQUE)
    if clusters.max() < _MOST_SHAPES:
        return clusters
    return _clusters(torque, criterion="maxclust", limit=_MOST_SHAPES)


def _clusters(torque: np.ndarray, *, criterion: str, limit: float) -> np.ndarray:
    """Return clusters by average linkage of the relative difference, numbered from 0."""
    if len(torque) < 2:
        return np.zeros(len(torque), dtype=int)
    products = torque @ torque.T
    squares = np.diag(products)
    difference = (squares[:, None] + squares - 2.0 * products).clip(0.0)
    relative = np.sqrt(difference / np.maximum(np.maximum(squares[:, None], squares), 1e-12))
    tree = linkage(squareform(relative, checks=False), method="average")
    return np.asarray(fcluster(tree, t=limit, criterion=criterion) - 1)
