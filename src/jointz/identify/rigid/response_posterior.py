"""Posterior over all hypotheses about joint and sensor, weighted by their evidence."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import softmax

from jointz.identify.rigid.reflex_hypothesis import with_reflexes
from jointz.identify.rigid.response_model import (
    CellResponse,
    Hypothesis,
    Posterior,
    Priors,
    ResponseModel,
)
from jointz.kernels.response_search import (
    B_DRIFT,
    CROSS_TALK,
    DELAY,
    FRICTION_GAIN,
    J_DEVIATION,
    K_DRIFT,
    LAG,
    LOG_J,
    LOG_RESONANCE,
    PER_POINT,
    RESONANCE_DAMPING,
    SHARED,
    B,
    K,
)
from jointz.results.estimates import FIT_SOURCES

#: Relative sd of the inertia between timing points: practically constant, or different.
CONSTANT_INERTIA_SD = 0.01
_INERTIA_SDS = (CONSTANT_INERTIA_SD, 0.1, 0.35)
#: K and B are constant in the window, or follow the curve through the points: for both, the sd of
#: their change over the window relative to their size, and the prior probability of the latter.
_DRIFT_SDS = {False: 0.04, True: 0.2}
_CURVE_CHANCE = 1.0 / 3.0
_INTERMEDIATE = Hypothesis(0.15, 0.1)
_START_INERTIAS = (0.05, 0.25)
#: Fewest timing points for a curve over the cycle.
_FEWEST_FOR_CURVE = 4
#: Less probable hypotheses about the sensor are dropped.
_UNLIKELY = 1e-3
#: Share of the priors of K, B and J that remains when they are removed.
_PRIOR_LEFT = 1e-6


@dataclass(frozen=True, slots=True)
class Moments:
    """An estimate and its variance by source."""

    mean: float  # unit of the parameters that are combined
    # source of error (:data:`~jointz.results.estimates.FIT_SOURCES`) -> variance
    sources: dict[str, float]

    @property
    def variance(self) -> float:
        """Sum of all sources."""
        return float(sum(self.sources.values()))


@dataclass(frozen=True, slots=True, eq=False)
class JointPosterior:
    """The weighted hypotheses of one participant."""

    posteriors: tuple[Posterior, ...]  # one for each hypothesis
    weights: np.ndarray  # probabilities of the hypotheses

    @classmethod
    def weighed(cls, posteriors: Sequence[Posterior]) -> "JointPosterior":
        """Return hypotheses weighted by their evidence."""
        return cls(tuple(posteriors), softmax([p.log_evidence for p in posteriors]))

    @property
    def best(self) -> Posterior:
        """The most likely hypothesis."""
        return self.posteriors[int(np.argmax(self.weights))]

    def probability(self, **properties: object) -> float:
        """Return the probability of the hypotheses with these properties."""
        matches = [
            all(getattr(p.hypothesis, name) == value for name, value in properties.items())
            for p in self.posteriors
        ]
        return float(self.weights[np.array(matches)].sum())

    def stiffness(self, i: int) -> Moments:
        """Return K of a timing point, N*m/rad."""
        return self._linear([PER_POINT * i + K])

    def damping(self, i: int) -> Moments:
        """Return B of a timing point, N*m*s/rad."""
        return self._linear([PER_POINT * i + B])

    def log_inertia(self, i: int) -> Moments:
        """Return the logarithm of J of a timing point."""
        n = self.best.values.size
        return self._linear([PER_POINT * i + J_DEVIATION, n - SHARED + LOG_J])

    def impedance_picks(self, i: int) -> np.ndarray:
        """Return the parameters that sum to K, B and log J of a timing point, (3, p) of 0, 1."""
        n = self.best.values.size
        picks = np.zeros((3, n))
        picks[0, PER_POINT * i + K] = picks[1, PER_POINT * i + B] = 1.0
        picks[2, [PER_POINT * i + J_DEVIATION, n - SHARED + LOG_J]] = 1.0
        return picks

    def impedance_covariance(self, i: int) -> np.ndarray:
        """Return the covariance of the errors of K, B and log J of a timing point."""
        picks = self.impedance_picks(i)
        means = np.array([picks @ p.values for p in self.posteriors])
        within = np.array([picks @ p.covariance @ picks.T for p in self.posteriors])
        return _mixture(self.weights, means, within)[1]

    def without_impedance_priors(self) -> tuple[np.ndarray, np.ndarray]:
        """Return mean and covariance of all parameters without priors of K, B and J.

        One Newton step from each mode: exact where responses are linear in the parameters.
        """
        moments = [_without_impedance_prior(p) for p in self.posteriors]
        means = np.array([mean for mean, _ in moments])
        within = np.array([covariance for _, covariance in moments])
        return _mixture(self.weights, means, within)

    def lag_s(self) -> Moments:
        """Return lag and delay of the sensor together, s."""
        n = self.best.values.size
        return self._linear([n - SHARED + LAG, n - SHARED + DELAY])

    def friction_gain(self) -> Moments:
        """Return true over stated friction."""
        return self._linear([self.best.values.size - SHARED + FRICTION_GAIN])

    def middle_s(self) -> np.ndarray:
        """Return the times in the window at which K, B and J hold, (n_point, 3) s."""
        middles = np.array([p.middle_s for p in self.posteriors])
        return np.asarray(np.tensordot(self.weights, middles, axes=1))

    def fitted(self, i: int) -> np.ndarray:
        """Return the angle of a timing point under the most likely hypothesis, rad."""
        return self.best.fitted[i]

    def _linear(self, places: Sequence[int]) -> Moments:
        """Return the sum of some parameters, with the variance within and between hypotheses."""
        picks = np.zeros(self.best.values.size)
        picks[list(places)] = 1.0
        means = np.array([picks @ p.values for p in self.posteriors])
        mean = float(self.weights @ means)
        sources = dict.fromkeys(FIT_SOURCES, 0.0)
        for weight, posterior in zip(self.weights, self.posteriors, strict=True):
            for name, variance in _budget(posterior, picks).items():
                sources[name] += float(weight) * variance
        sources["model"] = float(self.weights @ (means - mean) ** 2)
        return Moments(mean, sources)


def estimate_responses(
    cells: Sequence[CellResponse],
    priors: Priors,
    *,
    window_s: float,
    sensors: Sequence[Posterior],
) -> JointPosterior:
    """Fit all hypotheses to the responses of a participant."""
    posteriors: list[Posterior] = []
    model = ResponseModel(cells, priors, _INTERMEDIATE, window_s=window_s)
    chances = softmax([sensor.log_evidence for sensor in sensors])
    for sensor, chance in zip(sensors, chances, strict=True):
        if chance < _UNLIKELY:
            continue
        hypotheses = _hypotheses(sensor.hypothesis, curves=len(cells) >= _FEWEST_FOR_CURVE)
        posteriors += [model.under(h).refine(sensor.values) for h in hypotheses]
    return JointPosterior.weighed(with_reflexes(posteriors, cells))


def compare_sensors(
    cells: Sequence[CellResponse],
    priors: Priors,
    *,
    window_s: float,
    earlier: Sequence[Posterior] = (),
) -> tuple[Posterior, ...]:
    """Fit the hypotheses about the sensor, under an intermediate one about the joint.

    A resonance and a lag differ in what happens in the first milliseconds, whatever K, B and J
    do. Without an earlier result searches begin at light and at heavy legs: a long lag
    resembles inertia.
    """
    posteriors = []
    responses = ResponseModel(cells, priors, _INTERMEDIATE, window_s=window_s)
    for k, resonance in enumerate((False, True)):
        model = responses.under(replace(_INTERMEDIATE, resonance=resonance))
        if earlier:
            posteriors.append(model.refine(earlier[k].values))
            continue
        fits = [model.fit(model.start(inertia=inertia)) for inertia in _START_INERTIAS]
        posteriors.append(max(fits, key=lambda fit: fit.log_evidence))
    return tuple(posteriors)


def inertia_evidence(
    cells: Sequence[CellResponse], priors: Priors, *, window_s: float, start: Posterior
) -> float:
    """Return the logarithm of the evidence of all models of the inertia together."""
    model = ResponseModel(cells, priors, start.hypothesis, window_s=window_s)
    plain = replace(start.hypothesis, reflex_s=0.0)
    logs = [
        model.under(replace(plain, inertia_sd=sd)).refine(start.values).log_evidence
        for sd in _INERTIA_SDS
    ]
    return float(np.logaddexp.reduce(logs))


def _hypotheses(sensor: Hypothesis, *, curves: bool) -> list[Hypothesis]:
    """Return every hypothesis about the joint behind this sensor."""
    return [
        replace(
            sensor,
            inertia_sd=inertia_sd,
            drift_sd=_DRIFT_SDS[curve],
            follows_curve=curve,
            chance=_CURVE_CHANCE if curve else 1.0 - _CURVE_CHANCE,
        )
        for inertia_sd in _INERTIA_SDS
        for curve in ((False, True) if curves else (False,))
    ]


def _mixture(
    weights: np.ndarray, means: np.ndarray, within: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and covariance of a mixture of distributions."""
    mean = weights @ means
    off = means - mean
    return mean, np.asarray(np.tensordot(weights, within, 1) + (weights * off.T) @ off)


def _without_impedance_prior(posterior: Posterior) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and covariance under one hypothesis, K, B and J without prior.

    A millionth of the prior remains, so that undetermined parameters have a finite error.
    """
    prior, n = posterior.prior_precision, posterior.values.size
    points = PER_POINT * np.arange((n - SHARED) // PER_POINT)
    places = np.concatenate([points + K, points + B, [n - SHARED + LOG_J]])
    removed = np.zeros_like(prior)
    removed[places, places] = (1.0 - _PRIOR_LEFT) * prior[places, places]
    curvature = np.linalg.inv(posterior.bread)
    bread = np.linalg.inv(curvature - removed)
    mean = posterior.values + bread @ (removed @ (posterior.values - posterior.prior_mean))
    from_data = posterior.covariance - posterior.bread @ prior @ posterior.bread
    moved = bread @ curvature
    return mean, moved @ from_data @ moved.T + bread @ (prior - removed) @ bread


def _budget(posterior: Posterior, picks: np.ndarray) -> dict[str, float]:
    """Return the variance of a sum of parameters by source; their priors are independent."""
    reach = picks @ posterior.bread
    shares = reach * (posterior.prior_precision @ reach)
    points, shared = shares[:-SHARED].reshape(-1, PER_POINT).sum(axis=0), shares[-SHARED:]
    lag = shared[[LAG, DELAY, LOG_RESONANCE, RESONANCE_DAMPING]].sum()
    variance = float(picks @ posterior.covariance @ picks)
    reflex = float(picks @ posterior.reflex_reach) ** 2
    return {
        "friction": float(shared[FRICTION_GAIN]),
        "cross_talk": float(shared[CROSS_TALK]),
        "inertia_model": float(points[J_DEVIATION]),
        "drift": float(points[K_DRIFT] + points[B_DRIFT]),
        "lag": float(lag),
        "reflex": reflex,
        "prior": float(points[K] + points[B] + shared[LOG_J]),
        "noise": variance - float(shares.sum()) - reflex,
    }
