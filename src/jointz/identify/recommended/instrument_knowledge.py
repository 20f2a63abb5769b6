"""Reduction of an estimate's variance by measuring the instruments.

It differs from the error budget: an unknown lag may be estimated from the responses, so that their
noise is counted as noise although measuring the lag would remove that error, too.
"""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from jointz.identify.recommended.response_posterior import JointPosterior
from jointz.kernels.response_search import CROSS_TALK, DELAY, FRICTION_GAIN, LAG, SHARED

#: Measurable property of the instruments -> the shared parameters that sum to it.
_MEASURABLE: Final[Mapping[str, Sequence[int]]] = {
    "lag": (LAG, DELAY),
    "friction": (FRICTION_GAIN,),
    "cross_talk": (CROSS_TALK,),
}
#: Nodes and weights of a mean over a normal distribution.
_NODES, _NODE_WEIGHTS = np.polynomial.hermite_e.hermegauss(7)


def removed_variances(posterior: JointPosterior, picks: np.ndarray) -> dict[str, float]:
    """Return by how much knowing each instrument would reduce the variance of a sum of parameters.

    By the law of total variance, the remaining variance is the mean, over the distribution of the
    instrument, of the variance given its value, both within the hypotheses and between them, whose
    probabilities depend on that value. Errors are taken as normal, effects as linear about each
    mode.
    """
    removed = {}
    for name, places in _MEASURABLE.items():
        instrument = np.zeros(picks.size)
        instrument[[picks.size - SHARED + place for place in places]] = 1.0
        removed[name] = _removed(posterior, picks, instrument)
    return removed


def _removed(posterior: JointPosterior, picks: np.ndarray, instrument: np.ndarray) -> float:
    weights, hypotheses = posterior.weights, posterior.posteriors
    means, values = (np.array([x @ p.values for p in hypotheses]) for x in (picks, instrument))
    spread, shared = (
        np.array([x @ p.covariance @ instrument for p in hypotheses]) for x in (instrument, picks)
    )
    slopes, sds = shared / spread, np.sqrt(spread)
    between = float(weights @ (means - weights @ means) ** 2)
    nodes = values[:, None] + sds[:, None] * _NODES
    chances = weights[:, None] * _NODE_WEIGHTS / _NODE_WEIGHTS.sum()
    off = nodes.ravel()[:, None] - values
    likely = np.log(np.maximum(weights, 1e-300)) - 0.5 * (off / sds) ** 2 - np.log(sds)
    likely = np.exp(likely - likely.max(axis=1, keepdims=True))
    likely /= likely.sum(axis=1, keepdims=True)
    conditional = means + slopes * off
    middles = (likely * conditional).sum(axis=1, keepdims=True)
    remaining = float(chances.ravel() @ (likely * (conditional - middles) ** 2).sum(axis=1))
    return max(float(weights @ (slopes * shared)) + between - remaining, 0.0)
