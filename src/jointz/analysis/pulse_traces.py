"""Signals that each pulse was estimated from: measured, baseline, response, fit and residual.

Recordings are read and cut as the estimators do; nothing is estimated, fits are those of the
results. For ``bayesian``, the baseline is the prediction that it subtracts from the raw signals.
For the other methods, windows and baseline come from their own cutter, filtered.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from jointz.analysis.participant_jobs import participant_settings, read_participant
from jointz.core.codes import LISTED
from jointz.core.errors import DataError
from jointz.core.events import PulseRecord
from jointz.core.grouping import by_key
from jointz.core.method_names import BAYESIAN, COUPLING_OF, FULL_RECORD, RIGID, method_called
from jointz.core.study import Study, UserExclusion
from jointz.identify.estimators import METHODS, ParticipantData
from jointz.identify.prediction.predicted_cells import recorded_pulse
from jointz.identify.preparation.assignment import Candidate, assign_pulses
from jointz.identify.preparation.conditioning import ANGLE, TORQUE
from jointz.identify.preparation.raw_signals import common_rate_hz, raw_signals
from jointz.identify.preparation.recording_groups import recording_groups
from jointz.identify.preparation.sources import (
    SAME_TIME_S,
    ParticipantSettings,
    RecordingInput,
    Source,
    prepare_sources,
)
from jointz.identify.regression.cell_windows import WindowCutter
from jointz.identify.walking.bayesian_method import BayesianMethod
from jointz.results.estimates import CellEstimate
from jointz.results.study_analysis import StudyAnalysis
from jointz.tasks.engine import on_one_thread

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
    # factor of the responses, as the method averages them: the sign of the pulse, or 1 where pulses
    # of either sign are averaged apart
    factor: float
    shape: int  # place in the cell's responses; -1 if the pulse is not averaged
    # fit to the average response of the shape: angle, rad, or torque, N*m; None without a fit
    fitted: np.ndarray | None
    fits: str  # the fitted quantity: ``angle`` or ``torque``

    @property
    def response_angle(self) -> np.ndarray:
        """Measured minus baseline, times the factor, rad."""
        return np.asarray(self.factor * (self.angle - self.baseline_angle))

    @property
    def response_torque(self) -> np.ndarray:
        """Measured minus baseline, times the factor, N*m."""
        return np.asarray(self.factor * (self.torque - self.baseline_torque))

    @property
    def residual(self) -> np.ndarray | None:
        """Response of this pulse minus the fit to the average of its shape."""
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
    # method -> window, for methods that use the pulse, or would if the user had not excluded it
    windows: Mapping[str, Window]


def pulse_traces(
    participant: str,
    recordings: Sequence[RecordingInput],
    settings: ParticipantSettings,
    analysis: StudyAnalysis,
) -> dict[PulseKey, PulseTrace]:
    """Return the signals that every pulse of a participant was estimated from."""
    traces: dict[PulseKey, PulseTrace] = {}
    for unit, group in recording_groups(recordings, settings.kind):
        if unit is not None:
            key, estimates = (participant, *unit), (*analysis.cells, *analysis.comparison)
            cells = [c for c in estimates if (c.participant, c.session, c.side) == key]
            pulses = [p for p in analysis.pulses if (p.participant, p.session, p.side) == key]
            traces |= _group_traces(participant, group, settings, cells, pulses)
    return traces


def _group_traces(
    participant: str,
    recordings: Sequence[RecordingInput],
    settings: ParticipantSettings,
    cells: Sequence[CellEstimate],
    pulses: Sequence[PulseRecord],
) -> dict[PulseKey, PulseTrace]:
    without_pulse_exclusions = _without_exclusions(settings, pulses)
    sources = prepare_sources(recordings, without_pulse_exclusions)
    data = ParticipantData(participant, sources)
    excluded = {PulseKey.of(p) for p in pulses if p.code in LISTED}
    windows: dict[PulseKey, dict[str, Window]] = {PulseKey.of(p): {} for p in pulses}
    for method in settings.methods:
        if method == FULL_RECORD:
            continue  # it fits whole trials and has no windows
        name = _written_name(cells) if method == BAYESIAN else method
        cell_at = {cell.timing_point: cell for cell in cells if cell.method == name}
        windows_of_method = (
            _predicted(data, without_pulse_exclusions, pulses, turned=name == RIGID)
            if method == BAYESIAN
            else _filtered(participant, method, sources, without_pulse_exclusions)
        )
        for key, label, window in windows_of_method:
            averaged = replace(window, shape=-1) if key in excluded else window
            windows[key][name] = _with_fit(averaged, cell_at.get(label))
    return _with_surroundings(pulses, sources, windows)


def _written_name(cells: Sequence[CellEstimate]) -> str:
    """Return the method of walking as these cells name it: earlier versions had other names."""
    return next((cell.method for cell in cells if cell.method in COUPLING_OF), BAYESIAN)


def _without_exclusions(
    settings: ParticipantSettings, pulses: Sequence[PulseRecord]
) -> ParticipantSettings:
    """Return settings that exclude no pulse; excluded strides stay excluded."""
    kept = tuple(
        line for line in settings.user_exclusions if not any(is_about(line, p) for p in pulses)
    )
    return replace(settings, user_exclusions=kept)


def is_about(line: UserExclusion, pulse: PulseRecord) -> bool:
    """Return whether a line of ``exclusions.csv`` is about a pulse."""
    same = (line.participant, line.recording) == (pulse.participant, pulse.recording)
    return same and abs(line.onset_s - pulse.onset_s) < SAME_TIME_S


_Windows = Iterator[tuple[PulseKey, str, Window]]


def _predicted(
    data: ParticipantData,
    without_pulse_exclusions: ParticipantSettings,
    pulses: Sequence[PulseRecord],
    *,
    turned: bool,
) -> _Windows:
    """Yield the predicted windows; of excluded pulses as if restored.

    The others are those of the estimate, whatever the exclusions are now. An earlier method
    averaged pulses ``turned`` by their sign, as one shape.
    """
    listed = [p for p in pulses if p.code in LISTED]
    excluded = {PulseKey.of(p) for p in listed}
    if excluded:
        restored = _of_shapes(data, without_pulse_exclusions, turned=turned)
        yield from (w for w in restored if w[0] in excluded)
    lines = [UserExclusion(p.participant, p.recording, p.onset_s, "exclude", "") for p in listed]
    analysed = replace(
        without_pulse_exclusions,
        user_exclusions=(*without_pulse_exclusions.user_exclusions, *lines),
    )
    windows = _of_shapes(data, analysed, turned=turned)
    yield from (w for w in windows if w[0] not in excluded)


def _of_shapes(data: ParticipantData, settings: ParticipantSettings, *, turned: bool) -> _Windows:
    rate = common_rate_hz(data.sources)
    signals = [raw_signals(s, target_hz=rate) for s in data.sources]
    for point in BayesianMethod().predicted_shapes(data, settings):
        cell = point.cell
        for candidate, response, shape in zip(
            cell.answered, cell.predicted.responses, point.shapes, strict=True
        ):
            window = Window(
                **recorded_pulse(candidate, response, signals[candidate.source], cell.period_s),
                factor=candidate.pulse.sign if turned else 1.0,
                shape=min(int(shape), 0) if turned else int(shape),
                fitted=None,
                fits="angle",
            )
            yield PulseKey.of(candidate.record), cell.label, window


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
        factor=candidate.pulse.sign,
        shape=0,
        fitted=None,
        fits="torque",
    )
    return PulseKey.of(candidate.record), candidate.record.timing_point, filtered


def _with_fit(window: Window, cell: CellEstimate | None) -> Window:
    """Add the fit to the average of the pulse's shape, if there is one."""
    if cell is None or not 0 <= window.shape < len(cell.responses):
        return window
    response = cell.responses[window.shape]
    fits = "torque" if response.fitted_angle is None else "angle"
    curve = getattr(response, f"fitted_{fits}")
    fitted = np.interp(window.time_s, response.time_s, curve, left=np.nan, right=np.nan)
    return replace(window, fitted=fitted, fits=fits)


def _with_surroundings(
    pulses: Sequence[PulseRecord],
    sources: Sequence[Source],
    windows: Mapping[PulseKey, Mapping[str, Window]],
) -> dict[PulseKey, PulseTrace]:
    """Add the recording around each pulse, as in its file."""
    files = by_key((source.input.file, source) for source in sources)
    traces = {}
    for pulse in pulses:
        key = PulseKey.of(pulse)
        time_s, angle, torque = _around(pulse.onset_s, files.get(pulse.recording, []))
        traces[key] = PulseTrace(time_s, angle, torque, windows[key])
    return traces


def _around(onset_s: float, pieces: Sequence[Source]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    for source in pieces:
        recording = source.input.recording
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


@dataclass(frozen=True, slots=True)
class ReestimationRequest:
    """Settings of a new estimation."""

    method: str  # name of the method, of ``bayesian`` that of its coupling
    resamples: int  # number of resamples of the bootstrap
    seed: int
    # file -> hash at the time of the analysis; other contents are refused
    sha256: Mapping[str, str]
    is_earlier_method: bool = False  # results are by the earlier ``rigid``, no coupling of today's

    @classmethod
    def of(cls, analysis: StudyAnalysis) -> "ReestimationRequest":
        """Return the settings of an analysis."""
        settings, provenance = analysis.settings, analysis.provenance
        inputs = {str(entry["file"]): str(entry["sha256"]) for entry in provenance["inputs"]}
        return cls(
            requested_method(analysis),
            settings["resamples"],
            settings["seed"],
            inputs,
            is_earlier_method=settings["method"] == RIGID,
        )


def requested_method(analysis: StudyAnalysis) -> str:
    """Return the name by which the method of an analysis is requested: it states the coupling."""
    settings = analysis.settings
    names = {coupling: name for name, coupling in COUPLING_OF.items()}
    return names.get(settings.get("coupling", ""), str(settings["method"]))


def read_traces(
    study: Study, person_id: str, request: ReestimationRequest, analysis: StudyAnalysis
) -> Mapping[PulseKey, PulseTrace]:
    """Read a participant's recordings, and return every pulse as in the analysis."""
    settings, recordings = read_inputs(study, person_id, request)
    return on_one_thread(partial(pulse_traces, person_id, recordings, settings, analysis))


def read_inputs(
    study: Study, person_id: str, request: ReestimationRequest
) -> tuple[ParticipantSettings, Sequence[RecordingInput]]:
    """Return settings and recordings of a participant; refuse changed recordings."""
    if method_called(request.method) not in METHODS:
        raise DataError(
            f"method: these results are by {request.method!r}, which this version of jointz does "
            f"not have; it has {', '.join(METHODS)}. They can be read but not estimated again. "
            "Analyse the study by another method: jointz analyze --method NAME."
        )
    inputs: dict[str, dict[str, Any]] = {}
    recordings = read_participant(study, person_id, inputs)
    changed = [name for name, f in inputs.items() if request.sha256.get(name) != f["sha256"]]
    if changed:
        raise DataError(
            f"{', '.join(changed)}: expected the content that was analysed, found another. "
            "Analyse the study again: jointz analyze."
        )
    settings = participant_settings(
        study, person_id, request.method, resamples=request.resamples, seed=request.seed
    )
    return settings, recordings


def response_datasets(analysis: StudyAnalysis, study: Study | None) -> Iterator[xr.Dataset]:
    """Yield the responses of each timing point and shape of pulse; with a study single pulses."""
    cells = [c for c in analysis.cells if c.responses]
    traces: dict[PulseKey, PulseTrace] = {}
    if study is not None:
        request = ReestimationRequest.of(analysis)
        for person in dict.fromkeys(c.participant for c in cells):
            traces |= read_traces(study, person, request, analysis)
    for cell in cells:
        pulses = [
            (key, trace.windows[cell.method])
            for pulse in analysis.pulses
            if (pulse.label, pulse.timing_point) == (cell.label, cell.timing_point)
            and (trace := traces.get(key := PulseKey.of(pulse)))
            and cell.method in trace.windows
        ]
        for shape in range(len(cell.responses)):
            yield _dataset(cell, shape, [(k, w) for k, w in pulses if w.shape == shape])


def _dataset(
    cell: CellEstimate, shape: int, pulses: Sequence[tuple[PulseKey, Window]]
) -> xr.Dataset:
    response = cell.responses[shape]
    identity = ("participant", "session", "side", "timing_point", "method")
    made = xr.Dataset(
        {"mean_angle": ("time", response.angle), "mean_torque": ("time", response.torque)},
        coords={"time": ("time", response.time_s, {"units": "s"})},
        attrs={name: getattr(cell, name) for name in identity}
        | {"shape": shape, "n_pulses": response.n_pulses or cell.n_used},
    )
    if response.fitted_angle is None:
        made["fitted_torque"] = "time", response.fitted_torque
    else:
        made["fitted_angle"] = "time", response.fitted_angle
    if pulses:
        made = made.assign_coords(
            onset_s=("pulse", [key.onset_s for key, _ in pulses]),
            recording=("pulse", [key.recording for key, _ in pulses]),
        )
    for name in ("angle", "torque") if pulses else ():
        signals = [(w.time_s, getattr(w, f"response_{name}")) for _, w in pulses]
        made[name] = ("pulse", "time"), [np.interp(response.time_s, *own) for own in signals]
    for key, signal in made.data_vars.items():
        signal.attrs["units"] = "rad" if "angle" in str(key) else "N*m"
    return made
