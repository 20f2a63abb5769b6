"""Short holes of recordings, interpolated, and notes about them."""

from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr

from jointz.core.channels import CHANNEL_UNITS
from jointz.core.recording import history_of, with_history
from jointz.gait.timestamps import longest_step_s, rate_hz
from jointz.kernels.missing_samples import fill_holes

#: Longest hole, between the samples beside it, and what lies this close to an onset has edges.
_LONGEST_HOLE_S, _NEAR_ONSET_S = 0.02, 0.005
_SIGNALS = {*CHANNEL_UNITS, "position"} - {"time", "command", "reference", "ground_reaction_force"}


def interpolate_missing(recording: xr.Dataset, onsets_s: Sequence[float] = ()) -> xr.Dataset:
    """Return the recording with missing samples and rows interpolated, but not near an onset.

    Holes of more than 20 ms stay. All but signals holds in missing rows. The history has the share
    of the samples and the number of holes of each channel.
    """
    recorded_s = recording["time"].to_numpy()
    longest_s = _LONGEST_HOLE_S + 0.5 / rate_hz(
        recorded_s
    )  # stamps jitter by less than half a sample
    time, missing = _with_missing_rows(recorded_s, longest_s)
    whole = recording.reindex(time=time, method="ffill") if missing.any() else recording
    near = np.searchsorted(onsets_s, time - _NEAR_ONSET_S)
    allowed = near == np.searchsorted(onsets_s, time + _NEAR_ONSET_S, side="right")
    channels, counts, unfilled = {}, {}, missing.copy()
    for name in sorted(_SIGNALS.intersection(map(str, whole))):
        values = np.where(missing, np.nan, whole[name])
        filled = fill_holes(time, values, longest_s=longest_s, allowed=allowed)
        channels[name] = whole[name].copy(data=filled)
        at = np.flatnonzero(np.isfinite(filled) & ~np.isfinite(values))
        if at.size:
            counts[name] = (at.size / time.size, int(np.count_nonzero(np.diff(at) > 1)) + 1)
            unfilled[at] = False
    if not counts:
        return recording
    whole = whole.assign(channels).isel(time=~unfilled)
    return with_history(whole, "interpolated", filled=counts)


def missing_notes(file: str, recording: xr.Dataset) -> Iterator[str]:
    """Yield a note about the interpolated samples of each channel of a recording."""
    for step in history_of(recording):
        for name, (share, holes) in step.get("filled", {}).items():
            yield (
                f"{file}: {100.0 * share:.2g} % of the samples of {name} (in {holes} holes of at "
                "most 20 ms) are missing and were interpolated."
            )


def _with_missing_rows(time: np.ndarray, longest_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Return time with stamps for the rows missing in short holes, and which these are."""
    steps = np.diff(time)
    short = (steps > longest_step_s(time)) & (steps <= longest_s)
    rows = np.where(short, np.round(steps * rate_hz(time)), 1.0).astype(int)
    place = np.append(0, np.cumsum(rows))
    new = np.arange(place[-1] + 1)
    return np.interp(new, place, time), ~np.isin(new, place)
