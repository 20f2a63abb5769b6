"""Atomic writing of files: whole or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from jointz.core.errors import OutputError, WriteError


@contextmanager
def whole_file(file: Path, todo: str = "Make room.") -> Iterator[Path]:
    """Yield a temporary path; the file gets its name when the block ends without an error."""
    partial = file.with_name(f".{file.name}.{os.getpid()}.partial")
    try:
        try:
            yield partial
            partial.replace(file)
        finally:
            partial.unlink(missing_ok=True)
    except OSError as exc:
        raise WriteError(str(file), exc, todo) from exc


def refuse_existing(path: Path, what: str = "file") -> None:
    """Refuse to write where something is already."""
    if path.exists():
        raise OutputError(f"{path}: exists. Name another {what}, or remove it.")
