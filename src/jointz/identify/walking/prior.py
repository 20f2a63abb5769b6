"""Prior of all parameters of a participant under a hypothesis."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import expit, logit

from jointz.core.priors import AnyPrior, LogPrior, NormalPrior, PriorsSpec, SharePrior, spread_of
from jointz.core.study import Calibrated
from jointz.identify.walking.body import Body
from jointz.identify.walking.coupling import STRAP, Coupling, Hypothesis
from jointz.identify.walking.leg_model import (
    ADDED,
    ADDED_SOFTENING,
    LENGTH_CYCLES,
    REFLEX,
    SHANK,
    Layout,
    LegModel,
)
from jointz.identify.walking.responses import PointResponse
from jointz.results.value_scale import LOGARITHM

#: Correlation time of the drift of a point by itself, s.
_DRIFT_S = 0.13
_NUGGET = 1e-4
#: Parts of the goniometer's lag. Their sum is what a calibration states.
LAG_PARTS = ("sensor_delay_s", "sensor_lag_s")
#: Sd of the error of the model in that sum: in simulated legs without errors the responses alone
#: put it 0.4 to 1.0 ms too early, as tissue that leads the skin does.
LAG_MODEL_S = 0.001
#: Sd of log K and B of a person from one session to another, of the level and again of each timing
#: point: the stiffness of knee muscles by free oscillation under one load had a coefficient of
#: variation of 4 to 7 % between days (J Electromyogr Kinesiol 21, 492, 2011).
_SESSION_SD = 0.05
#: A band is linear, but what the fit takes for softening is partly that of strap, tissue and
#: friction, which act on it, too: of six simulated legs three showed softening, two none.
_ADDED_SOFTENING = SharePrior(median=0.5, logit_sd=1.5)
#: Of the size of a known addition, in the units of the model: wider than any addition.
_ANY_ADDITION = NormalPrior(mean=0.0, sd=10.0)
_OF_ADDITION: Mapping[str, AnyPrior] = {
    **dict.fromkeys(ADDED, _ANY_ADDITION),
    ADDED_SOFTENING: _ADDED_SOFTENING,
}
_SHORTEST_LAG_S, _LEAST_PART_S = 1e-4, 1.5e-4


@dataclass(frozen=True, slots=True, eq=False)
class LagObservation:
    """A calibrated lag: an observation of delay and first-order lag together."""

    places: list[int]  # of the logarithms of both
    value: float  # s
    sd: float  # s, error of the model included

    def residual(self, theta: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the distance of the observed lag from that of a vector, in sds, and its slope."""
        parts = np.exp(theta[self.places])
        slope = np.zeros(theta.size)
        slope[self.places] = parts / self.sd
        return float(self.value - parts.sum()) / self.sd, slope


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """A normal prior of the vector of parameters."""

    mean: np.ndarray
    covariance: np.ndarray
    precision: np.ndarray
    log_det: float  # of the covariance
    lag: LagObservation | None = None
    prior_probability: float = 1.0  # prior probability of the hypothesis over that of the others

    @property
    def sd(self) -> np.ndarray:
        """Standard deviations."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    def misfit(self, theta: np.ndarray) -> float:
        """Return the squared distance of a vector from mean and observed lag, in sds."""
        off = theta - self.mean
        squares = float(off @ self.precision @ off)
        return squares if self.lag is None else squares + self.lag.residual(theta)[0] ** 2

    def normal(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return Gauss and Newton's matrix at a vector, and the direction of descent."""
        precision, pull = self.precision, self.precision @ (self.mean - theta)
        if self.lag is None:
            return precision.copy(), pull
        residual, slope = self.lag.residual(theta)
        return precision + np.outer(slope, slope), pull + residual * slope

    def draw(self, rng: np.random.Generator) -> np.ndarray:
        """Draw a vector, whose lag is the observed one and its error."""
        root = np.linalg.cholesky(self.covariance)
        theta = np.asarray(self.mean + root @ rng.standard_normal(self.mean.size))
        if self.lag is not None:
            total = np.exp(theta[self.lag.places]).sum()
            lag = max(rng.normal(self.lag.value, self.lag.sd), _SHORTEST_LAG_S)
            theta[self.lag.places] += np.log(lag / total)
        return theta


@dataclass(frozen=True, slots=True, eq=False)
class LegPriors:
    """Priors of a participant's leg and instruments."""

    spec: PriorsSpec
    body: Body
    # priors of shared parameters that replace those of ``spec``
    shared: Mapping[str, AnyPrior]
    lag: Calibrated | None = None  # s: calibrated total lag, delay included
    coupling: Coupling = STRAP

    def build(self, model: LegModel, hypothesis: Hypothesis) -> Prior:
        """Return the prior under a hypothesis."""
        layout, spec, body = model.layout, self.spec, self.body
        mean, covariance = np.zeros(layout.size), np.zeros((layout.size, layout.size))
        alike = _correlation(model.points, model.knots_s, hypothesis)
        partners = [k if part is None else part.partner for k, part in enumerate(model.added)]
        knots = np.arange(layout.n_knots)
        of_person = np.concatenate([k * knots.size + knots for k in partners])
        alike = alike[np.ix_(of_person, of_person)]
        changed = _session_change(model)
        for scale, level, over_cycle, places in (
            (model.stiffness_scale, body.stiffness, spec.stiffness_over_cycle, layout.stiffness),
            (LOGARITHM, spec.damping, spec.damping_over_cycle, layout.damping),
        ):
            at = np.concatenate([np.r_[places(k)] for k in range(layout.n_points)])
            mean[at] = scale.of(level.median)
            covariance[np.ix_(at, at)] = scale.share(level.median) ** 2 * (
                level.log_sd**2 + over_cycle.sd**2 * alike + changed + _NUGGET * np.eye(at.size)
            )
        at = np.concatenate([np.r_[layout.inertia(k)] for k in range(layout.n_points)])
        own_sd = hypothesis.inertia_sd or spec.inertia_of_point.sd
        covariance[np.ix_(at, at)] = own_sd**2 * (alike + _NUGGET * np.eye(at.size))
        for place, (centre, sd) in self._independent(layout, hypothesis.shared).items():
            mean[place], covariance[place, place] = centre, sd**2
        observed = None
        if self.lag is not None:
            parts = [layout.shared(name) for name in LAG_PARTS]
            # Logarithms of usual parts would keep a lag of nearly zero away from it.
            mean[parts] = np.minimum(mean[parts], np.log(max(0.5 * self.lag.value, _LEAST_PART_S)))
            sd = float(np.hypot(self.lag.sd, LAG_MODEL_S))
            observed = LagObservation(parts, self.lag.value, sd)
        precision = np.linalg.inv(covariance)
        return Prior(
            mean=mean,
            covariance=covariance,
            precision=0.5 * (precision + precision.T),
            log_det=float(np.linalg.slogdet(covariance)[1]),
            lag=observed,
            prior_probability=hypothesis.prior_probability,
        )

    def _independent(
        self, layout: Layout, supposed: Mapping[str, AnyPrior]
    ) -> dict[int, tuple[float, float]]:
        spec, known = self.spec, {**self.shared, **supposed}
        of_point = {REFLEX: (0.0, spec.reflex_of_point.sd), SHANK: _moments(spec.shank_share)}
        entries = {
            layout.own(point, which): moments
            for point in range(layout.n_points)
            for which, moments in of_point.items()
            if which in layout.own_of_point
        }
        for name in layout.shared_names:
            if name not in known:
                of_body = self.body.inertia if name == "inertia" else getattr(spec, name, None)
                known[name] = of_body or _OF_ADDITION[name]
            entries[layout.shared(name)] = _moments(known[name])
        return entries


def untransformed(name: str, value: float) -> float:
    """Return a shared parameter as ``[priors]`` states it."""
    prior = getattr(STRAP.priors, name, None)
    if isinstance(prior, NormalPrior):
        return float(value)
    return float(expit(value) if isinstance(prior, SharePrior) else np.exp(value))


def _moments(prior: AnyPrior) -> tuple[float, float]:
    """Return mean and sd of the transformed quantity."""
    if isinstance(prior, NormalPrior):
        return prior.mean, prior.sd
    transformed = np.log if isinstance(prior, LogPrior) else logit
    return float(transformed(prior.median)), spread_of(prior)


def _session_change(model: LegModel) -> np.ndarray:
    """Return the covariance of log K, or B, by what a person changes with a known addition."""
    loaded = np.repeat([part is not None for part in model.added], model.knots_s.size)
    of_point = np.kron(np.eye(len(model.added)), np.ones((model.knots_s.size,) * 2))
    return np.asarray(_SESSION_SD**2 * np.outer(loaded, loaded) * (1.0 + of_point))


def _correlation(
    points: Sequence[PointResponse], knots_s: np.ndarray, hypothesis: Hypothesis
) -> np.ndarray:
    """Return the correlation of K, B or J between all knots of all points."""
    constant, follows_cycle = hypothesis.constant_share, hypothesis.follows_cycle
    apart = (knots_s[:, None] - knots_s) / _DRIFT_S
    of_point = constant + (1.0 - constant) * np.exp(-0.5 * apart**2)
    of_points = np.kron(np.eye(len(points)), of_point)
    if follows_cycle == 0.0:
        return of_points
    phase = np.concatenate([p.phase + knots_s / p.stride_s for p in points])
    turn = np.sin(np.pi * (phase[:, None] - phase)) ** 2
    curve = np.exp(-2.0 * turn / (2.0 * np.pi * LENGTH_CYCLES) ** 2)
    return np.asarray(follows_cycle * curve + (1.0 - follows_cycle) * of_points)
