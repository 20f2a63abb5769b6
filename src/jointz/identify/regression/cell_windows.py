"""Windows of the pulses of a cell and of the unperturbed strides to subtract."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import xarray as xr
from scipy.ndimage import map_coordinates

from jointz.core.study import Calibrated, CalibrationSpec
from jointz.gait.timestamps import resample_stretch
from jointz.identify.preparation import baselines
from jointz.identify.preparation.assignment import Candidate
from jointz.identify.preparation.baselines import Baseline, StridePool
from jointz.identify.preparation.calibration import joint_angle, value_of
from jointz.identify.preparation.conditioning import ANGLE, Stretch
from jointz.identify.preparation.sources import ParticipantSettings, Source, most_alike
from jointz.identify.study_kinds import StudyKind

_UNFILTERED = ("angle", "torque", "command")


@dataclass(frozen=True, slots=True, eq=False)
class WindowCutter:
    """Cuts windows out of a participant's recordings."""

    sources: Sequence[Source]
    settings: ParticipantSettings
    baseline: str  # name of the baseline
    window_s: float
    _pools: dict[tuple[int, ...], StridePool] = field(default_factory=dict, init=False)

    def cut(self, candidates: Sequence[Candidate]) -> tuple[np.ndarray, Baseline]:
        """Return the windows of pulses and their baselines."""
        order = [c.source for c in candidates]
        parts = [
            (index, *self._of_source(index, [c for c in candidates if c.source == index]))
            for index in dict.fromkeys(order)
        ]
        _, windows, baseline = parts[0]
        if len(parts) > 1:
            windows = np.concatenate([w for _, w, _ in parts])
            baseline = _stacked([(self._home(index), b) for index, _, b in parts])
        if not self.settings.kind.drifts:
            baseline = replace(baseline, block=1)
        if len(parts) == 1:
            return windows, baseline
        # In the order of the candidates.
        by_source = [k for index, _, _ in parts for k, i in enumerate(order) if i == index]
        back = np.argsort(by_source)
        return windows[back], baseline.take(back)

    def _of_source(
        self, index: int, candidates: Sequence[Candidate]
    ) -> tuple[np.ndarray, Baseline]:
        signals = self.sources[index].signals
        window_s = self.window_s
        onsets = np.array([c.pulse.onset_s for c in candidates])
        elapsed = [c.elapsed_s for c in candidates]
        windows, _ = signals.cut(onsets, before_s=0.0, after_s=window_s)
        if self.baseline == "pre_pulse":
            before, _ = signals.cut(onsets, before_s=baselines.PRE_PULSE_S, after_s=0.0)
            return windows, baselines.pre_pulse(before, n_samples=windows.shape[2])
        pool = self._pool(self._home(index))
        if pool.size == 0 or np.isnan(elapsed).any():
            return windows, _no_baseline(windows)
        if self.baseline == "unperturbed_mean":
            return windows, baselines.unperturbed_mean(pool, elapsed, window_s=window_s)
        before, _ = signals.cut(onsets, before_s=baselines.MATCH_S, after_s=0.0)
        angle = np.nan_to_num(before[:, ANGLE])
        return windows, baselines.matched_strides(pool, onsets, elapsed, angle, window_s=window_s)

    def _home(self, index: int) -> tuple[int, ...]:
        """Return the recordings whose strides are the baseline of the pulses of one."""
        if self.baseline != "unperturbed_mean":
            return (index,)
        unperturbed = [s.input for s in self.sources if s.input.condition == "unperturbed"]
        keys = self.settings.kind.reference_keys
        nearest = most_alike(self.sources[index].input, unperturbed, keys=keys)
        return tuple(k for k, s in enumerate(self.sources) if any(s.input is r for r in nearest))

    def _pool(self, home: tuple[int, ...]) -> StridePool:
        if home not in self._pools:
            sources = [self.sources[k] for k in home]
            if self.baseline == "matched_strides":
                self._pools[home] = _perturbed_pool(sources[0])
            else:
                self._pools[home] = _unperturbed_pool(sources, self.settings.kind)
        return self._pools[home]


def _no_baseline(windows: np.ndarray) -> Baseline:
    n = len(windows)
    return Baseline(
        np.zeros((n, 1, *windows.shape[1:])), np.zeros((n, 1), dtype=int), np.zeros((n, 1), bool)
    )


def _stacked(parts: Sequence[tuple[tuple[int, ...], Baseline]]) -> Baseline:
    """Join baselines of several recordings, which share strides if they share recordings."""
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
    return Baseline(
        np.concatenate(windows),
        np.concatenate(sources),
        np.concatenate(valid),
        block=max(part.block for _, part in parts),
    )


def _unperturbed_pool(sources: Sequence[Source], kind: StudyKind) -> StridePool:
    """Return the strides of the unperturbed condition; a bench trial is one stride."""
    recordings, starts, onsets = [], [], []
    for source in sources:
        if kind.by_gait and source.strides is None:
            continue
        recordings.append(source.signals)
        onsets.append(_onsets(source))
        if source.strides is None:
            starts.append(source.input.recording["time"].to_numpy()[:1])
        else:
            starts.append(source.strides.start_s[source.undisturbed])
    return StridePool(tuple(recordings), tuple(starts), tuple(onsets))


def _perturbed_pool(source: Source) -> StridePool:
    """Return the strides of a perturbed recording without a pulse and not after one."""
    if source.strides is None:
        return StridePool((), (), ())
    after_one = np.concatenate([[False], source.undisturbed[:-1]])
    start = source.strides.start_s[source.undisturbed & after_one]
    return StridePool((source.signals,), (start,), (_onsets(source),))


def _onsets(source: Source) -> np.ndarray:
    return np.array([p.onset_s for p in source.pulses])


def unfiltered_source(source: Source, *, lead_s: float) -> Source:
    """Return a recording with the rows of unfiltered windows, shifted by a lead."""
    signals = source.signals
    lead = round(lead_s * signals.rate_hz)
    runs = tuple(_unfiltered(stretch, source, lead) for stretch in signals.stretches)
    return replace(source, signals=replace(signals, stretches=runs, guard_s=0.0))


def _unfiltered(stretch: Stretch, source: Source, lead: int) -> Stretch:
    recording, known = source.input.recording, source.input.calibration
    time = recording["time"].to_numpy()
    half_a_step = 0.5 * float(np.median(np.diff(time[:1000])))
    ends_s = (stretch.time[0] - half_a_step, stretch.time[-1] + half_a_step)
    part = slice(*np.searchsorted(time, ends_s).tolist())
    rows = [stretch.signals[ANGLE]]
    records = _measured(recording, known, part)
    lags = (known.angle_lag_s, known.torque_lag_s, None)
    for name, lag in zip(_UNFILTERED, lags, strict=True):
        row = np.zeros(stretch.time.size)
        if name in records:
            row = _at(stretch.time, time[part], records[name], lag)
        rows.append(np.concatenate([np.full(lead, row[0]), row[: row.size - lead]]))
    return Stretch(time=stretch.time, signals=np.stack(rows))


def _measured(recording: xr.Dataset, known: CalibrationSpec, part: slice) -> dict[str, np.ndarray]:
    """Return the recorded channels, corrected for the instruments."""
    channels = {n: recording[n].to_numpy()[part] for n in _UNFILTERED if n in recording}
    torque = channels.get("torque", np.zeros(channels["angle"].size))
    channels["angle"] = joint_angle(channels["angle"], torque, known)
    if "torque" in channels:
        channels["torque"] = torque / value_of(known.torque_gain, 1.0)
    if "command" in channels:
        channels["command"] = _without_gaps(channels["command"])
    return channels


def _without_gaps(values: np.ndarray) -> np.ndarray:
    """Return a command with the last known sample in gaps, zero before the first.

    Gaps of angle or torque end a stretch; the command is only an instrument.
    """
    known = np.isfinite(values)
    last = np.maximum.accumulate(np.where(known, np.arange(values.size), -1))
    return np.asarray(np.where(last >= 0, values[last], 0.0))


def _at(
    new_time: np.ndarray, time: np.ndarray, values: np.ndarray, lag: Calibrated | None
) -> np.ndarray:
    """Return a channel at new times, without its lag."""
    torque_lag_s = 0.0 if lag is None else lag.value
    if not torque_lag_s and new_time.size == time.size and np.array_equal(new_time, time):
        return values
    rate = (time.size - 1) / (time[-1] - time[0])
    uniform, even = resample_stretch(time, values, step_s=1.0 / rate)
    step = (uniform[-1] - uniform[0]) / (uniform.size - 1)
    where = (new_time + torque_lag_s - uniform[0]) / step
    return np.asarray(map_coordinates(even, [where], order=3, mode="nearest"))
