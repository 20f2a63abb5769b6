"""Bytes of a C3D file: header, parameters, frames in single precision, rotations."""

import struct
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from jointz.io.c3d.c3d_parameters import BLOCK, KEY, Values
from jointz.io.c3d.c3d_plan import KINDS, C3dContent, Columns, seconds_of, side_of
from jointz.io.c3d.c3d_values import LONGEST, write_parameters
from jointz.io.formats.columns import file_error

_MOST_BLOCKS = 255
_SATURATED = 0xFFFF
_EMPTY = Columns()


def c3d_bytes(content: C3dContent, path: Path) -> bytes:
    """Return a whole file."""
    if not content.columns:
        raise file_error(path, "C3D can hold nothing of it. Choose another format.")
    frames = _frames(content)
    blocks_of_frames = -(-len(frames) // BLOCK)
    section = b""
    for _ in range(2):  # where the frames start is a word in the section, and its length no matter
        data_block = 2 + len(section) // BLOCK
        starts = data_block, data_block + blocks_of_frames
        section = write_parameters(dict(_parameters(content, starts)))
    if len(section) > _MOST_BLOCKS * BLOCK:
        raise file_error(
            path,
            f"names, descriptions and metadata need {len(section)} bytes; a C3D file has room "
            f"for {_MOST_BLOCKS * BLOCK}. Write fewer signals or metadata.",
        )
    header = _header(content, starts[0])
    rotations = _rotations(content)
    if rotations:  # else the file ends with its frames: some readers count them by its length
        frames = frames.ljust(blocks_of_frames * BLOCK, b"\0")
    return header + section + frames + rotations


def _header(content: C3dContent, data_block: int) -> bytes:
    clock = content.clock
    points, analogs = _role(content, "points"), _role(content, "analogs")
    per_frame = clock.times.get("analogs", 1)
    words = (
        len(points.labels),
        len(analogs.labels) * per_frame,
        min(clock.first_frame + 1, _SATURATED),
        min(clock.first_frame + clock.n_frames, _SATURATED),
        0,  # longest gap that was interpolated
    )
    head = bytes((2, KEY)) + struct.pack("<5H", *words) + struct.pack("<f", -1.0)
    return (head + struct.pack("<2Hf", data_block, per_frame, clock.rate_hz)).ljust(BLOCK, b"\0")


def _parameters(content: C3dContent, starts: tuple[int, int]) -> Iterator[tuple[str, Values]]:
    clock, points = content.clock, _role(content, "points")
    data_block, rotation_block = starts
    frames = clock.n_frames if clock.n_frames <= _SATURATED else _SATURATED
    yield "POINT.USED", _word(len(points.labels))
    yield "POINT.SCALE", np.array([-1.0])
    yield "POINT.RATE", np.array([clock.rate_hz])
    yield "POINT.DATA_START", _word(data_block)
    yield "POINT.FRAMES", _word(frames)
    unit = [
        u for u in points.units if u not in {kind_unit for kind_unit, _ in content.kinds.values()}
    ]
    yield "POINT.UNITS", tuple(unit[:1]) or ("",)
    yield from _lists("POINT.LABELS", points.labels)
    yield from _lists("POINT.DESCRIPTIONS", points.notes)
    for kind, (kind_unit, labels) in content.kinds.items():
        yield from _lists(f"POINT.{kind}", labels)
        yield f"POINT.{KINDS[kind]}", (kind_unit,)
    if clock.first_frame + max(clock.n_frames, 1) > _SATURATED:
        yield "POINT.LONG_FRAMES", np.array([float(clock.n_frames)])
        yield "TRIAL.ACTUAL_START_FIELD", _words(clock.first_frame + 1)
        yield "TRIAL.ACTUAL_END_FIELD", _words(clock.first_frame + clock.n_frames)
    yield from _analog_parameters(content)
    yield from _event_parameters(content)
    if "rotations" in content.columns:
        rotations = content.columns["rotations"]
        yield "ROTATION.USED", _word(len(rotations.labels))
        yield "ROTATION.DATA_START", _word(rotation_block)
        yield "ROTATION.RATIO", _word(clock.times["rotations"])
        yield from _lists("ROTATION.LABELS", rotations.labels)
    yield from content.parameters.items()


def _analog_parameters(content: C3dContent) -> Iterator[tuple[str, Values]]:
    analogs = _role(content, "analogs")
    count = len(analogs.labels)
    yield "ANALOG.USED", _word(count)
    yield "ANALOG.RATE", np.array([content.clock.rates_hz.get("analogs", content.clock.rate_hz)])
    yield "ANALOG.GEN_SCALE", np.array([1.0])
    yield "ANALOG.FORMAT", ("SIGNED",)
    yield "ANALOG.BITS", _word(16)
    yield from _lists("ANALOG.LABELS", analogs.labels)
    yield from _lists("ANALOG.DESCRIPTIONS", analogs.notes)
    yield from _lists("ANALOG.UNITS", analogs.units)
    for i, start in enumerate(range(0, count, LONGEST)):
        n = min(LONGEST, count - start)
        yield f"ANALOG.SCALE{i + 1 if i else ''}", np.ones(n)
        yield f"ANALOG.OFFSET{i + 1 if i else ''}", np.zeros(n, dtype=np.int64)


def _event_parameters(content: C3dContent) -> Iterator[tuple[str, Values]]:
    events = content.events
    if not events:
        return
    yield "EVENT.USED", _word(len(events))
    yield from _lists("EVENT.LABELS", [side_of(event.label)[1] for event in events])
    yield from _lists("EVENT.CONTEXTS", [side_of(event.label)[0] for event in events])
    times = np.array([seconds_of(event.time_s) for event in events]).T
    for i, start in enumerate(range(0, len(events), LONGEST)):
        yield f"EVENT.TIMES{i + 1 if i else ''}", times[:, start : start + LONGEST]


def _frames(content: C3dContent) -> bytes:
    """Return the frames: points with a residual, then analog samples."""
    points, analogs = _role(content, "points"), _role(content, "analogs")
    n = content.clock.n_frames
    with np.errstate(over="ignore"):
        trajectories = points.values.astype("<f4")
        samples = analogs.values.astype("<f4")
    per_frame = content.clock.times.get("analogs", 1)
    samples = samples.reshape(n if analogs.labels else 0, per_frame * len(analogs.labels))
    if not points.labels:
        return samples.tobytes()
    samples = samples if analogs.labels else np.zeros((n, 0), dtype="<f4")
    unseen = np.isnan(trajectories).all(axis=2, keepdims=True)
    residuals = np.where(unseen, np.float32(-1), np.float32(0))
    quads = np.concatenate([np.where(unseen, np.float32(0), trajectories), residuals], axis=2)
    flat = quads.reshape(n, 4 * len(points.labels))
    return np.concatenate([flat, samples], axis=1).astype("<f4").tobytes()


def _rotations(content: C3dContent) -> bytes:
    if "rotations" not in content.columns:
        return b""
    with np.errstate(over="ignore"):
        cells = content.columns["rotations"].values.astype("<f4")
    missing = np.isnan(cells).any(axis=2, keepdims=True)
    reliability = np.where(missing, np.float32(-1), np.float32(1))
    return np.concatenate([cells, reliability], axis=2).astype("<f4").tobytes()


def _role(content: C3dContent, role: str) -> Columns:
    return content.columns.get(role, _EMPTY)


def _lists(name: str, texts: Sequence[str]) -> Iterator[tuple[str, Values]]:
    """Yield texts, at most 255 a parameter, the next ones in NAME2, NAME3 ..."""
    for i, start in enumerate(range(0, len(texts), LONGEST)):
        yield f"{name}{i + 1 if i else ''}", tuple(texts[start : start + LONGEST])


def _word(value: int) -> np.ndarray:
    """Return a word: numbers from 32768 on are held as negative ones."""
    return np.array([value - 0x10000 if value > 0x7FFF else value])


def _words(value: int) -> np.ndarray:
    return np.concatenate([_word(value & 0xFFFF), _word(value >> 16)])
