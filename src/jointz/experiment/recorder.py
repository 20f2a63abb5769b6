"""Writes the log: one unbuffered write a tick, so that a crash loses nothing before it."""

import os
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

from jointz.core.errors import OutputError, WriteError
from jointz.core.session_log import Layout
from jointz.experiment.whole_files import append_whole


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
    OutputError
        When the file exists.
    WriteError
        When the disk does not take the header.
    """

    def __init__(self, path: Path, header: Mapping[str, Any], layout: Layout) -> None:
        self._path = path
        self._pack = layout.pack
        if path.exists():
            raise OutputError(
                f"{path}: a log that the journal knows nothing of; no log is ever written over. "
                "Restore the journal from a copy, or move the log away."
            )
        # A name of its own at first: a log without its header, left by a crash or a full disk,
        # would keep the whole session from being read.
        partial = path.with_name(f"{path.name}.partial")
        flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND
        try:
            self._fd = os.open(partial, flags, 0o644)
        except OSError as exc:
            raise WriteError(str(path), exc) from exc
        try:
            append_whole(self._fd, layout.encode_header(header), path)
            os.fsync(self._fd)  # else a power cut may leave the name without the header
            partial.rename(path)
        except (OSError, WriteError) as exc:
            os.close(self._fd)
            partial.unlink()
            raise exc if isinstance(exc, WriteError) else WriteError(str(path), exc) from exc

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
        WriteError
            When the disk does not take them whole.
        """
        pack = self._pack
        data = pack(records[0]) if len(records) == 1 else b"".join(pack(r) for r in records)
        append_whole(self._fd, data, self._path)

    @property
    def size_bytes(self) -> int:
        """Bytes of the log so far."""
        return os.fstat(self._fd).st_size
