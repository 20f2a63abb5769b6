"""The recommended way in walking: all timing points of a participant at once, with their doubts.

Each pulse's unperturbed motion and torque are predicted from its own past
(:mod:`~jointz.identify.recommended.unperturbed_prediction`); the average response of every
timing point is explained by a joint and a chain of instruments under several hypotheses
(:mod:`~jointz.identify.recommended.response_posterior`); what the prediction misses at virtual
pulses, what the calibration leaves open and what the hypotheses disagree about make the intervals.
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
#: Where more pulses than this share did not reach the joint, the others hardly did in full.
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
        self._unfelt: set[str] = set()
        self.model: ParticipantModel | None = None
        self.evidence: Evidence | None = None

    def run(
        self, candidates: Sequence[Candidate]
    ) -> tuple[tuple[CellEstimate, ...], list[PulseRecord]]:
        """Return the cells and the pulses with their final codes."""
        records = [c.record for c in candidates]
        found: dict[str, PredictedCell | CellEstimate] = {}
        for label in self._labels(records):
            chosen = [k for k, r in enumerate(records) if r.timing_point == label]
            cell, codes = self._prepared(label, [candidates[k] for k in chosen])
            found[label] = cell
            for k, code in zip(chosen, codes, strict=True):
                records[k] = replace(records[k], code=code)
        ready = [cell for cell in found.values() if isinstance(cell, PredictedCell)]
        counts = {label: [r.timing_point for r in records].count(label) for label in found}
        estimates = self._estimated(ready, counts) if ready else {}
        cells = [
            cell if isinstance(cell, CellEstimate) else estimates[label]
            for label, cell in found.items()
        ]
        return tuple(cells), records

    def _labels(self, records: Sequence[PulseRecord]) -> list[str]:
        """Return the timing points in the order of the cycle, then groups by name."""
        points = self._settings.timing_points
        found = {r.timing_point for r in records if r.timing_point}
        return sorted(found, key=lambda label: (points.get(label, 100.0), label))

    def _prepared(
        self, label: str, candidates: Sequence[Candidate]
    ) -> tuple[PredictedCell | CellEstimate, list[str]]:
        """Predict the pulses of a timing point; a failed estimate where none is left."""
        codes = [c.record.code for c in candidates]
        parts: list[tuple[list[int], Predicted]] = []
        for index in dict.fromkeys(c.source for c in candidates):
            mine = [k for k, c in enumerate(candidates) if c.source == index and not codes[k]]
            mine = self._alive(index, mine, candidates, codes)
            if not mine:
                continue
            part = self._predictor(index).predict([candidates[k] for k in mine])
            for k, code in zip(mine, part.codes, strict=True):
                codes[k] = code
            parts.append((mine, part))
        if not any(len(part.responses) for _, part in parts):
            return self._failed(label, codes), codes
        order = [k for mine, _ in parts for k in mine]
        chosen = [candidates[k] for k in order]
        joined = join_predictions([part for _, part in parts])
        fine = [k for k, code in zip(order, joined.codes, strict=True) if not code]
        lame = lame_pulses(joined, self._amplitudes_nm([candidates[k] for k in fine]))
        if lame.count(Exclusion.NO_RESPONSE.value) > _MOST_UNFELT * len(lame):
            self._unfelt.add(label)
        kept = alike(joined, whole=np.array([not code for code in lame], dtype=bool))
        for k, code, keep in zip(fine, lame, kept, strict=True):
            codes[k] = code or ("" if keep else Exclusion.UNUSUAL_RESPONSE.value)
        if not kept.any():
            return self._failed(label, codes), codes
        strides = self._sources[chosen[0].source].strides
        phase = mean_phase([c.predicted_pct for c in chosen])
        cell = PredictedCell(
            label=label,
            candidates=chosen,
            predicted=joined,
            kept=kept,
            period_s=1.0 / self._predictor(chosen[0].source).rate_hz,
            phase=np.nan if phase is None else phase / 100.0,
            stride_s=float(np.median(strides.duration_s)) if strides is not None else np.nan,
        )
        return cell, codes

    def _alive(
        self, index: int, mine: list[int], candidates: Sequence[Candidate], codes: list[str]
    ) -> list[int]:
        """Code pulses whose sensors stand still, and copies; return the others."""
        if not mine:
            return mine
        pulses = [candidates[k].pulse for k in mine]
        source, window_s = self._sources[index], self._settings.perturbations.window_s
        windows, _ = source.signals.cut(
            np.array([p.onset_s for p in pulses]), before_s=0.0, after_s=window_s
        )
        copies = copied_pulses(source.given.recording, pulses, window_s=window_s)
        for k, dead, copy in zip(mine, dead_signals(windows), copies, strict=True):
            codes[k] = dead or (Exclusion.COPIED_PULSE.value if copy else "")
        return [k for k in mine if not codes[k]]

    def _amplitudes_nm(self, candidates: Sequence[Candidate]) -> np.ndarray:
        """Return what was commanded, N*m; NaN where pulses are read off a motion."""
        motion = self._settings.perturbations.source in ("angle", "reference")
        return np.array([np.nan if motion else abs(c.pulse.amplitude) for c in candidates])

    def _predictor(self, index: int) -> UnperturbedPredictor:
        if index not in self._predictors:
            source = self._sources[index]
            window_s = self._settings.perturbations.window_s + LONGEST_LAG_S
            rate = common_rate_hz(self._sources)
            self._predictors[index] = UnperturbedPredictor(
                source,
                raw_signals(source, target_hz=rate),
                window_s=window_s,
                others=[(s, raw_signals(s, target_hz=rate)) for s in self._teachers(source)],
            )
        return self._predictors[index]

    def _teachers(self, source: Source) -> list[Source]:
        """Return what else to learn from where a recording has too few quiet strides."""
        if quiet_strides(source).size >= FEWEST_STRIDES:
            return []
        there = [s for s in self._sources if s.given.condition == "unperturbed"]
        alike = most_alike(source.given, [s.given for s in there], keys=("session", "side"))
        return [s for s in there if any(s.given is given for given in alike)]

    def _estimated(
        self, cells: Sequence[PredictedCell], counts: Mapping[str, int]
    ) -> dict[str, CellEstimate]:
        """Estimate the cells that can be, and say why the others cannot."""
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
            self.model = _model(evidence, _doubts(compared, odds))
            self.evidence = evidence
        estimates = self._without_steep(estimates)
        for cell in cells:
            failure = failures[cell.label]
            if failure is not None:
                estimates[cell.label] = self._refused(cell, failure, counts[cell.label])
        return estimates

    def _failures_before(self, cells: Sequence[PredictedCell]) -> dict[str, Failure | None]:
        """Return why the pulses of cells are not worth a fit."""
        if self._settings.perturbations.window_s > LONGEST_WINDOW_S + 1e-9:
            return {cell.label: Failure.WINDOW_TOO_LONG for cell in cells}
        sources = {c.source for cell in cells for c in cell.used}
        angles = {k: angle_failure(self._sources[k].given.recording) for k in sources}
        return common_failure({cell.label: self._failure_before(cell, angles) for cell in cells})

    def _explained(
        self, cells: Sequence[PredictedCell], failures: dict[str, Failure | None]
    ) -> tuple[Evidence | None, float]:
        """Explain the responses, and give the odds against the calibrated lag.

        A cell that no joint explains is entered among the failures and spoils no other.
        """
        window_s = self._settings.perturbations.window_s
        while left := [cell for cell in cells if failures[cell.label] is None]:
            known = known_together(
                [self._sources[c.source].given.calibration for cell in left for c in cell.used]
            )
            priors = priors_of(known).scaled(self._settings.prior_scale)
            posterior, responses = explain_responses(left, priors, window_s=window_s)
            odds = lag_odds(posterior, responses, priors, window_s=window_s)
            late = instrument_failure(posterior, priors, odds=odds, longest_s=LONGEST_LAG_S)
            if late:
                failures |= shared_failure(failures, late)
                continue
            found = [fit_failure(i, posterior, r) for i, r in enumerate(responses)]
            if not any(found):
                evidence = Evidence(
                    participant=self._participant,
                    cells=tuple(left),
                    responses=tuple(responses),
                    posterior=posterior,
                    known=known,
                    subtract_intrinsic=tuple(map(self._intrinsic_left_in, left)),
                    window_s=window_s,
                )
                return evidence, odds
            failures |= {cell.label: failure for cell, failure in zip(left, found, strict=True)}
        return None, 0.0

    def _without_steep(self, estimates: dict[str, CellEstimate]) -> dict[str, CellEstimate]:
        """Withhold values where K changes steeply inside the window, and say so."""
        if self.model is None:
            return estimates
        cells = undecided_where_steep(list(estimates.values()), self.model.curve_probability)
        kept = dict(zip(estimates, cells, strict=True))
        if any(kept[label] is not estimate for label, estimate in estimates.items()):
            doubts = (*self.model.doubts, Doubt.STEEP_CHANGE.value)
            self.model = replace(self.model, doubts=doubts)
        return kept

    def _failure_before(
        self, cell: PredictedCell, angles: Mapping[int, Failure | None]
    ) -> Failure | None:
        """Return why the pulses of a cell are not worth a fit."""
        if cell.label in self._unfelt:
            return Failure.CONSTANT_ANGLE
        indices = list(dict.fromkeys(c.source for c in cell.used))
        for index in indices:
            if failure := angles[index]:
                return failure
        size_nm = float(np.median(self._amplitudes_nm(cell.used)))
        if stray_pulses(cell.predicted, size_nm):
            return Failure.OUT_OF_STEP
        torque = self._settings.perturbations.source not in ("angle", "reference")
        for index in indices if torque else ():
            pulses = [c.pulse for c in cell.used if c.source == index]
            if failure := torque_failure(self._sources[index].given.recording, pulses):
                return failure
        window_s = self._settings.perturbations.window_s
        return response_failure(average_responses(cell, window_s=window_s))

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
        total = response.torque.sum(axis=0)
        off = float(((fitted - response.angle) ** 2).sum() / (response.angle**2).sum())
        onset = mean_phase([c.record.measured_pct for c in used])
        middle_s = float(posterior.middle_s()[i][0]) - response.lead_s
        centre = _centre(onset, middle_s, cell.stride_s)
        parameters = decided_parameters(i, posterior, decision)
        return CellEstimate(
            participant=self._participant,
            timing_point=cell.label,
            onset_gait_pct=onset,
            parameters=parameters,
            vaf_pct=100.0 * (1.0 - off),
            n_used=len(used),
            n_excluded=counts[cell.label] - len(used),
            method=METHOD,
            baseline=BASELINE,
            displacement_rad=float(np.abs(response.angle).max()),
            response=Response(
                time_s=response.samples_s - response.lead_s,
                angle=response.angle,
                torque=total,
                fitted_torque=total,
                fitted_angle=fitted,
            ),
            nuisance=_nuisance(posterior),
            centre_gait_pct=centre,
            gravity_corrected=self._gravity_corrected(cell, parameters[0], response, centre),
            budget=error_budget(i, posterior, decision),
            through_instruments=instrument_shares(i, posterior),
            covariance=_plain(error_covariance(i, posterior, decision)),
            prior_effects=effects,
        )

    def _intrinsic_left_in(self, cell: PredictedCell) -> tuple[str, ...]:
        """Return which of the device's own K, B and J are still in the torque of a cell."""
        recording = self._sources[cell.used[0].source].given.recording
        return intrinsic_left_in(recording)

    def _gravity_corrected(
        self,
        cell: PredictedCell,
        stiffness: ParameterEstimate,
        response: CellResponse,
        centre: float | None,
    ) -> ParameterEstimate | None:
        """Return the stiffness without gravity's part, where limb and posture are known."""
        settings = self._settings
        if settings.person is None or centre is None or stiffness.value is None:
            return None
        masses = hanging_masses(settings.joint, settings.person, settings.device)
        gravity = gravity_stiffness(
            masses,
            joint=settings.joint,
            angle_rad=cell.predicted.posture_rad + _moved_rad(cell, response),
            gait_pct=centre,
            positive=settings.positive,
            angle_sd_rad=self._zero_sd(cell),
        )
        return None if gravity is None else corrected_stiffness(stiffness, gravity)

    def _zero_sd(self, cell: PredictedCell) -> float:
        """Return the sd of the zero of the angle, rad; that of the posture knows no other."""
        known = pooled_calibration([self._sources[c.source].given.calibration for c in cell.used])
        return calibration_sd(known.angle_zero_rad)

    def _failed(self, label: str, codes: Sequence[str]) -> CellEstimate:
        failure = failure_of_codes(codes)
        return self._without_value(label, failure, onset=None, counts=(0, len(codes)))

    def _refused(self, cell: PredictedCell, failure: Failure, n_pulses: int) -> CellEstimate:
        used = cell.used
        onset = mean_phase([c.record.measured_pct for c in used])
        counts = (len(used), n_pulses - len(used))
        return self._without_value(cell.label, failure, onset=onset, counts=counts)

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


def _moved_rad(cell: PredictedCell, response: CellResponse) -> float:
    """Return the mean motion by the pulses, rad: the response was turned by their signs."""
    sign = float(np.mean([c.pulse.sign for c in cell.used]))
    return sign * float(response.angle.mean())


def _plain(matrix: np.ndarray) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in matrix.tolist())


def _centre(onset_pct: float | None, middle_s: float, stride_s: float) -> float | None:
    """Return a moment of the window in % of the cycle."""
    if onset_pct is None or not np.isfinite(stride_s):
        return None
    return (onset_pct + 100.0 * middle_s / stride_s) % 100.0


def _doubts(compared: Sequence[Contrast], odds: float) -> tuple[str, ...]:
    found = [contrast.doubt for contrast in compared if contrast.stands]
    return tuple(d.value for d in [*found, *[Doubt.LAG_UNLIKELY] * (odds > DOUBTFUL_ODDS)])


def _model(evidence: Evidence, doubts: tuple[str, ...]) -> ParticipantModel:
    posterior = evidence.posterior
    lag, friction = posterior.lag_s(), posterior.friction_gain()
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
        doubts=doubts,
    )


def _nuisance(posterior: JointPosterior) -> tuple[ParameterEstimate, ...]:
    """Return what had to be estimated of the instruments beside the impedance."""
    rows = []
    for name, moments in (
        ("angle_lag", posterior.lag_s()),
        ("friction_gain", posterior.friction_gain()),
    ):
        reach = 1.96 * float(np.sqrt(moments.variance))
        rows.append(
            ParameterEstimate(name, moments.mean, moments.mean - reach, moments.mean + reach, "ok")
        )
    return tuple(rows)
