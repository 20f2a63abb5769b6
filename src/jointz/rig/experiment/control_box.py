"""Commands of an operator's page, in a small file that both processes hold in memory.

The loop looks at it once a tick without a call to the system; whoever writes cannot make it
wait. A command starts, pauses, continues or ends, notes something down, or changes a parameter of
a controller, within the bounds and at the rate that the controller declares. None asks for torque.

Bytes, little-endian: 0 magic, 4 stop (anything but 0), 8 the page's last sign of life (ns of the
machine's monotonic clock), 16 how many commands were ever written, 64 a ring of commands of 256
bytes each: number, code, bytes of text, CRC-32 of these and the text, text in UTF-8.
"""

import mmap
import os
import struct
import time
import zlib
from contextlib import suppress
from enum import IntEnum
from pathlib import Path
from typing import NamedTuple

from jointz.core.errors import DataError
from jointz.core.whole_file import whole_file

_MAGIC = b"JZC1"
_STOP_AT, _BEAT_AT, _COUNT_AT, _RING_AT = 4, 8, 16, 64
_NUMBER = struct.Struct("<Q")
_HEAD = struct.Struct("<QHHI")
_ENTRY_BYTES, _ENTRIES = 256, 32
_SIZE = _RING_AT + _ENTRY_BYTES * _ENTRIES
#: Longer notes are refused where they are written.
LONGEST_TEXT_BYTES = _ENTRY_BYTES - _HEAD.size


class Order(IntEnum):
    """Commands of a page besides a stop."""

    START = 1
    PAUSE = 2
    GO_ON = 3
    NOTE = 4
    SET = 5
    UNDO = 6


class Command(NamedTuple):
    """One command."""

    order: Order  # requested action
    text: str = ""  # text of a note; "name=value" of a parameter to set; "" for other orders


def setting_text(name: str, value: float) -> str:
    """Return the text of a ``SET`` command."""
    return f"{name}={value!r}"


def read_setting(text: str) -> tuple[str, float]:
    """Return name and value of a ``SET`` command; ValueError if the text holds no number."""
    name, _, value = text.rpartition("=")
    return name, float(value)


class ControlBox:
    """The session's side: created with the session, read at every tick."""

    def __init__(self, path: Path) -> None:
        with whole_file(path) as partial:
            partial.write_bytes(_MAGIC + bytes(_SIZE - len(_MAGIC)))
        self._path, self._file = path, path.open("r+b")
        self._map = mmap.mmap(self._file.fileno(), _SIZE)
        self._taken = 0
        #: Commands that could not be read, so far.
        self.refused = 0

    def __enter__(self) -> "ControlBox":
        return self

    def __exit__(self, *_: object) -> None:
        self._map.close()
        self._file.close()
        with suppress(OSError):  # gone, or held by the page (Windows)
            self._path.unlink()

    @property
    def stop_asked(self) -> bool:
        """Whether a stop was asked for."""
        return self._map[_STOP_AT] != 0

    @property
    def beat_ns(self) -> int:
        """The page's last sign of life by the machine's monotonic clock, ns; 0 before the first."""
        return int(_NUMBER.unpack_from(self._map, _BEAT_AT)[0])

    def take(self) -> Command | None:
        """Return the oldest command that was not taken yet, None where there is none.

        What cannot be read is counted in ``refused`` and left out: a torn or forged entry, an
        unknown code, entries that were written over before they were taken.
        """
        count = int(_NUMBER.unpack_from(self._map, _COUNT_AT)[0])
        if count == self._taken:
            return None
        if not 0 < count - self._taken <= _ENTRIES:  # overrun, or no count at all
            self.refused += 1
            self._taken = count
            return None
        self._taken += 1
        command = self._entry(self._taken)
        if command is None:
            self.refused += 1
        return command

    def _entry(self, number: int) -> Command | None:
        at = _RING_AT + _ENTRY_BYTES * ((number - 1) % _ENTRIES)
        written, code, length, check = _HEAD.unpack_from(self._map, at)
        if written != number or length > LONGEST_TEXT_BYTES:
            return None
        text = self._map[at + _HEAD.size : at + _HEAD.size + length]
        if check != _checksum(written, code, text):
            return None
        try:
            return Command(Order(code), text.decode())
        except ValueError:  # no order of ours, or no text
            return None


class ControlSender:
    """The page's side."""

    def __init__(self, path: Path) -> None:
        try:
            self._file = path.open("r+b")
        except OSError as exc:
            raise DataError(
                f"{path}: no running session has made it. Start the session first.", path=str(path)
            ) from exc
        if os.fstat(self._file.fileno()).st_size != _SIZE or self._file.read(4) != _MAGIC:
            self._file.close()
            raise DataError(f"{path}: not the control file of a session.", path=str(path))
        self._map = mmap.mmap(self._file.fileno(), _SIZE)

    def close(self) -> None:
        """Close the file."""
        self._map.close()
        self._file.close()

    def stop(self) -> None:
        """Request a stop; it cannot be taken back."""
        self._map[_STOP_AT] = 1

    def beat(self) -> None:
        """Send a sign of life."""
        _NUMBER.pack_into(self._map, _BEAT_AT, time.monotonic_ns())

    def send(self, order: Order, text: str = "") -> None:
        """Send a command."""
        data = text.encode()
        if len(data) > LONGEST_TEXT_BYTES:
            raise DataError(
                f"note: {len(data)} bytes; at most {LONGEST_TEXT_BYTES} fit. Write two notes."
            )
        number = int(_NUMBER.unpack_from(self._map, _COUNT_AT)[0]) + 1
        at = _RING_AT + _ENTRY_BYTES * ((number - 1) % _ENTRIES)
        check = _checksum(number, order, data)
        _HEAD.pack_into(self._map, at, number, order, len(data), check)
        self._map[at + _HEAD.size : at + _HEAD.size + len(data)] = data
        # Last: an entry is looked at only when it is counted.
        _NUMBER.pack_into(self._map, _COUNT_AT, number)


def _checksum(number: int, code: int, text: bytes) -> int:
    return zlib.crc32(text, zlib.crc32(_HEAD.pack(number, code, len(text), 0)))
