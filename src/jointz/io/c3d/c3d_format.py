"""C3D: trajectories of points, analog channels at a rate of their own, and events."""

import json
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jointz.core.acquisition import Acquisition, Event, Signal, SignalGroup
from jointz.core.study import FilesSpec
from jointz.io.c3d.c3d_frames import SAME, SATURATED, Source, single, take_frames
from jointz.io.c3d.c3d_parameters import BLOCK, Values, read_parameters
from jointz.io.formats.group_format import GroupFormat
from jointz.io.text.column_names import READING, distinct_names, padded

_AXES = ("x", "y", "z")
_CELLS = tuple(f"r{i}{j}" for j in range(1, 5) for i in range(1, 5))  # column by column
_LOWEST_WORD = -0x8000
_FLOATS_OF_A_ROTATION = 17  # a matrix of 4 x 4, and how reliable it is


class C3dFormat(GroupFormat):
    """Points and analog channels, rotations where there are any, events and parameters."""

    name = "C3D"

    def read(self, path: Path, files: FilesSpec) -> Acquisition:  # noqa: ARG002
        """Return the groups ``points``, ``analogs`` and ``rotations`` of a file.

        A point gives three signals, ``LABEL.x``, ``.y`` and ``.z``, NaN where it was not seen
        (its residual is negative). Units are those of the file; other parameters are metadata
        by their names in lower case, several values as in JSON.
        """
        content = path.read_bytes()
        file = Source(path, content, *read_parameters(path, content))
        frames = take_frames(file)
        start_s = frames.first / file.rate_hz if file.rate_hz > 0 else 0.0
        groups = [_points(file, frames.points, start_s), _analogs(file, frames.analogs, start_s)]
        groups.append(_rotations(file, len(frames.points), start_s))
        events, event_notes = read_events(file)
        metadata = metadata_of({**file.parameters.values, **event_notes}) | _remarks(file)
        return Acquisition(tuple(g for g in groups if g), events, metadata)


def _remarks(file: Source) -> dict[str, str]:
    """Return remarks on what looks odd about a file."""
    parameters, header = file.parameters, file.header
    remarks = dict(file.notes)
    if not math.isclose(file.rate_hz, header.rate_hz, rel_tol=SAME):
        remarks["rate"] = f"The header says {header.rate_hz:g} Hz; POINT:RATE holds."
    if parameters.unread:
        remarks["parameters"] = f"{parameters.unread} bytes behind the last parameter are not read."
    counts = {"POINT.LABELS": file.n_points, "ANALOG.LABELS": file.n_channels}
    for name, count in counts.items():
        n_labels = len(parameters.texts(name))
        if n_labels < count:
            remarks[name.lower()] = f"{count - n_labels} of {count} have no label and are counted."
    return {f"{READING}{key}": text for key, text in remarks.items()}


def _points(file: Source, frames: np.ndarray, start_s: float) -> SignalGroup | None:
    if not file.n_points:
        return None
    stated = padded(file.parameters.texts("POINT.LABELS"), file.n_points)
    labels = distinct_names(stated, file.n_points, "point")
    notes = padded(file.parameters.texts("POINT.DESCRIPTIONS"), file.n_points)
    units = _point_units(file, stated)
    factor = 1.0 if file.in_floats else file.scale
    values = np.where(frames[:, :, 3:] < 0, np.nan, frames[:, :, :3] * factor)
    signals = [
        Signal(f"{label}.{axis}", np.ascontiguousarray(values[:, i, j]), unit, note)
        for i, (label, unit, note) in enumerate(zip(labels, units, notes, strict=True))
        for j, axis in enumerate(_AXES)
    ]
    return SignalGroup("points", tuple(signals), *_clock(file.rate_hz, start_s))


def _analogs(file: Source, samples: np.ndarray, start_s: float) -> SignalGroup | None:
    parameters, n = file.parameters, file.n_channels
    if not n:
        return None
    offsets, factors = _offsets(file), _factors(file)
    # Words from 32768 on, and offsets that look negative, are no negative numbers.
    if "UNSIGNED" in [text.upper() for text in parameters.texts("ANALOG.FORMAT")]:
        samples = samples if file.in_floats else samples & SATURATED
        offsets = np.where(offsets < 0, offsets + SATURATED + 1, offsets)
    else:
        offsets = _unsigned_all_the_same(file, samples, offsets)
    with np.errstate(over="ignore", invalid="ignore"):
        values = (samples - offsets) * factors
    names = distinct_names(parameters.texts("ANALOG.LABELS"), n, "analog")
    units = padded(parameters.texts("ANALOG.UNITS"), n)
    notes = padded(parameters.texts("ANALOG.DESCRIPTIONS"), n)
    signals = [
        Signal(name, np.ascontiguousarray(values[:, i]), unit, note)
        for i, (name, unit, note) in enumerate(zip(names, units, notes, strict=True))
    ]
    stated = single(parameters.number("ANALOG.RATE", 0.0))
    counted = file.rate_hz * file.per_frame
    if stated > 0 and not math.isclose(stated, counted, rel_tol=SAME):
        raise file.refuse(
            f"ANALOG:RATE is {stated:g} Hz, {file.per_frame} samples a frame at {file.rate_hz:g} "
            f"Hz are {counted:g} Hz; expected the same."
        )
    rate_hz = stated if stated > 0 else counted
    return SignalGroup("analogs", tuple(signals), *_clock(rate_hz, start_s))


def _factors(file: Source) -> np.ndarray:
    """Return the scale of each channel: a unit without it would be that of other numbers."""
    scales = _per_channel(file, "SCALE", "scales")
    if "ANALOG.GEN_SCALE" not in file.parameters.values:
        file.notes["analog.gen_scale"] = "ANALOG:GEN_SCALE is missing; taken as 1."
    return np.asarray(file.parameters.number("ANALOG.GEN_SCALE", 1.0) * scales)


def _offsets(file: Source) -> np.ndarray:
    """Return the offset of each channel; some programs write none where all are 0."""
    if "ANALOG.OFFSET" not in file.parameters.values:
        file.notes["analog.offset"] = "ANALOG:OFFSET is missing; taken as 0."
        return np.zeros(file.n_channels)
    return _per_channel(file, "OFFSET", "offsets")


def _per_channel(file: Source, name: str, what: str) -> np.ndarray:
    numbers = file.parameters.numbers(f"ANALOG.{name}")
    if numbers.size < file.n_channels:
        raise file.refuse(
            f"ANALOG:{name} holds {numbers.size} {what} for {file.n_channels} channels; expected "
            "one each."
        )
    return numbers[: file.n_channels]


def _unsigned_all_the_same(file: Source, samples: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Return offsets without those that cannot be meant.

    Some programs that wrote floats said SIGNED all the same: samples beyond 32767 give it away.
    An offset of 32768 reads -32768 then, in channels that are nowhere negative.
    """
    if not file.in_floats or not (samples >= -_LOWEST_WORD).any():
        return offsets
    meant = (offsets == _LOWEST_WORD) & ~(samples < 0).any(axis=0)
    if not meant.any():
        return offsets
    file.notes["analog.format"] = (
        f"Offsets of -32768 are taken as 32768 in {int(meant.sum())} of {len(meant)} channels, "
        "whose samples are no signed words."
    )
    return np.where(meant, -_LOWEST_WORD, offsets)


def _rotations(file: Source, n_frames: int, start_s: float) -> SignalGroup | None:
    """Return matrices of segments, which stand in a section of their own."""
    parameters = file.parameters
    used, block = file.n_rotations, parameters.count("ROTATION.DATA_START", 0)
    if not used:
        return None
    rate = parameters.number("ROTATION.RATE", 0.0)
    ratio = rate / file.rate_hz if file.rate_hz > 0 else 1.0
    ratio = parameters.number("ROTATION.RATIO", ratio or 1.0)
    if not (
        math.isfinite(ratio) and ratio >= 1 and math.isclose(ratio, round(ratio), rel_tol=SAME)
    ):
        raise file.refuse(f"ROTATION:RATIO is {ratio:g}; expected a whole number from 1 on.")
    ratio = round(ratio)
    n_samples, start = n_frames * ratio, BLOCK * (block - 1)
    count = n_samples * used * _FLOATS_OF_A_ROTATION
    if start + 4 * count > len(file.content):
        raise file.refuse(f"{n_samples} samples of {used} rotations end after the file's own end.")
    raw = file.machine.floats(file.content[start : start + 4 * count])
    cells = raw.reshape(n_samples, used, _FLOATS_OF_A_ROTATION)
    cells = np.where(cells[:, :, -1:] < 0, np.nan, cells)
    labels = distinct_names(parameters.texts("ROTATION.LABELS"), used, "rotation")
    signals = [
        Signal(f"{label}.{cell}", np.ascontiguousarray(cells[:, i, j]))
        for i, label in enumerate(labels)
        for j, cell in enumerate(_CELLS)
    ]
    return SignalGroup("rotations", tuple(signals), *_clock(file.rate_hz * ratio, start_s))


def _clock(rate_hz: float, start_s: float) -> tuple[float | None, float]:
    """Return rate and start; a rate is held in single precision, and meant as it is typed."""
    rate_hz = single(rate_hz)
    if not np.isfinite(rate_hz) or rate_hz <= 0:
        return None, 0.0
    return rate_hz, start_s


def _point_units(file: Source, labels: Sequence[str]) -> list[str]:
    """Return the unit of each point: that of its kind, else the usual one."""
    parameters = file.parameters
    special = {
        label: unit
        for kind, unit_name in KINDS.items()
        for unit in parameters.texts(f"POINT.{unit_name}")[:1]
        for label in parameters.texts(f"POINT.{kind}")
        if label
    }
    usual = next(iter(parameters.texts("POINT.UNITS")), "")
    return [special.get(label, usual) for label in labels]


#: Parameters that hold one value an event, and become metadata.
_MORE = ("DESCRIPTIONS", "SUBJECTS", "ICON_IDS", "GENERIC_FLAGS")
_PART = re.compile(r"EVENT\.([A-Z_]+?)\d*")


def read_events(file: Source) -> tuple[tuple[Event, ...], dict[str, Values]]:
    """Return events of the EVENT group (minutes and seconds), else those of the header."""
    parameters = file.parameters
    times = parameters.numbers("EVENT.TIMES")
    times = times[: 2 * (times.size // 2)].reshape(-1, 2)
    used = min(parameters.count("EVENT.USED", len(times)), len(times))
    if used:
        labels = padded(parameters.texts("EVENT.LABELS"), used)
        sides = padded(parameters.texts("EVENT.CONTEXTS"), used)
        rows = zip(times[:used].tolist(), sides, labels, strict=True)
        events = [
            Event(60.0 * minutes + seconds, f"{side} {label}" if side else label)
            for (minutes, seconds), side, label in rows
        ]
    else:
        events = [Event(time, label) for time, label in file.header.events]
    if not all(math.isfinite(event.time_s) for event in events):
        raise file.refuse("an event has a time that is no number.")
    order = sorted(range(len(events)), key=lambda i: events[i].time_s)
    return tuple(events[i] for i in order), _in_order(file, order) if used else {}


def _in_order(file: Source, order: list[int]) -> dict[str, Values]:
    """Return what is said of each event in the order of time, as the events are."""
    if order == sorted(order):
        return {}
    ordered: dict[str, Values] = {}
    unordered = []
    for name in _MORE:
        parts = {
            key: values
            for key, values in file.parameters.values.items()
            if (match := _PART.fullmatch(key)) and match[1] == name
        }
        if sum(map(len, map(_flat, parts.values()))) == len(order):
            ordered |= _turned(parts, order)
        elif parts:
            unordered.append(name)
    if unordered:
        file.notes["events"] = (
            f"In the order of the file, not of time: EVENT:{', '.join(unordered)}."
        )
    return ordered


def _turned(parts: Mapping[str, Values], order: list[int]) -> dict[str, Values]:
    """Return lists that continue each other in another order, each as long as it was."""
    cells = [value for values in parts.values() for value in _flat(values)]
    turned = [cells[i] for i in order]
    ordered: dict[str, Values] = {}
    for key, values in parts.items():
        part, turned = turned[: len(_flat(values))], turned[len(_flat(values)) :]
        ordered[key] = tuple(part) if isinstance(values, tuple) else np.reshape(part, values.shape)
    return ordered


def _flat(values: Values) -> list[Any]:
    return list(values) if isinstance(values, tuple) else list(values.ravel(order="F"))


#: Parameter that lists points of one kind -> the parameter of their unit. What is in none of
#: them is a trajectory.
KINDS: Mapping[str, str] = {
    "ANGLES": "ANGLE_UNITS",
    "FORCES": "FORCE_UNITS",
    "MOMENTS": "MOMENT_UNITS",
    "POWERS": "POWER_UNITS",
    "SCALARS": "SCALAR_UNITS",
}
_TOLD = re.compile(
    r"POINT\.(USED|SCALE|RATE|DATA_START|FRAMES|LONG_FRAMES|LABELS|DESCRIPTIONS|UNITS"
    rf"|{'|'.join((*KINDS, *KINDS.values()))})\d*"
    r"|ANALOG\.(USED|RATE|FORMAT|BITS|GEN_SCALE|SCALE|OFFSET|LABELS|DESCRIPTIONS|UNITS)\d*"
    r"|EVENT\.(USED|TIMES|LABELS|CONTEXTS)\d*"
    r"|ROTATION\.(USED|DATA_START|RATE|RATIO|LABELS)\d*"
    r"|TRIAL\.ACTUAL_(START|END)_FIELD"
)


def metadata_of(parameters: Mapping[str, Values]) -> dict[str, str]:
    """Return parameters as text, but for those that became groups, signals or events."""
    return {
        name.lower(): text
        for name, values in parameters.items()
        if not _TOLD.fullmatch(name) and (text := _text(values)) not in ("", "[]")
    }


def _text(values: Values) -> str:
    """Write a parameter as text: one value plainly, several as in JSON."""
    if isinstance(values, tuple):
        return values[0] if len(values) == 1 else json.dumps(list(values), ensure_ascii=False)
    plain: Any = values.tolist()
    if values.dtype.kind == "f":
        short = [float(str(v)) for v in values.astype(np.float32).ravel()]
        plain = np.array(short).reshape(values.shape).tolist()
    return json.dumps(plain if values.size != 1 else np.ravel(plain)[0].item())
