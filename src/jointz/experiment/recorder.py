"""Writes the log: one unbuffered write a tick, so that a crash loses nothing before it."""

import os
from collections.abc import Mapping
from errno import EEXIST
from pathlib import Path
from types import TracebackType
from typing import Any

from jointz.core.session_log import Layout


class Recorder:
    """The log of one segment; it appears under its name with its whole header.

    Parameters
    ----------
    path : pathlib.Path
        A file that does not exist yet.
    header : mapping
        What the log is of.
    layout : Layout
        Of the records.

    Raises
    ------
    OSError
        When the file exists, or the disk does not take the header.
    """

    def __init__(self, path: Path, header: Mapping[str, Any], layout: Layout) -> None:
        self._path = path
        self._pack = layout.pack
        if path.exists():
            raise FileExistsError(EEXIST, "a log is never written over", str(path))
        # A name of its own at first: a log without its header, left by a crash or a full disk,
        # would keep the whole session from being read.
        partial = path.with_name(f"{path.name}.partial")
        self._fd = os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND, 0o644)
        try:
            self._write_all(layout.encode_header(header))
            os.rename(partial, path)
        except OSError:
            os.close(self._fd)
            partial.unlink()
            raise

    def __enter__(self) -> "Recorder":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        os.close(self._fd)

    def write(self, *records: tuple[float, ...]) -> None:
        """Write the records of one tick.

        Parameters
        ----------
        *records : tuple
            One number a field of the layout.

        Raises
        ------
        OSError
            When the disk does not take them whole.
        """
        pack = self._pack
        self._write_all(
            pack(records[0]) if len(records) == 1 else b"".join(pack(r) for r in records)
        )

    def _write_all(self, data: bytes) -> None:
        written = os.write(self._fd, data)
        if written != len(data):
            raise OSError(f"{self._path}: the disk took {written} of {len(data)} bytes.")
