"""The recommended method for walking: all timing points of a participant together.

Each pulse's unperturbed motion and torque are predicted from its own past
(:mod:`~jointz.identify.prediction.unperturbed_prediction`); the average response of every
timing point is explained by a joint and a chain of instruments under several hypotheses
(:mod:`~jointz.identify.rigid.response_posterior`). Intervals cover the errors of the
prediction, of the calibration, and the differences between hypotheses.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from jointz.core.codes import Doubt, Failure
from jointz.core.gait_phases import mean_phase
from jointz.core.method_names import PREDICTED, RIGID
from jointz.identify.estimators import Estimates, ParticipantData
from jointz.identify.methods.failed_cells import failed_cell, failure_of_codes
from jointz.identify.prediction.predicted_cells import (
    CellPredictor,
    PredictedCell,
    PredictedShapes,
)
from jointz.identify.prediction.pulse_checks import has_pulses_in_strides
from jointz.identify.prediction.pulse_shapes import push_one_way
from jointz.identify.prediction.signal_checks import common_failure
from jointz.identify.preparation.assignment import Candidate, assign_pulses
from jointz.identify.preparation.calibration import pooled_calibration
from jointz.identify.preparation.instrument_checks import angle_failure, torque_failure
from jointz.identify.preparation.raw_signals import intrinsic_left_in
from jointz.identify.preparation.sources import ParticipantSettings, Source
from jointz.identify.rigid.gravity import participant_stiffness_without_gravity
from jointz.identify.rigid.response_checks import (
    DOUBTFUL_ODDS,
    fit_failure,
    instrument_failure,
    lag_odds,
    response_failure,
    shared_failure,
)
from jointz.identify.rigid.response_decision import (
    Decision,
    NaturalSize,
    decided_parameters,
    error_budget,
    error_covariance,
    instrument_shares,
    prior_effects,
)
from jointz.identify.rigid.response_linearity import Contrast, contrasts, doubted
from jointz.identify.rigid.response_model import CellResponse
from jointz.identify.rigid.response_posterior import CONSTANT_INERTIA_SD, JointPosterior
from jointz.identify.rigid.steep_change import undecided_where_steep
from jointz.identify.rigid.walking_evidence import Evidence
from jointz.identify.rigid.walking_responses import (
    LONGEST_LAG_S,
    LONGEST_WINDOW_S,
    average_responses,
    explain_responses,
    known_together,
    priors_of,
)
from jointz.identify.study_kinds import StudyKind
from jointz.results.estimates import CellEstimate, ParameterEstimate, Response
from jointz.results.participant_model import ParticipantModel


class RigidMethod:
    """Estimator of walking that explains all timing points of a participant together."""

    name = RIGID
    kinds = ("walking",)

    def baseline_for(self, kind: StudyKind) -> str:  # noqa: ARG002 - the protocol's
        """Return ``predicted``."""
        return PREDICTED

    def estimate(self, data: ParticipantData, settings: ParticipantSettings) -> Estimates:
        """Estimate every timing point, that of a lone pulse too."""
        estimator = WalkingEstimator(data.participant, data.sources, settings)
        return estimator.run(_assigned(data, settings))

    def predicted_shapes(
        self, data: ParticipantData, settings: ParticipantSettings
    ) -> list[PredictedShapes]:
        """Return the pulses of every timing point as predicted, without an estimate."""
        estimator = WalkingEstimator(data.participant, data.sources, settings)
        return estimator.predicted_shapes(_assigned(data, settings))


def _assigned(data: ParticipantData, settings: ParticipantSettings) -> list[Candidate]:
    return assign_pulses(data.participant, data.sources, settings, baseline=PREDICTED, alone=True)


class WalkingEstimator:
    """Estimates every timing point of a walking participant."""

    def __init__(
        self, participant: str, sources: Sequence[Source], settings: ParticipantSettings
    ) -> None:
        self._participant = participant
        self._sources = sources
        self._settings = settings
        self._predictor = CellPredictor(
            sources, settings, reach_s=settings.perturbations.window_s + LONGEST_LAG_S
        )
        self._by_torque = settings.perturbations.source not in ("angle", "reference")

    def run(self, candidates: Sequence[Candidate]) -> Estimates:
        """Estimate; without model and evidence if no response could be explained."""
        records, predicted, codes = self._predictor.predict_points(candidates)
        counts = {label: len(own) for label, own in codes.items()}
        estimates, model, evidence = self._estimated(list(predicted.values()), counts)
        estimated = tuple(
            estimates[label] if label in predicted else self._failed(label, own)
            for label, own in codes.items()
        )
        return Estimates(estimated, records, model=model, evidence=evidence)

    def predicted_shapes(self, candidates: Sequence[Candidate]) -> list[PredictedShapes]:
        """Return the pulses of every timing point; turned by their signs, they have one shape."""
        _, predicted, _ = self._predictor.predict_points(candidates)
        return [PredictedShapes(c, np.where(c.kept, 0, -1)) for c in predicted.values()]

    def _estimated(
        self, cells: Sequence[PredictedCell], counts: Mapping[str, int]
    ) -> tuple[dict[str, CellEstimate], ParticipantModel | None, Evidence | None]:
        """Estimate the cells, or return why they cannot be estimated; with what explains them."""
        if not cells:
            return {}, None, None
        failures = self._failures_before(cells)
        evidence, odds = self._explained(cells, failures)
        estimates: dict[str, CellEstimate] = {}
        model = None
        if evidence is not None:
            compared = contrasts(evidence.cells, evidence.responses, evidence.posterior)
            effects = prior_effects(evidence.posterior, len(evidence.cells))
            estimates = {
                cell.label: doubted(self._estimate(i, evidence, counts, effects[i]), compared)
                for i, cell in enumerate(evidence.cells)
            }
            estimates, model = _without_steep(estimates, _model(evidence, compared, odds))
        for cell in cells:
            failure = failures[cell.label]
            if failure is not None:
                used = cell.used
                estimates[cell.label] = self._without_value(
                    cell.label,
                    failure,
                    onset=mean_phase([c.record.measured_pct for c in used]),
                    counts=(len(used), counts[cell.label] - len(used)),
                )
        return estimates, model, evidence

    def _failures_before(self, cells: Sequence[PredictedCell]) -> dict[str, Failure | None]:
        """Return why cells cannot be estimated, before anything is fitted."""
        if self._settings.perturbations.window_s > LONGEST_WINDOW_S + 1e-9:
            return {cell.label: Failure.WINDOW_TOO_LONG for cell in cells}
        sources = {c.source for cell in cells for c in cell.used}
        angles = {k: angle_failure(self._sources[k].given.recording) for k in sources}
        failures = {cell.label: self._failure_before(cell, angles) for cell in cells}
        return common_failure(
            {cell.label: _named_by_shape(failures[cell.label], cell) for cell in cells}
        )

    def _failure_before(
        self, cell: PredictedCell, angles: Mapping[int, Failure | None]
    ) -> Failure | None:
        if cell.label in self._predictor.unfelt:
            return Failure.CONSTANT_ANGLE
        indices = list(dict.fromkeys(c.source for c in cell.used))
        if failure := next(filter(None, map(angles.get, indices)), None):
            return failure
        size_nm = float(np.median(self._predictor.amplitudes_nm(cell.used)))
        if has_pulses_in_strides(cell.predicted, size_nm):
            return Failure.OUT_OF_STEP
        for index in indices if self._by_torque else ():
            pulses = [c.pulse for c in cell.used if c.source == index]
            if failure := torque_failure(self._sources[index].given.recording, pulses):
                return failure
        window_s = self._settings.perturbations.window_s
        return response_failure(average_responses(cell, window_s=window_s))

    def _explained(
        self, cells: Sequence[PredictedCell], failures: dict[str, Failure | None]
    ) -> tuple[Evidence | None, float]:
        """Explain the responses; return the odds against the calibrated lag, too.

        A cell that no joint explains is added to the failures, and the others are explained
        without it.
        """
        window_s = self._settings.perturbations.window_s
        while remaining := [cell for cell in cells if failures[cell.label] is None]:
            known = known_together(
                [self._sources[c.source].given.calibration for cell in remaining for c in cell.used]
            )
            priors = priors_of(known).scaled(self._settings.prior_scale)
            posterior, responses = explain_responses(remaining, priors, window_s=window_s)
            odds = lag_odds(posterior, responses, priors, window_s=window_s)
            late = instrument_failure(posterior, priors, odds=odds, longest_s=LONGEST_LAG_S)
            if late:
                failures |= shared_failure(failures, late)
                continue
            misfits = [fit_failure(i, posterior, r) for i, r in enumerate(responses)]
            if not any(misfits):
                recordings = [self._sources[c.used[0].source].given.recording for c in remaining]
                evidence = Evidence(
                    participant=self._participant,
                    cells=tuple(remaining),
                    responses=tuple(responses),
                    posterior=posterior,
                    known=known,
                    subtract_intrinsic=tuple(map(intrinsic_left_in, recordings)),
                )
                return evidence, odds
            failures |= {c.label: failure for c, failure in zip(remaining, misfits, strict=True)}
        return None, 0.0

    def _estimate(
        self,
        i: int,
        evidence: Evidence,
        counts: Mapping[str, int],
        effects: Mapping[str, tuple[float, float]],
    ) -> CellEstimate:
        settings, posterior = self._settings, evidence.posterior
        cell, response = evidence.cells[i], evidence.responses[i]
        used = cell.used
        decision = Decision(
            known=evidence.known,
            subtract_intrinsic=evidence.subtract_intrinsic[i],
            mass_kg=settings.mass_kg,
            natural=NaturalSize.of(response),
        )
        fitted = posterior.fitted(i)
        torque = response.torque.sum(axis=0)
        residual = float(((fitted - response.angle) ** 2).sum() / (response.angle**2).sum())
        onset = mean_phase([c.record.measured_pct for c in used])
        centre = None
        if onset is not None and np.isfinite(cell.stride_s):
            middle_s = float(posterior.middle_s()[i][0]) - response.lead_s
            centre = (onset + 100.0 * middle_s / cell.stride_s) % 100.0
        parameters = decided_parameters(i, posterior, decision)
        covariance = error_covariance(i, posterior, decision)
        return CellEstimate(
            participant=self._participant,
            timing_point=cell.label,
            onset_gait_pct=onset,
            parameters=parameters,
            vaf_pct=100.0 * (1.0 - residual),
            n_used=len(used),
            n_excluded=counts[cell.label] - len(used),
            method=RIGID,
            baseline=PREDICTED,
            displacement_rad=float(np.abs(response.angle).max()),
            response=Response(
                time_s=response.samples_s - response.lead_s,
                angle=response.angle,
                torque=torque,
                fitted_torque=torque,
                fitted_angle=fitted,
            ),
            nuisance=_nuisance(posterior),
            centre_gait_pct=centre,
            gravity_corrected=self._gravity_corrected(cell, parameters[0], response, centre),
            budget=error_budget(i, posterior, decision),
            through_instruments=instrument_shares(i, posterior),
            covariance=tuple(map(tuple, covariance.tolist())),
            prior_effects=effects,
            example=self._predictor.example(cell, n=response.angle.size),
        )

    def _gravity_corrected(
        self,
        cell: PredictedCell,
        stiffness: ParameterEstimate,
        response: CellResponse,
        centre: float | None,
    ) -> ParameterEstimate | None:
        """Return the stiffness without gravity's part, if limb and posture are known."""
        used = cell.used
        # The response was turned by the signs of the pulses.
        moved_rad = float(np.mean([c.pulse.sign for c in used])) * float(response.angle.mean())
        return participant_stiffness_without_gravity(
            stiffness,
            self._settings,
            angle_rad=cell.predicted.posture_rad + moved_rad,
            gait_pct=centre,
            known=pooled_calibration([self._sources[c.source].given.calibration for c in used]),
        )

    def _failed(self, label: str, codes: Sequence[str]) -> CellEstimate:
        failure = failure_of_codes(codes)
        return self._without_value(label, failure, onset=None, counts=(0, len(codes)))

    def _without_value(
        self, label: str, failure: Failure, *, onset: float | None, counts: tuple[int, int]
    ) -> CellEstimate:
        return failed_cell(
            failure,
            self._settings,
            participant=self._participant,
            timing_point=label,
            counts=counts,
            method=RIGID,
            baseline=PREDICTED,
            onset_gait_pct=onset,
        )


def _named_by_shape(failure: Failure | None, cell: PredictedCell) -> Failure | None:
    """Return the shape of the pulses as the failure if this may be why the checks failed.

    They compare pulses by their size, and expect that a joint takes in energy all the time.
    """
    if failure not in (Failure.CONSTANT_ANGLE, Failure.OPPOSITE_SIGN):
        return failure
    torque = cell.predicted.responses[cell.kept][:, 1:].sum(axis=1)
    return failure if push_one_way(torque) else Failure.PULSE_SHAPE


def _without_steep(
    estimates: dict[str, CellEstimate], model: ParticipantModel
) -> tuple[dict[str, CellEstimate], ParticipantModel]:
    """Withhold values where K changes steeply inside the window, and add the doubt."""
    cells = undecided_where_steep(list(estimates.values()), model.curve_probability)
    if any(cell is not e for cell, e in zip(cells, estimates.values(), strict=True)):
        model = replace(model, doubts=(*model.doubts, Doubt.STEEP_CHANGE.value))
    return dict(zip(estimates, cells, strict=True)), model


def _model(evidence: Evidence, compared: Sequence[Contrast], odds: float) -> ParticipantModel:
    posterior = evidence.posterior
    lag, friction = posterior.lag_s(), posterior.friction_gain()
    doubts = [contrast.doubt for contrast in compared if contrast.significant]
    doubts += [Doubt.LAG_UNLIKELY] * (odds > DOUBTFUL_ODDS)
    return ParticipantModel(
        participant=evidence.participant,
        lag_s=lag.mean,
        lag_sd_s=float(np.sqrt(lag.variance)),
        friction_gain=friction.mean,
        friction_gain_sd=float(np.sqrt(friction.variance)),
        resonance_probability=posterior.probability(resonance=True),
        constant_inertia_probability=posterior.probability(inertia_sd=CONSTANT_INERTIA_SD),
        curve_probability=posterior.probability(follows_curve=True),
        n_strides=min(cell.predicted.n_strides for cell in evidence.cells),
        doubts=tuple(doubt.value for doubt in doubts),
    )


def _nuisance(posterior: JointPosterior) -> tuple[ParameterEstimate, ...]:
    """Return the estimates of the instruments."""
    rows = []
    estimates = {"angle_lag": posterior.lag_s(), "friction_gain": posterior.friction_gain()}
    for name, moments in estimates.items():
        reach = 1.96 * float(np.sqrt(moments.variance))
        rows.append(
            ParameterEstimate(name, moments.mean, moments.mean - reach, moments.mean + reach, "ok")
        )
    return tuple(rows)
