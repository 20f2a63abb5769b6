"""Bytes of text files, unpacked and in UTF-8 whatever they are written in."""

import codecs
import gzip
import io
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, cast

from jointz.core.errors import DataError
from jointz.io.formats.columns import file_error

UTF8 = "utf-8"
_USUAL_SIGNS = "äöüßéèêàçñóíáâîôëïùìò°µ²³"
#: What the first bytes of a file say of its encoding.
_MARKS = (
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
    (codecs.BOM_UTF8, UTF8),
)
_FIRST_BYTES = 1 << 16
_BLOCK_BYTES = 1 << 18
DECOMPRESSION_ERRORS = (EOFError, zlib.error, gzip.BadGzipFile)


def stated_encoding(path: Path, encoding: str | None) -> str:
    """Return the encoding that a file's first bytes state, else the given one, else UTF-8."""
    with reading_errors(path), _open_decompressed(path) as stream:
        first = stream.read(4)
    marked = (name for mark, name in _MARKS if first.startswith(mark))
    return next(marked, encoding or UTF8)


def likely_encoding(path: Path) -> str:
    """Return the encoding in which the first bytes of a file are a usual text."""
    with reading_errors(path), _open_decompressed(path) as stream:
        first = stream.read(_FIRST_BYTES)
    if b"\0" in first:
        return "utf-16-le" if first[1::2].count(0) > first[::2].count(0) else "utf-16-be"
    first = first[: first.rfind(b"\n") + 1] or first
    try:
        return first.decode(UTF8) and UTF8
    except UnicodeDecodeError:
        texts = {name: first.decode(name, errors="replace") for name in ("cp1252", "mac_roman")}
        return max(texts, key=lambda name: sum(texts[name].count(sign) for sign in _USUAL_SIGNS))


def is_compressed(path: Path) -> bool:
    """Return whether a file is packed by gzip."""
    return path.name.lower().endswith(".gz")


def _open_decompressed(path: Path) -> IO[bytes]:
    return cast("IO[bytes]", gzip.open(path)) if is_compressed(path) else path.open("rb")


def recoded(stream: IO[bytes], encoding: str) -> IO[bytes]:
    """Return the bytes of a text in UTF-8."""
    return stream if encoding == UTF8 else io.BufferedReader(_Recoded(stream, encoding))


def open_text_bytes(path: Path, encoding: str) -> IO[bytes]:
    """Open a file for its bytes in UTF-8, unpacked."""
    return recoded(_open_decompressed(path), encoding)


class _Recoded(io.RawIOBase):
    """A text of another encoding, as UTF-8."""

    def __init__(self, stream: IO[bytes], encoding: str) -> None:
        # A text of an old Mac ends its lines by a sign of its own.
        self._text = io.TextIOWrapper(stream, encoding=encoding, newline=None)
        self._rest = b""

    def close(self) -> None:
        self._text.close()
        super().close()

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        self._rest = self._rest or self._text.read(_BLOCK_BYTES).encode()
        block, self._rest = self._rest[: len(buffer)], self._rest[len(buffer) :]
        buffer[: len(block)] = block
        return len(block)


@contextmanager
def reading_errors(path: Path) -> Iterator[None]:
    """Turn errors of unpacking and decoding into errors about the file."""
    try:
        yield
    except UnicodeDecodeError as exc:
        raise not_decoded(path, exc) from exc
    except DECOMPRESSION_ERRORS as exc:
        raise file_error(
            path,
            "the recording is cut off or damaged; its compressed stream does not end as it should "
            f"({exc}). Copy the file again.",
        ) from exc


def not_decoded(path: Path, exc: UnicodeDecodeError) -> DataError:
    """Return the error of a text that is not in the stated encoding."""
    byte = exc.object[exc.start : exc.start + 1]
    return file_error(
        path,
        f"expected {exc.encoding.upper()} text, found {byte!r} ({exc.reason}). Set [files] encoding"
        ' (jointz identify: --encoding), of Western Windows files "cp1252".',
    )
