"""Names of paths that are not regular files, for messages."""

import os
import stat
from pathlib import Path

_KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a named pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


def special_kind(path: str | os.PathLike[str]) -> str:
    """Return what a path is if it is not a regular file; empty if it is one or is absent."""
    try:
        mode = Path(path).stat().st_mode
    except (OSError, ValueError):  # absent, or a name that no system takes
        return ""
    return next((name for is_kind, name in _KINDS if is_kind(mode)), "")


def missing_file(path: Path, todo: str, what: str = "file") -> str:
    """Return a message about a path that is not a regular file."""
    kind = special_kind(path)
    if kind:
        return f"{path}: is {kind}; expected a file. Name a recording."
    return f"{path}: no such {what}. {todo}"
