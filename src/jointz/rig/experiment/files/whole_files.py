"""The files of an experiment: written whole or not at all, read or refused."""

import json
import os
import shutil
from collections.abc import Mapping
from errno import ENOSPC
from itertools import count
from pathlib import Path
from typing import Any

from jointz.core.errors import DataError, WriteError
from jointz.core.session_log import checked_line, checked_text
from jointz.core.whole_file import whole_file


def make_folder(folder: Path) -> None:
    """Make a folder and those above it; one that is there stays."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as exc:
        raise WriteError(str(folder), exc, "Name a place that can be written.") from exc


def write_whole(file: Path, text: str) -> None:
    """Write a file that is there whole or not at all."""
    with whole_file(file) as partial, partial.open("w", encoding="utf-8", newline="\n") as stream:
        stream.write(text)
        stream.flush()
        os.fsync(stream.fileno())


def open_to_append(file: Path, *, emptied: bool = False) -> int:
    """Open a file for appending bytes as they are, and make it where there is none."""
    flags = os.O_RDWR | os.O_CREAT | os.O_APPEND | (os.O_TRUNC if emptied else 0)
    # Windows makes two bytes of every one that looks like the end of a line, unless asked.
    return os.open(file, flags | getattr(os, "O_BINARY", 0), 0o644)


def append_whole(fd: int, data: bytes, path: Path) -> None:
    """Append to a file by one write."""
    try:
        written = os.write(fd, data)
    except OSError as exc:
        raise WriteError(str(path), exc) from exc
    if written != len(data):
        raise WriteError(str(path), OSError(ENOSPC, os.strerror(ENOSPC)))


def read_object(file: Path, *, otherwise: str = "Restore it from a copy.") -> dict[str, Any]:
    """Return the object that stands in a JSON file."""
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as exc:
        raise DataError(
            f"{file}: damaged, it cannot be read as JSON ({exc}). {otherwise}", path=str(file)
        ) from exc
    if not isinstance(content, Mapping):
        raise DataError(
            f"{file}: damaged, expected a JSON object, got {type(content).__name__}. {otherwise}",
            path=str(file),
        )
    return dict(content)


def kept_beside(file: Path) -> Path:
    """Return a copy of a damaged file, made beside it under a name that was free."""
    names = (file.with_name(f"{file.name}.damaged{n or ''}") for n in count())
    kept = next(name for name in names if not name.exists())
    with whole_file(kept) as partial:
        shutil.copy2(file, partial)
    return kept


def write_twice(file: Path, text: str) -> None:
    """Write a file and a copy with a checksum beside it."""
    write_whole(_copy_of(file), checked_line(text.encode("ascii")).decode("ascii"))
    write_whole(file, text)


def is_written(file: Path) -> bool:
    """Return whether a file that is written twice, or its copy, exists."""
    return file.exists() or _copy_of(file).exists()


def read_twice(file: Path) -> tuple[dict[str, Any], str]:
    """Return the object of a JSON file that has a copy, and which of the two is damaged."""
    copy = _copy_of(file)
    if not copy.exists():
        return read_object(file), ""
    text = checked_text(copy.read_bytes()[:-1])
    if text is None:
        return read_object(file), f"{copy.name}: damaged; {file.name} was taken."
    damaged = not file.exists() or file.read_bytes() != text
    note = (
        f"{file.name}: damaged or altered; {copy.name} is intact and was taken." if damaged else ""
    )
    return dict(json.loads(text)), note


def _copy_of(file: Path) -> Path:
    return file.with_name(f"{file.name}.copy")
