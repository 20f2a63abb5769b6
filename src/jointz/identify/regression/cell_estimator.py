"""Estimators that fit every cell of a participant by itself: windows, baselines, fits, failures."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from jointz.core.codes import Exclusion, Failure
from jointz.core.errors import EstimationError
from jointz.core.events import PulseEstimate, PulseRecord
from jointz.core.gait_phases import mean_phase
from jointz.identify.bench.bench_estimates import pulse_estimates
from jointz.identify.estimators import Estimates, ParticipantData
from jointz.identify.prediction.predicted_cells import example_place
from jointz.identify.preparation.assignment import Candidate, assign_pulses
from jointz.identify.preparation.baselines import Baseline
from jointz.identify.preparation.calibration import pooled_calibration
from jointz.identify.preparation.cell_data import CellData, Fit, FitSettings, Windows, dead_signals
from jointz.identify.preparation.conditioning import ANGLE, TORQUE
from jointz.identify.preparation.sources import ParticipantSettings, Source
from jointz.identify.regression.cell_windows import WindowCutter, unfiltered_source
from jointz.identify.regression.failed_cells import failed_cell, failure_of_codes
from jointz.identify.study_kinds import StudyKind
from jointz.results.estimates import CellEstimate, PulseExample

#: Unfiltered windows begin this much before the onset and end this much after the window, for
#: the low-pass of what is in it.
_MARGIN_S = 0.02


@dataclass(frozen=True, slots=True)
class CellMethod:
    """An :class:`~jointz.identify.estimators.Estimator` from a function that fits one cell.

    Parameters
    ----------
    name : str
        Name of the method.
    baseline : str
        Baseline to subtract, unless the study sets another.
    fit : callable
        Returns the fit of the windows of a timing point, case or group.
    raw : bool
        Whether ``fit`` takes unfiltered windows or the commanded torque, too.
    kinds : tuple of str
        Kinds of study that the method serves.
    """

    name: str
    baseline: str
    fit: Fit
    raw: bool = False
    kinds: tuple[str, ...] = ("walking", "bench")

    def baseline_for(self, kind: StudyKind) -> str:
        """Return its baseline; without strides to match, the unperturbed mean."""
        matches = self.baseline == "matched_strides" and self.name != "matched_strides"
        return "unperturbed_mean" if matches and not kind.by_gait else self.baseline

    def estimate(self, data: ParticipantData, settings: ParticipantSettings) -> Estimates:
        """Estimate every timing point, case or group."""
        return CellEstimator(data.participant, self, data.sources, settings).estimates()


class CellEstimator:
    """Estimates every cell of a participant by one method.

    ``baseline`` is what is subtracted: as the study sets it, else the method's. ``single`` holds
    the pulses of a bench that were estimated so far, each by itself.
    """

    def __init__(
        self,
        participant: str,
        method: CellMethod,
        sources: Sequence[Source],
        settings: ParticipantSettings,
    ) -> None:
        self._participant = participant
        self._method = method
        self._sources = sources
        self._settings = settings
        self.baseline = settings.perturbations.baseline or method.baseline_for(settings.kind)
        self.single: tuple[PulseEstimate, ...] = ()
        window_s = settings.perturbations.window_s
        self._filtered = WindowCutter(sources, settings, baseline=self.baseline, window_s=window_s)
        self._lead = 0
        if method.raw and sources:
            signals = sources[0].signals
            # A filtered window keeps at least the guard from every gap.
            self._lead = int(min(_MARGIN_S, 0.5 * signals.guard_s) * signals.rate_hz)
            lead_s = self._lead / signals.rate_hz
            self._raw = WindowCutter(
                [unfiltered_source(source, lead_s=lead_s) for source in sources],
                settings,
                baseline=self.baseline,
                window_s=window_s + 2 * lead_s,
            )

    def estimates(self) -> Estimates:
        """Assign the pulses to cells and estimate every cell."""
        pulses = assign_pulses(
            self._participant, self._sources, self._settings, baseline=self.baseline
        )
        cells, records = self.run(pulses)
        return Estimates(cells, records, single=self.single)

    def run(
        self, candidates: Sequence[Candidate]
    ) -> tuple[tuple[CellEstimate, ...], list[PulseRecord]]:
        """Return the cells and the pulses with their final codes."""
        records = [c.record for c in candidates]
        cells = []
        for label in dict.fromkeys(r.timing_point for r in records if r.timing_point):
            indices = [k for k, r in enumerate(records) if r.timing_point == label]
            cell, codes = self._cell(label, [candidates[k] for k in indices])
            cells.append(cell)
            for k, code in zip(indices, codes, strict=True):
                records[k] = replace(records[k], code=code)
        return tuple(cells), records

    def _cell(self, label: str, candidates: Sequence[Candidate]) -> tuple[CellEstimate, list[str]]:
        codes = [c.record.code for c in candidates]
        usable = [k for k, code in enumerate(codes) if not code]
        windows = baseline = None
        if usable:
            windows, baseline = self._filtered.cut([candidates[k] for k in usable])
            for k, code, dead in zip(usable, baseline.codes, dead_signals(windows), strict=True):
                codes[k] = dead or code
        kept = np.array([not codes[k] for k in usable], dtype=bool)
        used = [candidates[k] for k, keep in zip(usable, kept, strict=True) if keep]
        if windows is None or baseline is None or len(used) < 2:
            if len(used) == 1:
                codes = [code or Exclusion.LONE_PULSE.value for code in codes]
            return self._failed(label, self._failure(codes), n_used=0, n_pulses=len(codes)), codes
        try:
            cell = self._fitted(label, used, windows[kept], baseline.take(kept), len(codes))
        except EstimationError as exc:
            cell = self._failed(label, Failure(exc.code), n_used=len(used), n_pulses=len(codes))
        return cell, codes

    def _fitted(
        self,
        label: str,
        used: Sequence[Candidate],
        windows: np.ndarray,
        baseline: Baseline,
        n_pulses: int,
    ) -> CellEstimate:
        if self._settings.kind.single_pulses:
            responses = windows - baseline.mean()
            self.single += pulse_estimates(self._participant, used, responses, self._sources)
        signs = np.array([c.pulse.sign for c in used])
        raw = None
        if self._method.raw:
            raw_windows, unperturbed = self._raw.cut(used)
            raw = Windows(raw_windows, signs, unperturbed, self._lead)
        filtered = Windows(windows, signs, baseline)
        fit = self._method.fit(CellData(filtered, raw), self._fit_settings(used))
        return CellEstimate(
            participant=self._participant,
            timing_point=label,
            onset_gait_pct=mean_phase([c.record.measured_pct for c in used]),
            parameters=fit.parameters,
            vaf_pct=fit.vaf_pct,
            n_used=len(used),
            n_excluded=n_pulses - len(used),
            method=self._method.name,
            baseline=self.baseline,
            condition_number=fit.condition_number,
            displacement_rad=fit.displacement_rad,
            response=fit.response,
            nuisance=fit.nuisance,
            example=self._example(used, filtered),
        )

    def _example(self, used: Sequence[Candidate], windows: Windows) -> PulseExample:
        torque = windows.responses()[:, TORQUE]
        best = example_place(torque)
        recorded, baseline = windows.recorded[best], windows.baseline.mean()[best]
        return PulseExample(
            recording=used[best].record.recording,
            onset_s=used[best].pulse.onset_s,
            time_s=np.arange(recorded.shape[1]) / self._sources[used[0].source].signals.rate_hz,
            angle=recorded[ANGLE],
            torque=recorded[TORQUE],
            baseline_angle=baseline[ANGLE],
            baseline_torque=baseline[TORQUE],
            response=torque[best],
            n_averaged=len(used),
        )

    def _fit_settings(self, used: Sequence[Candidate]) -> FitSettings:
        settings, kind = self._settings, self._settings.kind
        published = self.baseline == self._method.baseline_for(kind)
        calibrations = [self._sources[c.source].input.calibration for c in used]
        return FitSettings(
            n_resamples=settings.n_resamples,
            seed=settings.seed,
            rate_hz=self._sources[used[0].source].signals.rate_hz,
            as_published=published and self._method.name == "dissertation",
            calibration=pooled_calibration(calibrations),
            mass_kg=settings.mass_kg,
            wants_per_mass=kind.per_mass,
            bounded=kind.bounded,
            cutoff_hz=settings.perturbations.cutoff_hz,
        )

    def _failed(self, label: str, failure: Failure, *, n_used: int, n_pulses: int) -> CellEstimate:
        return failed_cell(
            failure,
            self._settings,
            participant=self._participant,
            timing_point=label,
            counts=(n_used, n_pulses - n_used),
            method=self._method.name,
            baseline=self.baseline,
        )

    def _failure(self, codes: Sequence[str]) -> Failure:
        failure = failure_of_codes(codes)
        unperturbed = any(s.input.condition == "unperturbed" for s in self._sources)
        if self.baseline != "unperturbed_mean" or unperturbed:
            return failure
        missing = failure is Failure.NO_UNPERTURBED_STRIDES
        return Failure.NO_UNPERTURBED_RECORDING if missing else failure
