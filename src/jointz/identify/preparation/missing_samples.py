"""Short holes of recordings, interpolated, and notes about them."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
import xarray as xr

from jointz.core.channels import CHANNEL_UNITS
from jointz.core.recording import history_of, with_history
from jointz.gait.timestamps import longest_step_s, rate_hz
from jointz.kernels.missing_samples import fill_holes

#: Longest hole, between the samples beside it, and what lies this close to an onset has edges.
_LONGEST_HOLE_S, _NEAR_ONSET_S = 0.02, 0.005
#: Signals with edges are not filled, but interpolated linearly where rows are missing.
_WITH_EDGES = ("reference", "ground_reaction_force")
_SIGNALS = {*CHANNEL_UNITS, "position"} - {"time", "command", *_WITH_EDGES}


def interpolate_missing(recording: xr.Dataset, onsets_s: Sequence[float] = ()) -> xr.Dataset:
    """Return the recording with missing samples and rows interpolated, but not near an onset.

    Holes of more than 20 ms stay. Levels hold in missing rows. The history has the numbers.
    """
    whole, unfilled = _with_missing_rows(recording)
    time = whole["time"].to_numpy()
    longest_s = _longest_s(time)
    allowed = np.ones(time.size, dtype=bool)
    for onset_s in onsets_s:
        first = np.searchsorted(time, onset_s - _NEAR_ONSET_S)
        allowed[first : np.searchsorted(time, onset_s + _NEAR_ONSET_S, side="right")] = False
    counts, channels = {}, {}
    for name in sorted(_SIGNALS.intersection(map(str, whole))):
        values = whole[name].to_numpy()
        if np.isfinite(values).all():
            continue
        filled = fill_holes(time, values, longest_s=longest_s, allowed=allowed)
        at = np.flatnonzero(np.isfinite(filled) & ~np.isfinite(values))
        if at.size:
            channels[name] = whole[name].copy(data=filled)
            counts[name] = [at.size, 1 + int(np.count_nonzero(np.diff(at) > 1))]
            unfilled[at] = False
    if not counts:
        return recording
    whole = whole.assign(channels).isel(time=~unfilled)
    return with_history(whole, "interpolated", counts=counts)


def missing_notes(recordings: Iterable[tuple[str, xr.Dataset]]) -> Iterator[str]:
    """Yield a note about the interpolated samples of each file."""
    samples: Counter[str] = Counter()
    numbers: dict[tuple[str, str], np.ndarray] = {}
    for file, recording in recordings:
        samples[file] += recording.sizes["time"]
        steps = [s for s in history_of(recording) if s.get("step") == "interpolated"]
        for step in steps:
            for name, counts in step["counts"].items():
                numbers[file, name] = numbers.get((file, name), 0) + np.array(counts)
    for (file, name), (missing, holes) in numbers.items():
        yield (
            f"{file}: {100.0 * missing / samples[file]:.2g} % of the samples of {name} (in "
            f"{holes} holes of at most {1e3 * _LONGEST_HOLE_S:g} ms) are missing and were "
            "interpolated."
        )


def _longest_s(time: np.ndarray) -> float:
    """Return the longest step over a hole: stamps jitter by less than half a sample."""
    return _LONGEST_HOLE_S + 0.5 / rate_hz(time)


def _with_missing_rows(recording: xr.Dataset) -> tuple[xr.Dataset, np.ndarray]:
    """Return the recording with rows for short holes of the clock, and which rows these are."""
    time = recording["time"].to_numpy()
    steps = np.diff(time)
    short = (steps > longest_step_s(time)) & (steps <= _longest_s(time))
    if not short.any():
        return recording, np.zeros(time.size, dtype=bool)
    rows = np.where(short, np.maximum(np.round(steps * rate_hz(time)), 1.0), 1.0).astype(int)
    place = np.append(0, np.cumsum(rows))
    new = np.arange(place[-1] + 1)
    before = np.searchsorted(place, new, side="right") - 1
    missing = place[before] != new

    def values(name: str) -> np.ndarray:
        own = recording[name].to_numpy()
        if name in _WITH_EDGES:
            return np.asarray(np.interp(new, place, own))
        return np.where((name in _SIGNALS) & missing, np.nan, own[before])

    stamps = ("time", np.interp(new, place, time), recording["time"].attrs)
    channels = {str(n): ("time", values(str(n)), recording[n].attrs) for n in recording}
    return xr.Dataset(channels, coords={"time": stamps}, attrs=recording.attrs), missing
