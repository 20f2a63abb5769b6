"""What of an estimate's variance would go, were something about the instruments measured.

The error budget tells where an error enters, not what takes it away: the spread of strides that
leaves a lag open is counted as that of strides, though a lag that is measured takes it away too.
"""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from jointz.identify.recommended.response_model import Posterior
from jointz.identify.recommended.response_posterior import JointPosterior
from jointz.kernels.response_search import CROSS_TALK, DELAY, FRICTION_GAIN, LAG, SHARED

#: What can be measured of the instruments -> the shared parameters whose sum that is.
_MEASURABLE: Final[Mapping[str, Sequence[int]]] = {
    "lag": (LAG, DELAY),
    "friction": (FRICTION_GAIN,),
    "cross_talk": (CROSS_TALK,),
}
#: Places and weights by which a mean over a normal distribution is taken.
_NODES, _NODE_WEIGHTS = np.polynomial.hermite_e.hermegauss(7)


def removed_variances(posterior: JointPosterior, picks: np.ndarray) -> dict[str, float]:
    """Return the variance of a sum of parameters that knowing the instruments would take away.

    The law of total variance: what is left is the mean, over all that the instrument may be, of
    the variance given that; both within the hypotheses and between them, whose probabilities the
    knowledge moves. Errors are taken for normal, effects for linear about each mode.
    """
    n = picks.size
    found = {}
    for name, places in _MEASURABLE.items():
        known = np.zeros(n)
        known[[n - SHARED + place for place in places]] = 1.0
        found[name] = _removed(posterior, picks, known)
    return found


def _removed(posterior: JointPosterior, picks: np.ndarray, known: np.ndarray) -> float:
    means, instruments = (_means(posterior.posteriors, x) for x in (picks, known))
    spread, shared = (_products(posterior.posteriors, x, known) for x in (known, picks))
    slopes = shared / spread
    weights = posterior.weights
    between = float(weights @ (means - weights @ means) ** 2)
    # What the instrument may be: some places in the distribution of every hypothesis.
    sds = np.sqrt(spread)
    places = instruments[:, None] + sds[:, None] * _NODES
    chances = weights[:, None] * _NODE_WEIGHTS / _NODE_WEIGHTS.sum()
    off = places.ravel()[:, None] - instruments
    likely = np.log(np.maximum(weights, 1e-300)) - 0.5 * (off / sds) ** 2 - np.log(sds)
    likely = np.exp(likely - likely.max(axis=1, keepdims=True))
    likely /= likely.sum(axis=1, keepdims=True)
    given = means + slopes * off
    middles = (likely * given).sum(axis=1, keepdims=True)
    left = float(chances.ravel() @ (likely * (given - middles) ** 2).sum(axis=1))
    return max(float(weights @ (slopes * shared)) + between - left, 0.0)


def _means(posteriors: Sequence[Posterior], picks: np.ndarray) -> np.ndarray:
    return np.array([picks @ p.values for p in posteriors])


def _products(posteriors: Sequence[Posterior], one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return np.array([one @ p.covariance @ other for p in posteriors])
