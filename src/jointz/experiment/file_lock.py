"""One process at a time: a lock on a file, gone with the process that holds it."""

import fcntl
from pathlib import Path

from jointz.core.errors import OutputError, WriteError


def hold(fd: int, file: Path) -> None:
    """Hold a file until it is closed, or the process ends in any way.

    Parameters
    ----------
    fd : int
        Of the file, open for writing.
    file : pathlib.Path
        Its name, for messages.

    Raises
    ------
    OutputError
        When another process holds it.
    WriteError
        When the file system knows no locks.
    """
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as exc:
        raise OutputError(
            f"{file.parent}: another process is running this. Wait for its end, or stop it."
        ) from exc
    except OSError as exc:
        raise WriteError(str(file), exc, "Name a folder on a disk that knows locks.") from exc
