"""Expected estimates of one leg by a design: half-widths, and which values are decided."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular

from jointz.identify.preparation.cell_data import PARAMETERS
from jointz.identify.walking.coupling import Hypothesis, ModelError
from jointz.identify.walking.decisions import Decision, decided_rows, held_torque, value_and_sd
from jointz.identify.walking.estimands import ESTIMANDS, LogMoments, log_gradient, mixed_moments
from jointz.identify.walking.information import GROUPS, places_of
from jointz.identify.walking.leg_model import REFLEX, LegModel
from jointz.identify.walking.map_fit import MapFit, MapSearch
from jointz.identify.walking.prior import LegPriors, Prior
from jointz.planning.laboratory import Laboratory
from jointz.planning.predicted_responses import Design, planned_points, with_usable_samples
from jointz.results.value_scale import ValueScale

#: Half a step of the central differences, of transformed parameters.
_STEP = 1e-4
#: The same of delays, which are in seconds.
_DELAYS, _STEP_S = ("encoder_delay_s", "gyroscope_delay_s"), 1e-6
#: Logarithm of a gain that is practically zero.
_NO_REFLEX = -20.0


def response_slopes(model: LegModel, theta: np.ndarray, point: int) -> np.ndarray:
    """Return the Jacobian of the fitted responses of a point, (used, columns)."""
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
            + float(np.log(prior.prior_probability))
        )
        means.append(values + gradient @ shift)
        covariances.append(gradient @ covariance @ gradient.T)
        prior_means.append(values + gradient @ (prior.mean - theta))
        prior_covariances.append(gradient @ prior.covariance @ gradient.T)
    weights = np.exp(np.array(evidence) - max(evidence))
    weights /= weights.sum()
    mean, covariance = mixed_moments(weights, means, covariances)
    prior_mean, spread = mixed_moments(weights, prior_means, prior_covariances)
    wider = logs.error.sd_inflation**2 * covariance
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


#: So many pulses that noise averages out: the remaining error has other causes.
ENDLESS = 1e7
#: Fisher information of parameters that are taken as known.
_KNOWN = 1e9
#: Steps of derivatives of what is estimated, over those of the estimator, in prior sds.
_STEP_SD = 0.05
#: Half-width if nothing of a value is left without the device's own part.
_NOTHING_LEFT = 1e3


@dataclass(frozen=True, slots=True, eq=False)
class LegEstimates:
    """Expected half-widths of one leg, and which values are decided."""

    half_width: np.ndarray  # (parameter, point), of the value
    decided: np.ndarray  # (parameter, point) bool
    moments: LogMoments


class PlannedLeg:
    """One leg under one design; numbers of pulses may change."""

    def __init__(
        self, lab: Laboratory, design: Design, person: int, theta: np.ndarray | None = None
    ) -> None:
        self._lab, self._design = lab, design
        model, priors = planned_model(lab, design, person), lab.leg_priors(person)
        self.priors: Sequence[Prior] = [
            priors.build(model, hypothesis) for hypothesis in usual_hypotheses(model, priors)
        ]
        self.theta = self.priors[0].mean if theta is None else theta
        self.model = with_usable_samples(model, self.theta)
        self._information: dict[tuple[float, ...], np.ndarray] = {}

    @cached_property
    def sensitivity(self) -> Sensitivity:
        """How the responses depend on the parameters."""
        return sensitivity(self.model, self.theta)

    @cached_property
    def logs(self) -> LogValues:
        """Logarithms of all estimands with their gradient."""
        return log_values(self.model, self.theta, self.priors[0], _STEP_SD)

    def search(self, counts: Mapping[str, float]) -> MapSearch:
        """Return the estimator's errors with numbers of pulses."""
        n_variants = len(self._design.variants)
        points = [p.with_pulses(counts[p.label] / n_variants) for p in self.model.points]
        return MapSearch(self.model.with_points(points), self.priors[0])

    def estimates(self, counts: Mapping[str, float]) -> LegEstimates:
        """Return the expected estimates after so many pulses at each timing point."""
        return self._estimates(self._information_of(counts))

    def if_known(self, counts: Mapping[str, float]) -> dict[str, np.ndarray]:
        """Return the half-widths (parameter, point) if a group of parameters were known."""
        information, half_widths = self._information_of(counts), {}
        for source in GROUPS:
            known = np.zeros(self.theta.size)
            known[places_of(self.model.layout, source)] = _KNOWN
            half_widths[source] = self._estimates(information + np.diag(known)).half_width
        return half_widths

    def reflex_bias(self, counts: Mapping[str, float]) -> np.ndarray:
        """Return the relative bias (parameter, point) of an estimator without a reflex."""
        return reflex_bias(self.sensitivity, self.search(counts), self.priors[0], self.logs)[
            : len(PARAMETERS) * len(self.model.points)
        ].reshape(len(PARAMETERS), -1)

    def _information_of(self, counts: Mapping[str, float]) -> np.ndarray:
        """Return the information of so many pulses; computed once."""
        key = tuple(counts[point.label] for point in self.model.points)
        if key not in self._information:
            self._information[key] = self.sensitivity.information(self.search(counts))
        return self._information[key]

    def _estimates(self, information: np.ndarray) -> LegEstimates:
        moments = predicted_moments(self.logs, self.theta, information, self.priors)
        points, decision = self.model.points, self._lab.decision
        decided = np.zeros((len(PARAMETERS), len(points)), dtype=bool)
        half = np.zeros(decided.shape)
        for k, point in enumerate(points):
            rows = decided_rows(k, moments, decision, held_torque(point, self._lab.coupling))
            decided[:, k] = [row.status == "ok" for row in rows[: len(PARAMETERS)]]
            for i, name in enumerate(ESTIMANDS[: len(PARAMETERS)]):
                half[i, k] = _half_width(name, k, moments, decision)
        return LegEstimates(half, decided, moments)


def _half_width(name: str, k: int, moments: LogMoments, decision: Decision) -> float:
    """Return the half-width of an estimate over its value, less the device's own part."""
    scale, (value, sd) = moments.scale(name), value_and_sd(name, k, moments, decision)
    if value <= 0.0:
        return _NOTHING_LEFT
    return scale.half_width(value, sd / float(scale.slope(value)))


def planned_model(lab: Laboratory, design: Design, person: int = 0) -> LegModel:
    """Return the estimator's model of a person's responses to a design."""
    return LegModel(
        planned_points(design, lab, person),
        window_s=design.window_s,
        gravity_stiffness=lab.body(person).gravity_stiffness,
        error=lab.coupling.error,
    )


def typical_leg(lab: Laboratory, design: Design) -> PlannedLeg:
    """Return the leg in the middle of the priors of the first person."""
    return PlannedLeg(lab, design, 0)


def usual_hypotheses(model: LegModel, priors: LegPriors) -> Sequence[Hypothesis]:
    """Return the hypotheses of the estimator about a planned leg."""
    return priors.coupling.hypotheses_of(
        priors.spec, several_sensors=bool(model.layout.sensors), phases=len(model.points)
    )


def drawn_parameters(lab: Laboratory, design: Design, *, n: int, seed: int) -> list[np.ndarray]:
    """Return parameters of legs drawn from the priors: the hypotheses take turns."""
    drawn = []
    for number in range(n):
        model, priors = planned_model(lab, design, number), lab.leg_priors(number)
        hypotheses = usual_hypotheses(model, priors)
        prior = priors.build(model, hypotheses[number % len(hypotheses)])
        drawn.append(prior.draw(np.random.default_rng([seed, number])))
    return drawn
