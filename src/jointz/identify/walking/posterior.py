"""Posterior of a participant under hypotheses that are weighed by their evidence."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import softmax

from jointz.identify.walking.coupling import Hypothesis
from jointz.identify.walking.leg_model import LegModel
from jointz.identify.walking.map_fit import MapFit, MapSearch
from jointz.identify.walking.prior import LAG_PARTS, LegPriors, Prior

#: Logarithm of the odds against what is not tried any more.
_FAR_LESS_LIKELY = 7.0


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
    model: LegModel, priors: LegPriors, hypotheses: Sequence[Hypothesis] | None = None
) -> LegPosterior:
    """Fit all hypotheses; the first from several starts, others from another's mode and the mean.

    Where sensors show device and bone, the search has one mode (all starts agreed): two starts and
    one are enough. What is supposed beside the cycle is dropped where it was far less likely.
    """
    several = bool(model.layout.sensors)
    one_mode = len(model.layout.sensors) > 1
    known = all(np.isfinite(point.phase) for point in model.points)
    usual = priors.coupling.hypotheses_of(
        priors.spec, several_sensors=several, phases=len(model.points) if known else 0
    )
    tried: list[tuple[Hypothesis, MapFit]] = []
    for hypothesis in hypotheses or usual:
        if _is_far_less_likely(hypothesis, tried):
            continue
        best = max((fit for _, fit in tried), key=lambda fit: fit.log_evidence, default=None)
        same = [fit for h, fit in tried if h.shared == hypothesis.shared]
        alike = max(same, key=lambda fit: fit.log_evidence, default=best)
        prior = priors.build(model, hypothesis)
        if best and alike:
            starts = [_start(model, hypothesis, prior, fit) for fit in dict.fromkeys((alike, best))]
            starts = starts[:1] if one_mode else [*starts, prior.mean]
        else:
            starts = [prior.mean, *_other_starts(model, priors, prior.mean)]
            starts = starts[:2] if one_mode else starts
        fit = MapSearch(model, prior).best(starts)
        if best and not one_mode and fit.log_evidence > best.log_evidence:
            tried = [(h, _again(model, h, other, fit)) for h, other in tried]
        tried.append((hypothesis, fit))
    fits = tuple(fit for _, fit in tried)
    return LegPosterior(model, fits, softmax([fit.log_evidence for fit in fits]))


class LastFit:
    """The likeliest fit of an estimate, at which the next one of the same session begins.

    Between full fits, which come every so many, all other hypotheses are left out.
    """

    def __init__(self, *, full_every: int) -> None:
        self._full_every = full_every
        # parameters -> fit, and estimates since the last full one
        self._fits: dict[object, tuple[MapFit, int]] = {}

    def explain(self, model: LegModel, priors: LegPriors) -> LegPosterior:
        """Return the posterior, by one hypothesis where the last fit is of the same parameters."""
        key = (model.layout, priors.lag is None)
        last, n_since = self._fits.get(key, (None, 0))
        if last is None or n_since == self._full_every - 1:
            posterior = explain(model, priors)
            self._fits[key] = posterior.best, 0
        else:
            fit = MapSearch(model, last.prior).fit(last.theta)
            posterior = LegPosterior(model, (fit,), np.ones(1))
            self._fits[key] = fit, n_since + 1
        return posterior


def _is_far_less_likely(hypothesis: Hypothesis, tried: Sequence[tuple[Hypothesis, MapFit]]) -> bool:
    """Return whether what is supposed was so before, all else the same."""
    return any(
        fit.log_evidence < other.log_evidence - _FAR_LESS_LIKELY
        for h, fit in tried
        if h.shared == hypothesis.shared
        for o, other in tried
        if (o.follows_cycle, o.inertia_sd) == (h.follows_cycle, h.inertia_sd)
    )


def _start(model: LegModel, hypothesis: Hypothesis, prior: Prior, fit: MapFit) -> np.ndarray:
    """Return another hypothesis' mode with what this one supposes."""
    start = fit.theta.copy()
    supposed = [model.layout.shared(name) for name in hypothesis.shared]
    start[supposed] = prior.mean[supposed]
    return start


def _again(model: LegModel, hypothesis: Hypothesis, fit: MapFit, better: MapFit) -> MapFit:
    """Return the better of a fit and one from a mode that a likelier hypothesis found."""
    other = MapSearch(model, fit.prior).fit(_start(model, hypothesis, fit.prior, better))
    return min(fit, other, key=lambda candidate: candidate.objective)


def _other_starts(model: LegModel, priors: LegPriors, mean: np.ndarray) -> list[np.ndarray]:
    starts = []
    for stiffness, changes in priors.coupling.starts:
        start = mean.copy()
        for point in range(model.layout.n_points):
            start[model.layout.stiffness(point)] += stiffness
        for name, change in changes.items():
            start[model.layout.shared(name)] += change
        starts.append(start)
    return starts
