"""Pulses and positive directions of recordings, for export to other programs."""

from collections.abc import Sequence

import pandas as pd
import xarray as xr

from jointz.analysis.rate_checks import check_onsets
from jointz.core.channels import CHANNEL_UNITS
from jointz.core.study import RecordingSpec, Study
from jointz.identify.preparation.pulse_tables import share_table
from jointz.identify.preparation.pulses import (
    Pulse,
    pulses_from_angle,
    pulses_from_command,
    pulses_from_table,
    with_measured_amplitudes,
)
from jointz.io.recordings import read_pulse_table

_MOST_SHOWN = 5
#: Channels without a direction.
_NO_DIRECTION = ("time", "ground_reaction_force", "contact", "condition", "trial", "cycle")


def pulse_tables(
    study: Study, entry: RecordingSpec, pieces: Sequence[xr.Dataset]
) -> list[pd.DataFrame | None]:
    """Return the pulse table of each piece of a file, None if pulses have another source."""
    table = read_pulse_table(study, entry)
    if table is None or study.spec.perturbations.source not in (None, "table"):
        return [None] * len(pieces)
    check_onsets(study, entry, pieces, table)
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
    if settings.source == "angle":
        return pulses_from_angle(recording, cutoff_hz=settings.cutoff_hz), ""
    return (), (
        f"{recording.attrs['file']}: its pulses are detected by comparison with another recording; "
        "they are in pulses.csv of jointz analyze, not here."
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
