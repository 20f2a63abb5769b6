"""Follows files that a session is still writing, asking nothing of it.

A journal and a log only grow; what is not whole yet is left for the next look. A look takes a
limited share of a long file, so that catching up never holds up anything else.
"""

import zlib
from pathlib import Path
from typing import Any

import numpy as np

from jointz.core.errors import DataError
from jointz.core.session_log import Layout, decode_header
from jointz.rig.experiment.files.journal import Event, decode_event

#: Of a log at a look: more than a second of any loop, little enough to be read in one go.
_MOST_RECORDS = 4000
_MOST_JOURNAL_BYTES = 1_000_000
_LONGEST_HEADER_BYTES = 100_000


class JournalTail:
    """The events of a journal as they come."""

    def __init__(self, path: Path, *, from_end: bool = False) -> None:
        self._path = path
        self._at = _read(path, 0, -1).rfind(b"\n") + 1 if from_end else 0

    def poll(self) -> list[Event]:
        """Return the events since the last look."""
        content = _read(self._path, self._at, _MOST_JOURNAL_BYTES)
        lines = content.split(b"\n")[:-1]
        events = [_event(self._path, line) for line in lines]
        self._at += sum(len(line) + 1 for line in lines)
        return events


class LogTail:
    """The records of a log as they come."""

    def __init__(self, path: Path, *, from_end: bool = False) -> None:
        self._path = path
        self._at = 0
        self._layout: Layout | None = None
        self._doubted_at = -1
        self.header: dict[str, Any] = {}
        self.damaged = 0
        if from_end:
            self._skip()

    def _skip(self) -> None:
        self._layout = self._read_header()
        if self._layout is not None:
            size = self._layout.record_bytes
            self._at += (self._path.stat().st_size - self._at) // size * size

    def poll(self) -> np.ndarray:
        """Return the records since the last look, at most a few thousand."""
        if self._layout is None:
            self._layout = self._read_header()
        if self._layout is None:
            return np.empty(0)
        size = self._layout.record_bytes
        content = _read(self._path, self._at, _MOST_RECORDS * size)
        whole = self._whole(content, size)
        self._at += whole * size
        return np.frombuffer(content, dtype=self._layout.dtype, count=whole)

    def _whole(self, content: bytes, size: int) -> int:
        """Return how many good records come first; one that stays bad is stepped over."""
        count = len(content) // size
        for k in range(count):
            end = (k + 1) * size
            check = int.from_bytes(content[end - 4 : end], "little")
            if zlib.crc32(content[k * size : end - 4]) == check:
                continue
            at = self._at + k * size
            if k == 0 and self._doubted_at == at and count > 1:  # it had its time
                self.damaged += 1
                self._at += size
                return 0
            self._doubted_at = at
            return k
        return count

    def _read_header(self) -> Layout | None:
        content = _read(self._path, 0, _LONGEST_HEADER_BYTES)
        if b"\n" not in content:
            return None
        try:
            header = decode_header(content)
        except ValueError as exc:
            raise DataError(
                f"{self._path}: not a log of this jointz. Follow it with the one that writes it.",
                path=str(self._path),
            ) from exc
        self.header, self._at = header.values, header.size_bytes
        return header.layout


def _read(path: Path, at: int, most: int) -> bytes:
    try:
        with path.open("rb") as stream:
            stream.seek(at)
            return stream.read(most)
    except FileNotFoundError:
        return b""
    except OSError as exc:
        raise DataError(f"{path}: cannot be read ({exc.strerror}).", path=str(path)) from exc


def _event(path: Path, line: bytes) -> Event:
    event = decode_event(line)
    if event is None:
        raise DataError(
            f"{path}: a line was altered or damaged: its checksum does not fit. Restore the file "
            "from a copy.",
            path=str(path),
        )
    return event
