"""Pulses and positive directions of recordings, for export to other programs."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pandas as pd
import xarray as xr

from jointz.analysis.rate_checks import check_lengths, check_onsets
from jointz.core.channels import CHANNEL_UNITS
from jointz.core.errors import DataError
from jointz.core.study import RecordingSpec, Study
from jointz.identify.preparation.pulses import (
    Pulse,
    pulses_from_angle,
    pulses_from_command,
    pulses_from_table,
    with_measured_amplitudes,
)
from jointz.identify.preparation.triggers import pulses_from_trigger
from jointz.io.recordings import read_pulse_table

_MOST_SHOWN = 5
#: Channels without a direction.
_NO_DIRECTION = (
    "time",
    "ground_reaction_force",
    "contact",
    "trigger",
    "condition",
    "trial",
    "cycle",
)


def pulse_tables(
    study: Study, entry: RecordingSpec, pieces: Sequence[xr.Dataset]
) -> list[pd.DataFrame | None]:
    """Return the pulse table of each piece of a file, None if pulses have another source."""
    table = read_pulse_table(study, entry)
    if table is None or study.spec.perturbations.source not in (None, "table"):
        return [None] * len(pieces)
    check_onsets(study, entry, pieces, table)
    check_lengths(study, entry, pieces, table)
    return share_table(table, pieces)


def given_pulses(
    study: Study, recording: xr.Dataset, table: pd.DataFrame | None
) -> tuple[tuple[Pulse, ...], str]:
    """Return the pulses of a recording, and a note if some are missing."""
    settings = study.spec.perturbations
    condition = recording.attrs["condition"]
    if condition == "no_device":
        return (), ""
    if table is not None and settings.source in (None, "table"):
        pulses, note = _within(pulses_from_table(table), recording)
        return with_measured_amplitudes(pulses, recording), note
    if "command" in recording and settings.source in (None, "command"):
        return pulses_from_command(recording), ""
    if condition != "perturbed":
        return (), ""
    if "trigger" in recording and settings.source in (None, "trigger"):
        return pulses_from_trigger(recording), ""
    if settings.source == "angle":
        return pulses_from_angle(recording, cutoff_hz=settings.cutoff_hz), ""
    return (), (
        f"{recording.attrs['file']}: its pulses are detected by comparison with another recording; "
        "they are in pulses.csv of jointz analyze --tables, not here."
    )


def amplitude_unit(study: Study) -> str:
    """Return the unit of the amplitudes of a study's pulses."""
    return "rad" if study.spec.perturbations.source == "angle" else "N*m"


def positive_direction(study: Study, channel: str) -> str:
    """Return the positive direction, "" if the channel has none or it is unknown."""
    spec = study.spec.channels.get(channel)
    stated = spec is not None and spec.positive is not None
    if channel in _NO_DIRECTION or not (channel in CHANNEL_UNITS or stated):
        return ""
    return study.spec.positive


def _within(pulses: tuple[Pulse, ...], recording: xr.Dataset) -> tuple[tuple[Pulse, ...], str]:
    """Return the pulses of a table within the samples, and a note about the others."""
    time = recording["time"].to_numpy()
    inside = tuple(p for p in pulses if time[0] <= p.onset_s <= time[-1])
    outside = [f"{p.onset_s:g}" for p in pulses if p not in inside]
    if not outside:
        return inside, ""
    shown = ", ".join(outside[:_MOST_SHOWN]) + (", ..." if len(outside) > _MOST_SHOWN else "")
    return inside, (
        f"{recording.attrs['file']}: {len(outside)} pulse(s) of its table are outside its "
        f"perturbed samples and are excluded: onset {shown} s."
    )


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
