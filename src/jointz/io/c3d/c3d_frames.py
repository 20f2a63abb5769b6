"""Frames of a C3D file, after header, parameters and file length were compared.

Header and parameters state the layout of the frames twice. Frames that are cut in the wrong
places are numbers all the same, so both are held against each other and against the length of
the file; what cannot be told is an error.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from jointz.core.errors import DataError
from jointz.io.c3d.c3d_parameters import BLOCK, Header, Machine, Parameters
from jointz.io.formats.columns import file_error

SATURATED = 0xFFFF
#: Most points, and most analog values, of a frame.
_MOST_VALUES = 0xFFFF
#: Two floats that are to say the same; both are of single precision.
SAME = 1e-5
_SMALLEST_SCALE = float(np.finfo(np.float32).tiny)
_COPY = "Copy it again, or save it as csv where it was made."
_SAVE = "Export it again, or open it in another program, such as Mokka, and save it as C3D or csv."


def single(rate_hz: float) -> float:
    """Return a rate as single precision holds it, in as few digits as that needs."""
    with np.errstate(over="ignore"):
        return float(str(np.float32(rate_hz)))


@dataclass(frozen=True, slots=True)
class Source:
    """Content, header and parameters of a file."""

    path: Path
    content: bytes  # all bytes of the file
    machine: Machine  # byte order of the file
    header: Header  # first block of the file
    parameters: Parameters  # parameter section of the file
    # subject -> remark about it, added while the file is read
    notes: dict[str, str] = field(default_factory=dict)

    @property
    def scale(self) -> float:
        """Of the points; negative in files of floats."""
        return self.parameters.number("POINT.SCALE", 0.0) or self.header.scale

    @property
    def in_floats(self) -> bool:
        """Whether its samples are floats, not whole numbers."""
        return self.scale < 0

    @property
    def rate_hz(self) -> float:
        """Of the frames."""
        return single(self.parameters.number("POINT.RATE", 0.0)) or single(self.header.rate_hz)

    @property
    def n_points(self) -> int:
        """Points of a frame."""
        return self.parameters.count("POINT.USED", 0) or self.header.n_points

    @property
    def per_frame(self) -> int:
        """Samples of an analog channel in a frame."""
        return max(self.header.per_frame, 1)

    @property
    def n_channels(self) -> int:
        """Analog channels."""
        used = self.parameters.count("ANALOG.USED", 0)
        return used or self.header.n_analog_values // self.per_frame

    @property
    def n_rotations(self) -> int:
        """Rotations of a frame, 0 where they have no place in the file."""
        placed = self.parameters.count("ROTATION.DATA_START", 0)
        return self.parameters.count("ROTATION.USED", 0) if placed else 0

    def frame_bytes(self, n_points: int, n_values: int) -> int:
        """Return the bytes of a frame."""
        return (4 if self.in_floats else 2) * (4 * n_points + n_values)

    def refuse(self, what: str, todo: str = _SAVE) -> DataError:
        """Return the error about the file."""
        return file_error(self.path, f"{what} {todo}")


@dataclass(frozen=True, slots=True)
class Frames:
    """The frames as they stand in the file."""

    points: np.ndarray  # coordinates and residual as stored, before scale, (frames, points, 4)
    analogs: np.ndarray  # samples as stored, before scale and offset, (samples, channels)
    first: int  # number of the first frame, counted from 0


def take_frames(file: Source) -> Frames:
    """Return the frames of a file in which header, parameters and length agree."""
    _check_parameters(file)
    _check_counts(file)
    _check_scale(file)
    start = _start(file)
    room = _room(file, start)
    n_values = file.n_channels * file.per_frame
    size = file.frame_bytes(file.n_points, n_values)
    n_frames = _n_frames(file, start, size, room)
    _check_layout(file, room)
    _check_neighbours(file, start, n_frames * size, room)
    raw = file.content[start : start + n_frames * size]
    values = file.machine.floats(raw) if file.in_floats else file.machine.ints(raw)
    frames = values.reshape(n_frames, 4 * file.n_points + n_values)
    cut = 4 * file.n_points
    return Frames(
        frames[:, :cut].reshape(n_frames, file.n_points, 4),
        frames[:, cut:].reshape(n_frames * file.per_frame, file.n_channels),
        _first_frame(file, n_frames),
    )


def _check_parameters(file: Source) -> None:
    """Refuse a section that ends early: something stands behind it, and something is missing."""
    required = ["POINT.USED", "POINT.SCALE", "POINT.RATE", "POINT.FRAMES", "ANALOG.USED"]
    required += ["POINT.LABELS", "POINT.UNITS"] if file.n_points else []
    required += ["ANALOG.LABELS", "ANALOG.SCALE"] if file.n_channels else []
    missing = [name for name in required if name not in file.parameters.values]
    if missing and file.parameters.unread:
        raise file.refuse(
            f"expected the parameters {', '.join(missing).replace('.', ':')}, found none, and "
            f"{file.parameters.unread} bytes that belong to no parameter; it is damaged.",
            _COPY,
        )


def _check_counts(file: Source) -> None:
    """Refuse counts that no frame can have: the header holds each in a word."""
    counts = {
        "POINT:USED": file.n_points,
        "ANALOG:USED": file.n_channels,
        "ROTATION:USED": file.n_rotations,
    }
    for name, count in counts.items():
        if count > _MOST_VALUES:
            raise file.refuse(f"{name} is {count:.6g}; expected at most {_MOST_VALUES}.")
    if not any(counts.values()):
        raise file.refuse("it states no points, no analog channels and no rotations.")


def _check_scale(file: Source) -> None:
    """Refuse a scale that is none, or whose sign, the kind of the samples, is told two ways."""
    stated, header = file.parameters.number("POINT.SCALE", 0.0), file.header.scale
    if not math.isfinite(file.scale) or abs(file.scale) < _SMALLEST_SCALE:
        raise file.refuse(f"POINT:SCALE is {file.scale:g}; expected a number other than 0.")
    if not stated or not header:
        return
    if (stated < 0) != (header < 0):
        raise file.refuse(
            f"POINT:SCALE is {stated:g} and the scale of the header {header:g}; expected one sign, "
            "which tells floats from whole numbers."
        )
    if not file.in_floats and stated != header:
        file.notes["scale"] = (
            f"The header scales points by {header:g}; POINT:SCALE {stated:g} holds."
        )


def _start(file: Source) -> int:
    """Return the byte where the frames start."""
    block, stated = file.header.data_block, file.parameters.count("POINT.DATA_START", 0)
    if stated and stated != block:
        raise file.refuse(
            f"its frames start at block {block} by the header, and at {stated} by "
            "POINT:DATA_START; expected the same.",
            _COPY,
        )
    start = BLOCK * (block - 1)
    if start < BLOCK or start > len(file.content):
        raise file.refuse(
            f"its frames start at byte {start} of {len(file.content)}; it is cut off."
        )
    return start


def _room(file: Source, start: int) -> int:
    """Return the bytes from the start of the frames to the rotations, or to the end."""
    end = len(file.content)
    rotations = BLOCK * (file.parameters.count("ROTATION.DATA_START", 0) - 1)
    if file.n_rotations and start < rotations < end:
        end = rotations
    return end - start


def _n_frames(file: Source, start: int, size: int, room: int) -> int:
    """Return how many frames there are; where the file says two numbers its length decides."""
    if size and _stopped_counting(file):
        return _frames_to_the_end(file, start, size, room)
    counts = list(dict.fromkeys(_said_frames(file)))
    if len(counts) > 1:
        statement = f"it states {' and '.join(map(str, counts))} frames"
        counts = [n for n in counts if _fills(n * size, room)] or counts
        if len(counts) > 1:
            raise file.refuse(f"{statement}; expected one number.")
        file.notes["frames"] = f"I{statement[1:]}; the length of the file tells {counts[0]}."
    if counts[0] * size > room:
        raise file.refuse(
            f"it states {counts[0]} frames, and holds {room // size}; it is cut off or damaged.",
            _COPY,
        )
    return counts[0]


def _stopped_counting(file: Source) -> bool:
    """Return whether frames are counted up to the most that a word can, and nowhere beyond."""
    beyond = file.parameters.count("POINT.LONG_FRAMES", 0) or _trial(file)
    stated = file.parameters.count("POINT.FRAMES", 0)
    return file.header.last_frame == SATURATED and not beyond and stated in (0, SATURATED)


def _frames_to_the_end(file: Source, start: int, size: int, room: int) -> int:
    """Return how many frames the file has room for, without the zeros that fill its last block."""
    n_frames = room // size
    if (start + room) % BLOCK == 0:
        content = file.content
        last_block = n_frames - BLOCK // size
        while n_frames > last_block and not any(
            content[start + (n_frames - 1) * size : start + n_frames * size]
        ):
            n_frames -= 1
    file.notes["frames"] = (
        f"It counts {SATURATED} frames, the most that it can; its length tells {n_frames}."
    )
    return n_frames


def _fills(size: int, room: int) -> bool:
    """Whether frames of this size fill the blocks that there are."""
    return size <= room and -(-size // BLOCK) == -(-room // BLOCK)


def _check_layout(file: Source, room: int) -> None:
    """Refuse two layouts of a frame, unless the file is as long as that of the parameters."""
    parameters, header = file.parameters, file.header
    stated = {
        "points": (parameters.count("POINT.USED", 0), header.n_points),
        "analog values": (
            parameters.count("ANALOG.USED", 0) * file.per_frame,
            header.n_analog_values,
        ),
    }
    differ = [f"{b} {what}, not {a}" for what, (a, b) in stated.items() if a and b and a != b]
    if not differ:
        return
    statement = f"The header counts {', '.join(differ)} a frame"
    sizes = [file.frame_bytes(*counts) for counts in zip(*stated.values(), strict=True)]
    fills = [any(_fills(n * size, room) for n in _said_frames(file)) for size in sizes]
    if fills != [True, False]:
        raise file.refuse(f"{statement[0].lower()}{statement[1:]}, as the parameters do.", _COPY)
    file.notes["layout"] = f"{statement}; the length of the file tells that the parameters hold."


def _check_neighbours(file: Source, start: int, size: int, room: int) -> None:
    """Refuse frames that lie in the parameters, and a count of frames that stopped counting."""
    first, last = file.parameters.span
    if start < last and start + max(size, 1) > first:
        raise file.refuse(
            f"its frames start at byte {start}, among the parameters at {first} to {last}.", _COPY
        )
    if size and (behind := room - size) >= BLOCK:
        file.notes["behind"] = f"{behind} bytes behind the frames are not read."


def _said_frames(file: Source) -> Iterator[int]:
    """Yield how many frames the file says there are, here and there."""
    parameters, header = file.parameters, file.header
    trial = _trial(file)
    if trial is not None:
        yield trial[1] - trial[0] + 1
    long = parameters.count("POINT.LONG_FRAMES", 0)
    if long:
        yield long
    stated = parameters.count("POINT.FRAMES", 0)
    if stated and (stated != SATURATED or not (trial or long)):
        yield stated
    if header.last_frame != SATURATED or not (trial or long or stated):
        # A header that counts from 0 agrees with POINT:FRAMES.
        from_zero = header.first_frame == 0 and header.last_frame + 1 == stated
        yield stated if from_zero else max(header.last_frame - max(header.first_frame, 1) + 1, 0)


def _trial(file: Source) -> tuple[int, int] | None:
    """Return first and last frame of the trial, two words each, counted from 1."""
    fields = []
    for name in ("TRIAL.ACTUAL_START_FIELD", "TRIAL.ACTUAL_END_FIELD"):
        words_found = file.parameters.numbers(name)
        if not words_found.size or not np.isfinite(words_found).all():
            return None
        words = [int(v) & SATURATED for v in words_found[:2]]
        fields.append(words[0] + (words[1] << 16 if len(words) > 1 else 0))
    # A trial without frames ends before it starts.
    return (fields[0], fields[1]) if 0 < fields[0] <= fields[1] + 1 else None


def _first_frame(file: Source, n_frames: int) -> int:
    """Return the number of the first frame, counted from 0; a trial of other length is another."""
    trial, header = _trial(file), file.header.first_frame
    if trial is None or trial[1] - trial[0] + 1 != n_frames:
        return max(header - 1, 0)
    if header not in (min(trial[0], SATURATED), trial[0] & SATURATED):
        file.notes["start"] = (
            f"The header counts frames from {header}; TRIAL, from {trial[0]}, holds."
        )
    return trial[0] - 1
