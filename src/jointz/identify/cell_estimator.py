"""Every cell of a participant by one method: windows, baselines, fits, failures."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from jointz.core.codes import Exclusion, Failure
from jointz.core.errors import EstimationError
from jointz.core.estimates import CellEstimate
from jointz.core.events import PulseEstimate, PulseRecord
from jointz.identify import baselines
from jointz.identify.assignment import Candidate
from jointz.identify.baselines import Baseline, StridePool
from jointz.identify.calibration import pooled_calibration
from jointz.identify.cells import (
    FitSettings,
    Method,
    dead_signals,
    failed_parameters,
    fit_cell,
)
from jointz.identify.conditioning import ANGLE
from jointz.identify.pulse_estimates import pulse_estimates
from jointz.identify.sources import ParticipantSettings, Source, most_alike


class CellEstimator:
    """Estimates every cell of a participant by one method.

    Parameters
    ----------
    participant : str
        The id.
    method : Method
        How.
    sources : sequence of Source
        The participant's recordings, made ready.
    settings : ParticipantSettings
        What the study and the caller ask for.
    """

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
        self._baseline = settings.perturbations.baseline or method.baseline
        self._pools: dict[tuple[int, ...], StridePool] = {}
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
        """Return the cells and the pulses with their final codes.

        Parameters
        ----------
        candidates : sequence of Candidate
            Every pulse of the participant's perturbed recordings.
        """
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
            windows, baseline = self._windows([candidates[k] for k in usable])
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
        letter = self._method.name == "dissertation" and self._baseline == self._method.baseline
        fit = fit_cell(
            windows,
            np.array([c.pulse.sign for c in used]),
            baseline,
            settings=FitSettings(
                n_resamples=self._settings.n_resamples,
                seed=self._settings.seed,
                rate_hz=self._sources[used[0].source].signals.rate_hz,
                letter=letter,
                calibration=pooled_calibration(
                    [self._sources[c.source].given.calibration for c in used]
                ),
                mass_kg=self._settings.mass_kg,
                wants_per_mass=self._settings.walking,
                bounded=self._settings.walking,
            ),
        )
        return CellEstimate(
            participant=self._participant,
            timing_point=label,
            onset_gait_pct=_mean_phase([c.record.measured_pct for c in used]),
            parameters=fit.parameters,
            vaf_pct=fit.vaf_pct,
            n_used=len(used),
            n_excluded=n_pulses - len(used),
            method=self._method.name,
            baseline=self._baseline,
            condition_number=fit.condition_number,
            displacement_rad=fit.displacement_rad,
            response=fit.response,
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

    def _windows(self, candidates: Sequence[Candidate]) -> tuple[np.ndarray, Baseline]:
        """Cut the pulses' windows and their baselines, recording by recording."""
        order = [c.source for c in candidates]
        parts = []
        for index in dict.fromkeys(order):
            mine = [c for c in candidates if c.source == index]
            parts.append((index, *self._of_source(index, mine)))
        windows = np.concatenate([w for _, w, _ in parts])
        baseline = _stacked([(self._home(index), b) for index, _, b in parts])
        # Back into the order of the candidates.
        placed = [k for index, _, _ in parts for k, i in enumerate(order) if i == index]
        back = np.argsort(placed)
        return windows[back], baseline.take(back)

    def _of_source(
        self, index: int, candidates: Sequence[Candidate]
    ) -> tuple[np.ndarray, Baseline]:
        signals = self._sources[index].signals
        window_s = self._settings.perturbations.window_s
        onsets = np.array([c.pulse.onset_s for c in candidates])
        elapsed = [c.elapsed_s for c in candidates]
        windows, _ = signals.cut(onsets, before_s=0.0, after_s=window_s)
        if self._baseline == "pre_pulse":
            before, _ = signals.cut(onsets, before_s=baselines.PRE_PULSE_S, after_s=0.0)
            return windows, baselines.pre_pulse(before, n_samples=windows.shape[2])
        pool = self._pool(self._home(index))
        if pool.size == 0 or np.isnan(elapsed).any():
            return windows, _no_baseline(windows)
        if self._baseline == "unperturbed_mean":
            return windows, baselines.unperturbed_mean(pool, elapsed, window_s=window_s)
        before, _ = signals.cut(onsets, before_s=baselines.MATCH_S, after_s=0.0)
        angle = np.nan_to_num(before[:, ANGLE])
        return windows, baselines.matched_strides(pool, onsets, elapsed, angle, window_s=window_s)

    def _home(self, index: int) -> tuple[int, ...]:
        """Return which recordings make the baseline of the pulses of one."""
        if self._baseline != "unperturbed_mean":
            return (index,)
        unperturbed = [s.given for s in self._sources if s.given.condition == "unperturbed"]
        # A new donning moves the sensor; on a bench every trial has a reference of its own.
        keys = ("session", "side") if self._settings.walking else ("session", "side", "trial")
        alike = most_alike(self._sources[index].given, unperturbed, keys=keys)
        return tuple(k for k, s in enumerate(self._sources) if any(s.given is a for a in alike))

    def _pool(self, home: tuple[int, ...]) -> StridePool:
        if home not in self._pools:
            sources = [self._sources[k] for k in home]
            own = self._baseline == "matched_strides"
            self._pools[home] = (
                _own_pool(sources[0])
                if own
                else _unperturbed_pool(sources, walking=self._settings.walking)
            )
        return self._pools[home]


def _no_baseline(windows: np.ndarray) -> Baseline:
    n = len(windows)
    return Baseline(
        np.zeros((n, 1, *windows.shape[1:])), np.zeros((n, 1), dtype=int), np.zeros((n, 1), bool)
    )


def _stacked(parts: Sequence[tuple[tuple[int, ...], Baseline]]) -> Baseline:
    """Join baselines of several recordings; strides are shared where their home is."""
    widest = max(b.windows.shape[1] for _, b in parts)
    windows, sources, valid = [], [], []
    first: dict[tuple[int, ...], int] = {}
    total = 0
    for home, part in parts:
        if home not in first:
            first[home] = total
            total += part.n_sources
        pad = widest - part.windows.shape[1]
        windows.append(np.pad(part.windows, ((0, 0), (0, pad), (0, 0), (0, 0))))
        sources.append(np.pad(part.sources + first[home], ((0, 0), (0, pad)), mode="edge"))
        valid.append(np.pad(part.valid, ((0, 0), (0, pad))))
    return Baseline(np.concatenate(windows), np.concatenate(sources), np.concatenate(valid))


def _mean_phase(phases: Sequence[float | None]) -> float | None:
    """Return the circular mean of phases in %, None where any is missing."""
    known = [p for p in phases if p is not None]
    if not known or len(known) < len(phases):
        return None
    angles = np.asarray(known) * 2 * np.pi / 100.0
    mean = np.angle(np.exp(1j * angles).mean()) * 100.0 / (2 * np.pi)
    return float(mean % 100.0)


def _unperturbed_pool(sources: Sequence[Source], *, walking: bool) -> StridePool:
    """Collect the strides of the unperturbed condition; a bench trial is one stride."""
    recordings, starts, onsets = [], [], []
    for source in sources:
        if walking and source.strides is None:
            continue
        recordings.append(source.signals)
        onsets.append(_onsets(source))
        if source.strides is None:
            starts.append(source.given.recording["time"].to_numpy()[:1])
        else:
            starts.append(source.strides.start_s[source.undisturbed])
    return StridePool(tuple(recordings), tuple(starts), tuple(onsets))


def _own_pool(source: Source) -> StridePool:
    """Collect the strides of a perturbed recording that neither hold nor follow a pulse."""
    if source.strides is None:
        return StridePool((), (), ())
    after_one = np.concatenate([[False], source.undisturbed[:-1]])
    start = source.strides.start_s[source.undisturbed & after_one]
    return StridePool((source.signals,), (start,), (_onsets(source),))


def _onsets(source: Source) -> np.ndarray:
    return np.array([p.onset_s for p in source.pulses])
