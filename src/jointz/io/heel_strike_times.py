"""Heel strikes that a file lists as times, samples or events."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from jointz.core.channels import HEEL_STRIKES
from jointz.core.errors import UnitError
from jointz.core.study import ChannelSpec, FilesSpec, RecordingSpec, Study
from jointz.core.units import conversion
from jointz.io.column_units import SAMPLE
from jointz.io.formats.columns import file_error, missing_columns
from jointz.io.formats.registry import list_columns, read_acquisition, read_table
from jointz.io.pulse_tables import agreed_unit, times_of_samples, unit_in
from jointz.io.study_files import named_as_written

#: Beginnings of the name of a column of heel strikes.
_NAMES = ("heelstrike", "strike", "time", "sample")


def read_heel_strikes(study: Study, entry: RecordingSpec, time_s: np.ndarray) -> np.ndarray | None:
    """Return the number of heel strikes up to each sample, (n,); None where no file lists them."""
    channel = study.spec.channels.get(HEEL_STRIKES)
    if channel is None and entry.heel_strikes is None:
        return None
    file = entry.heel_strikes or entry.file
    with named_as_written(study.root, file) as path:
        values, unit = _listed(study, entry, path, channel)
        strike_s = (
            times_of_samples(path, HEEL_STRIKES, values, study.spec, time_s)
            if unit == SAMPLE
            else values * _seconds(path, unit)
        )
        inside = (strike_s >= time_s[0]) & (strike_s <= time_s[-1])
        if not inside.any():
            span = (
                f"from {strike_s.min():.6g} to {strike_s.max():.6g} s" if strike_s.size else "none"
            )
            raise file_error(
                path,
                f"expected heel strikes between {time_s[0]:.6g} and {time_s[-1]:.6g} s, the "
                f"samples of {entry.file}; found {span}. Correct their unit or clock.",
                channel=HEEL_STRIKES,
            )
    return np.searchsorted(np.sort(strike_s), time_s, side="right").astype(float)


def _listed(
    study: Study, entry: RecordingSpec, path: Path, channel: ChannelSpec | None
) -> tuple[np.ndarray, str]:
    """Return what a file lists, without the missing values that pad a column, and its unit."""
    files = study.spec.files
    if entry.heel_strikes is not None:
        files = FilesSpec(encoding=files.encoding)
    names = list_columns(path, files)
    column = _column(path, channel, names)
    if channel is not None and names is not None and column not in names:
        return _events(path, column, entry.side, names, files), "s"
    table = read_table(path, numeric=[column], files=files)
    values = np.asarray(table.columns[str(column)], dtype=float)
    given = channel.unit if channel is not None else None
    stated = table.units.get(str(column)) or unit_in(str(column))
    unit = agreed_unit(path, str(column), given, stated, "s") or "s"
    return values[np.isfinite(values)], unit


def _column(path: Path, channel: ChannelSpec | None, names: list[str] | None) -> str | int:
    if channel is not None:
        return channel.column
    likely = names or []
    if len(likely) > 1:
        plain = {name: name.casefold().replace("_", "").replace(" ", "") for name in likely}
        likely = [n for n in likely if plain[n].startswith(_NAMES)]
    if len(likely) == 1:
        return likely[0]
    raise file_error(
        path,
        f"expected one column of heel strikes, found {', '.join(names or []) or 'none'}. Name it: "
        f'[channels.{HEEL_STRIKES}] column = "COLUMN".',
    )


def _events(
    path: Path, label: str | int, side: str | None, names: Sequence[str], files: FilesSpec
) -> np.ndarray:
    """Return the times of the events of a label, alone or behind the recording's side, s."""
    events = read_acquisition(path, files).events
    labels = {str(label).casefold(), f"{side} {label}".casefold()}
    times = [event.time_s for event in events if event.label.casefold() in labels]
    if not times:
        known = dict.fromkeys(event.label for event in events)
        raise missing_columns(path, [str(label)], [*names, *known])
    return np.array(times)


def _seconds(path: Path, unit: str) -> float:
    try:
        return conversion(unit, "s")[0]
    except UnitError as exc:
        raise file_error(path, f"{exc} Or give {SAMPLE!r}.", channel=HEEL_STRIKES) from exc
