"""Impedance of every timing point as functions of the parameters, with prior and posterior."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jointz.identify.walking.coupling import STRAP, ModelError
from jointz.identify.walking.leg_model import REFERENCE_S, LegModel
from jointz.identify.walking.map_fit import MapFit
from jointz.identify.walking.posterior import LegPosterior
from jointz.kernels import strapped_leg as leg
from jointz.results.estimates import ONE_SIDED_95
from jointz.results.value_scale import LOGARITHM, ValueScale, shares_at

#: Estimated logarithms: K along the motion (secant), mean B, J, and K and B at the onset. Both K
#: are on the scale of K.
ESTIMANDS = ("stiffness", "damping", "inertia", "stiffness_onset", "damping_onset")
_STIFFNESS = ("stiffness", "stiffness_onset")
_EVERY_S = 0.002
_DERIVATIVE_SD = 0.05
#: Information of data that are uninformative: an SD of 1000.
_LEAST_INFORMATION = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class LogMoments:
    """Mean and covariance of all estimands on their scales, and those of the prior."""

    mean: np.ndarray  # (estimand * point,) natural logarithms of values in SI, K on its scale
    covariance: np.ndarray
    prior_mean: np.ndarray
    prior_covariance: np.ndarray
    stiffness_scale: ValueScale = LOGARITHM
    error: ModelError = STRAP.error

    @property
    def sd(self) -> np.ndarray:
        """Standard deviations of the posterior."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    def scale(self, name: str) -> ValueScale:
        """Return the scale of an estimand."""
        return self.stiffness_scale if name in _STIFFNESS else LOGARITHM

    def value(self, name: str, point: int) -> float:
        """Return the value, SI, at the mean of an estimand at a point."""
        return float(self.scale(name).value(self.of(name, point)[0]))

    def prior_share(self, name: str, point: int) -> float:
        """Return the variance of an estimand at a point over that of its prior."""
        at = self._place(name, point)
        return float(self.covariance[at, at] / self.prior_covariance[at, at])

    def low_by_data(self, name: str, point: int) -> float:
        """Return the lower limit, SI, of an estimand without its prior, 0 or more.

        Posterior over prior of the estimand at all points together.
        """
        n = self.mean.size // len(ESTIMANDS)
        block = slice(self._place(name, 0), self._place(name, 0) + n)
        # The posterior is widened for the error of the model, not for missing information.
        inverse = np.linalg.inv(self.covariance[block, block] / self.error.sd_inflation**2)
        prior_inverse = np.linalg.inv(self.prior_covariance[block, block])
        information, vectors = np.linalg.eigh(inverse - prior_inverse)
        known = information > _LEAST_INFORMATION
        variances = 1.0 / np.where(known, information, _LEAST_INFORMATION)
        pull = inverse @ self.mean[block] - prior_inverse @ self.prior_mean[block]
        mean = (vectors @ (variances * known * (vectors.T @ pull)))[point]
        sd = self.error.sd_inflation * np.sqrt(variances @ vectors[point] ** 2)
        place = np.clip(mean - ONE_SIDED_95 * sd, 0.0, max(self.mean[block][point], 0.0))
        return float(self.scale(name).value(place))

    @property
    def shares(self) -> np.ndarray:
        """Sd of each element over the relative sd of its value: 1 for a logarithm."""
        n = self.mean.size // len(ESTIMANDS)
        return shares_at((self.scale(name) for name in ESTIMANDS for _ in range(n)), self.mean)

    def of(self, name: str, point: int) -> tuple[float, float]:
        """Return mean and sd of an estimand at a point."""
        at = self._place(name, point)
        return float(self.mean[at]), float(self.sd[at])

    def means(self, name: str) -> np.ndarray:
        """Return the means of an estimand at all points."""
        n = self.mean.size // len(ESTIMANDS)
        return self.mean[self._place(name, 0) :][:n]

    def _place(self, name: str, point: int) -> int:
        return ESTIMANDS.index(name) * (self.mean.size // len(ESTIMANDS)) + point


def log_moments(posterior: LegPosterior) -> LogMoments:
    """Return the moments of all hypotheses together."""
    model, weights = posterior.model, posterior.weights
    means, covariances, prior_means, prior_covariances = zip(
        *(_linear_moments(model, fit) for fit in posterior.fits), strict=True
    )
    mean, covariance = mixed_moments(weights, means, covariances)
    prior = mixed_moments(weights, prior_means, prior_covariances)
    inflated = model.error.sd_inflation**2 * covariance
    return LogMoments(mean, inflated, *prior, model.stiffness_scale, model.error)


def mixed_moments(
    weights: np.ndarray, means: Sequence[np.ndarray], covariances: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and covariance of a mixture."""
    mean = sum(w * m for w, m in zip(weights, means, strict=True))
    covariance = sum(
        w * (c + np.outer(m - mean, m - mean))
        for w, m, c in zip(weights, means, covariances, strict=True)
    )
    return np.asarray(mean), np.asarray(covariance)


def _linear_moments(
    model: LegModel, fit: MapFit
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return mean and covariance of the posterior and of the prior, to first order."""
    mean, gradient = log_gradient(model, fit)
    return (
        mean,
        gradient @ fit.covariance @ gradient.T,
        mean + gradient @ (fit.prior.mean - fit.theta),
        gradient @ fit.prior.covariance @ gradient.T,
    )


def log_gradient(model: LegModel, fit: MapFit) -> tuple[np.ndarray, np.ndarray]:
    """Return all logarithms (estimand * point,) at the mode, and their gradient."""
    sd = np.sqrt(np.diag(fit.covariance))
    points = range(model.layout.n_points)
    values = np.zeros((len(ESTIMANDS), len(points)))
    slopes = np.zeros((len(ESTIMANDS), len(points), fit.theta.size))
    for k in points:
        columns = model.layout.columns(k)
        steps = _DERIVATIVE_SD * sd[columns]
        moved = np.tile(fit.theta, (columns.size + 1, 1))
        moved[np.arange(columns.size) + 1, columns] += steps
        logs = log_estimands(model, moved, k)
        values[:, k] = logs[0]
        slopes[:, k, columns] = ((logs[1:] - logs[0]) / steps[:, None]).T
    return values.ravel(), slopes.reshape(-1, fit.theta.size)


def log_estimands(model: LegModel, theta: np.ndarray, point: int) -> np.ndarray:
    """Return the logarithms of all estimands at a point, (m, estimand)."""
    layout, at = model.layout, model.points[point].time_s
    window = np.arange(0.0, model.window_s + 1e-9, _EVERY_S)
    inside = model.knot_weights(window)
    scaled_k, log_b = theta[:, layout.stiffness(point)], theta[:, layout.damping(point)]
    scale = model.stiffness_scale
    stiffness, damping = scale.value(scaled_k @ inside.T), np.exp(log_b @ inside.T)
    _, _, p = model.natural(theta, point)
    limb = model.limb_inertia(theta, point, np.array([REFERENCE_S]))[:, 0]
    bone = model.bone(theta, point)
    moved = np.stack([[np.interp(window, at, x) for x in shapes] for shapes in bone])
    gravity, half, power = (
        p[:, column, None, None]
        for column in (leg.GRAVITY_STIFFNESS, leg.HALF_ANGLE, leg.SOFTENING_POWER)
    )
    secant = gravity + (stiffness[:, None] - gravity) / (1.0 + (np.abs(moved) / half) ** power)
    onset = model.knot_weights(np.zeros(1))[0]
    return np.stack(
        [
            scale.of(secant.mean(axis=(1, 2))),
            np.log(damping.mean(axis=1)),
            np.log(limb + p[:, leg.DEVICE_INERTIA]),
            scaled_k @ onset,
            log_b @ onset,
        ],
        axis=1,
    )
