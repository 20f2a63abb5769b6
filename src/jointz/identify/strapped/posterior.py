"""Posterior of a participant under two hypotheses about the gait cycle, weighed by evidence."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import softmax

from jointz.identify.strapped.leg_model import LegModel
from jointz.identify.strapped.map_fit import MapFit, MapSearch
from jointz.identify.strapped.prior import LAG_PARTS, LegPriors

#: Shares of K's and B's variance that follow one curve of the gait cycle: hypotheses.
CYCLE_SHARES = (0.9, 0.0)
#: Starts off the prior's mean: changes of the logarithms of K and of shared parameters. A soft
#: strap is a mode of its own.
_OTHER_STARTS: Sequence[tuple[float, Mapping[str, float]]] = (
    (-0.4, {"inertia": -0.45, "strap_hz": 0.35}),
    (0.0, {"strap_hz": -0.8}),
)


@dataclass(frozen=True, slots=True, eq=False)
class LegPosterior:
    """Fits of all hypotheses with their probabilities."""

    model: LegModel
    fits: tuple[MapFit, ...]
    weights: np.ndarray  # probabilities of the hypotheses

    @property
    def best(self) -> MapFit:
        """The fit of the likeliest hypothesis."""
        return self.fits[int(np.argmax(self.weights))]

    def shared_moments(self, name: str) -> tuple[float, float]:
        """Return mean and sd of a shared parameter as transformed."""
        at = self.model.layout.shared(name)
        means = np.array([fit.theta[at] for fit in self.fits])
        variances = np.array([fit.covariance[at, at] for fit in self.fits])
        mean = float(self.weights @ means)
        variance = float(self.weights @ (variances + (means - mean) ** 2))
        return mean, float(np.sqrt(variance))

    def lag_moments(self) -> tuple[float, float]:
        """Return mean and sd of the goniometer's lag, s: delay and first-order lag together."""
        places = [self.model.layout.shared(name) for name in LAG_PARTS]
        parts = np.stack([np.exp(fit.theta[places]) for fit in self.fits])
        lags, among = parts.sum(axis=1), np.ix_(places, places)
        variances = [p @ f.covariance[among] @ p for p, f in zip(parts, self.fits, strict=True)]
        mean = float(self.weights @ lags)
        return mean, float(np.sqrt(self.weights @ (np.array(variances) + (lags - mean) ** 2)))


def explain(
    model: LegModel, priors: LegPriors, cycle_shares: Sequence[float] = CYCLE_SHARES
) -> LegPosterior:
    """Fit all hypotheses; the first from three starts, the other from its mode and the mean.

    Where sensors show device and bone, the search has one mode (all starts agreed): two starts and
    one are enough.
    """
    one_mode = len(model.layout.sensors) > 1
    known = all(np.isfinite(point.phase) for point in model.points)
    fits: list[MapFit] = []
    for share in cycle_shares if known else CYCLE_SHARES[-1:]:
        prior = priors.build(model, follows_cycle=share)
        others = [fits[0].theta] if fits else _other_starts(model, prior.mean)
        starts = [prior.mean, *others]
        if one_mode:
            starts = others if fits else starts[:2]
        fits.append(MapSearch(model, prior).best(starts))
    return LegPosterior(model, tuple(fits), softmax([fit.log_evidence for fit in fits]))


def _other_starts(model: LegModel, mean: np.ndarray) -> list[np.ndarray]:
    starts = []
    for stiffness, changes in _OTHER_STARTS:
        start = mean.copy()
        for point in range(model.layout.n_points):
            start[model.layout.stiffness(point)] += stiffness
        for name, change in changes.items():
            start[model.layout.shared(name)] += change
        starts.append(start)
    return starts
