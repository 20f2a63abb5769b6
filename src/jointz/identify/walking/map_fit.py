"""Most probable parameters of a participant, and the normal posterior about them.

Levenberg and Marquardt's method on responses whitened by the covariance of their errors: errors
of the predicted unperturbed motion, and of the model, which grows with the response.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from jointz.identify.preparation.raw_signals import JOINT_VELOCITY, SHANK_VELOCITY
from jointz.identify.walking.leg_model import LegModel
from jointz.identify.walking.prior import Prior
from jointz.identify.walking.responses import PointResponse

#: Time over which the error of the model is correlated.
_MODEL_S = 0.03
#: The floor of a velocity, over that of an angle.
_FLOOR_HZ = 30.0
#: The share is of no less than this part of the largest response.
_LEAST_RESPONSE = 0.1
_JITTER = 1e-9
#: Steps of the derivatives, in prior sds, and the longest.
_DERIVATIVE_SD, _LONGEST_DERIVATIVE = 0.02, 0.02
#: Damping of the search, and its factors after a failure and a success.
_DAMPING, _MORE, _LESS, _LEAST_DAMPING = 1e-2, 4.0, 5.0, 1e-7
_LONGEST_STEP_SD = 2.0
_SMALL_DECREASE = 0.02
_ITERATIONS, _TRIALS, _REWEIGHTED = 40, 8, 3


@dataclass(frozen=True, slots=True, eq=False)
class _Weights:
    """Cholesky factors of the error covariance of each point's used samples."""

    factors: tuple[np.ndarray, ...]
    measured: tuple[np.ndarray, ...]  # measured angles of the used samples, rad

    @property
    def log_det(self) -> float:
        """Half the logarithm of the determinant of all covariances."""
        return float(sum(np.log(np.diag(factor)).sum() for factor in self.factors))

    def whitened(self, point: int, values: np.ndarray) -> np.ndarray:
        return np.asarray(
            solve_triangular(self.factors[point], values, lower=True, check_finite=False)
        )


#: Share of an addition that the parameters must leave unexplained for its size to be known.
_LEAST_INFORMATION = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class MapFit:
    """The mode of the posterior, and its covariance by the curvature there (Laplace)."""

    theta: np.ndarray  # parameters in the order of the layout
    covariance: np.ndarray
    prior: Prior
    objective: float  # negative logarithm of the posterior, up to a constant
    misfits: tuple[float, ...]  # chi squared over the number of samples, one for each point

    @property
    def log_evidence(self) -> float:
        """Laplace's approximation with the hypothesis' prior, up to a constant of the data."""
        curvature = -np.linalg.slogdet(self.covariance)[1]
        log_prior = np.log(self.prior.prior_probability)
        return float(log_prior - self.objective - 0.5 * (curvature + self.prior.log_det))


class MapSearch:
    """Search for the mode under one prior."""

    def __init__(self, model: LegModel, prior: Prior) -> None:
        self._model = model
        self._prior = prior

    def best(self, starts: Sequence[np.ndarray]) -> MapFit:
        """Return the best of the modes reached from several starts."""
        return min((self.fit(start) for start in starts), key=lambda fit: fit.objective)

    def fit(self, start: np.ndarray) -> MapFit:
        """Return the mode reached from a start; weights are made again twice at the mode."""
        theta = start
        for _ in range(_REWEIGHTED):
            weights = self._weights(theta)
            theta, residuals, cost = self._descend(theta, weights)
        hessian, _ = self._normal(theta, residuals, weights)
        covariance = np.linalg.inv(hessian)
        return MapFit(
            theta=theta,
            covariance=0.5 * (covariance + covariance.T),
            prior=self._prior,
            objective=cost + weights.log_det,
            misfits=tuple(float(r @ r) / r.size for r in residuals),
        )

    def covariance_at(self, theta: np.ndarray) -> np.ndarray:
        """Return the covariance by the curvature at a vector, which need not be the mode."""
        weights = self._weights(theta)
        residuals, _ = self._cost(theta, weights)
        hessian, _ = self._normal(theta, residuals, weights)
        return np.asarray(np.linalg.inv(hessian))

    def size_of(self, fit: MapFit, additions: Sequence[np.ndarray]) -> tuple[float, float]:
        """Return the size, and its sd, of what is added to the responses of every point.

        All parameters are free to take it over: the size is that of what the model cannot explain.
        """
        weights = self._weights(fit.theta)
        residuals, _ = self._cost(fit.theta, weights)
        shared = np.zeros(fit.theta.size)
        power = product = 0.0
        for k, (addition, residual) in enumerate(zip(additions, residuals, strict=True)):
            added = weights.whitened(k, self._model.points[k].fitted(addition))
            columns, slopes = self._slopes(fit.theta, weights, k)
            shared[columns] += slopes.T @ added
            power, product = power + float(added @ added), product + float(added @ residual)
        information = power - float(shared @ fit.covariance @ shared)
        if not information > _LEAST_INFORMATION * power:
            return 0.0, np.inf
        return product / information, float(1.0 / np.sqrt(information))

    def _descend(
        self, theta: np.ndarray, weights: _Weights
    ) -> tuple[np.ndarray, list[np.ndarray], float]:
        damping = _DAMPING
        residuals, cost = self._cost(theta, weights)
        for _ in range(_ITERATIONS):
            hessian, gradient = self._normal(theta, residuals, weights)
            for _ in range(_TRIALS):
                step = self._step(hessian, gradient, damping)
                tried, tried_cost = self._cost(theta + step, weights)
                if np.isfinite(tried_cost) and tried_cost < cost:
                    break
                damping *= _MORE
            else:
                break
            decrease = cost - tried_cost
            theta, residuals, cost = theta + step, tried, tried_cost
            damping = max(damping / _LESS, _LEAST_DAMPING)
            if decrease < _SMALL_DECREASE:
                break
        return theta, residuals, cost

    def _step(self, hessian: np.ndarray, gradient: np.ndarray, damping: float) -> np.ndarray:
        damped = hessian + damping * np.diag(np.diag(hessian))
        step = cho_solve(cho_factor(damped, check_finite=False), gradient, check_finite=False)
        longest = float(np.max(np.abs(step) / (_LONGEST_STEP_SD * self._prior.sd)))
        return np.asarray(step / max(1.0, longest))

    def _cost(self, theta: np.ndarray, weights: _Weights) -> tuple[list[np.ndarray], float]:
        residuals = []
        for k in range(len(self._model.points)):
            modelled = self._modelled(theta[None], k)[0]
            residuals.append(weights.whitened(k, weights.measured[k] - modelled))
        squares = sum(float(r @ r) for r in residuals)
        return residuals, 0.5 * (squares + self._prior.misfit(theta))

    def _normal(
        self, theta: np.ndarray, residuals: Sequence[np.ndarray], weights: _Weights
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return Gauss and Newton's matrix and the direction of descent."""
        hessian, gradient = self._prior.normal(theta)
        for k, residual in enumerate(residuals):
            columns, slopes = self._slopes(theta, weights, k)
            hessian[np.ix_(columns, columns)] += slopes.T @ slopes
            gradient[columns] += slopes.T @ residual
        return hessian, gradient

    def _slopes(self, theta: np.ndarray, weights: _Weights, k: int) -> tuple[np.ndarray, ...]:
        """Return the places of a point's parameters, and its whitened derivatives by them."""
        columns = self._model.layout.columns(k)
        steps = np.clip(_DERIVATIVE_SD * self._prior.sd, 1e-5, _LONGEST_DERIVATIVE)[columns]
        moved = np.tile(theta, (columns.size + 1, 1))
        moved[np.arange(columns.size) + 1, columns] += steps
        responses = self._modelled(moved, k)
        return columns, weights.whitened(k, ((responses[1:] - responses[0]) / steps[:, None]).T)

    def _weights(self, theta: np.ndarray) -> _Weights:
        factors, measured = [], []
        for k, point in enumerate(self._model.points):
            used = point.used
            covariance = self.error_covariance(theta, k)[np.ix_(used, used)]
            factors.append(np.linalg.cholesky(covariance))
            measured.append(point.fitted(point.stacked))
        return _Weights(tuple(factors), tuple(measured))

    def _modelled(self, theta: np.ndarray, k: int) -> np.ndarray:
        return self._model.points[k].fitted(self._model.responses(theta, k))

    def error_covariance(self, theta: np.ndarray, k: int) -> np.ndarray:
        """Return the covariance of all errors of a point's average responses, by blocks."""
        point = self._model.points[k]
        stride = point.stride_covariance(self._model.impulse_responses(theta, k))
        stride = _over_blocks(point, stride)
        time_s = point.blocks(point.time_s)
        n, shapes, channels = time_s.size, len(point.shapes), len(point.channels)
        # The prediction's own error is common to all shapes.
        covariance = np.tile(stride / point.n_strides, (shapes, shapes))
        smooth = np.exp(-0.5 * ((time_s[:, None] - time_s) / _MODEL_S) ** 2)
        floors = [self._floor(c) ** 2 * 0.5 * (smooth + np.eye(n)) for c in point.channels]
        full = self._model.responses(theta[None], k)[0].reshape(shapes, channels, -1)
        modelled = point.blocks(full)
        for i, (shape, responses) in enumerate(zip(point.shapes, modelled, strict=True)):
            block = slice(i * channels * n, (i + 1) * channels * n)
            covariance[block, block] += stride / shape.n_pulses
            for c, (floor, response) in enumerate(zip(floors, responses, strict=True)):
                rows = slice(block.start + c * n, block.start + (c + 1) * n)
                size = np.maximum(np.abs(response), _LEAST_RESPONSE * np.abs(response).max())
                covariance[rows, rows] += (
                    self._model.error.share**2 * np.outer(size, size) * smooth + floor
                )
        if point.twist_sd:
            torque = np.zeros((shapes, channels, n))
            torque[:, 0] = [point.blocks(shape.torque) for shape in point.shapes]
            covariance += point.twist_sd**2 * np.outer(torque, torque)
        return np.asarray(covariance + _JITTER * np.diag(np.diag(covariance)))

    def _floor(self, channel: str) -> float:
        """Return the floor of the model's error, rad or rad/s."""
        velocity = channel in (JOINT_VELOCITY, SHANK_VELOCITY)
        return self._model.error.floor_rad * (_FLOOR_HZ if velocity else 1.0)


def _over_blocks(point: PointResponse, covariance: np.ndarray) -> np.ndarray:
    """Return the covariance of what is averaged over blocks, channel by channel."""
    for _ in range(2):
        rows = point.blocks(covariance.reshape(len(covariance), -1, point.time_s.size))
        covariance = rows.reshape(len(covariance), -1).T
    return covariance
