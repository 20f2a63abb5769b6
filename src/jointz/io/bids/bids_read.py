"""Read the recordings of a Motion-BIDS folder.

Each ``*_motion.tsv`` becomes one acquisition with the names and units of its ``*_channels.tsv``,
the rate of its sidecar and the events of its ``*_events.tsv``. Sidecars further up are honoured,
the nearest one over the others. :mod:`jointz.conversion.bids_study` writes such folders.
"""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from jointz.core.acquisition import Acquisition, Event, Signal, SignalGroup
from jointz.core.errors import DataError
from jointz.io.bids.bids_tables import (
    NOTHING,
    cell_number,
    entities_of,
    number,
    read_samples,
    read_tsv,
)
from jointz.io.formats.columns import file_error
from jointz.io.small_files import read_json
from jointz.io.text.column_names import READING

DESCRIPTION = "dataset_description.json"
#: Key of ``channels.json`` under which jointz says what BIDS has no keys for: sidecars of
#: recordings may hold none but their own.
OWN = "Recording"
#: Keys in there: time of the first sample, and the channel of the exact clock.
CLOCK_START, CLOCK_CHANNEL = "ClockStart", "ClockChannel"
#: And how many samples and events there are, by which a file that was cut off is known.
SAMPLE_COUNT, EVENT_COUNT = "SampleCount", "EventCount"
_NOMINAL, _EFFECTIVE = "SamplingFrequency", "SamplingFrequencyEffective"
_OWN_EVENT_COLUMNS = ("onset", "duration", "trial_type")
_ENTITY_KEYS = {"sub": "subject.id", "ses": "session", "acq": "acquisition"}
#: Keys of a sidecar by which a study tells its recordings, and what they are called here.
_TOLD = {
    "Joint": "joint",
    "Side": "side",
    "Condition": "condition",
    "Trial": "trial",
    "PositiveDirection": "positive",
    "TorqueActsOn": "torque_acts_on",
    "Coupling": "coupling",
}
#: A recording may miss a sample of what its sidecar says, for rounding.
_SAMPLES_OFF = 1.5


@dataclass(frozen=True, slots=True)
class _Channel:
    """A row of ``channels.tsv``."""

    name: str
    kind: str  # type in BIDS, in capitals, such as ``JNTANG``
    unit: str  # as in the table, with ``*`` for a product
    description: str
    positive: str | None  # positive direction; "" for ``n/a``, None without this column


def read_bids(
    folder: str | os.PathLike[str], *, recording: str | None = None
) -> dict[str, Acquisition]:
    """Read all motion recordings of a BIDS folder, or one of them.

    Parameters
    ----------
    folder : path
        The folder that holds ``dataset_description.json``.
    recording : str, optional
        Name of one, such as ``sub-S01_task-walking_tracksys-knee``, with or without what follows.

    Returns
    -------
    dict of str to Acquisition
        Name of the file without ``_motion.tsv`` -> what it holds: one group of signals, events on
        its clock, and metadata of file name, sidecar and participant.

    Raises
    ------
    DataError
        Naming file, row and cause where something is missing or damaged.
    """
    root = Path(folder)
    if not (root / DESCRIPTION).is_file():
        raise DataError(
            f"{root}: no {DESCRIPTION}; expected a BIDS folder. Give the folder that holds it.",
            path=str(root),
        )
    _read_json(root / DESCRIPTION)
    files = sorted(root.glob("sub-*/**/motion/*_motion.tsv"))
    names = {file.name.removesuffix("_motion.tsv"): file for file in files}
    if recording is not None:
        name_wanted = Path(recording).name.split(".")[0].removesuffix("_motion")
        names = {name: file for name, file in names.items() if name == name_wanted}
    if not names:
        what = f"recording '{recording}'" if recording else "*_motion.tsv"
        shown = ", ".join(f.name for f in files[:5]) or "none"
        raise DataError(
            f"{root}: no {what} in the motion folders; it has: {shown}. Correct the name, or give "
            "another folder.",
            path=str(root),
        )
    people, people_end = _people(root)
    return {name: _acquisition(root, file, people, people_end) for name, file in names.items()}


def _people(root: Path) -> tuple[dict[str, dict[str, str]], str]:
    """Return the row of every participant, and a note on the end of their table."""
    table = root / "participants.tsv"
    if not table.is_file():
        return {}, ""
    content = read_tsv(table, ("participant_id",))
    rows = {row["participant_id"]: row for row in content.rows}
    if not rows:
        raise DataError(
            "participants.tsv: expected a row for each participant, found none. Copy it again.",
            path=str(table),
        )
    return rows, content.end_note


def _person(
    root: Path, entities: Mapping[str, str], people: Mapping[str, Mapping[str, str]]
) -> Mapping[str, str]:
    """Return the row of who was recorded; a table of participants lists everybody."""
    name = f"sub-{entities.get('sub', '')}"
    if people and name not in people:
        raise DataError(
            f"participants.tsv: no row for {name}, of whom there is a recording; it has: "
            f"{', '.join(list(people)[:5])}. Add the row, or copy the file again.",
            path=str(root / "participants.tsv"),
        )
    return people.get(name, {})


def _acquisition(
    root: Path, file: Path, people: Mapping[str, Mapping[str, str]], people_end: str
) -> Acquisition:
    entities = entities_of(file.name)
    sidecar_file, sidecar = _sidecar(root, file)
    channels_file, channels, channels_end = _channels(root, file)
    samples = read_samples(file, len(channels), named_in=channels_file.name)
    rate, rate_note = _rate(sidecar_file, sidecar)
    _check_duration(file, sidecar, n_samples=len(samples), rate_hz=rate)
    start = _start(sidecar_file, sidecar)
    clock, clock_note = _clock_column(file, channels, sidecar, samples)
    time = None if clock is None else samples[:, clock]
    latency = [k for k, c in enumerate(channels) if c.kind == "LATENCY"]
    dropped = {clock, *(latency if sidecar.get(CLOCK_CHANNEL) else [])}
    signals = tuple(
        Signal(c.name, np.ascontiguousarray(samples[:, k]), c.unit, c.description)
        for k, c in enumerate(channels)
        if k not in dropped
    )
    group = SignalGroup(
        "",
        signals,
        rate_hz=rate if time is None else None,
        start_s=start if time is None else 0.0,
        time_s=None if time is None else np.ascontiguousarray(time),
    )
    zero = start if time is None or sidecar.get(CLOCK_CHANNEL) else float(time[0])
    person = _person(root, entities, people)
    metadata = _metadata(file, entities, sidecar, person)
    metadata |= {f"positive.{c.name}": c.positive for c in channels if c.positive is not None}
    events, events_end = _events(root, file, zero, sidecar.get(EVENT_COUNT))
    notes = {
        "clock": clock_note,
        "rate": rate_note if time is None else "",
        "end": " ".join(filter(None, (people_end, channels_end, events_end))),
    }
    metadata |= {f"{READING}{name}": note for name, note in notes.items() if note}
    return Acquisition((group,), events, metadata)


# --- files that belong to a recording -----------------------------------------------------------


def _belonging(root: Path, file: Path, ending: str) -> list[Path]:
    """Return the files of one kind that apply to a recording, the farthest first."""
    entities = entities_of(file.name).items()
    folders = [folder for folder in (*reversed(file.parents),) if folder.is_relative_to(root)]
    paths = []
    for folder in folders:
        fitting = [
            path for path in folder.glob(f"*{ending}") if entities_of(path.name).items() <= entities
        ]
        paths += sorted(fitting, key=lambda path: len(entities_of(path.name)))
    return paths


def _read_json(path: Path) -> dict[str, Any]:
    return read_json(path, "Correct it, or copy it again.", finite=False)


def _sidecar(root: Path, file: Path) -> tuple[Path, dict[str, Any]]:
    files = _belonging(root, file, "_motion.json")
    if not files:
        raise file_error(
            file, "no sidecar *_motion.json says its rate. Bring the file that belongs to it."
        )
    content: dict[str, Any] = {}
    for path in files:
        content |= _read_json(path)
    for path in _belonging(root, file, "_channels.json"):
        extra = _read_json(path).get(OWN, {})
        if not isinstance(extra, dict):
            raise file_error(path, f"key '{OWN}': expected an object, found {extra!r}. Correct it.")
        content |= extra
    return files[-1], content


def _channels(root: Path, file: Path) -> tuple[Path, tuple[_Channel, ...], str]:
    """Return the table of channels, what it says, and a note on its end."""
    files = _belonging(root, file, "_channels.tsv")
    if not files:
        raise file_error(
            file, "no *_channels.tsv names its columns. Bring the file that belongs to it."
        )
    table = read_tsv(files[-1], ("name", "type", "units"))
    names = [row["name"] for row in table.rows]
    repeated = sorted({name for name in names if names.count(name) > 1})
    if not all(names) or repeated:
        what = f"'{repeated[0]}' more than once" if repeated else "a row without a name"
        raise file_error(
            files[-1], f"expected a name of its own for each channel, found {what}. Correct it."
        )
    channels = tuple(
        _Channel(
            row["name"],
            row["type"].upper(),
            row["units"].replace(".", "*"),  # BIDS writes N.m
            row.get("description", ""),
            row.get("positive_direction"),
        )
        for row in table.rows
    )
    return files[-1], channels, table.end_note


def _rate(file: Path, sidecar: Mapping[str, Any]) -> tuple[float, str]:
    """Return the rate of the samples, and a note where it is not the one that was set.

    What jointz wrote has the exact rate in ``SamplingFrequency``; of others that is what their
    device was told to do, and the effective one what it did.
    """
    nominal = number(file, sidecar, _NOMINAL)
    if SAMPLE_COUNT in sidecar or sidecar.get(_EFFECTIVE) in (None, NOTHING):
        return nominal, ""
    rate = number(file, sidecar, _EFFECTIVE)
    if rate == nominal:
        return rate, ""
    return rate, f"the clock runs at {_EFFECTIVE}, {rate:g} Hz; {_NOMINAL} is {nominal:g} Hz"


def _check_duration(
    file: Path, sidecar: Mapping[str, Any], *, n_samples: int, rate_hz: float
) -> None:
    seconds = sidecar.get("RecordingDuration")
    count = sidecar.get(SAMPLE_COUNT)
    if isinstance(count, int):
        _check_count(file, n_samples, count, "samples")
    elif isinstance(seconds, int | float) and not isinstance(seconds, bool):
        expected = seconds * rate_hz
        if abs(expected - n_samples) > max(_SAMPLES_OFF, 0.01 * expected):
            raise file_error(
                file,
                f"expected {expected:.0f} samples ({seconds:g} s at {rate_hz:g} Hz by its "
                f"sidecar), found {n_samples}. Copy it again, or correct RecordingDuration.",
            )


def _check_count(file: Path, found: int, expected: int, what: str) -> None:
    if found != expected:
        raise file_error(
            file,
            f"expected {expected} {what}, as *_channels.json says under {OWN}, found {found}: it "
            "was cut off or changed. Copy it again.",
        )


def _start(file: Path, sidecar: Mapping[str, Any]) -> float:
    value = sidecar.get(CLOCK_START, 0.0)
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
        raise file_error(
            file, f"key '{CLOCK_START}': expected a number of seconds, found {value!r}. Correct it."
        )
    return float(value)


def _clock_column(
    file: Path, channels: tuple[_Channel, ...], sidecar: Mapping[str, Any], samples: np.ndarray
) -> tuple[int | None, str]:
    """Return the channel that holds time stamps, None for an even clock; and why none does."""
    named = sidecar.get(CLOCK_CHANNEL)
    if named is not None:
        columns = [k for k, c in enumerate(channels) if c.name == named]
        if not columns or not _increases(samples[:, columns[0]]):
            raise file_error(
                file,
                f"expected channel {named!r} to hold increasing time stamps, as its sidecar says "
                f"under {CLOCK_CHANNEL}. Correct one of them.",
            )
        return columns[0], ""
    latency = [k for k, c in enumerate(channels) if c.kind == "LATENCY"]
    if not latency:
        return None, ""
    names = ", ".join(f"'{channels[k].name}'" for k in latency)
    note = f"channel {names} of type LATENCY is not taken for the clock: "
    if len(latency) > 1:
        return None, f"{note}expected one"
    (only,) = latency
    if channels[only].unit not in ("s", ""):
        return None, f"{note}it is in '{channels[only].unit}', expected s"
    if not _increases(samples[:, only]):
        return None, f"{note}it does not increase from sample to sample"
    return only, ""


def _increases(stamps: np.ndarray) -> bool:
    return bool(np.isfinite(stamps).all() and (np.diff(stamps) > 0).all())


# --- events and what else is said ---------------------------------------------------------------


def _events(root: Path, file: Path, zero_s: float, count: Any) -> tuple[tuple[Event, ...], str]:
    """Return the events by time, and a note on the end of their table."""
    files = _belonging(root, file, "_events.tsv")
    if not files:
        if count:
            _check_count(file.with_name(file.name.replace("_motion", "_events")), 0, count, "rows")
        return (), ""
    table = read_tsv(files[-1], ("onset", "duration"), whole=not isinstance(count, int))
    if isinstance(count, int):
        _check_count(files[-1], len(table.rows), count, "rows")
    events = []
    for row, cells in enumerate(table.rows, start=2):
        onset = cell_number(files[-1], row, "onset", cells["onset"])
        length = cell_number(files[-1], row, "duration", cells["duration"], default=np.nan)
        events.append(Event(zero_s + onset, _event_label(cells), length))
    return tuple(sorted(events, key=lambda event: event.time_s)), table.end_note


def _event_label(cells: Mapping[str, str]) -> str:
    """Return what an event is, with all that further columns say of it."""
    more = [
        f"{name}={value}"
        for name, value in cells.items()
        if value and name not in _OWN_EVENT_COLUMNS
    ]
    return " ".join([cells.get("trial_type") or "event", *more])


def _metadata(
    file: Path,
    entities: Mapping[str, str],
    sidecar: Mapping[str, Any],
    person: Mapping[str, str],
) -> dict[str, str]:
    metadata = {"bids.file": file.name}
    metadata |= {_ENTITY_KEYS.get(name, name): value for name, value in entities.items()}
    metadata |= {
        f"subject.{name}": value
        for name, value in person.items()
        if value and name != "participant_id"
    }
    for key, value in sidecar.items():
        if key not in (CLOCK_START, CLOCK_CHANNEL, SAMPLE_COUNT, EVENT_COUNT, "Description"):
            text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
            metadata[_TOLD.get(key, f"sidecar.{key}")] = text
    return metadata
