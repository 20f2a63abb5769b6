"""Which recording of a file each pulse of the file's table belongs to."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pandas as pd
import xarray as xr

from jointz.core.errors import DataError

_Span = tuple[float, float]


def share_table(table: pd.DataFrame, recordings: Sequence[xr.Dataset]) -> list[pd.DataFrame | None]:
    """Give every perturbed recording of a file its part of the file's pulse table."""
    perturbed = [k for k, r in enumerate(recordings) if r.attrs["condition"] == "perturbed"]
    spans = {k: _span(recordings[k]) for k in perturbed}
    perturbed.sort(key=lambda k: spans[k])
    in_order = [spans[k] for k in perturbed]
    file = str(recordings[0].attrs["file"])
    _check_clock(in_order, file)
    onsets = table["onset_s"].to_numpy(dtype=float)
    _check_onsets(onsets, in_order, file)
    starts = [begin for begin, _ in in_order]
    home = np.maximum(np.searchsorted(starts, onsets, side="right") - 1, 0)
    shares: list[pd.DataFrame | None] = [None] * len(recordings)
    for place, k in enumerate(perturbed):
        shares[k] = table[home == place]
    return shares


def _span(recording: xr.Dataset) -> _Span:
    time = recording["time"].to_numpy()
    return float(time[0]), float(time[-1])


def _check_clock(spans: Sequence[_Span], file: str) -> None:
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


def _check_onsets(onsets: np.ndarray, spans: Sequence[_Span], file: str) -> None:
    if onsets.size and not any(((begin <= onsets) & (onsets <= end)).any() for begin, end in spans):
        known = ", ".join(f"{begin:.6g} to {end:.6g} s" for begin, end in spans) or "there are none"
        raise DataError(
            f"{file}: all {onsets.size} onsets of its pulse table lie outside its perturbed "
            f"samples ({known}). Is it the right table, and does its clock start at the same zero?",
            path=file,
        )
