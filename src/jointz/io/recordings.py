"""Read the recordings of a study into SI, the study's direction and one condition each."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from jointz.core.channels import (
    CONDITIONS,
    DEVICE_SIDE_CHANNELS,
    HEEL_STRIKES,
    LABEL_CHANNELS,
    MOTION_SENSORS,
    MOTOR_CHANNELS,
    is_turned,
)
from jointz.core.errors import DataError, UnitError
from jointz.core.recording import build_recording, deflection
from jointz.core.study import ChannelSpec, FilesSpec, RecordingSpec, Study, StudySpec, name_problem
from jointz.core.units import conversion
from jointz.io.clocks import ClockedSamples, ClockSource, clock_sources, on_one_clock
from jointz.io.column_units import SAMPLE, stated_unit, unit_in_study
from jointz.io.formats.columns import RawTable, check_samples, file_error, missing_columns
from jointz.io.formats.registry import list_columns, read_acquisition, read_table
from jointz.io.pulse_tables import agreed_unit, read_pulses, times_of_samples, unit_in
from jointz.io.study_files import (
    named_as_written,
    needed_channels,
    study_of_recording,
    trigger_threshold,
)
from jointz.io.text.clock_times import CLOCK_TEXT, seconds_of_clock
from jointz.io.text.delimited import is_number

_FULL_TURN_RAD = 2 * np.pi
_RATE_TOLERANCE = 0.05


@dataclass(frozen=True, slots=True, repr=False)
class StudyRecording:
    """One recording of an opened study; ``spec`` is its entry in ``study.toml``."""

    study: Study
    spec: RecordingSpec

    def read(self) -> tuple[xr.Dataset, ...]:
        """Read the samples: one dataset a condition and trial, see :func:`read_recording`."""
        return read_recording(self.study, self.spec)

    def read_pulses(self) -> pd.DataFrame | None:
        """Read the pulse table; None without one."""
        return read_pulse_table(self.study, self.spec)

    def __repr__(self) -> str:
        spec = self.spec
        cell = (spec.participant, spec.condition, spec.session, spec.side)
        return f"<recording {spec.file!r}: {', '.join(filter(None, cell))}>"


def read_recording(study: Study, entry: RecordingSpec) -> tuple[xr.Dataset, ...]:
    """Read one recording; a file of several conditions or trials gives several.

    Parameters
    ----------
    study : Study
        The opened study.
    entry : RecordingSpec
        One of its recordings.

    Returns
    -------
    tuple of xarray.Dataset
        One a contiguous run of condition and trial, in the order of the file,
        in SI units, positive in the study's direction, torque on the joint.

    Raises
    ------
    DataError
        When the file cannot be trusted; names file, row or channel.
    """
    study = study_of_recording(study, entry)
    parts = [part for source in clock_sources(study, entry) for part in _samples(source, entry)]
    if not parts:
        raise DataError(f"{entry.file}: it has no channel of numbers. Name one under [channels].")
    samples, steps = on_one_clock(parts)
    strikes = read_heel_strikes(study, entry, samples.time_s)
    if strikes is not None:
        samples = replace(samples, channels={**samples.channels, HEEL_STRIKES: strikes})
    pieces = _split(samples.labels, samples.time_s.size)
    history = (*samples.table.history, *steps)
    return tuple(_piece(study, entry, samples, rows, history=history) for rows in pieces)


def _samples(source: ClockSource, entry: RecordingSpec) -> Iterator[ClockedSamples]:
    """Read channels of a file; where the file itself knows of several clocks, by these."""
    study, spec = source.study, source.study.spec
    columns = {n: spec.channels[n].column for n in ("time", *source.names) if n in spec.channels}
    needed = needed_channels(columns, entry.condition, moments_only=spec.moments_only)
    labels = [name for name in LABEL_CHANNELS if name in needed]
    numeric = [name for name in needed if name not in (*LABEL_CHANNELS, HEEL_STRIKES)]
    # A time of day is text in the file, and a number from here on.
    clocks = [n for n in numeric if n == "time" and spec.channels[n].unit == CLOCK_TEXT]
    with named_as_written(study.root, source.file) as path:
        numeric = _without_absent_sensors(spec, path, numeric)
        if not labels and set(numeric) <= {"time"}:
            return
        table = read_table(
            path,
            numeric=[columns[n] for n in numeric if n not in clocks],
            labels=[columns[n] for n in (*labels, *clocks)],
            files=spec.files,
            from_zero=_counts_from_zero(spec),
            several_clocks=True,
        )
        seconds = {
            str(columns[n]): seconds_of_clock(table.columns[str(columns[n])]) for n in clocks
        }
        table = replace(table, columns={**table.columns, **seconds})
        check_samples(path, table)
        _check_labels(path, table, columns, labels)
    text = {n: np.asarray(table.columns[str(columns[n])]) for n in labels}
    read = [n for n in numeric if str(columns[n]) in table.columns]
    converted = {n: _in_si(source, entry, n, table) for n in read}
    clocks_of_file = list(_by_clock(table, {n: str(columns[n]) for n in (*read, *labels)}))
    several = len(clocks_of_file) > 1
    for names, own_s in clocks_of_file:
        channels = {n: values for n, (values, _) in converted.items() if n in names}
        timed = own_s is not None or "time" in names or not (several or "time" in read)
        if not (timed or ("time" not in read and _has_rate(spec, names))):
            raise _without_clock(source.file, [str(columns[n]) for n in names])
        n_samples = len(table.columns[str(columns[names[0]])])
        time_s = _whole_time(spec, source.file, channels, own_s, n_samples, several=several)
        if (source.offset_s, source.rate) != (0.0, 1.0):
            time_s = source.offset_s + source.rate * time_s
        yield ClockedSamples(
            source=source,
            table=table,
            time_s=time_s,
            channels={n: values for n, values in channels.items() if n != "time"},
            units={n: unit for n, (_, unit) in converted.items() if n in names},
            labels={n: text[n] for n in labels if n in names},
        )


def _by_clock(
    table: RawTable, columns: Mapping[str, str]
) -> Iterator[tuple[list[str], np.ndarray | None]]:
    """Yield the channels that share a clock, with its times where the file knows them."""
    clocks = {name: table.clocks.get(column) for name, column in columns.items()}
    for key in dict.fromkeys(map(id, clocks.values())):
        names = [name for name, clock in clocks.items() if id(clock) == key]
        if names != ["time"]:
            yield names, clocks[names[0]]


def _counts_from_zero(spec: StudySpec) -> bool:
    """Return whether columns count from 0: one of them is 0, be it needed or not."""
    zeros: set[str | int] = {0} if spec.files.header else {0, "0"}
    return any(channel.column in zeros for channel in spec.channels.values())


def _without_absent_sensors(spec: StudySpec, path: Path, numeric: list[str]) -> list[str]:
    """Return channels without encoder and gyroscopes that this file does not have."""
    optional = {n: str(spec.channels[n].column) for n in numeric if n in MOTION_SENSORS}
    there = list_columns(path, spec.files) if optional and spec.files.header else None
    if there is None:
        return numeric
    return [n for n in numeric if n not in optional or optional[n] in there]


def read_pulse_table(study: Study, entry: RecordingSpec) -> pd.DataFrame | None:
    """Read the pulses of a recording from its pulse table, None where it has none."""
    if entry.perturbations is None:
        return None
    times = partial(_times_of_samples, study, entry)
    return read_pulses(study_of_recording(study, entry), entry, times)


def _times_of_samples(study: Study, entry: RecordingSpec) -> np.ndarray:
    """Return the times of all samples of a recording, s."""
    return np.concatenate([piece["time"].to_numpy() for piece in read_recording(study, entry)])


def _check_labels(
    path: Path, table: RawTable, columns: Mapping[str, str | int], labels: Sequence[str]
) -> None:
    """Refuse labels that cannot stand in a table; a number, however signed, can."""
    for column in (str(columns[name]) for name in labels):
        for label in dict.fromkeys(table.columns[column].tolist()):
            if not is_number(label) and (problem := name_problem(label)):
                raise file_error(path, f"{label!r} {problem}. Rename it.", channel=column)


def _in_si(
    source: ClockSource, entry: RecordingSpec, name: str, table: RawTable
) -> tuple[np.ndarray, str]:
    """Convert one column to SI, the study's direction and torque on the joint."""
    spec = source.study.spec
    channel = spec.channels[name]
    unit = unit_in_study(spec, entry, (name, channel), table.units, file=source.file)
    values = np.asarray(table.columns[str(channel.column)], dtype=float)
    return unit.in_si(values, inverted=_sign_is_inverted(name, spec)), unit.si_unit


def _sign_is_inverted(name: str, spec: StudySpec) -> bool:
    """Whether a channel's sign is opposite to the study's."""
    direction = spec.channels[name].positive
    if direction is None and name in MOTOR_CHANNELS and "current" in spec.channels:
        # Current, velocity and friction of a motor change sign together.
        direction = spec.channels["current"].positive
    on_device = name in DEVICE_SIDE_CHANNELS and spec.torque_acts_on == "device"
    return is_turned(direction, spec.positive, on_device=on_device)


def _split(labels: Mapping[str, np.ndarray], n: int) -> list[slice]:
    """Cut at every change of condition or trial; cycles do not cut."""
    changes = np.zeros(max(n - 1, 0), dtype=bool)
    for name, values in labels.items():
        if name != "cycle":
            changes |= values[1:] != values[:-1]
    cuts = [0, *(np.flatnonzero(changes) + 1).tolist(), n]
    return [slice(a, b) for a, b in pairwise(cuts)]


def _piece(
    study: Study,
    entry: RecordingSpec,
    samples: ClockedSamples,
    rows: slice,
    *,
    history: tuple[dict[str, object], ...],
) -> xr.Dataset:
    spec, table = study.spec, samples.table
    data = {name: values[rows] for name, values in samples.channels.items()}
    labels = {name: texts[rows] for name, texts in samples.labels.items()}
    if "cycle" in labels:
        data["cycle"] = pd.factorize(labels["cycle"])[0].astype(float)
    contact, trial = spec.channels.get("contact"), ""
    if "trial" in labels:
        value = str(labels["trial"][0])
        trial = (spec.channels["trial"].values or {}).get(value, value)  # noqa: PD011 - a field
    recording = build_recording(
        samples.time_s[rows],
        data,
        units={name: samples.units[name] for name in data if name in samples.units},
        first_row=table.first_row + rows.start,
        history=(*history, _reading_step(study, entry, table, samples.units)),
        participant=entry.participant,
        condition=entry.condition or _condition(spec, entry, str(labels["condition"][0])),
        file=entry.label,
        session=entry.session or "",
        trial=trial,
        side=entry.side or "",
        joint=spec.joint,
        positive=spec.positive,
        contact_kind=(contact.kind or "contact") if contact else "",
        trigger_threshold=trigger_threshold(spec),
        sha256=table.sha256,
    )
    _check_angle(entry, recording, bench=spec.kind == "bench")
    return recording


def _has_rate(spec: StudySpec, names: Sequence[str]) -> bool:
    """Return whether sample_rate_hz is that of channels beside others that the file times."""
    return bool(spec.sample_rate_hz) and not {"torque", "current"}.isdisjoint(names)


def _without_clock(file: str, columns: Sequence[str]) -> DataError:
    return DataError(
        f"{file}: {', '.join(columns)}: expected one time stamp for each sample, found none or "
        "another number of them. Give the channel a time of its own: a column of as many stamps, "
        "or rate_hz.",
        path=file,
        channel=columns[0],
    )


def _whole_time(
    spec: StudySpec,
    file: str,
    channels: Mapping[str, np.ndarray],
    own_s: np.ndarray | None,
    n_samples: int,
    *,
    several: bool,
) -> np.ndarray:
    """Return the times of all samples of a clock, s: stamps, the clock of the file, or a rate.

    A rate that is given is no file's of several clocks.
    """
    declared = spec.sample_rate_hz
    if "time" not in channels:
        if own_s is not None:
            if several or not declared:
                return own_s
            _check_rate(file, own_s, declared, "by its own clock it runs at", "Correct the rate")
        # On the file's own clock, so that an onset of a pulse table falls into one piece.
        return np.arange(n_samples) / float(declared or 1.0)
    time = channels["time"]
    if declared:
        _check_rate(file, time, declared, "the time column runs at", "Correct the unit of time")
    return time


def _check_rate(file: str, time: np.ndarray, declared: float, what: str, remedy: str) -> None:
    """Refuse a rate that is not that of the stamps."""
    steps = np.diff(time)
    steps = steps[np.isfinite(steps)]
    step = float(np.median(steps)) if steps.size else 0.0
    if step > 0 and abs(step * declared - 1) > _RATE_TOLERANCE:
        raise DataError(
            f"{file}: {what} {1 / step:.6g} Hz, sample_rate_hz (or rate_hz) says {declared:.6g}. "
            f"{remedy}, or remove the rate.",
            path=file,
            channel="time",
        )


def _condition(spec: StudySpec, entry: RecordingSpec, value: str) -> str:
    mapping = spec.channels["condition"].values or {}  # noqa: PD011 - a field, not a frame
    name = CONDITIONS.get(mapping.get(value, value).lower())
    if name is None:
        raise DataError(
            f"{entry.file}: column '{spec.channels['condition'].column}' holds '{value}', which "
            f"channels.condition.values does not name (it names {', '.join(mapping) or 'none'}). "
            "Name it there, or correct the file.",
            path=entry.file,
            channel="condition",
        )
    return name


def _reading_step(
    study: Study, entry: RecordingSpec, table: RawTable, si_units: Mapping[str, str]
) -> dict[str, object]:
    names = si_units.keys() - entry.joined_channels.keys()
    channels = {n: c for n, c in study.spec.channels.items() if n in names}
    return {
        "step": "read",
        "file": entry.file,
        "sha256": table.sha256,
        "units": {
            n: c.unit or stated_unit(n, str(c.column), table.units) or si_units[n]
            for n, c in channels.items()
        },
        "factors": {n: c.factor for n, c in channels.items() if c.factor != 1.0},
        "turned": [name for name in channels if _sign_is_inverted(name, study.spec)],
    }


def _check_angle(entry: RecordingSpec, recording: xr.Dataset, *, bench: bool) -> None:
    """Refuse an angle no joint has: most likely degrees declared as rad."""
    # The two sides of a bench may turn for ever, together.
    angle = deflection(recording) if bench else recording["angle"].to_numpy()
    finite = angle[np.isfinite(angle)]
    if finite.size and np.ptp(finite) > _FULL_TURN_RAD:
        raise DataError(
            f"{entry.file}: the joint's angle spans {np.rad2deg(np.ptp(finite)):.0f} deg, more "
            "than a full turn. Is its unit right in study.toml (deg declared as rad?)",
            path=entry.file,
            channel="angle",
        )


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
            ends = f"from {strike_s.min():.6g} to {strike_s.max():.6g} s" if strike_s.size else ""
            raise file_error(
                path,
                f"expected heel strikes between {time_s[0]:.6g} and {time_s[-1]:.6g} s, the "
                f"samples of {entry.file}; found {ends or 'none'}. Correct their unit or clock.",
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
