"""Prior of all parameters of a participant, under a hypothesis about the gait cycle."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logit

from jointz.core.priors import LogPrior, NormalPrior, PriorsSpec, SharePrior
from jointz.core.study import Calibrated
from jointz.identify.strapped.body import Body
from jointz.identify.strapped.leg_model import (
    LENGTH_CYCLES,
    REFLEX,
    SHANK,
    Layout,
    LegModel,
)
from jointz.identify.strapped.responses import PointResponse
from jointz.results.value_scale import LOGARITHM

#: Of a point by itself: share that does not change in the window, and time of what does, s.
_STEADY, _DRIFT_S = 0.6, 0.13
_NUGGET = 1e-4
#: Of a calibrated lag: shortest part, and sd of the logarithm by which delay and lag share it.
_SHORTEST_LAG_S, _SHARES_SD, _WIDEST_SD = 1e-4, 0.6, 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """A normal prior of the vector of parameters."""

    mean: np.ndarray
    covariance: np.ndarray
    precision: np.ndarray
    log_det: float  # of the covariance

    @property
    def sd(self) -> np.ndarray:
        """Standard deviations."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    def misfit(self, theta: np.ndarray) -> float:
        """Return the squared distance of a vector from the mean, in sds."""
        off = theta - self.mean
        return float(off @ self.precision @ off)


@dataclass(frozen=True, slots=True, eq=False)
class LegPriors:
    """Priors of a participant's leg and instruments."""

    spec: PriorsSpec
    body: Body
    # priors of shared parameters that replace those of ``spec``
    shared: Mapping[str, LogPrior | SharePrior | NormalPrior]
    lag: Calibrated | None = None  # s: calibrated total lag, delay included

    def build(self, model: LegModel, *, follows_cycle: float) -> Prior:
        """Return the prior.

        ``follows_cycle`` is the share of the variance of K, B and J that one smooth curve of the
        gait cycle has through all points; the rest is every point's own.
        """
        layout, spec, body = model.layout, self.spec, self.body
        mean, covariance = np.zeros(layout.size), np.zeros((layout.size, layout.size))
        for scale, level, over_cycle, places in (
            (model.stiffness_scale, body.stiffness, spec.stiffness_over_cycle, layout.stiffness),
            (LOGARITHM, spec.damping, spec.damping_over_cycle, layout.damping),
        ):
            at = np.concatenate([np.r_[places(k)] for k in range(layout.n_points)])
            mean[at] = scale.of(level.median)
            alike = _correlation(model.points, model.knots_s, follows_cycle)
            covariance[np.ix_(at, at)] = scale.share(level.median) ** 2 * (
                level.log_sd**2 + over_cycle.sd**2 * alike + _NUGGET * np.eye(at.size)
            )
        at = np.concatenate([np.r_[layout.inertia(k)] for k in range(layout.n_points)])
        alike = _correlation(model.points, model.knots_s, follows_cycle)
        covariance[np.ix_(at, at)] = spec.inertia_of_point.sd**2 * alike + _NUGGET * np.eye(at.size)
        for place, (centre, sd) in self._independent(layout).items():
            mean[place], covariance[place, place] = centre, sd**2
        if self.lag is not None:
            parts = [layout.shared("sensor_delay_s"), layout.shared("sensor_lag_s")]
            mean[parts], covariance[np.ix_(parts, parts)] = _calibrated_lag(self.lag)
        precision = np.linalg.inv(covariance)
        return Prior(
            mean=mean,
            covariance=covariance,
            precision=0.5 * (precision + precision.T),
            log_det=float(np.linalg.slogdet(covariance)[1]),
        )

    def _independent(self, layout: Layout) -> dict[int, tuple[float, float]]:
        spec = self.spec
        own = {
            REFLEX: (0.0, spec.reflex_of_point.sd),
            SHANK: _moments(spec.shank_share),
        }
        entries = {
            layout.own(point, which): moments
            for point in range(layout.n_points)
            for which, moments in own.items()
            if which in layout.own_of_point
        }
        for name in layout.shared_names:
            usual = self.body.inertia if name == "inertia" else getattr(spec, name)
            entries[layout.shared(name)] = _moments(self.shared.get(name, usual))
        return entries


def _calibrated_lag(lag: Calibrated) -> tuple[float, np.ndarray]:
    """Return mean and covariance of the logarithms of delay and first-order lag.

    Their sum is known to first order about equal shares; how they share it is not.
    """
    value = max(lag.value, 2.0 * _SHORTEST_LAG_S)
    total = min(np.sqrt(2.0) * max(lag.sd / value, 1e-3), _WIDEST_SD)
    common, apart = 0.5 * (total**2 + _SHARES_SD**2), 0.5 * (total**2 - _SHARES_SD**2)
    return float(np.log(0.5 * value)), np.array([[common, apart], [apart, common]])


def _moments(prior: LogPrior | SharePrior | NormalPrior) -> tuple[float, float]:
    """Return mean and sd of the transformed quantity."""
    if isinstance(prior, LogPrior):
        return float(np.log(prior.median)), prior.log_sd
    if isinstance(prior, SharePrior):
        return float(logit(prior.median)), prior.logit_sd
    return prior.mean, prior.sd


def _correlation(
    points: Sequence[PointResponse], knots_s: np.ndarray, follows_cycle: float
) -> np.ndarray:
    """Return the correlation of K, B or J between all knots of all points."""
    n = len(points)
    apart = (knots_s[:, None] - knots_s) / _DRIFT_S
    own = np.kron(np.eye(n), _STEADY + (1.0 - _STEADY) * np.exp(-0.5 * apart**2))
    if follows_cycle == 0.0:
        return own
    phase = np.concatenate([p.phase + knots_s / p.stride_s for p in points])
    turn = np.sin(np.pi * (phase[:, None] - phase)) ** 2
    curve = np.exp(-2.0 * turn / (2.0 * np.pi * LENGTH_CYCLES) ** 2)
    return np.asarray(follows_cycle * curve + (1.0 - follows_cycle) * own)
