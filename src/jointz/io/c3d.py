"""C3D: trajectories of points, analog channels at a rate of their own, and events."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jointz.core.acquisition import Acquisition, Event, Signal, SignalGroup
from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.core.whole_file import whole_file
from jointz.io.c3d_clock import single
from jointz.io.c3d_parameters import (
    BLOCK,
    Header,
    Machine,
    Parameters,
    read_parameters,
)
from jointz.io.c3d_plan import AXES, CELLS, KINDS, is_told, plan
from jointz.io.c3d_values import text_of
from jointz.io.c3d_write import c3d_bytes
from jointz.io.column_names import READING
from jointz.io.formats import register_format
from jointz.io.signal_names import distinct_names, filled

_SATURATED = 0xFFFF
_LOWEST_WORD = -0x8000
_FLOATS_OF_A_ROTATION = 17  # a matrix of 4 x 4, and how reliable it is
_RATE_TOLERANCE = 0.01


@dataclass(frozen=True, slots=True)
class _File:
    """What a file says of itself."""

    path: Path
    content: bytes
    machine: Machine
    header: Header
    parameters: Parameters

    @property
    def scale(self) -> float:
        return self.parameters.number("POINT.SCALE", 0.0) or self.header.scale

    @property
    def in_floats(self) -> bool:
        return self.scale < 0

    @property
    def rate_hz(self) -> float:
        return self.parameters.number("POINT.RATE", 0.0) or self.header.rate_hz

    @property
    def n_points(self) -> int:
        return self.parameters.count("POINT.USED", 0) or self.header.n_points

    @property
    def per_frame(self) -> int:
        return max(self.header.per_frame, 1)

    @property
    def n_channels(self) -> int:
        used = self.parameters.count("ANALOG.USED", 0)
        return used or self.header.n_analog_values // self.per_frame

    @property
    def values_per_frame(self) -> int:
        return 4 * self.n_points + self.n_channels * self.per_frame

    def refuse(self, what: str, todo: str = "Export it again.") -> DataError:
        return DataError(f"{self.path.name}: {what} {todo}", path=str(self.path))


@register_format(".c3d")
class C3dFormat:
    """Points and analog channels, rotations where there are any, events and parameters."""

    name = "C3D"

    def read(self, path: Path, files: FilesSpec) -> Acquisition:  # noqa: ARG002
        """Return the groups ``points``, ``analogs`` and ``rotations`` of a file.

        A point gives three signals, ``LABEL.x``, ``.y`` and ``.z``, NaN where it was not seen
        (its residual is negative). Units are those of the file; other parameters are metadata
        by their names in lower case, several values as in JSON.

        Parameters
        ----------
        path : pathlib.Path
            The file.
        files : FilesSpec
            Not used: a C3D file describes itself.

        Raises
        ------
        DataError
            When the file is damaged, cut off, or contradicts itself.
        """
        content = path.read_bytes()
        file = _File(path, content, *read_parameters(path, content))
        _check_parameters(file)
        points, analogs = _frames(file)
        start_s = _first_frame(file) / single(file.rate_hz) if file.rate_hz > 0 else 0.0
        groups = [_points(file, points, start_s), _analogs(file, analogs, start_s)]
        groups.append(_rotations(file, len(points), start_s))
        metadata = {
            name.lower(): text
            for name, values in file.parameters.values.items()
            if not is_told(name) and (text := text_of(values)) not in ("", "[]")
        }
        metadata |= _remarks(file)
        return Acquisition(tuple(g for g in groups if g), _events(file), metadata)

    def losses(self, content: Acquisition) -> list[str]:
        """Return what of a content a C3D file cannot hold.

        Parameters
        ----------
        content : Acquisition
            What is to be written.
        """
        return plan(content)[1]

    def write(self, content: Acquisition, path: Path) -> None:
        """Write what a C3D file can hold, in single precision.

        Parameters
        ----------
        content : Acquisition
            What to write.
        path : pathlib.Path
            The file.

        Raises
        ------
        DataError
            When nothing of it, or more names than a C3D file has room for, would be written.
        WriteError
            When the file cannot be written.
        """
        raw = c3d_bytes(plan(content)[0], path)
        with whole_file(path, "Make room or name another place.") as partial:
            partial.write_bytes(raw)


def _check_parameters(file: _File) -> None:
    """Refuse a section that ends early: something stands behind it, and something is missing."""
    wanted = ["POINT.USED", "POINT.SCALE", "POINT.RATE", "POINT.FRAMES", "ANALOG.USED"]
    wanted += ["POINT.LABELS", "POINT.UNITS"] if file.n_points else []
    wanted += ["ANALOG.LABELS", "ANALOG.SCALE"] if file.n_channels else []
    missing = [name for name in wanted if name not in file.parameters.values]
    if missing and file.parameters.unread:
        raise file.refuse(
            f"expected the parameters {', '.join(missing).replace('.', ':')}, found none, and "
            f"{file.parameters.unread} bytes that belong to no parameter; it is damaged.",
            "Copy or export it again.",
        )


def _remarks(file: _File) -> dict[str, str]:
    """Say what looks odd about a file."""
    parameters, header = file.parameters, file.header
    found = {}
    if not math.isclose(file.rate_hz, header.rate_hz, rel_tol=_RATE_TOLERANCE):
        found["rate"] = f"The header says {header.rate_hz:g} Hz; POINT:RATE holds."
    if parameters.unread:
        found["parameters"] = f"{parameters.unread} bytes behind the last parameter are not read."
    counts = {"POINT.LABELS": file.n_points, "ANALOG.LABELS": file.n_channels}
    for name, count in counts.items():
        n_labels = len(parameters.texts(name))
        if n_labels < count:
            found[name.lower()] = f"{count - n_labels} of {count} have no label and are counted."
    return {f"{READING}{key}": text for key, text in found.items()}


def _frames(file: _File) -> tuple[np.ndarray, np.ndarray]:
    """Return points (frame, point, 4) and analog values (sample, channel), as they stand."""
    width = 4 if file.in_floats else 2
    if not np.isfinite(file.scale) or file.scale == 0:
        raise file.refuse(f"POINT:SCALE is {file.scale}; expected a number other than 0.")
    size = width * file.values_per_frame
    start = BLOCK * (file.header.data_block - 1)
    there = len(file.content) - start
    if size == 0 and not file.parameters.count("ROTATION.USED", 0):
        raise file.refuse("it states no points, no analog channels and no rotations.")
    if start < BLOCK or there < 0:
        raise file.refuse(
            f"its frames start at byte {start} of {len(file.content)}; it is cut off."
        )
    n_frames = _n_frames(file, there, size)
    raw = file.content[start : start + n_frames * size]
    values = file.machine.floats(raw) if file.in_floats else file.machine.ints(raw)
    frames = values.reshape(n_frames, file.values_per_frame)
    cut = 4 * file.n_points
    points = frames[:, :cut].reshape(n_frames, file.n_points, 4)
    return points, frames[:, cut:].reshape(n_frames * file.per_frame, file.n_channels)


def _n_frames(file: _File, there: int, size: int) -> int:
    """Return how many frames there are; where the file says two numbers its length decides."""
    said = list(dict.fromkeys(_said_frames(file)))
    if len(said) > 1:
        blocks = -(-there // BLOCK)
        fitting = [n for n in said if n * size <= there and -(-n * size // BLOCK) == blocks]
        said = fitting or said
    if len(said) > 1:
        raise file.refuse(f"it states {' and '.join(map(str, said))} frames; expected one number.")
    if said[0] * size > there:
        raise file.refuse(
            f"it states {said[0]} frames, and holds {there // size}; it is cut off or damaged.",
            "Copy or export it again.",
        )
    return said[0]


def _said_frames(file: _File) -> Iterator[int]:
    """Yield how many frames the file says there are, here and there."""
    parameters, header = file.parameters, file.header
    trial = _trial(file)
    if trial is not None:
        yield trial[1] - trial[0] + 1
    long = parameters.count("POINT.LONG_FRAMES", 0)
    if long:
        yield long
    stated = parameters.count("POINT.FRAMES", 0)
    if stated and (stated != _SATURATED or not (trial or long)):
        yield stated
    if header.last_frame != _SATURATED or not (trial or long or stated):
        yield max(header.last_frame - max(header.first_frame, 1) + 1, 0)


def _trial(file: _File) -> tuple[int, int] | None:
    """Return first and last frame of the trial, two words each, counted from 1."""
    fields = []
    for name in ("TRIAL.ACTUAL_START_FIELD", "TRIAL.ACTUAL_END_FIELD"):
        found = file.parameters.numbers(name)
        if not found.size or not np.isfinite(found).all():
            return None
        words = [int(v) & _SATURATED for v in found[:2]]
        fields.append(words[0] + (words[1] << 16 if len(words) > 1 else 0))
    # A trial without frames ends before it starts.
    return (fields[0], fields[1]) if 0 < fields[0] <= fields[1] + 1 else None


def _first_frame(file: _File) -> int:
    """Return the number of the first frame, counted from 0."""
    trial = _trial(file)
    first = trial[0] if trial else file.header.first_frame
    return max(first - 1, 0)


def _points(file: _File, frames: np.ndarray, start_s: float) -> SignalGroup | None:
    if not file.n_points:
        return None
    labels = distinct_names(file.parameters.texts("POINT.LABELS"), file.n_points, "point")
    notes = file.parameters.texts("POINT.DESCRIPTIONS")
    units = _point_units(file)
    factor = 1.0 if file.in_floats else file.scale
    values = np.where(frames[:, :, 3:] < 0, np.nan, frames[:, :, :3] * factor)
    signals = [
        Signal(f"{label}.{axis}", np.ascontiguousarray(values[:, i, j]), units(label), note)
        for i, (label, note) in enumerate(zip(labels, filled(notes, len(labels)), strict=True))
        for j, axis in enumerate(AXES)
    ]
    return SignalGroup("points", tuple(signals), *_clock(file.rate_hz, start_s))


def _analogs(file: _File, samples: np.ndarray, start_s: float) -> SignalGroup | None:
    parameters, n = file.parameters, file.n_channels
    if not n:
        return None
    offsets = parameters.numbers("ANALOG.OFFSET")
    if _unsigned(file, samples):
        samples = samples if file.in_floats else samples & _SATURATED
        offsets = np.where(offsets < 0, offsets + _SATURATED + 1, offsets)
    general = parameters.number("ANALOG.GEN_SCALE", 1.0)
    scales = parameters.numbers("ANALOG.SCALE")
    factor = general * np.concatenate([scales[:n], np.ones(max(n - scales.size, 0))])
    offset = np.concatenate([offsets[:n], np.zeros(max(n - offsets.size, 0))])
    with np.errstate(over="ignore", invalid="ignore"):
        values = (samples - offset) * factor
    names = distinct_names(parameters.texts("ANALOG.LABELS"), n, "analog")
    units = filled(parameters.texts("ANALOG.UNITS"), n)
    notes = filled(parameters.texts("ANALOG.DESCRIPTIONS"), n)
    signals = [
        Signal(name, np.ascontiguousarray(values[:, i]), unit, note)
        for i, (name, unit, note) in enumerate(zip(names, units, notes, strict=True))
    ]
    stated = parameters.number("ANALOG.RATE", 0.0)
    counted = file.rate_hz * file.per_frame
    if stated > 0 and not math.isclose(stated, counted, rel_tol=_RATE_TOLERANCE):
        raise file.refuse(
            f"ANALOG:RATE is {stated:g} Hz, {file.per_frame} samples a frame at {file.rate_hz:g} "
            f"Hz are {counted:g} Hz; expected the same."
        )
    rate_hz = stated if stated > 0 else counted
    return SignalGroup("analogs", tuple(signals), *_clock(rate_hz, start_s))


def _unsigned(file: _File, samples: np.ndarray) -> bool:
    """Whether words from 32768 on, and offsets that look negative, are no negative numbers.

    Some programs that wrote floats said SIGNED all the same; samples beyond 32767 give it away.
    """
    if "UNSIGNED" in [text.upper() for text in file.parameters.texts("ANALOG.FORMAT")]:
        return True
    offsets = file.parameters.numbers("ANALOG.OFFSET")
    if not file.in_floats or not (offsets == _LOWEST_WORD).any():
        return False
    return bool((samples >= -_LOWEST_WORD).any())


def _rotations(file: _File, n_frames: int, start_s: float) -> SignalGroup | None:
    """Return matrices of segments, which stand in a section of their own."""
    parameters = file.parameters
    used = parameters.count("ROTATION.USED", 0)
    block = parameters.count("ROTATION.DATA_START", 0)
    if not used or not block:
        return None
    rate = parameters.number("ROTATION.RATE", 0.0)
    ratio = rate / file.rate_hz if file.rate_hz > 0 else 1.0
    ratio = parameters.number("ROTATION.RATIO", ratio or 1.0)
    if not ratio.is_integer() or ratio < 1:
        raise file.refuse(f"ROTATION:RATIO is {ratio:g}; expected a whole number from 1 on.")
    n_samples, start = n_frames * int(ratio), BLOCK * (block - 1)
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
        for j, cell in enumerate(CELLS)
    ]
    return SignalGroup("rotations", tuple(signals), *_clock(file.rate_hz * ratio, start_s))


def _clock(rate_hz: float, start_s: float) -> tuple[float | None, float]:
    """Return rate and start; a rate is held in single precision, and meant as it is typed."""
    if not np.isfinite(rate_hz) or rate_hz <= 0:
        return None, 0.0
    return single(rate_hz), start_s


def _point_units(file: _File) -> "_Units":
    parameters = file.parameters
    own = {
        label: unit
        for kind, unit_name in KINDS.items()
        for unit in parameters.texts(f"POINT.{unit_name}")[:1]
        for label in parameters.texts(f"POINT.{kind}")
    }
    return _Units(own, next(iter(parameters.texts("POINT.UNITS")), ""))


@dataclass(frozen=True, slots=True)
class _Units:
    own: dict[str, str]
    usual: str

    def __call__(self, label: str) -> str:
        return self.own.get(label, self.usual)


def _events(file: _File) -> tuple[Event, ...]:
    """Return events of the EVENT group (minutes and seconds), else those of the header."""
    parameters = file.parameters
    times = parameters.numbers("EVENT.TIMES")
    times = times[: 2 * (times.size // 2)].reshape(-1, 2)
    used = min(parameters.count("EVENT.USED", len(times)), len(times))
    if not used:
        found = [Event(time, label) for time, label in file.header.events]
    else:
        labels = filled(parameters.texts("EVENT.LABELS"), used)
        sides = filled(parameters.texts("EVENT.CONTEXTS"), used)
        found = [
            Event(60.0 * minutes + seconds, f"{side} {label}" if side else label)
            for (minutes, seconds), side, label in zip(
                times[:used].tolist(), sides, labels, strict=True
            )
        ]
    if not all(math.isfinite(event.time_s) for event in found):
        raise file.refuse("an event has a time that is no number.")
    return tuple(sorted(found, key=lambda event: event.time_s))
