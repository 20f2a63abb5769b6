"""Errors of the estimates that a design would give, by the estimator's own posterior.

At legs drawn from the priors, the information of the responses and the estimator's priors give
the posterior of all hypotheses as it would be; its weights follow from the evidence of responses
without noise.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from jointz.identify.walking.coupling import ModelError
from jointz.identify.walking.estimands import LogMoments, log_gradient, mixed_moments
from jointz.identify.walking.leg_model import REFLEX, LegModel
from jointz.identify.walking.map_fit import MapFit, MapSearch
from jointz.identify.walking.prior import Prior
from jointz.results.value_scale import ValueScale

#: Half a step of the central differences, of transformed parameters.
_STEP = 1e-4
#: The same of delays, which are in seconds.
_DELAYS, _STEP_S = ("encoder_delay_s", "gyroscope_delay_s"), 1e-6
#: Logarithm of a gain that is none.
_NO_REFLEX = -20.0


def response_slopes(model: LegModel, theta: np.ndarray, point: int) -> np.ndarray:
    """Return derivatives of what is fitted of a point by its parameters, (used, columns)."""
    columns = model.layout.columns(point)
    moved = np.tile(theta, (2 * columns.size, 1))
    rows, steps = np.arange(columns.size), _steps(model)[columns]
    moved[rows, columns] += steps
    moved[columns.size + rows, columns] -= steps
    responses = model.points[point].fitted(model.responses(moved, point))
    return np.asarray((responses[: columns.size] - responses[columns.size :]).T / (2.0 * steps))


def _steps(model: LegModel) -> np.ndarray:
    """Return half a step of every parameter; delays in seconds are interpolated in between."""
    steps = np.full(model.layout.size, _STEP)
    for name in _DELAYS:
        if name in model.layout.shared_names:
            steps[model.layout.shared(name)] = _STEP_S
    return steps


@dataclass(frozen=True, slots=True, eq=False)
class Sensitivity:
    """A leg, and how its responses depend on every parameter."""

    model: LegModel
    theta: np.ndarray
    slopes: tuple[np.ndarray, ...]  # of every point

    def whitened(self, search: MapSearch) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield slopes of every point over the errors of ``search``, and the errors' factor."""
        for k, slopes in enumerate(self.slopes):
            used = self.model.points[k].used
            covariance = search.error_covariance(self.theta, k)[np.ix_(used, used)]
            factor = np.linalg.cholesky(covariance)
            yield solve_triangular(factor, slopes, lower=True, check_finite=False), factor

    def information(self, search: MapSearch) -> np.ndarray:
        """Return the Fisher information of all parameters, without a prior."""
        total = np.zeros((self.theta.size, self.theta.size))
        for k, (slopes, _) in enumerate(self.whitened(search)):
            columns = self.model.layout.columns(k)
            total[np.ix_(columns, columns)] += slopes.T @ slopes
        return total


def sensitivity(model: LegModel, theta: np.ndarray) -> Sensitivity:
    """Return how the responses of a leg depend on its parameters."""
    points = range(len(model.points))
    return Sensitivity(model, theta, tuple(response_slopes(model, theta, k) for k in points))


@dataclass(frozen=True, slots=True, eq=False)
class LogValues:
    """Logarithms of all estimands of a leg, and how they depend on its parameters."""

    values: np.ndarray  # (estimand * point,)
    gradient: np.ndarray  # (estimand * point, parameter)
    stiffness_scale: ValueScale
    error: ModelError


def log_values(model: LegModel, theta: np.ndarray, prior: Prior, sd: float) -> LogValues:
    """Return the logarithms of all estimands; steps of the derivatives are shares of prior sds."""
    steps = MapFit(theta, sd**2 * prior.covariance, prior, 0.0, ())
    return LogValues(*log_gradient(model, steps), model.stiffness_scale, model.error)


def predicted_moments(
    logs: LogValues, theta: np.ndarray, information: np.ndarray, priors: Sequence[Prior]
) -> LogMoments:
    """Return posterior and prior of all logarithms if the leg is ``theta``."""
    values, gradient = logs.values, logs.gradient
    means, covariances, prior_means, prior_covariances, evidence = [], [], [], [], []
    for prior in priors:
        precision, pull = prior.normal(theta)
        curvature = information + precision
        covariance = np.linalg.inv(curvature)
        shift = covariance @ pull
        evidence.append(
            -0.5 * prior.misfit(theta)
            + 0.5 * float(pull @ shift)
            - 0.5 * float(np.linalg.slogdet(curvature)[1])
            - 0.5 * prior.log_det
            + float(np.log(prior.chance))
        )
        means.append(values + gradient @ shift)
        covariances.append(gradient @ covariance @ gradient.T)
        prior_means.append(values + gradient @ (prior.mean - theta))
        prior_covariances.append(gradient @ prior.covariance @ gradient.T)
    weights = np.exp(np.array(evidence) - max(evidence))
    weights /= weights.sum()
    mean, covariance = mixed_moments(weights, means, covariances)
    prior_mean, spread = mixed_moments(weights, prior_means, prior_covariances)
    wider = logs.error.wider**2 * covariance
    return LogMoments(mean, wider, prior_mean, spread, logs.stiffness_scale, logs.error)


def reflex_bias(
    sensitive: Sensitivity, search: MapSearch, prior: Prior, logs: LogValues
) -> np.ndarray:
    """Return the relative bias of all estimands if the estimator had no reflex, to first order."""
    model, theta = sensitive.model, sensitive.theta
    layout = model.layout
    without = theta.copy()
    without[layout.shared("reflex_gain")] = _NO_REFLEX
    known = [layout.shared(name) for name in layout.shared_names if name.startswith("reflex_")]
    known += [layout.own(point, REFLEX) for point in range(layout.n_points)]
    free = np.setdiff1d(np.arange(theta.size), known)
    information, pushed = np.zeros((theta.size, theta.size)), np.zeros(theta.size)
    for k, (slopes, factor) in enumerate(sensitive.whitened(search)):
        columns = layout.columns(k)
        missed = model.responses(theta[None], k)[0] - model.responses(without[None], k)[0]
        answer = solve_triangular(factor, model.points[k].fitted(missed), lower=True)
        information[np.ix_(columns, columns)] += slopes.T @ slopes
        pushed[columns] += slopes.T @ answer
    curvature = (information + prior.normal(theta)[0])[np.ix_(free, free)]
    shift = np.zeros(theta.size)
    shift[free] = np.linalg.solve(curvature, pushed[free])
    return np.asarray(np.expm1(logs.gradient @ shift))
