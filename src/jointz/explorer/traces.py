"""Signals that each pulse was estimated from: measured, baseline, response, fit and residual.

All signals are those of the estimators. For ``strapped``, response and fit are those of the shape
of the pulse, the baseline is the prediction. For ``rigid``, the response is that of its evidence,
the fit that of its cell, and the baseline the prediction that it subtracted from the raw signals.
For the other methods, windows and baseline come from their own cutter, filtered.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

import numpy as np

from jointz.core.codes import LISTED
from jointz.core.events import PulseRecord
from jointz.core.method_names import FULL_RECORD, RIGID, STRAPPED
from jointz.explorer.exclusions import is_about
from jointz.identify.estimators import METHODS, ParticipantData
from jointz.identify.methods.cell_windows import WindowCutter
from jointz.identify.participant import ParticipantResult, analyze_participant
from jointz.identify.prediction.predicted_cells import recorded_pulse
from jointz.identify.preparation.assignment import Candidate, assign_pulses
from jointz.identify.preparation.conditioning import ANGLE, TORQUE, Conditioned
from jointz.identify.preparation.raw_signals import (
    common_rate_hz,
    raw_signals,
)
from jointz.identify.preparation.recording_groups import Unit, recording_groups
from jointz.identify.preparation.sources import (
    ParticipantSettings,
    RecordingInput,
    Source,
    prepare_sources,
)
from jointz.identify.rigid.walking_evidence import Evidence
from jointz.identify.strapped.strapped_method import FittedShapes, StrappedMethod
from jointz.results.estimates import CellEstimate

#: Part of the recording that is shown around a pulse, s.
_BEFORE_S, _AFTER_S = 0.15, 0.35


@dataclass(frozen=True, slots=True)
class PulseKey:
    """Identity of a pulse."""

    participant: str
    recording: str
    onset_s: float  # commanded onset

    @classmethod
    def of(cls, pulse: PulseRecord) -> "PulseKey":
        """Return the key of a pulse."""
        return cls(pulse.participant, pulse.recording, pulse.onset_s)


@dataclass(frozen=True, slots=True, eq=False)
class Window:
    """A pulse in the window of a method."""

    time_s: np.ndarray  # time since the commanded onset, (n,)
    angle: np.ndarray  # rad: measured angle, raw or filtered, as the method uses it
    torque: np.ndarray  # N*m: measured torque, raw or filtered, as the method uses it
    baseline_angle: np.ndarray  # rad: predicted angle without the pulse
    baseline_torque: np.ndarray  # N*m: predicted torque without the pulse
    sign: float  # sign of the pulse, +1 or -1; factor of the responses
    # fit to the average response of the timing point: angle, rad, or torque, N*m; None without a
    # fit
    fitted: np.ndarray | None
    fits: str  # the fitted quantity: ``angle`` or ``torque``

    @property
    def response_angle(self) -> np.ndarray:
        """Measured minus baseline, times the sign, rad."""
        return np.asarray(self.sign * (self.angle - self.baseline_angle))

    @property
    def response_torque(self) -> np.ndarray:
        """Measured minus baseline, times the sign, N*m."""
        return np.asarray(self.sign * (self.torque - self.baseline_torque))

    @property
    def residual(self) -> np.ndarray | None:
        """Response of this pulse minus the fit to the average of all."""
        if self.fitted is None:
            return None
        response = self.response_angle if self.fits == "angle" else self.response_torque
        return np.asarray(response - self.fitted)

    @property
    def misfit(self) -> float | None:
        """Root mean square of the residual, rad or N*m."""
        residual = self.residual
        if residual is None or not np.isfinite(residual).any():
            return None
        return float(np.sqrt(np.nanmean(residual**2)))


@dataclass(frozen=True, slots=True, eq=False)
class PulseTrace:
    """Signals of one pulse."""

    time_s: np.ndarray  # time since the commanded onset; from before the window to after it
    angle: np.ndarray  # rad: recorded angle; NaN if missing
    torque: np.ndarray  # N*m: recorded torque; NaN if missing
    windows: Mapping[str, Window]  # method -> window, for methods that use the pulse
    if_restored: bool  # whether the user excluded the pulse, so that windows show it as if restored


def pulse_traces(
    participant: str,
    recordings: Sequence[RecordingInput],
    settings: ParticipantSettings,
    result: ParticipantResult,
) -> dict[PulseKey, PulseTrace]:
    """Return the signals that every pulse of a participant was estimated from."""
    traces: dict[PulseKey, PulseTrace] = {}
    for unit, group in recording_groups(recordings, settings.kind):
        if unit is not None:
            traces |= _group_traces(participant, group, settings, _part(result, unit))
    return traces


def _part(result: ParticipantResult, unit: Unit) -> ParticipantResult:
    """Return the result for a session and side."""

    def part(rows: Sequence[Any]) -> tuple[Any, ...]:
        return tuple(row for row in rows if (row.session, row.side) == unit)

    cells = {method: part(cells) for method, cells in result.cells.items()}
    return replace(result, cells=cells, pulses=part(result.pulses), evidence=part(result.evidence))


def _group_traces(
    participant: str,
    recordings: Sequence[RecordingInput],
    settings: ParticipantSettings,
    result: ParticipantResult,
) -> dict[PulseKey, PulseTrace]:
    lifted = _without_exclusions(settings, result.pulses)
    sources = prepare_sources(recordings, lifted)
    windows: dict[PulseKey, dict[str, Window]] = {PulseKey.of(p): {} for p in result.pulses}
    for method in settings.methods:
        if method == FULL_RECORD:
            continue  # it fits whole trials and has no windows
        if method == STRAPPED:
            for key, window in _by_shape(participant, sources, (settings, lifted), result):
                windows[key][method] = window
            continue
        cells = {cell.timing_point: cell for cell in result.cells[method]}
        windows_of_method = (
            _predicted(participant, recordings, sources, (settings, lifted), result)
            if method == RIGID
            else _filtered(participant, method, sources, lifted)
        )
        for key, label, window in windows_of_method:
            windows[key][method] = _with_fit(window, cells.get(label))
    return _with_surroundings(result.pulses, sources, windows)


def _without_exclusions(
    settings: ParticipantSettings, pulses: Sequence[PulseRecord]
) -> ParticipantSettings:
    """Return settings that exclude no pulse; excluded strides stay excluded."""
    kept = tuple(
        line for line in settings.user_exclusions if not any(is_about(line, p) for p in pulses)
    )
    return replace(settings, user_exclusions=kept)


_Windows = Iterator[tuple[PulseKey, str, Window]]


def _predicted(
    participant: str,
    recordings: Sequence[RecordingInput],
    sources: Sequence[Source],
    settings: tuple[ParticipantSettings, ParticipantSettings],
    result: ParticipantResult,
) -> _Windows:
    """Yield the windows of the method ``rigid``; of excluded pulses as if restored."""
    original, lifted = settings
    rate = common_rate_hz(sources)
    signals = [raw_signals(source, target_hz=rate) for source in sources]
    excluded = {PulseKey.of(p) for p in result.pulses if p.code in LISTED}
    if excluded and lifted.user_exclusions != original.user_exclusions:
        single = replace(lifted, methods=(RIGID,))
        restored = analyze_participant(participant, recordings, single)
        yield from (w for w in _of_evidence(restored.evidence, signals) if w[0] in excluded)
    yield from (w for w in _of_evidence(result.evidence, signals) if w[0] not in excluded)


def _of_evidence(evidence: Sequence[Evidence], signals: Sequence[Conditioned]) -> _Windows:
    pairs = (zip(part.cells, part.responses, strict=True) for part in evidence)
    for cell, average in chain.from_iterable(pairs):
        usable = [
            c for c, code in zip(cell.candidates, cell.predicted.codes, strict=True) if not code
        ]
        n = average.angle.size
        responses = cell.predicted.responses[:, :, :n]
        for candidate, response in zip(usable, responses, strict=True):
            window = _raw_window(candidate, response, signals, cell.period_s)
            yield PulseKey.of(candidate.record), cell.label, window


def _raw_window(
    candidate: Candidate,
    response: np.ndarray,
    signals: Sequence[Conditioned],
    period_s: float,
) -> Window:
    """Return the window of a predicted pulse, from the raw signals and without a fit."""
    return Window(
        **recorded_pulse(candidate, response, signals[candidate.source], period_s),
        sign=candidate.pulse.sign,
        fitted=None,
        fits="angle",
    )


def _by_shape(
    participant: str,
    sources: Sequence[Source],
    settings: tuple[ParticipantSettings, ParticipantSettings],
    result: ParticipantResult,
) -> Iterator[tuple[PulseKey, Window]]:
    """Yield the windows of the method ``strapped``; of excluded pulses as if restored."""
    original, lifted = settings
    data = ParticipantData(participant, sources)
    rate = common_rate_hz(sources)
    signals = [raw_signals(source, target_hz=rate, strapped=True) for source in sources]
    excluded = {PulseKey.of(p) for p in result.pulses if p.code in LISTED}
    if excluded and lifted.user_exclusions != original.user_exclusions:
        restored = StrappedMethod().fitted_shapes(data, lifted, fit=False)
        yield from (w for w in _of_shapes(restored, signals) if w[0] in excluded)
    used = StrappedMethod().fitted_shapes(data, original)
    yield from (w for w in _of_shapes(used, signals) if w[0] not in excluded)


def _of_shapes(
    points: Sequence[FittedShapes], signals: Sequence[Conditioned]
) -> Iterator[tuple[PulseKey, Window]]:
    for point in points:
        responses = point.cell.predicted.responses[point.cell.kept, :, : point.time_s.size]
        for candidate, response, shape in zip(
            point.cell.used, responses, point.shapes, strict=True
        ):
            sign = candidate.pulse.sign
            window = _raw_window(candidate, response, signals, point.cell.period_s)
            # The fit is as signed, the response of a window is turned.
            fitted = None if point.fitted is None else sign * point.fitted[shape]
            yield PulseKey.of(candidate.record), replace(window, fitted=fitted)


def _filtered(
    participant: str, method: str, sources: Sequence[Source], settings: ParticipantSettings
) -> _Windows:
    """Yield the filtered windows of a method and its baseline."""
    default = METHODS[method].baseline_for(settings.kind)
    baseline = settings.perturbations.baseline or default
    candidates = assign_pulses(participant, sources, settings, baseline=baseline, alone=True)
    usable = [c for c in candidates if not c.record.code and np.isfinite(c.elapsed_s)]
    if not usable:
        return
    window_s = settings.perturbations.window_s
    windows, subtracted = WindowCutter(sources, settings, baseline=baseline, window_s=window_s).cut(
        usable
    )
    means, codes = subtracted.mean(), subtracted.codes
    for candidate, window, mean, code in zip(usable, windows, means, codes, strict=True):
        if not code:
            yield _filtered_window(candidate, window, mean, sources)


def _filtered_window(
    candidate: Candidate, window: np.ndarray, mean: np.ndarray, sources: Sequence[Source]
) -> tuple[PulseKey, str, Window]:
    rate_hz = sources[candidate.source].signals.rate_hz
    filtered = Window(
        time_s=np.arange(window.shape[1]) / rate_hz,
        angle=window[ANGLE],
        torque=window[TORQUE],
        baseline_angle=mean[ANGLE],
        baseline_torque=mean[TORQUE],
        sign=candidate.pulse.sign,
        fitted=None,
        fits="torque",
    )
    return PulseKey.of(candidate.record), candidate.record.timing_point, filtered


def _with_fit(window: Window, cell: CellEstimate | None) -> Window:
    """Add the fit to the average of the timing point, if there is one."""
    if cell is None or cell.response is None:
        return window
    response = cell.response
    angle = response.fitted_angle is not None
    fitted = response.fitted_angle if response.fitted_angle is not None else response.fitted_torque
    on_own_time = np.interp(window.time_s, response.time_s, fitted, left=np.nan, right=np.nan)
    return replace(window, fitted=on_own_time, fits="angle" if angle else "torque")


def _with_surroundings(
    pulses: Sequence[PulseRecord],
    sources: Sequence[Source],
    windows: Mapping[PulseKey, Mapping[str, Window]],
) -> dict[PulseKey, PulseTrace]:
    """Add the recording around each pulse, as in its file."""
    files: dict[str, list[Source]] = {}
    for source in sources:
        files.setdefault(source.given.file, []).append(source)
    traces = {}
    for pulse in pulses:
        key = PulseKey.of(pulse)
        time_s, angle, torque = _around(pulse.onset_s, files.get(pulse.recording, []))
        traces[key] = PulseTrace(time_s, angle, torque, windows[key], pulse.code in LISTED)
    return traces


def _around(onset_s: float, pieces: Sequence[Source]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    for source in pieces:
        recording = source.given.recording
        time = recording["time"].to_numpy()
        first, last = np.searchsorted(time, [onset_s - _BEFORE_S, onset_s + _AFTER_S])
        if last > first:
            part = slice(int(first), int(last))
            angle = recording["angle"].to_numpy()[part]
            has_torque = "torque" in recording
            torque = (
                recording["torque"].to_numpy()[part] if has_torque else np.full_like(angle, np.nan)
            )
            return time[part] - onset_s, angle, torque
    return np.empty(0), np.empty(0), np.empty(0)
