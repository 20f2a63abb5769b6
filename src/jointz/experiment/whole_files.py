"""The files of an experiment: written whole or not at all, read or refused."""

import json
import os
import shutil
from collections.abc import Mapping
from errno import ENOSPC
from itertools import count
from pathlib import Path
from typing import Any

from jointz.core.checked_lines import checked_line, checked_text
from jointz.core.errors import DataError, WriteError
from jointz.core.whole_file import whole_file


def make_folder(folder: Path) -> None:
    """Make a folder and those above it; one that is there stays.

    Parameters
    ----------
    folder : pathlib.Path
        Which.

    Raises
    ------
    WriteError
        When the system does not let it be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as exc:
        raise WriteError(str(folder), exc, "Name a place that can be written.") from exc


def write_whole(file: Path, text: str) -> None:
    """Write a file that is there whole or not at all.

    Parameters
    ----------
    file : pathlib.Path
        The file; one that exists is replaced.
    text : str
        What is to stand in it.

    Raises
    ------
    WriteError
        When the system does not let it be written.
    """
    with whole_file(file) as partial, partial.open("w", encoding="utf-8", newline="\n") as stream:
        stream.write(text)
        stream.flush()
        os.fsync(stream.fileno())


def open_to_append(file: Path, *, emptied: bool = False) -> int:
    """Open a file for appending bytes as they are, and make it where there is none.

    Parameters
    ----------
    file : pathlib.Path
        The file.
    emptied : bool
        Whether what stands in it goes.

    Returns
    -------
    int
        Its descriptor.

    Raises
    ------
    OSError
        When the system does not let it be opened.
    """
    flags = os.O_RDWR | os.O_CREAT | os.O_APPEND | (os.O_TRUNC if emptied else 0)
    # Windows makes two bytes of every one that looks like the end of a line, unless asked.
    return os.open(file, flags | getattr(os, "O_BINARY", 0), 0o644)


def append_whole(fd: int, data: bytes, path: Path) -> None:
    """Append to a file by one write.

    Parameters
    ----------
    fd, path : int, pathlib.Path
        The file, open for appending, and its name.
    data : bytes
        What to append.

    Raises
    ------
    WriteError
        When the system does not take it whole.
    """
    try:
        written = os.write(fd, data)
    except OSError as exc:
        raise WriteError(str(path), exc) from exc
    if written != len(data):
        raise WriteError(str(path), OSError(ENOSPC, os.strerror(ENOSPC)))


def read_object(file: Path, *, otherwise: str = "Restore it from a copy.") -> dict[str, Any]:
    """Return the object that stands in a JSON file.

    Parameters
    ----------
    file : pathlib.Path
        The file.
    otherwise : str
        What to do where it cannot be read.

    Raises
    ------
    DataError
        When it cannot be read or holds something else.
    """
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
    """Return a copy of a damaged file, made beside it under a name that was free.

    Parameters
    ----------
    file : pathlib.Path
        The file.

    Raises
    ------
    WriteError
        When the system does not let it be written.
    """
    names = (file.with_name(f"{file.name}.damaged{n or ''}") for n in count())
    kept = next(name for name in names if not name.exists())
    with whole_file(kept) as partial:
        shutil.copy2(file, partial)
    return kept


def write_twice(file: Path, text: str) -> None:
    """Write a file and a copy with a checksum beside it.

    Parameters
    ----------
    file : pathlib.Path
        The file; one that exists is replaced.
    text : str
        What is to stand in it, ASCII.

    Raises
    ------
    WriteError
        When the system does not let it be written.
    """
    write_whole(_copy_of(file), checked_line(text.encode("ascii")).decode("ascii"))
    write_whole(file, text)


def is_written(file: Path) -> bool:
    """Tell whether a file that is written twice is there, or its copy."""
    return file.exists() or _copy_of(file).exists()


def read_twice(file: Path) -> tuple[dict[str, Any], str]:
    """Return the object of a JSON file that has a copy, and which of the two is damaged.

    Parameters
    ----------
    file : pathlib.Path
        The file; one of an earlier version has no copy.

    Returns
    -------
    content : dict
        From the one that is intact.
    damage : str
        A sentence about the one that is not, "" where both are.

    Raises
    ------
    DataError
        When neither is intact.
    """
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
