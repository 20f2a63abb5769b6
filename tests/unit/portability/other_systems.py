"""What Windows and a Mac lack or do differently, put over a Python of Linux: run before jointz.

Only what jointz meets: modules and functions that are not there, bytes that are written as text
unless asked, files that cannot be renamed or removed while they are open, locks of bytes.
"""

import asyncio  # noqa: F401 - what the standard library takes of this system it takes now
import concurrent.futures  # noqa: F401
import errno
import fcntl
import os
import pathlib
import signal
import subprocess  # noqa: F401
import sys
import types

_BINARY = 1 << 30
_MODULES = ("fcntl", "resource", "pwd", "grp", "termios")
_OF_SIGNAL = ("SIGHUP", "SIGKILL", "pthread_sigmask", "setitimer", "alarm")
_OF_OS = ("fork", "setsid", "killpg", "fchmod", "chown")


def as_on_a_mac() -> None:
    """Take away what macOS lacks."""
    for name in [name for name in vars(os) if name.startswith(("sched_", "SCHED_"))]:
        delattr(os, name)
    if hasattr(os, "process_cpu_count"):  # since Python 3.13; on Linux it asks sched_getaffinity
        os.process_cpu_count = os.cpu_count
    exists = pathlib.Path.exists
    pathlib.Path.exists = lambda self, **more: (
        not str(self).startswith("/proc/") and exists(self, **more)
    )


def as_on_windows() -> None:
    """Take away what Windows lacks, and do files as it does."""
    as_on_a_mac()
    for name in _OF_SIGNAL:
        delattr(signal, name)
    for name in _OF_OS:
        delattr(os, name)
    sys.modules |= dict.fromkeys(_MODULES)
    sys.modules["msvcrt"] = _msvcrt()
    _write_text_unless_asked()
    for name in ("rename", "replace", "unlink", "remove", "rmdir"):
        setattr(os, name, _refusing_open_files(getattr(os, name)))


def _msvcrt() -> types.ModuleType:
    module = types.ModuleType("msvcrt")
    module.LK_NBLCK = 2

    def locking(fd: int, mode: int, count: int) -> None:
        assert (mode, count) == (module.LK_NBLCK, 1)
        # What is locked cannot be read by others: it must lie behind all that is written.
        assert os.lseek(fd, 0, os.SEEK_CUR) > os.fstat(fd).st_size
        try:
            fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise PermissionError(errno.EACCES, "Permission denied") from None

    module.locking = locking
    return module


def _write_text_unless_asked() -> None:
    opened, write, text = os.open, os.write, set()

    def open_(path, flags, *rest, **more):
        fd = opened(path, flags & ~_BINARY, *rest, **more)
        (text.discard if flags & _BINARY else text.add)(fd)
        return fd

    def write_(fd, data):
        written = write(fd, bytes(data).replace(b"\n", b"\r\n") if fd in text else data)
        return min(written, len(data))

    os.O_BINARY, os.open, os.write = _BINARY, open_, write_


def _refusing_open_files(call):
    def refusing(path, *rest, **more):
        if more.get("dir_fd") is None:
            inside = os.path.realpath(path)
            for name in _open_files():
                if name == inside or name.startswith(inside + os.sep):
                    raise PermissionError(errno.EACCES, f"open: {name}", str(path))
        return call(path, *rest, **more)

    return refusing


def _open_files() -> list[str]:
    found = []
    for fd in os.listdir("/proc/self/fd"):
        try:
            found.append(os.readlink(f"/proc/self/fd/{fd}"))
        except OSError:  # that of the list itself
            continue
    return found
