"""Variables of MATLAB files, version 4 to 7.3, through pymatreader, and their dotted names."""

import io
import math
import struct
import warnings
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np
import pymatreader
from scipy.io import whosmat
from scipy.io.matlab import MatReadError, matfile_version

from jointz.io.formats.columns import damage_errors, file_error
from jointz.io.formats.hdf5_size import check_hdf5
from jointz.io.formats.memory_limit import NUMBER_BYTES, OBJECT_BYTES, check_unpacked
from jointz.io.text.column_names import is_unit

#: First number of a handle of an object, and the fields that scipy gives one of version 5.
_HANDLE, _HANDLE_FIELDS = 0xDD000000, {"s0", "s1", "s2", "arr"}
_OCTAVE = b"# Created by Octave"
_MOST_COLUMNS = 64  # of a matrix that is wider than long, to be taken apart
_HEADER_BYTES = 128
_MOST_NAMES_BYTES = 1 << 20  # of a variable's dimensions or the names of its fields
_BLOCK_BYTES = 1 << 20
_PACKED_BYTES = 1 << 16
_VERSION_4, _VERSION_5 = 0, 1
_MATRIX, _COMPRESSED = 14, 15  # types of the elements of a version 5 file
#: Classes of arrays that scipy makes at their stated size, whatever the file holds of them.
_CELL, _STRUCT, _OBJECT, _CHAR = 1, 2, 3, 4
#: Bytes of a number of each type in the file; letters of other types count as numbers of one byte.
_NUMBER_SIZES = {3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8}

#: What a damaged file makes scipy, h5py and pymatreader raise.
_LIBRARY_ERRORS = (
    *(OSError, ValueError, TypeError, KeyError, IndexError, AttributeError, AssertionError),
    *(EOFError, MemoryError, OverflowError, RuntimeError, ArithmeticError),
    *(MatReadError, zlib.error, struct.error),
)


def load_variables(path: Path, variables: set[str] | None) -> tuple[dict[str, Any], bool]:
    """Return the variables, and whether there are MATLAB objects among them."""
    with path.open("rb") as file:
        if file.read(len(_OCTAVE)) == _OCTAVE:
            raise file_error(path, "is a text file of Octave. Load it there; save -v7 or csvwrite.")
    with damage_errors(path, *_LIBRARY_ERRORS):
        _check_elements(path)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            content = pymatreader.read_mat(path, variable_names=variables)
    objects = any("pymatreader" in str(w.filename) for w in caught)
    return _without_objects(content), objects


def _without_objects(content: Mapping[str, Any]) -> dict[str, Any]:
    """Leave out what MATLAB keeps of its objects and of itself: handles, not samples."""
    return {
        name: _without_objects(value) if isinstance(value, Mapping) else value
        for name, value in content.items()
        if not (name.startswith(("__", "#")) or _is_handle(value))
    }


def _is_handle(value: Any) -> bool:
    if isinstance(value, Mapping):
        return set(value) == _HANDLE_FIELDS
    return isinstance(value, np.ndarray) and bool((value.ravel()[:1] == _HANDLE).any())


def _check_elements(path: Path) -> None:
    """Prove a file's checksums and bound its size: scipy may crash on a damaged one."""
    import h5py

    if h5py.is_hdf5(path):
        with h5py.File(path, "r") as content:
            check_hdf5(path, content, skip=("#refs#",))
    total = 0
    with path.open("rb") as file:
        major, _ = matfile_version(file)  # by which pymatreader chooses how to read
        if major == _VERSION_4:
            shapes = [(s, math.prod(s)) for _, s, _ in whosmat(file)]
            check_unpacked(path, NUMBER_BYTES * sum(max(*s, n) for s, n in shapes))
        if major != _VERSION_5:
            return
        file.seek(0)
        order = "<" if file.read(_HEADER_BYTES).endswith(b"IM") else ">"
        while tag := file.read(8):
            kind, size = struct.unpack(f"{order}2I", tag)
            content = file.read(size)
            if len(content) < size or kind not in (_MATRIX, _COMPRESSED):
                raise EOFError("a variable is cut off")
            packed = kind == _COMPRESSED
            stream = io.BufferedReader(_Inflated(content)) if packed else io.BytesIO(tag + content)
            for n_bytes in _sizes(stream, order):
                total += n_bytes
                check_unpacked(path, total)


def _sizes(stream: IO[bytes], order: str) -> Iterator[int]:
    """Yield the bytes that each array and each run of numbers takes once it is read."""
    while len(tag := stream.read(8)) == 8:
        kind, size = struct.unpack(f"{order}2I", tag)
        if kind == _MATRIX:  # its parts follow
            yield OBJECT_BYTES + (_size_of_places(stream, order) if size else 0)
        elif not kind >> 16:  # else its few numbers stand in the tag
            # The numbers, and beside them their bytes while they are read.
            yield NUMBER_BYTES * size // _NUMBER_SIZES.get(kind, 1) + size
            left = size + -size % 8
            while left > 0 and (block := stream.read(min(left, _BLOCK_BYTES))):
                left -= len(block)


def _size_of_places(stream: IO[bytes], order: str) -> int:
    """Return the bytes that a cell array, a struct or a text takes before its parts are read."""
    array_class = struct.unpack(f"{order}4I", stream.read(16))[2] & 0xFF
    if array_class not in (_CELL, _STRUCT, _OBJECT, _CHAR):
        return 0
    n = int(math.prod(np.frombuffer(_part(stream, order), f"{order}u4").tolist()))
    if array_class in (_CELL, _CHAR):
        return NUMBER_BYTES * n
    *_, width, names = [_part(stream, order) for _ in range(array_class + 1)]
    n_fields = len(names) // max(1, int(np.frombuffer(width, f"{order}u4")[0]))
    return (NUMBER_BYTES * n + OBJECT_BYTES) * n_fields


def _part(stream: IO[bytes], order: str) -> bytes:
    """Return the next element of an array's description."""
    kind, size = struct.unpack(f"{order}2I", tag := stream.read(8))
    if kind >> 16:  # it stands in the tag
        return tag[4 : 4 + (kind >> 16)]
    if size > _MOST_NAMES_BYTES:
        raise EOFError("the description of a variable is damaged")
    return stream.read(size + -size % 8)[:size]


class _Inflated(io.RawIOBase):
    """A compressed variable, unpacked piece by piece; a wrong checksum ends it with an error."""

    def __init__(self, content: bytes) -> None:
        self._file, self._unpacker, self._rest = io.BytesIO(content), zlib.decompressobj(), b""

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        piece = b""
        while not piece and not self._unpacker.eof:
            self._rest = self._rest or self._file.read(_PACKED_BYTES)
            if not self._rest:
                raise EOFError("a compressed variable is cut off")
            piece = self._unpacker.decompress(self._rest, len(buffer))
            self._rest = self._unpacker.unconsumed_tail
        buffer[: len(piece)] = piece
        return len(piece)


_SERIES = (list, Mapping, np.ndarray)


def value_at(value: Any, parts: list[str]) -> Any:
    """Follow a dotted name; None where it leads nowhere."""
    for part in parts:
        if isinstance(value, Mapping):
            value = value.get(part)
        elif part.isdecimal():
            value = _numbered(value, int(part))
        else:
            return None
    return None if isinstance(value, Mapping) else value


def _numbered(value: Any, number: int) -> Any:
    """Return a column of a matrix or an element of a list, counted from 1."""
    if isinstance(value, np.ndarray) and value.ndim == 2 and 1 <= number <= value.shape[1]:
        return value[:, number - 1]
    if isinstance(value, list) and 1 <= number <= len(value):
        return value[number - 1]
    return None


def series_at(path: Path, name: str, value: Any) -> np.ndarray:
    """Return one series of samples."""
    if isinstance(value, list) and any(isinstance(v, (list, dict, np.ndarray)) for v in value):
        raise file_error(
            path,
            f"expected one series, found {len(value)} pieces. Choose one of them: {name}.1 to "
            f"{name}.{len(value)}.",
            channel=name,
        )
    text = isinstance(value, list) and any(isinstance(v, str) for v in value)
    array = np.array(value, dtype=object) if text else np.atleast_1d(np.asarray(value))
    if array.ndim == 2 and 1 in array.shape:
        array = array.ravel()
    if array.ndim == 2:
        n_rows, n_columns = array.shape
        raise file_error(
            path,
            f"expected one series, found a matrix of {n_rows} x {n_columns}. Choose one of its "
            f"columns: {name}.1 to {name}.{n_columns}.",
            channel=name,
        )
    return array


def _is_wide(matrix: np.ndarray) -> bool:
    """Whether a matrix has samples along its rows, or is an image: no column is a series."""
    n_rows, n_columns = matrix.shape
    return bool(n_columns > _MOST_COLUMNS and n_columns >= n_rows)


def series_names(content: Mapping[str, Any], prefix: str = "") -> Iterator[str]:
    """Yield the dotted names of what may be a series of samples."""
    for name, value in content.items():
        if isinstance(value, list) and any(isinstance(v, _SERIES) for v in value):  # of structs
            value = {str(i): element for i, element in enumerate(value, start=1)}
        if isinstance(value, Mapping):
            yield from series_names(value, f"{prefix}{name}.")
        elif isinstance(value, np.ndarray) and value.ndim == 2 and not _is_wide(value):
            yield from (f"{prefix}{name}.{i + 1}" for i in range(value.shape[1]))
        elif value is not None:
            yield prefix + name


def column_labels(
    content: Mapping[str, Any], prefix: str = ""
) -> Iterator[tuple[str, tuple[str, str]]]:
    """Yield columns of matrices, each with name and unit out of cell arrays of text beside it."""
    texts = [
        v for v in content.values() if isinstance(v, list) and all(isinstance(t, str) for t in v)
    ]
    for name, value in content.items():
        if isinstance(value, Mapping):
            yield from column_labels(value, f"{prefix}{name}.")
        elif isinstance(value, np.ndarray) and value.ndim == 2:
            nothing = [""] * value.shape[1]
            beside = [text for text in texts if len(text) == len(nothing)]
            units = next((text for text in beside if all(map(is_unit, text))), nothing)
            names = next((text for text in beside if text is not units), nothing)
            for k, label in enumerate(zip(names, units, strict=True), start=1):
                yield f"{prefix}{name}.{k}", label
