"""Parts of a file's pulse table, one for each perturbed recording of the file."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pandas as pd
import xarray as xr

from jointz.core.errors import DataError

_Span = tuple[float, float]


def share_table(table: pd.DataFrame, recordings: Sequence[xr.Dataset]) -> list[pd.DataFrame | None]:
    """Return each perturbed recording's part of the pulse table of their file."""
    times = {
        k: r["time"].to_numpy()
        for k, r in enumerate(recordings)
        if r.attrs["condition"] == "perturbed"
    }
    spans = {k: (float(time[0]), float(time[-1])) for k, time in times.items()}
    perturbed = sorted(spans, key=lambda k: spans[k])
    ordered = [spans[k] for k in perturbed]
    onsets = table["onset_s"].to_numpy(dtype=float)
    _check(onsets, ordered, str(recordings[0].attrs["file"]))
    starts = [begin for begin, _ in ordered]
    position = np.maximum(np.searchsorted(starts, onsets, side="right") - 1, 0)
    shares: list[pd.DataFrame | None] = [None] * len(recordings)
    for i, k in enumerate(perturbed):
        shares[k] = table[position == i]
    return shares


def _check(onsets: np.ndarray, spans: Sequence[_Span], file: str) -> None:
    for (_, end), (begin, _) in pairwise(spans):
        if begin <= end:
            raise DataError(
                f"{file}: time starts again in its perturbed trials, so an onset of its pulse "
                f"table ({begin:.6g} s, say) lies in several. Let time run on through the file "
                "(sample_rate_hz instead of channels.time counts from its first sample), or give "
                "every trial a file, a session and a table of its own.",
                path=file,
                channel="time",
            )
    if onsets.size and not any(((begin <= onsets) & (onsets <= end)).any() for begin, end in spans):
        known = ", ".join(f"{begin:.6g} to {end:.6g} s" for begin, end in spans) or "there are none"
        raise DataError(
            f"{file}: all {onsets.size} onsets of its pulse table lie outside its perturbed "
            f"samples ({known}). Is it the right table, and does its clock start at the same zero?",
            path=file,
        )
