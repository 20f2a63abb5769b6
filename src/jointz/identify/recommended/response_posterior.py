"""All hypotheses about joint and sensor together, weighted by what the responses say of them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from jointz.identify.recommended.reflex_hypothesis import with_reflexes
from jointz.identify.recommended.response_model import (
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

#: Inertia as good as one for all points, or a value of each.
CONSTANT_INERTIA_SD = 0.01
_INERTIA_SDS = (CONSTANT_INERTIA_SD, 0.1, 0.35)
#: K and B stay in the window, or change as the curve through the points does: how well each of
#: the two is known, sd over the window over their size, and how likely it is before the data. The
#: dissertation's window is short so that they stay.
_DRIFT_SDS = {False: 0.04, True: 0.2}
_CURVE_CHANCE = 1.0 / 3.0
_MIDDLING = Hypothesis(0.15, 0.1)
_START_INERTIAS = (0.05, 0.25)
#: Fewer points make no curve over the cycle.
_FEWEST_FOR_CURVE = 4
#: A hypothesis about the sensor that is less likely than this is not looked into.
_UNLIKELY = 1e-3
#: Share of the priors of K, B and J that is kept where they are removed.
_PRIOR_LEFT = 1e-6


@dataclass(frozen=True, slots=True)
class Moments:
    """An estimate with the variances that make its uncertainty."""

    mean: float  # the estimate
    sources: dict[
        str, float
    ]  # source -> variance; see :data:`~jointz.results.estimates.FIT_SOURCES`

    @property
    def variance(self) -> float:
        """Sum of all sources."""
        return float(sum(self.sources.values()))


@dataclass(frozen=True, slots=True, eq=False)
class JointPosterior:
    """The weighted hypotheses of one participant."""

    posteriors: tuple[Posterior, ...]  # one a hypothesis
    weights: np.ndarray  # their probabilities

    @classmethod
    def weighed(cls, posteriors: Sequence[Posterior]) -> "JointPosterior":
        """Return hypotheses weighted by their evidence."""
        return cls(tuple(posteriors), _weights(posteriors))

    @property
    def best(self) -> Posterior:
        """The most likely hypothesis."""
        return self.posteriors[int(np.argmax(self.weights))]

    def probability(self, **asked: object) -> float:
        """Return how probable hypotheses with these properties are."""
        fits = [
            all(getattr(p.hypothesis, name) == value for name, value in asked.items())
            for p in self.posteriors
        ]
        return float(self.weights[np.array(fits)].sum())

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
        """Return what K, B and the logarithm of J of a timing point are sums of, (3, p) of 0, 1."""
        n = self.best.values.size
        picks = np.zeros((3, n))
        picks[0, PER_POINT * i + K] = picks[1, PER_POINT * i + B] = 1.0
        picks[2, [PER_POINT * i + J_DEVIATION, n - SHARED + LOG_J]] = 1.0
        return picks

    def impedance_covariance(self, i: int) -> np.ndarray:
        """Return how the errors of K, B and the logarithm of J of a timing point go together."""
        picks = self.impedance_picks(i)
        means = np.array([picks @ p.values for p in self.posteriors])
        within = np.array([picks @ p.covariance @ picks.T for p in self.posteriors])
        off = means - self.weights @ means
        return np.asarray(np.tensordot(self.weights, within, 1) + (self.weights * off.T) @ off)

    def without_impedance_priors(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the estimates of all parameters had K, B and J no prior.

        One Newton step from each mode: exact where responses are linear in the parameters.
        """
        moments = [_without_impedance_prior(p) for p in self.posteriors]
        means = np.array([mean for mean, _ in moments])
        within = np.array([covariance for _, covariance in moments])
        mean = self.weights @ means
        off = means - mean
        between = (self.weights * off.T) @ off
        return mean, np.asarray(np.tensordot(self.weights, within, 1) + between)

    def lag_s(self) -> Moments:
        """Return lag and delay of the sensor together, s."""
        n = self.best.values.size
        return self._linear([n - SHARED + LAG, n - SHARED + DELAY])

    def friction_gain(self) -> Moments:
        """Return true over stated friction."""
        return self._linear([self.best.values.size - SHARED + FRICTION_GAIN])

    def middle_s(self) -> np.ndarray:
        """Return where in the window K, B and J have the values given, (n_point, 3) s."""
        middles = np.array([p.middle_s for p in self.posteriors])
        return np.asarray(np.tensordot(self.weights, middles, axes=1))

    def fitted(self, i: int) -> np.ndarray:
        """Return the angle of a timing point under the most likely hypothesis, rad."""
        return self.best.fitted[i]

    def _linear(self, places: Sequence[int]) -> Moments:
        """Return a sum of parameters: the variance of a mixture is that within and between."""
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
    model = ResponseModel(cells, priors, _MIDDLING, window_s=window_s)
    for sensor, chance in zip(sensors, _weights(sensors), strict=True):
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
    """Fit the hypotheses about the sensor, under a middling one about the joint.

    A resonance and a lag differ in what happens in the first milliseconds, whatever K, B and J
    do. Without an earlier result searches begin at light and at heavy legs: a long lag
    resembles inertia.
    """
    found = []
    responses = ResponseModel(cells, priors, _MIDDLING, window_s=window_s)
    for k, resonance in enumerate((False, True)):
        model = responses.under(replace(_MIDDLING, resonance=resonance))
        if earlier:
            found.append(model.refine(earlier[k].values))
            continue
        fits = [model.fit(model.start(inertia=inertia)) for inertia in _START_INERTIAS]
        found.append(max(fits, key=lambda fit: fit.log_evidence))
    return tuple(found)


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


def _weights(posteriors: Sequence[Posterior]) -> np.ndarray:
    logs = np.array([p.log_evidence for p in posteriors])
    chances = np.exp(logs - logs.max())
    return np.asarray(chances / chances.sum())


def _without_impedance_prior(posterior: Posterior) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and covariance of the parameters under one hypothesis, K, B and J without prior.

    A millionth of the prior stays, so that what the responses do not tell has a finite error.
    """
    prior, n = posterior.prior_precision, posterior.values.size
    points = PER_POINT * np.arange((n - SHARED) // PER_POINT)
    places = np.concatenate([points + K, points + B, [n - SHARED + LOG_J]])
    removed = np.zeros_like(prior)
    removed[places, places] = (1.0 - _PRIOR_LEFT) * prior[places, places]
    curvature = np.linalg.inv(posterior.bread)
    bread = np.linalg.inv(curvature - removed)
    mean = posterior.values + bread @ (removed @ (posterior.values - posterior.prior_mean))
    told = posterior.covariance - posterior.bread @ prior @ posterior.bread
    moved = bread @ curvature
    return mean, moved @ told @ moved.T + bread @ (prior - removed) @ bread


def _budget(posterior: Posterior, picks: np.ndarray) -> dict[str, float]:
    """Split the variance of a sum of parameters by where it comes from.

    The priors of two sources have nothing in common, so that each has its own share.
    """
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
