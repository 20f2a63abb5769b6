"""Lock on a file that ends with the process that holds it."""

import os
from importlib import import_module
from pathlib import Path
from typing import Any

from jointz.core.errors import OutputError, WriteError

#: Byte that is locked on Windows, where nobody reads what is locked: far behind the end.
_FAR = 2**31 - 2


def hold(fd: int, file: Path) -> None:
    """Hold a file until it is closed, or the process ends in any way."""
    try:
        free = _lock(fd)
    except OSError as exc:
        raise WriteError(str(file), exc, "Name a folder on a disk that knows locks.") from exc
    if not free:
        raise OutputError(
            f"{file.parent}: another process is running this. Wait for its end, or stop it."
        )


def _lock(fd: int) -> bool:
    """Lock a file; False where another process has."""
    try:
        import fcntl
    except ImportError:  # Windows
        return _lock_far_behind(fd)
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _lock_far_behind(fd: int) -> bool:
    msvcrt: Any = import_module("msvcrt")
    at = os.lseek(fd, 0, os.SEEK_CUR)
    os.lseek(fd, _FAR, os.SEEK_SET)
    try:
        msvcrt.locking(fd, msvcrt.LK_NBLCK, 1)
    except PermissionError:
        return False
    finally:
        os.lseek(fd, at, os.SEEK_SET)
    return True
