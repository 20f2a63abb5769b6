"""The recommended way in walking: all timing points of a participant at once, with their doubts.

Each pulse's unperturbed motion and torque are predicted from its own past
(:mod:`jointz.identify.unperturbed_prediction`); the average response of every timing point is
explained by a joint and a chain of instruments under several hypotheses
(:mod:`jointz.identify.response_posterior`); what the prediction misses at virtual pulses, what
the calibration leaves open and what the hypotheses disagree about make the intervals.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from jointz.core.codes import Exclusion, Failure
from jointz.core.estimates import CellEstimate, ParameterEstimate, Response
from jointz.core.events import PulseEstimate, PulseRecord
from jointz.core.participant_model import ParticipantModel
from jointz.core.study import CalibrationSpec
from jointz.identify.assignment import Candidate
from jointz.identify.calibration import pooled_calibration
from jointz.identify.cell_data import dead_signals
from jointz.identify.cell_estimator import mean_phase
from jointz.identify.cells import failed_parameters
from jointz.identify.gravity import corrected_stiffness, gravity_stiffness, hanging_masses
from jointz.identify.raw_signals import raw_signals, takes_out_intrinsic
from jointz.identify.response_decision import (
    Decision,
    NaturalSize,
    decided_parameters,
    error_budget,
)
from jointz.identify.response_model import CellResponse
from jointz.identify.response_posterior import (
    CONSTANT_INERTIA_SD,
    JointPosterior,
)
from jointz.identify.sources import ParticipantSettings, Source
from jointz.identify.unperturbed_prediction import Predicted, UnperturbedPredictor
from jointz.identify.walking_responses import (
    LONGEST_LAG_S,
    PredictedCell,
    alike,
    explain_responses,
    priors_of,
)

METHOD = "recommended"
BASELINE = "predicted"


class WalkingEstimator:
    """Estimates every timing point of a walking participant.

    Parameters
    ----------
    participant : str
        The id.
    sources : sequence of Source
        The participant's recordings, made ready.
    settings : ParticipantSettings
        What the study and the caller ask for.
    """

    def __init__(
        self, participant: str, sources: Sequence[Source], settings: ParticipantSettings
    ) -> None:
        self._participant = participant
        self._sources = sources
        self._settings = settings
        self._predictors: dict[int, UnperturbedPredictor] = {}
        self._model: ParticipantModel | None = None

    @property
    def model(self) -> ParticipantModel | None:
        """What was found about joint and sensor by the last run."""
        return self._model

    @property
    def baseline(self) -> str:
        """What is subtracted."""
        return BASELINE

    @property
    def single(self) -> tuple[PulseEstimate, ...]:
        """Pulses estimated each by itself: none in walking."""
        return ()

    def run(
        self, candidates: Sequence[Candidate]
    ) -> tuple[tuple[CellEstimate, ...], list[PulseRecord]]:
        """Return the cells and the pulses with their final codes.

        Parameters
        ----------
        candidates : sequence of Candidate
            Every pulse of the participant's perturbed recordings.
        """
        records = [c.record for c in candidates]
        found: dict[str, PredictedCell | CellEstimate] = {}
        for label in dict.fromkeys(r.timing_point for r in records if r.timing_point):
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
        joined = _joined([part for _, part in parts])
        kept = alike(joined)
        fine = [k for k, code in zip(order, joined.codes, strict=True) if not code]
        for k, keep in zip(fine, kept, strict=True):
            codes[k] = "" if keep else Exclusion.UNUSUAL_RESPONSE.value
        chosen = [candidates[k] for k in order]
        source = self._sources[chosen[0].source]
        strides = source.strides
        cell = PredictedCell(
            label=label,
            candidates=chosen,
            predicted=joined,
            kept=kept,
            period_s=1.0 / self._predictor(chosen[0].source).rate_hz,
            phase=(mean_phase([c.record.measured_pct for c in chosen]) or np.nan) / 100.0,
            stride_s=float(np.median(strides.duration_s)) if strides is not None else np.nan,
            posture_rad=joined.posture_rad,
        )
        return cell, codes

    def _alive(
        self, index: int, mine: list[int], candidates: Sequence[Candidate], codes: list[str]
    ) -> list[int]:
        """Code pulses whose sensors stand still; return the others."""
        if not mine:
            return mine
        onsets = np.array([candidates[k].pulse.onset_s for k in mine])
        windows, _ = self._sources[index].signals.cut(
            onsets, before_s=0.0, after_s=self._settings.perturbations.window_s
        )
        for k, dead in zip(mine, dead_signals(windows), strict=True):
            codes[k] = dead
        return [k for k in mine if not codes[k]]

    def _predictor(self, index: int) -> UnperturbedPredictor:
        if index not in self._predictors:
            source = self._sources[index]
            window_s = self._settings.perturbations.window_s + LONGEST_LAG_S
            self._predictors[index] = UnperturbedPredictor(
                source, raw_signals(source), window_s=window_s
            )
        return self._predictors[index]

    def _estimated(
        self, cells: Sequence[PredictedCell], counts: Mapping[str, int]
    ) -> dict[str, CellEstimate]:
        window_s = self._settings.perturbations.window_s
        known = pooled_calibration(
            [self._sources[c.source].given.calibration for cell in cells for c in cell.used]
        )
        priors = priors_of(known).scaled(self._settings.prior_scale)
        posterior, responses = explain_responses(cells, priors, window_s=window_s)
        self._model = _model(self._participant, posterior, cells)
        return {
            cell.label: self._estimate(i, cell, responses[i], posterior, known, counts)
            for i, cell in enumerate(cells)
        }

    def _estimate(
        self,
        i: int,
        cell: PredictedCell,
        response: CellResponse,
        posterior: JointPosterior,
        known: CalibrationSpec,
        counts: Mapping[str, int],
    ) -> CellEstimate:
        settings, used = self._settings, cell.used
        subtract = not takes_out_intrinsic(self._sources[used[0].source].given.recording)
        decision = Decision(
            known=known,
            subtract_intrinsic=subtract,
            mass_kg=settings.mass_kg,
            natural=NaturalSize.of(response),
        )
        fitted = posterior.fitted(i)
        total = response.torque.sum(axis=0)
        off = float(((fitted - response.angle) ** 2).sum() / (response.angle**2).sum())
        onset = mean_phase([c.record.measured_pct for c in used])
        centre = _centre(onset, float(posterior.middle_s()[i][0]), cell.stride_s)
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
                time_s=response.samples_s,
                angle=response.angle,
                torque=total,
                fitted_torque=total,
                fitted_angle=fitted,
            ),
            nuisance=_nuisance(posterior),
            centre_gait_pct=centre,
            gravity_corrected=self._gravity_corrected(cell, parameters[0], response, centre),
            budget=error_budget(i, posterior, decision),
        )

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
            angle_rad=cell.posture_rad + float(response.angle.mean()),
            gait_pct=centre,
            positive=settings.positive,
        )
        return None if gravity is None else corrected_stiffness(stiffness, gravity)

    def _failed(self, label: str, codes: Sequence[str]) -> CellEstimate:
        return CellEstimate(
            participant=self._participant,
            timing_point=label,
            onset_gait_pct=None,
            parameters=failed_parameters(
                _why(codes), mass_kg=self._settings.mass_kg, wants_per_mass=True
            ),
            vaf_pct=None,
            n_used=0,
            n_excluded=len(codes),
            method=METHOD,
            baseline=BASELINE,
        )


def _joined(parts: Sequence[Predicted]) -> Predicted:
    """Put the pulses of several recordings together; strides of different ones stay apart."""
    first = np.cumsum([0, *(int(part.strides.max(initial=-1)) + 1 for part in parts)])
    return Predicted(
        responses=np.concatenate([part.responses for part in parts]),
        misses=np.concatenate([part.misses for part in parts]),
        strides=np.concatenate(
            [part.strides + start for part, start in zip(parts, first, strict=False)]
        ),
        codes=tuple(code for part in parts for code in part.codes),
        posture_rad=float(np.mean([part.posture_rad for part in parts])),
    )


def _centre(onset_pct: float | None, middle_s: float, stride_s: float) -> float | None:
    """Return a moment of the window in % of the cycle."""
    if onset_pct is None or not np.isfinite(stride_s):
        return None
    return (onset_pct + 100.0 * middle_s / stride_s) % 100.0


def _model(
    participant: str, posterior: JointPosterior, cells: Sequence[PredictedCell]
) -> ParticipantModel:
    lag, friction = posterior.lag_s(), posterior.friction_gain()
    return ParticipantModel(
        participant=participant,
        lag_s=lag.mean,
        lag_sd_s=float(np.sqrt(lag.variance)),
        friction_gain=friction.mean,
        friction_gain_sd=float(np.sqrt(friction.variance)),
        resonance_probability=posterior.probability(resonance=True),
        constant_inertia_probability=posterior.probability(inertia_sd=CONSTANT_INERTIA_SD),
        curve_probability=posterior.probability(follows_curve=True),
        n_strides=min(cell.predicted.n_strides for cell in cells),
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


def _why(codes: Sequence[str]) -> Failure:
    kinds = set(codes)
    if Exclusion.NO_BASELINE.value in kinds:
        return Failure.NO_UNPERTURBED_STRIDES
    for dead in (Failure.CONSTANT_ANGLE, Failure.CONSTANT_TORQUE):
        if dead.value in kinds:
            return dead
    if kinds == {Exclusion.NO_HEEL_STRIKES.value}:
        return Failure.NO_HEEL_STRIKES
    return Failure.ALL_PULSES_EXCLUDED
