"""Estimates that a design lets expect of one leg: half-widths, what is decided, and motion."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from jointz.identify.preparation.cell_data import PARAMETERS
from jointz.identify.walking.coupling import Hypothesis
from jointz.identify.walking.decisions import (
    Decision,
    decided_rows,
    held_torque,
    value_and_sd,
)
from jointz.identify.walking.estimands import ESTIMANDS, LogMoments
from jointz.identify.walking.information import GROUPS, places_of
from jointz.identify.walking.leg_model import LegModel
from jointz.identify.walking.map_fit import MapSearch
from jointz.identify.walking.prior import LegPriors, Prior
from jointz.planning.laboratory import Laboratory
from jointz.planning.predicted_errors import (
    LogValues,
    Sensitivity,
    log_values,
    predicted_moments,
    reflex_bias,
    sensitivity,
)
from jointz.planning.predicted_responses import (
    Design,
    planned_points,
    with_usable_samples,
)

#: As many pulses as nobody fires: what remains is not noise.
ENDLESS = 1e7
#: Information about what is known.
_KNOWN = 1e9
#: Steps of derivatives of what is estimated, over those of the estimator, in prior sds.
_STEP_SD = 0.05
#: Half-width of a value of which the device's own part leaves nothing.
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
            priors.build(model, hypothesis) for hypothesis in _hypotheses(model, priors)
        ]
        self.theta = self.priors[0].mean if theta is None else theta
        self.model = with_usable_samples(model, self.theta)
        self._sensitivity: Sensitivity | None = None
        self._logs: LogValues | None = None
        self._information: dict[tuple[float, ...], np.ndarray] = {}

    @property
    def sensitivity(self) -> Sensitivity:
        """How the responses depend on the parameters; computed once."""
        if self._sensitivity is None:
            self._sensitivity = sensitivity(self.model, self.theta)
        return self._sensitivity

    @property
    def logs(self) -> LogValues:
        """Logarithms of all estimands with their gradient; computed once."""
        if self._logs is None:
            self._logs = log_values(self.model, self.theta, self.priors[0], _STEP_SD)
        return self._logs

    def search(self, counts: Mapping[str, float]) -> MapSearch:
        """Return the estimator's errors with numbers of pulses."""
        n_variants = len(self._design.variants)
        points = [p.with_pulses(counts[p.label] / n_variants) for p in self.model.points]
        return MapSearch(self.model.with_points(points), self.priors[0])

    def estimates(self, counts: Mapping[str, float]) -> LegEstimates:
        """Return what would be said after so many pulses at each timing point."""
        return self._estimates(self._information_of(counts))

    def if_known(self, counts: Mapping[str, float]) -> dict[str, np.ndarray]:
        """Return the half-widths (parameter, point) if a group of parameters were known."""
        information, found = self._information_of(counts), {}
        for source in GROUPS:
            known = np.zeros(self.theta.size)
            known[places_of(self.model.layout, source)] = _KNOWN
            found[source] = self._estimates(information + np.diag(known)).half_width
        return found

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


def _hypotheses(model: LegModel, priors: LegPriors) -> Sequence[Hypothesis]:
    several = bool(model.layout.sensors)
    phases = len(model.points)
    return priors.coupling.hypotheses_of(priors.spec, several_sensors=several, phases=phases)


def drawn_parameters(lab: Laboratory, design: Design, *, n: int, seed: int) -> list[np.ndarray]:
    """Return parameters of legs drawn from the priors: the hypotheses take turns."""
    drawn = []
    for number in range(n):
        model, priors = planned_model(lab, design, number), lab.leg_priors(number)
        hypotheses = _hypotheses(model, priors)
        prior = priors.build(model, hypotheses[number % len(hypotheses)])
        drawn.append(prior.draw(np.random.default_rng([seed, number])))
    return drawn
