"""Store of finished tasks, so that none is run twice."""

import errno
import hashlib
import json
import os
import pickle
import shutil
import stat
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from jointz.core.errors import OutputError, WriteError
from jointz.core.provenance import software
from jointz.core.whole_file import whole_file

Result = TypeVar("Result")

_SUFFIX = ".result"
_KEPT_S = 30 * 86_400.0
_ANOTHER = "Make room, or set XDG_CACHE_HOME to another folder of your own."


@dataclass(frozen=True, slots=True)
class TaskStore:
    """Results of a job that are done, kept in the user's cache folder.

    They are pickles, which run code when they are read. So nothing is read from where data can
    arrive: the folder is below ``$XDG_CACHE_HOME/jointz/tasks`` or ``~/.cache/jointz/tasks`` of
    whoever does the task, named by a hash of the place, and no other user may write there.

    Parameters
    ----------
    place : pathlib.Path
        Of the job, such as the results folder: what tells its results from another job's. Nothing
        is written to it or read from it.
    """

    place: Path

    def __post_init__(self) -> None:
        """Make the path absolute: workers may run in another folder."""
        object.__setattr__(self, "place", self.place.resolve())

    def check_writable(self) -> None:
        """Refuse a cache folder that cannot be written, or that another user may write to."""
        root = _own_root()
        if not os.access(root, os.W_OK):
            raise WriteError(str(root), PermissionError(errno.EACCES, "read-only"), _ANOTHER)

    @property
    def folder(self) -> Path:
        """The folder, which is made when the first result comes."""
        name = hashlib.sha256(os.fsencode(self.place)).hexdigest()[:32]
        return _own_root() / name

    def holds(self, key: str) -> bool:
        """Tell whether a result is there."""
        return _file(self.folder, key).exists()

    def kept(self, key: Callable[[], str], call: Callable[[], Result]) -> Callable[[], Result]:
        """Return a call that keeps its result, or returns the one that was kept."""
        return partial(_kept, self, key, call)

    @contextmanager
    def noting_kept_results(self) -> Iterator[None]:
        """Add to an error that leaves the block which results are kept."""
        try:
            yield
        except Exception as exc:
            if any(self.folder.glob(f"*{_SUFFIX}")):
                exc.add_note(
                    f"What is done is kept in {self.folder}: the same command goes on from there."
                )
            raise

    def clear(self) -> None:
        """Remove all results."""
        shutil.rmtree(self.folder, ignore_errors=True)


def task_key(*, what: str, inputs: Mapping[str, str], settings: Mapping[str, Any]) -> str:
    """Return the name of a result: a hash of all that it depends on."""
    depends = {"what": what, "inputs": dict(inputs), "settings": settings, **software()}
    text = json.dumps(depends, sort_keys=True, default=repr)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def _file(folder: Path, key: str) -> Path:
    return folder / f"{key}{_SUFFIX}"


def _own_root() -> Path:
    """Return the folder of all stores, writable by its user only; it is made if missing."""
    named = os.environ.get("XDG_CACHE_HOME", "")
    cache = Path(named if os.path.isabs(named) else os.path.expanduser("~/.cache"))
    if not cache.is_absolute():
        raise WriteError(str(cache), FileNotFoundError(errno.ENOENT, "no home folder"), _ANOTHER)
    return _own(_own(cache / "jointz") / "tasks")


def _own(folder: Path) -> Path:
    """Return a folder, made where it is not there; refuse one that others may write to."""
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
        status = folder.lstat()
    except OSError as exc:
        raise WriteError(str(folder), exc, _ANOTHER) from exc
    foreign = hasattr(os, "getuid") and (
        status.st_uid != os.getuid() or status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    )
    if foreign or not stat.S_ISDIR(status.st_mode):
        raise OutputError(
            f"{folder}: expected a folder of your own that nobody else can write to: results in "
            f"it can run code. Where it is yours, remove it or chmod 700 it. {_ANOTHER}"
        )
    return folder


def _kept(store: TaskStore, key: Callable[[], str], call: Callable[[], Result]) -> Result:
    folder = store.folder
    file = _file(folder, key())
    if os.path.lexists(folder):
        _own(folder)
        with suppress(Exception):  # not there, damaged, or of a module that is gone: made again
            kept: Result = pickle.loads(file.read_bytes())  # this user's own
            return kept
    else:
        _remove_old(folder.parent)
    result = call()
    try:
        _keep(file, result)
    except WriteError as exc:
        if not isinstance(exc.__cause__, FileNotFoundError):
            raise
        _keep(file, result)  # another run for the same place ended and removed the folder
    return result


def _keep(file: Path, result: object) -> None:
    """Write a result, in a folder that is made if missing."""
    _own(file.parent)
    with whole_file(file, _ANOTHER) as partial_file, partial_file.open("wb") as stream:
        pickle.dump(result, stream, protocol=pickle.HIGHEST_PROTOCOL)
        stream.flush()
        os.fsync(stream.fileno())  # or a name may outlive its content when the power fails


def _remove_old(root: Path) -> None:
    """Remove what nobody has gone on with for a month."""
    oldest_s = time.time() - _KEPT_S
    for folder in root.iterdir():
        with suppress(OSError):
            if folder.stat().st_mtime < oldest_s:
                shutil.rmtree(folder)
