"""Parameters of a C3D file as text, and as bytes to be written."""

import json
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jointz.io.c3d.c3d_parameters import BLOCK, KEY, Machine, Values, parameter_values

#: Most elements along one side of a parameter, and most characters of one text.
LONGEST = 255
_LONGEST_NAME = 127
_LARGEST_WORD = 0x8000
_MOST_DIMENSIONS = 7
_MOST_BYTES = 0xFFFF - 1024  # of one parameter: the way to the next is a word
_INTEL = 84
_TEXT, _INT, _FLOAT = -1, 2, 4


def text_of(values: Values) -> str:
    """Write a parameter as text: one value plainly, several as in JSON."""
    if isinstance(values, tuple):
        return values[0] if len(values) == 1 else json.dumps(list(values), ensure_ascii=False)
    plain: Any = values.tolist()
    if values.dtype.kind == "f":
        short = [float(str(v)) for v in values.astype(np.float32).ravel()]
        plain = np.array(short).reshape(values.shape).tolist()
    return json.dumps(plain if values.size != 1 else np.ravel(plain)[0].item())


def values_of(text: str) -> Values:
    """Read what :func:`text_of` wrote; anything else is one text."""
    try:
        plain = json.loads(text)
    except (ValueError, RecursionError):
        return (text,)
    if isinstance(plain, list) and plain and all(isinstance(v, str) for v in plain):
        texts: Values = tuple(plain)
        return texts if len(plain) > 1 and text_of(texts) == text else (text,)
    numbers = _rectangular(plain)
    return (text,) if numbers is None or text_of(numbers) != text else numbers


def write_parameters(values: Mapping[str, Values]) -> bytes:
    """Return the parameter section, of whole blocks."""
    groups = list(dict.fromkeys(name.partition(".")[0] for name in values))
    entries = [_entry(name, -i, b"\0") for i, name in enumerate(groups, start=1)]
    for key, value in values.items():
        group, _, name = key.partition(".")
        entries.append(_entry(name, groups.index(group) + 1, _body(value) + b"\0"))
    body = b"".join(entries) + b"\0\0"
    n_blocks = -(-(len(body) + 4) // BLOCK)
    head = bytes((1, KEY, n_blocks & 0xFF, _INTEL))
    return (head + body).ljust(n_blocks * BLOCK, b"\0")


def fits(key: str, values: Values) -> bool:
    """Return whether a parameter can be written and comes back the same."""
    group, dot, name = key.partition(".")
    named = all(part.isascii() and part.isprintable() and part.strip() for part in (group, name))
    if not dot or not named or max(len(group), len(name)) > _LONGEST_NAME:
        return False
    try:
        body = _body(values)
    except (ValueError, UnicodeEncodeError):
        return False
    if len(body) > _MOST_BYTES:
        return False
    back = parameter_values(Path(key), Machine("<"), body, 0)[0]
    return text_of(back) == text_of(values)


def _entry(name: str, number: int, body: bytes) -> bytes:
    raw = name.encode("ascii")
    return struct.pack("bb", len(raw), number) + raw + struct.pack("<H", len(body) + 2) + body


def _body(values: Values) -> bytes:
    """Return kind, shape and values as they stand in the file."""
    if isinstance(values, tuple):
        raw = [text.encode("utf-8") for text in values]
        width = max(1, *map(len, raw)) if raw else 0
        shape = (width,) if len(raw) == 1 else (width, len(raw))
        content = b"".join(text.ljust(width) for text in raw)
        kind = _TEXT
    else:
        kind = _FLOAT if values.dtype.kind == "f" else _INT
        with np.errstate(over="ignore"):
            stored = values.astype("<f4" if kind == _FLOAT else "<i2")
        if kind == _INT and not np.array_equal(stored, values):
            raise ValueError("a whole number beyond 16 bits")
        content = stored.tobytes(order="F")
        shape = values.shape if values.size != 1 else ()
    if max(shape, default=0) > LONGEST or len(shape) > _MOST_DIMENSIONS:
        raise ValueError("a side longer than a byte can say")
    return struct.pack("bB", kind, len(shape)) + bytes(shape) + content


def _rectangular(plain: Any) -> np.ndarray | None:
    """Return numbers as an array of int64 or float64, None for anything else."""
    flat: Sequence[Any] = [plain]
    while any(isinstance(v, list) for v in flat):
        if not all(isinstance(v, list) for v in flat) or len({len(v) for v in flat}) > 1:
            return None
        flat = [w for v in flat for w in v]
    if not flat or not all(type(v) in (int, float) for v in flat):
        return None
    whole = type(flat[0]) is int
    if len({type(v) for v in flat}) > 1 or (whole and max(map(abs, flat)) > _LARGEST_WORD):
        return None
    return np.array(plain)
