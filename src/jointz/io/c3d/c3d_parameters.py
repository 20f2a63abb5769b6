"""Header and parameter section of a C3D file, as named values.

C3D (https://www.c3d.org) was made for computers of three kinds, which differ in the order of
bytes and in their floats; all three are read. jointz reads the format itself: the library at
hand (ezc3d) takes files of two kinds only, and a damaged parameter section can end the process
that it runs in. The tests hold both against each other.
"""

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jointz.core.errors import DataError

BLOCK = 512
_KEY = 0x50
_MOST_DIMENSIONS = 7
_TEXT, _BYTE, _INT, _FLOAT = -1, 1, 2, 4
_VAX_BIAS = 4.0  # a VAX float reads four times too large as an IEEE float

Values = tuple[str, ...] | np.ndarray


@dataclass(frozen=True, slots=True)
class Machine:
    """Byte order of the computer that wrote a file."""

    order: str  # ``<`` or ``>``, as in :mod:`struct`
    vax: bool = False  # whether floats have the format of a VAX

    def ints(self, content: bytes, *, signed: bool = True) -> np.ndarray:
        """Return words of two bytes as an (n,) int64 array."""
        kind = f"{self.order}{'i' if signed else 'u'}2"
        return np.frombuffer(content, dtype=kind).astype(np.int64)

    def floats(self, content: bytes) -> np.ndarray:
        """Return floats of four bytes as an (n,) float64 array."""
        if not self.vax:
            with np.errstate(invalid="ignore"):  # a NaN with a message of its own
                return np.frombuffer(content, dtype=f"{self.order}f4").astype(np.float64)
        swapped = np.frombuffer(content, dtype="<u2").reshape(-1, 2)[:, ::-1]
        with np.errstate(invalid="ignore"):
            return np.ascontiguousarray(swapped).view("<f4").ravel().astype(np.float64) / _VAX_BIAS


MACHINES: Mapping[int, Machine] = {
    84: Machine("<"),
    85: Machine("<", vax=True),
    86: Machine(">"),
}


@dataclass(frozen=True, slots=True)
class Header:
    """The words of the first block that are needed."""

    n_points: int  # number of points in a frame
    n_analog_values: int  # number of analog values in a frame: channels times ``per_frame``
    first_frame: int  # number of the first frame, counted from 1
    last_frame: int  # number of the last frame, counted from 1
    scale: float  # scale of the points; negative in files of floats
    data_block: int  # block where the frames start, counted from 1
    per_frame: int  # samples of an analog channel in a frame
    rate_hz: float  # rate of the frames
    events: tuple[tuple[float, str], ...]  # time, s, and label of each event of the header


@dataclass(frozen=True, slots=True)
class Parameters:
    """Values by ``GROUP.NAME``, in upper case."""

    values: Mapping[str, Values]  # ``GROUP.NAME`` -> texts, or numbers in the shape of the file
    unread: int  # number of bytes other than zero between the last parameter and the frames
    span: tuple[int, int]  # offset of the section, and of the byte after its last parameter

    def texts(self, name: str) -> list[str]:
        """Return the texts of a parameter and of those that continue it (``LABELS2`` ...)."""
        return [str(v) for part in self._parts(name) if isinstance(part, tuple) for v in part]

    def numbers(self, name: str) -> np.ndarray:
        """Return the numbers of a parameter and of those that continue it, flat."""
        parts = [p.ravel(order="F") for p in self._parts(name) if isinstance(p, np.ndarray)]
        return np.concatenate([np.zeros(0), *parts])

    def number(self, name: str, default: float) -> float:
        """Return the first number of a parameter."""
        numbers = self.numbers(name)
        return float(numbers[0]) if numbers.size else default

    def count(self, name: str, default: int) -> int:
        """Return an unsigned number."""
        number = self.number(name, default)
        if not np.isfinite(number):
            return default
        return int(number) & 0xFFFF if number < 0 else int(number)

    def _parts(self, name: str) -> list[Values]:
        parts, number = [], 2
        key = name
        while key in self.values:
            parts.append(self.values[key])
            key, number = f"{name}{number}", number + 1
        return parts


def read_parameters(path: Path, content: bytes) -> tuple[Machine, Header, Parameters]:
    """Return what the header and the parameter section say."""
    if len(content) < BLOCK or content[1] != _KEY:
        found = f"{len(content)} bytes" if len(content) < BLOCK else f"byte 1 = {content[1]:#04x}"
        raise _broken(path, 0, f"the header of a C3D file ({BLOCK} bytes, byte 1 = 0x50)", found)
    start = BLOCK * (content[0] - 1)
    if content[0] < 2 or start + 4 > len(content):
        raise _broken(path, 0, "the block of the parameters, from 2 on", f"{content[0]}")
    machine = MACHINES.get(content[start + 3])
    if machine is None:
        raise _broken(path, start + 3, "84, 85 or 86 (a kind of computer)", content[start + 3])
    header = _header(machine, content)
    return machine, header, _section(path, machine, content, (start, header.data_block))


def _header(machine: Machine, content: bytes) -> Header:
    words = machine.ints(content[:BLOCK], signed=False)
    floats = machine.floats(content[12:16] + content[20:24] + content[304:376])
    n_events = min(int(words[150]), 18)
    labels = [_text(content[396 + 4 * i : 400 + 4 * i]) for i in range(n_events)]
    return Header(
        n_points=int(words[1]),
        n_analog_values=int(words[2]),
        first_frame=int(words[3]),
        last_frame=int(words[4]),
        scale=float(floats[0]),
        data_block=int(words[8]),
        per_frame=int(words[9]),
        rate_hz=float(floats[1]),
        events=tuple(zip(map(float, floats[2:]), labels, strict=False)),
    )


def _section(path: Path, machine: Machine, content: bytes, blocks: tuple[int, int]) -> Parameters:
    """Walk from entry to entry; the way to the next stands in each."""
    start, data_block = blocks
    data_start = BLOCK * (data_block - 1)
    end = data_start if data_start > start else len(content)
    groups: dict[int, str] = {}
    entries: list[tuple[int, str, Values]] = []
    at, tail, step = start + 4, start + 4, 1
    while step and at + 1 < end:  # some programs write no last entry
        length, number = struct.unpack("bb", _cut(path, content, at, 2))
        tail = at + 2
        if length == 0:
            break
        name = _text(_cut(path, content, at + 2, abs(length))).upper()
        step_at = at + 2 + abs(length)
        step = int(machine.ints(_cut(path, content, step_at, 2), signed=False)[0])
        tail = step_at + 2
        if number == 0:
            raise _broken(path, at + 1, "the number of a group", 0)
        if number < 0:
            groups[-number] = name
        else:
            values, tail = _parameter_values(path, machine, content, step_at + 2)
            if step and tail > step_at + step:
                expected = f"parameter {name} to end before byte {step_at + step}"
                raise _broken(path, step_at, expected, f"its end at {tail}")
            entries.append((number, name, values))
        tail += 1 + sum(content[tail : tail + 1])  # the description
        at = step_at + step
    unread = sum(map(bool, content[tail:end])) if data_start > start else 0
    named = {f"{groups.get(g, f'GROUP{g}')}.{name}": v for g, name, v in entries}
    return Parameters(named, unread, (start, tail))


def _parameter_values(path: Path, machine: Machine, content: bytes, at: int) -> tuple[Values, int]:
    """Return the values of a parameter, and the byte after them."""
    kind, n_dimensions = struct.unpack("bB", _cut(path, content, at, 2))
    if kind not in (_TEXT, _BYTE, _INT, _FLOAT) or n_dimensions > _MOST_DIMENSIONS:
        raise _broken(
            path, at, "a parameter of kind -1, 1, 2 or 4", f"kind {kind}, {n_dimensions} dimensions"
        )
    shape = tuple(_cut(path, content, at + 2, n_dimensions))
    start = at + 2 + n_dimensions
    size = int(np.prod(shape, dtype=object)) * abs(kind)
    raw = _cut(path, content, start, size)
    if kind == _TEXT:
        width = shape[0] if shape else 1
        texts = tuple(_text(raw[i : i + width]) for i in range(0, size, max(width, 1)))
        return texts, start + size
    if kind == _FLOAT:
        numbers = machine.floats(raw)
    elif kind == _INT:
        numbers = machine.ints(raw)
    else:
        numbers = np.frombuffer(raw, dtype=np.int8).astype(np.int64)
    return numbers.reshape(shape, order="F"), start + size


def _text(raw: bytes) -> str:
    """Decode a text; older programs wrote that of Western Windows."""
    try:
        text = raw.decode("utf-8")
    except UnicodeDecodeError:
        text = raw.decode("cp1252", errors="replace")
    return text.split("\0", 1)[0].rstrip(" ")


def _cut(path: Path, content: bytes, at: int, size: int) -> bytes:
    if at + size > len(content):
        raise _broken(
            path, at, f"{size} more bytes of parameters", f"the end of the file at {len(content)}"
        )
    return content[at : at + size]


def _broken(path: Path, at: int, expected: str, found: object) -> DataError:
    return DataError(
        f"{path.name}, byte {at}: expected {expected}, found {found}. It is no C3D file, or it is "
        "damaged or cut off. Copy it again, or save it as csv where it was made.",
        path=str(path),
    )
