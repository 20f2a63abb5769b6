"""Every cell of a participant by one method: windows, baselines, fits, failures."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from jointz.core.codes import Exclusion, Failure
from jointz.core.errors import EstimationError
from jointz.core.events import PulseEstimate, PulseRecord
from jointz.core.gait_phases import mean_phase
from jointz.identify.bench.pulse_estimates import pulse_estimates
from jointz.identify.methods.cell_parameters import failed_parameters
from jointz.identify.methods.cell_windows import WindowCutter, unfiltered_source
from jointz.identify.methods.cells import Method
from jointz.identify.preparation.assignment import Candidate
from jointz.identify.preparation.baselines import Baseline
from jointz.identify.preparation.calibration import pooled_calibration
from jointz.identify.preparation.cell_data import CellData, FitSettings, Windows, dead_signals
from jointz.identify.preparation.sources import ParticipantSettings, Source
from jointz.results.estimates import CellEstimate

#: Unfiltered windows begin so much before the onset and end so much behind the window: torque
#: that a lag may need, and rest that the weak form sees the onset against.
_MARGIN_S = 0.02


class CellEstimator:
    """Estimates every cell of a participant by one method."""

    def __init__(
        self,
        participant: str,
        method: Method,
        sources: Sequence[Source],
        settings: ParticipantSettings,
    ) -> None:
        self._participant = participant
        self._method = method
        self._sources = sources
        self._settings = settings
        self._own_baseline = method.baseline_for(walking=settings.walking)
        self._baseline = settings.perturbations.baseline or self._own_baseline
        window_s = settings.perturbations.window_s
        self._filtered = WindowCutter(sources, settings, baseline=self._baseline, window_s=window_s)
        self._lead = 0
        if method.raw and sources:
            signals = sources[0].signals
            # A filtered window keeps the guard from every gap: so much there always is.
            self._lead = int(min(_MARGIN_S, 0.5 * signals.guard_s) * signals.rate_hz)
            lead_s = self._lead / signals.rate_hz
            self._raw = WindowCutter(
                [unfiltered_source(source, lead_s=lead_s) for source in sources],
                settings,
                baseline=self._baseline,
                window_s=window_s + 2 * lead_s,
            )
        self._single: list[PulseEstimate] = []

    @property
    def baseline(self) -> str:
        """What is subtracted: as the study asks, else the method's own."""
        return self._baseline

    @property
    def single(self) -> tuple[PulseEstimate, ...]:
        """Pulses of a bench that were estimated so far, each by itself."""
        return tuple(self._single)

    def run(
        self, candidates: Sequence[Candidate]
    ) -> tuple[tuple[CellEstimate, ...], list[PulseRecord]]:
        """Return the cells and the pulses with their final codes."""
        records = [c.record for c in candidates]
        cells = []
        for label in dict.fromkeys(r.timing_point for r in records if r.timing_point):
            chosen = [k for k, r in enumerate(records) if r.timing_point == label]
            cell, codes = self._cell(label, [candidates[k] for k in chosen])
            cells.append(cell)
            for k, code in zip(chosen, codes, strict=True):
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
        fine = np.array([not codes[k] for k in usable], dtype=bool)
        used = [candidates[k] for k, keep in zip(usable, fine, strict=True) if keep]
        if windows is None or baseline is None or len(used) < 2:
            if len(used) == 1:
                codes = [code or Exclusion.LONE_PULSE.value for code in codes]
            return self._failed(label, codes, self._why(codes)), codes
        try:
            return self._fitted(label, used, windows[fine], baseline.take(fine), len(codes)), codes
        except EstimationError as exc:
            return self._failed(label, codes, Failure(exc.code), n_used=len(used)), codes

    def _fitted(
        self,
        label: str,
        used: Sequence[Candidate],
        windows: np.ndarray,
        baseline: Baseline,
        n_pulses: int,
    ) -> CellEstimate:
        if not self._settings.walking:
            responses = windows - baseline.mean()
            self._single += pulse_estimates(self._participant, used, responses, self._sources)
        signs = np.array([c.pulse.sign for c in used])
        raw = None
        if self._method.raw:
            cut, unperturbed = self._raw.cut(used)
            raw = Windows(cut, signs, unperturbed, self._lead)
        fit = self._method.fit(
            CellData(Windows(windows, signs, baseline), raw), self._fit_settings(used)
        )
        return CellEstimate(
            participant=self._participant,
            timing_point=label,
            onset_gait_pct=mean_phase([c.record.measured_pct for c in used]),
            parameters=fit.parameters,
            vaf_pct=fit.vaf_pct,
            n_used=len(used),
            n_excluded=n_pulses - len(used),
            method=self._method.name,
            baseline=self._baseline,
            condition_number=fit.condition_number,
            displacement_rad=fit.displacement_rad,
            response=fit.response,
            nuisance=fit.nuisance,
        )

    def _fit_settings(self, used: Sequence[Candidate]) -> FitSettings:
        settings, own = self._settings, self._baseline == self._own_baseline
        return FitSettings(
            n_resamples=settings.n_resamples,
            seed=settings.seed,
            rate_hz=self._sources[used[0].source].signals.rate_hz,
            letter=own and self._method.name == "dissertation",
            calibration=pooled_calibration(
                [self._sources[c.source].given.calibration for c in used]
            ),
            mass_kg=settings.mass_kg,
            wants_per_mass=settings.walking,
            bounded=settings.walking,
            cutoff_hz=settings.perturbations.cutoff_hz,
        )

    def _failed(
        self, label: str, codes: Sequence[str], failure: Failure, *, n_used: int = 0
    ) -> CellEstimate:
        parameters = failed_parameters(
            failure, mass_kg=self._settings.mass_kg, wants_per_mass=self._settings.walking
        )
        return CellEstimate(
            participant=self._participant,
            timing_point=label,
            onset_gait_pct=None,
            parameters=parameters,
            vaf_pct=None,
            n_used=n_used,
            n_excluded=len(codes) - n_used,
            method=self._method.name,
            baseline=self._baseline,
        )

    def _why(self, codes: Sequence[str]) -> Failure:
        kinds = set(codes)
        if Exclusion.NO_BASELINE in kinds:
            conditions = {s.given.condition for s in self._sources}
            if self._baseline == "unperturbed_mean" and "unperturbed" not in conditions:
                return Failure.NO_UNPERTURBED_RECORDING
            return Failure.NO_UNPERTURBED_STRIDES
        if Exclusion.LONE_PULSE in kinds:
            return Failure.TOO_FEW_PULSES
        for dead in (Failure.CONSTANT_ANGLE, Failure.CONSTANT_TORQUE):
            if dead.value in kinds:
                return dead
        if kinds == {Exclusion.NO_HEEL_STRIKES.value}:
            return Failure.NO_HEEL_STRIKES
        return Failure.ALL_PULSES_EXCLUDED
