"""Writes the log: one unbuffered write a tick, so that a crash loses nothing before it."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jointz.core.errors import OutputError, WriteError
from jointz.core.session_log import Layout
from jointz.rig.experiment.files.whole_files import append_whole, open_to_append


class Recorder:
    """The log of one segment; it appears under its name with its whole header."""

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
        try:
            _write_header(partial, layout.encode_header(header))
            partial.rename(path)
            self._fd = open_to_append(path)
        except (OSError, WriteError) as exc:
            partial.unlink(missing_ok=True)
            raise exc if isinstance(exc, WriteError) else WriteError(str(path), exc) from exc

    def __enter__(self) -> "Recorder":
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self._fd)

    def write(self, *records: tuple[float, ...]) -> None:
        """Write the records of one tick."""
        pack = self._pack
        data = pack(records[0]) if len(records) == 1 else b"".join(pack(r) for r in records)
        append_whole(self._fd, data, self._path)

    @property
    def size_bytes(self) -> int:
        """Bytes of the log so far."""
        return os.fstat(self._fd).st_size


def _write_header(file: Path, header: bytes) -> None:
    """Write a log's header and close the file: Windows renames none that is open."""
    fd = open_to_append(file, emptied=True)
    try:
        append_whole(fd, header, file)
        os.fsync(fd)  # else a power cut may leave the name without the header
    finally:
        os.close(fd)
