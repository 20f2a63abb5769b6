"""Results of tasks, kept as they come: what was done once is not done again."""

import hashlib
import json
import pickle
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from jointz.core.provenance import software
from jointz.core.whole_file import whole_file

Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class TaskStore:
    """A folder of results that every worker can see.

    Parameters
    ----------
    folder : pathlib.Path
        The folder; made when the first result comes. It is for this user's own runs: its files
        are pickles, which must not come from elsewhere.
    """

    folder: Path

    @classmethod
    def beside(cls, out: Path) -> "TaskStore":
        """Return the store of what becomes a folder: hidden beside it, where there is a place.

        Parameters
        ----------
        out : pathlib.Path
            The folder, which need not be there yet.
        """
        whole = out.resolve()
        place = next(folder for folder in whole.parents if folder.is_dir())
        return cls(place / f".{whole.name}.tasks")

    def kept(self, key: Callable[[], str], call: Callable[[], Result]) -> Callable[[], Result]:
        """Return a call that keeps its result, or returns the one that was kept.

        Parameters
        ----------
        key : callable
            Returns what :func:`task_key` does.
        call : callable
            Without arguments, fit for pickling.
        """
        return partial(_kept, self.folder, key, call)

    @contextmanager
    def until_done(self) -> Iterator["TaskStore"]:
        """Keep results while a block lasts, and after it only where it was interrupted.

        Yields
        ------
        TaskStore
            This one. A process that is killed leaves its results too.
        """
        try:
            yield self
        except Exception:  # the same would happen again, or the disk is full
            self.clear()
            raise
        self.clear()

    def clear(self) -> None:
        """Remove all results."""
        shutil.rmtree(self.folder, ignore_errors=True)


def task_key(*, what: str, inputs: Mapping[str, str], settings: Mapping[str, Any]) -> str:
    """Return the name of a result: a hash of all that it depends on.

    Parameters
    ----------
    what : str
        Which job, and which task of it.
    inputs : mapping of str to str
        File -> hash of its content.
    settings : mapping
        Plain values; the software's versions are added.
    """
    depends = {"what": what, "inputs": dict(inputs), "settings": settings, **software()}
    text = json.dumps(depends, sort_keys=True, default=repr)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def _kept(folder: Path, key: Callable[[], str], call: Callable[[], Result]) -> Result:
    file = folder / f"{key()}.result"
    try:
        content = file.read_bytes()
    except FileNotFoundError:
        content = b""
    if content:
        kept: Result = pickle.loads(content)  # this user's own
        return kept
    result = call()
    file.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(file) as partial_file:
        partial_file.write_bytes(pickle.dumps(result, protocol=pickle.HIGHEST_PROTOCOL))
    return result
