"""The recommended method for walking: all timing points of a participant together.

Each pulse's unperturbed motion and torque are predicted from its own past
(:mod:`~jointz.identify.recommended.unperturbed_prediction`); the average response of every
timing point is explained by a joint and a chain of instruments under several hypotheses
(:mod:`~jointz.identify.recommended.response_posterior`). Intervals cover the errors of the
prediction, of the calibration, and the differences between hypotheses.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from jointz.core.codes import Doubt, Exclusion, Failure
from jointz.core.events import PulseRecord
from jointz.core.gait_phases import mean_phase
from jointz.identify.estimators import Estimates, ParticipantData
from jointz.identify.methods.failed_cells import failed_cell, failure_of_codes
from jointz.identify.preparation.assignment import Candidate, assign_pulses
from jointz.identify.preparation.calibration import pooled_calibration
from jointz.identify.preparation.cell_data import calibration_sd, dead_signals
from jointz.identify.preparation.raw_signals import common_rate_hz, intrinsic_left_in, raw_signals
from jointz.identify.preparation.sources import ParticipantSettings, Source, most_alike
from jointz.identify.recommended.gravity import (
    corrected_stiffness,
    gravity_stiffness,
    hanging_masses,
)
from jointz.identify.recommended.pulse_checks import copied_pulses, lame_pulses, stray_pulses
from jointz.identify.recommended.response_checks import (
    DOUBTFUL_ODDS,
    angle_failure,
    common_failure,
    fit_failure,
    instrument_failure,
    lag_odds,
    response_failure,
    shared_failure,
    torque_failure,
)
from jointz.identify.recommended.response_decision import (
    Decision,
    NaturalSize,
    decided_parameters,
    error_budget,
    error_covariance,
    instrument_shares,
    prior_effects,
)
from jointz.identify.recommended.response_linearity import Contrast, contrasts, doubted
from jointz.identify.recommended.response_model import CellResponse
from jointz.identify.recommended.response_posterior import CONSTANT_INERTIA_SD, JointPosterior
from jointz.identify.recommended.steep_change import undecided_where_steep
from jointz.identify.recommended.unperturbed_prediction import (
    FEWEST_STRIDES,
    Predicted,
    UnperturbedPredictor,
    join_predictions,
    quiet_strides,
)
from jointz.identify.recommended.walking_evidence import Evidence
from jointz.identify.recommended.walking_responses import (
    LONGEST_LAG_S,
    LONGEST_WINDOW_S,
    PredictedCell,
    alike,
    average_responses,
    explain_responses,
    known_together,
    priors_of,
)
from jointz.identify.study_kinds import StudyKind
from jointz.results.estimates import CellEstimate, ParameterEstimate, Response
from jointz.results.participant_model import ParticipantModel

METHOD = "recommended"
BASELINE = "predicted"
#: If more than this share of the pulses did not reach the joint, the others did not in full.
_MOST_UNFELT = 0.3


class RecommendedMethod:
    """Estimator of walking that explains all timing points of a participant together."""

    name = METHOD
    kinds = ("walking",)

    def baseline_for(self, kind: StudyKind) -> str:  # noqa: ARG002 - the protocol's
        """Return ``predicted``."""
        return BASELINE

    def estimate(self, data: ParticipantData, settings: ParticipantSettings) -> Estimates:
        """Estimate every timing point, that of a lone pulse too."""
        estimator = WalkingEstimator(data.participant, data.sources, settings)
        pulses = assign_pulses(
            data.participant, data.sources, settings, baseline=BASELINE, alone=True
        )
        cells, records = estimator.run(pulses)
        return Estimates(cells, records, model=estimator.model, evidence=estimator.evidence)


class WalkingEstimator:
    """Estimates every timing point of a walking participant.

    After a run, ``model`` describes the estimated joint and sensor, and ``evidence`` the
    responses and what explains them; both are None if no response could be explained.
    """

    baseline = BASELINE

    def __init__(
        self, participant: str, sources: Sequence[Source], settings: ParticipantSettings
    ) -> None:
        self._participant = participant
        self._sources = sources
        self._settings = settings
        self._predictors: dict[int, UnperturbedPredictor] = {}
        self._unfelt: set[str] = set()  # timing points whose pulses did not reach the joint
        self._by_torque = settings.perturbations.source not in ("angle", "reference")
        self.model: ParticipantModel | None = None
        self.evidence: Evidence | None = None

    def run(
        self, candidates: Sequence[Candidate]
    ) -> tuple[tuple[CellEstimate, ...], list[PulseRecord]]:
        """Return the cells and the pulses with their final codes."""
        records = [c.record for c in candidates]
        points = self._settings.timing_points
        labels = {r.timing_point for r in records if r.timing_point}
        cells: dict[str, PredictedCell | CellEstimate] = {}
        counts: dict[str, int] = {}
        # Timing points in the order of the cycle, then groups by name.
        for label in sorted(labels, key=lambda label: (points.get(label, 100.0), label)):
            indices = [k for k, r in enumerate(records) if r.timing_point == label]
            cells[label], codes = self._prepared(label, [candidates[k] for k in indices])
            counts[label] = len(indices)
            for k, code in zip(indices, codes, strict=True):
                records[k] = replace(records[k], code=code)
        predicted = [cell for cell in cells.values() if isinstance(cell, PredictedCell)]
        estimates = self._estimated(predicted, counts) if predicted else {}
        return tuple(
            cell if isinstance(cell, CellEstimate) else estimates[label]
            for label, cell in cells.items()
        ), records

    def _prepared(
        self, label: str, candidates: Sequence[Candidate]
    ) -> tuple[PredictedCell | CellEstimate, list[str]]:
        """Predict the pulses of a timing point; without any, return a failed estimate."""
        codes = [c.record.code for c in candidates]
        parts: list[tuple[list[int], Predicted]] = []
        for index in dict.fromkeys(c.source for c in candidates):
            usable = [k for k, c in enumerate(candidates) if c.source == index and not codes[k]]
            usable = self._alive(index, usable, candidates, codes)
            if not usable:
                continue
            part = self._predictor(index).predict([candidates[k] for k in usable])
            for k, code in zip(usable, part.codes, strict=True):
                codes[k] = code
            parts.append((usable, part))
        if not any(len(part.responses) for _, part in parts):
            return self._failed(label, codes), codes
        order = [k for usable, _ in parts for k in usable]
        ordered = [candidates[k] for k in order]
        joined = join_predictions([part for _, part in parts])
        predicted = [k for k, code in zip(order, joined.codes, strict=True) if not code]
        lame = lame_pulses(joined, self._amplitudes_nm([candidates[k] for k in predicted]))
        if lame.count(Exclusion.NO_RESPONSE.value) > _MOST_UNFELT * len(lame):
            self._unfelt.add(label)
        kept = alike(joined, whole=np.array([not code for code in lame], dtype=bool))
        for k, code, keep in zip(predicted, lame, kept, strict=True):
            codes[k] = code or ("" if keep else Exclusion.UNUSUAL_RESPONSE.value)
        if not kept.any():
            return self._failed(label, codes), codes
        strides = self._sources[ordered[0].source].strides
        phase = mean_phase([c.predicted_pct for c in ordered])
        cell = PredictedCell(
            label=label,
            candidates=ordered,
            predicted=joined,
            kept=kept,
            period_s=1.0 / self._predictor(ordered[0].source).rate_hz,
            phase=np.nan if phase is None else phase / 100.0,
            stride_s=float(np.median(strides.duration_s)) if strides is not None else np.nan,
        )
        return cell, codes

    def _alive(
        self, index: int, usable: list[int], candidates: Sequence[Candidate], codes: list[str]
    ) -> list[int]:
        """Code pulses with a constant signal, and copies; return the others."""
        if not usable:
            return usable
        pulses = [candidates[k].pulse for k in usable]
        source, window_s = self._sources[index], self._settings.perturbations.window_s
        windows, _ = source.signals.cut(
            np.array([p.onset_s for p in pulses]), before_s=0.0, after_s=window_s
        )
        copies = copied_pulses(source.given.recording, pulses, window_s=window_s)
        for k, dead, copy in zip(usable, dead_signals(windows), copies, strict=True):
            codes[k] = dead or (Exclusion.COPIED_PULSE.value if copy else "")
        return [k for k in usable if not codes[k]]

    def _amplitudes_nm(self, candidates: Sequence[Candidate]) -> np.ndarray:
        """Return the commanded amplitudes, N*m; NaN if pulses are read off a motion."""
        if not self._by_torque:
            return np.full(len(candidates), np.nan)
        return np.array([abs(c.pulse.amplitude) for c in candidates])

    def _predictor(self, index: int) -> UnperturbedPredictor:
        if index not in self._predictors:
            source, rate = self._sources[index], common_rate_hz(self._sources)
            self._predictors[index] = UnperturbedPredictor(
                source,
                raw_signals(source, target_hz=rate),
                window_s=self._settings.perturbations.window_s + LONGEST_LAG_S,
                others=[(s, raw_signals(s, target_hz=rate)) for s in self._teachers(source)],
            )
        return self._predictors[index]

    def _teachers(self, source: Source) -> list[Source]:
        """Return what else to learn from if a recording has too few quiet strides."""
        if quiet_strides(source).size >= FEWEST_STRIDES:
            return []
        unperturbed = [s for s in self._sources if s.given.condition == "unperturbed"]
        keys = self._settings.kind.reference_keys
        nearest = most_alike(source.given, [s.given for s in unperturbed], keys=keys)
        return [s for s in unperturbed if any(s.given is given for given in nearest)]

    def _estimated(
        self, cells: Sequence[PredictedCell], counts: Mapping[str, int]
    ) -> dict[str, CellEstimate]:
        """Estimate the cells, or return why they cannot be estimated."""
        failures = self._failures_before(cells)
        evidence, odds = self._explained(cells, failures)
        estimates: dict[str, CellEstimate] = {}
        if evidence is not None:
            compared = contrasts(evidence.cells, evidence.responses, evidence.posterior)
            effects = prior_effects(evidence.posterior, len(evidence.cells))
            estimates = {
                cell.label: doubted(self._estimate(i, evidence, counts, effects[i]), compared)
                for i, cell in enumerate(evidence.cells)
            }
            self.model = _model(evidence, compared, odds)
            self.evidence = evidence
        estimates = self._without_steep(estimates)
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
        return estimates

    def _failures_before(self, cells: Sequence[PredictedCell]) -> dict[str, Failure | None]:
        """Return why cells cannot be estimated, before anything is fitted."""
        if self._settings.perturbations.window_s > LONGEST_WINDOW_S + 1e-9:
            return {cell.label: Failure.WINDOW_TOO_LONG for cell in cells}
        sources = {c.source for cell in cells for c in cell.used}
        angles = {k: angle_failure(self._sources[k].given.recording) for k in sources}
        return common_failure({cell.label: self._failure_before(cell, angles) for cell in cells})

    def _failure_before(
        self, cell: PredictedCell, angles: Mapping[int, Failure | None]
    ) -> Failure | None:
        if cell.label in self._unfelt:
            return Failure.CONSTANT_ANGLE
        indices = list(dict.fromkeys(c.source for c in cell.used))
        if failure := next(filter(None, map(angles.get, indices)), None):
            return failure
        size_nm = float(np.median(self._amplitudes_nm(cell.used)))
        if stray_pulses(cell.predicted, size_nm):
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
                    window_s=window_s,
                )
                return evidence, odds
            failures |= {c.label: failure for c, failure in zip(remaining, misfits, strict=True)}
        return None, 0.0

    def _without_steep(self, estimates: dict[str, CellEstimate]) -> dict[str, CellEstimate]:
        """Withhold values where K changes steeply inside the window, and add the doubt."""
        if self.model is None:
            return estimates
        cells = undecided_where_steep(list(estimates.values()), self.model.curve_probability)
        if any(cell is not e for cell, e in zip(cells, estimates.values(), strict=True)):
            doubts = (*self.model.doubts, Doubt.STEEP_CHANGE.value)
            self.model = replace(self.model, doubts=doubts)
        return dict(zip(estimates, cells, strict=True))

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
            method=METHOD,
            baseline=BASELINE,
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
        )

    def _gravity_corrected(
        self,
        cell: PredictedCell,
        stiffness: ParameterEstimate,
        response: CellResponse,
        centre: float | None,
    ) -> ParameterEstimate | None:
        """Return the stiffness without gravity's part, if limb and posture are known."""
        settings, used = self._settings, cell.used
        if settings.person is None or centre is None or stiffness.value is None:
            return None
        # The response was turned by the signs of the pulses.
        moved_rad = float(np.mean([c.pulse.sign for c in used])) * float(response.angle.mean())
        known = pooled_calibration([self._sources[c.source].given.calibration for c in used])
        gravity = gravity_stiffness(
            hanging_masses(settings.joint, settings.person, settings.device),
            joint=settings.joint,
            angle_rad=cell.predicted.posture_rad + moved_rad,
            gait_pct=centre,
            positive=settings.positive,
            angle_sd_rad=calibration_sd(known.angle_zero_rad),
        )
        return None if gravity is None else corrected_stiffness(stiffness, gravity)

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
            method=METHOD,
            baseline=BASELINE,
            onset_gait_pct=onset,
        )


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
