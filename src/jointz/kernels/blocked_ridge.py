"""Ridge regression of many targets at once, validated on blocks of rows left out."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_PENALTIES = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2)


@dataclass(frozen=True, slots=True, eq=False)
class BlockedRidge:
    """A linear prediction and how far it was off on rows it had not seen.

    ``centre``, ``scale`` (p,): mean and sd of the features; ``coefficients`` (p + 1, q): the
    constant first; ``left_out`` (n, q): targets minus their prediction from the other blocks;
    ``penalty``: in units of the features' variance, the one with the best prediction.
    """

    centre: np.ndarray
    scale: np.ndarray
    coefficients: np.ndarray
    left_out: np.ndarray
    penalty: float

    def predict(self, features: np.ndarray) -> np.ndarray:
        """Return the prediction, (m, q).

        ``features`` (m, p).
        """
        return np.asarray(_designed(features, self.centre, self.scale) @ self.coefficients)


def fit_blocked_ridge(
    features: np.ndarray,
    targets: np.ndarray,
    blocks: np.ndarray,
    *,
    penalties: Sequence[float] = _PENALTIES,
    judged: slice = slice(None),
) -> BlockedRidge:
    """Fit targets by ridge regression; the penalty is the one that predicts best.

    ``features`` (n, p), ``targets`` (n, q): a constant is added and not penalised. ``blocks`` (n,):
    rows with the same number are left out together, so that similar neighbours do not vouch for
    each other. ``penalties`` are in units of the features' variance; ``judged`` are the targets
    they are judged by, by the median over rows of the squared error: a few rows from a false step
    do not choose.
    """
    n = len(features)
    names = np.unique(blocks)
    if len(targets) != n or len(blocks) != n or names.size < 2:
        raise ValueError(
            f"fit_blocked_ridge: expected as many targets and blocks as features ({n}) in two "
            f"blocks or more, got {len(targets)}, {len(blocks)} and {names.size} blocks."
        )
    centre, scale = features.mean(axis=0), features.std(axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    design = _designed(features, centre, scale)
    penalised = n * np.diag([0.0, *np.ones(features.shape[1])])
    parts = [np.flatnonzero(blocks == name) for name in names]
    grams = [design[part].T @ design[part] for part in parts]
    moments = [design[part].T @ targets[part] for part in parts]
    gram, moment = sum(grams), sum(moments)

    def errors(penalty: float, columns: slice) -> np.ndarray:
        out = np.empty_like(targets[:, columns])
        for part, own_gram, own_moment in zip(parts, grams, moments, strict=True):
            left = gram - own_gram + penalty * penalised
            solved = np.linalg.solve(left, (moment - own_moment)[:, columns])
            out[part] = targets[part, columns] - design[part] @ solved
        return out

    scores = [float(np.median((errors(p, judged) ** 2).mean(axis=1))) for p in penalties]
    best = penalties[int(np.argmin(scores))]
    return BlockedRidge(
        centre=centre,
        scale=scale,
        coefficients=np.linalg.solve(gram + best * penalised, moment),
        left_out=errors(best, slice(None)),
        penalty=best,
    )


def _designed(features: np.ndarray, centre: np.ndarray, scale: np.ndarray) -> np.ndarray:
    return np.column_stack([np.ones(len(features)), (features - centre) / scale])
