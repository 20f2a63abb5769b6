"""Runs of nodes whose statistic is beyond a threshold."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class ThresholdCluster:
    """Neighbouring nodes beyond a threshold, all on one side of zero.

    ``start_node``, ``end_node``: ends, where the line between nodes crosses the threshold, or the
    curve ends; ``peak_node``: farthest from zero; ``peak``: the statistic there, with its sign.
    """

    start_node: float
    end_node: float
    peak_node: int
    peak: float

    @property
    def extent_nodes(self) -> float:
        """Width in nodes."""
        return self.end_node - self.start_node


def threshold_clusters(statistic: np.ndarray, threshold: float) -> tuple[ThresholdCluster, ...]:
    """Return the clusters above a threshold and below its negative, from left to right.

    ``statistic`` (n_node,). Neighbours on opposite sides of zero are two clusters.
    """
    if not threshold > 0.0:
        raise ValueError(f"threshold_clusters: expected a positive threshold, got {threshold:g}")
    clusters = []
    for sign in (1.0, -1.0):
        height = sign * statistic
        edges = np.flatnonzero(np.diff(np.concatenate([[False], height > threshold, [False]])))
        for start, stop in zip(edges[::2], edges[1::2], strict=True):
            peak = int(start + np.argmax(height[start:stop]))
            clusters.append(
                ThresholdCluster(
                    start_node=_crossing(height, int(start), -1, threshold),
                    end_node=_crossing(height, int(stop) - 1, 1, threshold),
                    peak_node=peak,
                    peak=float(statistic[peak]),
                )
            )
    return tuple(sorted(clusters, key=lambda cluster: cluster.start_node))


def _crossing(height: np.ndarray, node: int, step: int, threshold: float) -> float:
    beyond = node + step
    if not 0 <= beyond < height.size:
        return float(node)
    share = (height[node] - threshold) / (height[node] - height[beyond])
    return float(node + step * share)
