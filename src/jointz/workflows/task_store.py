"""Results of tasks, kept as they come: what was done once is not done again."""

import hashlib
import json
import os
import pickle
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from jointz.core.provenance import software
from jointz.core.whole_file import whole_file

Result = TypeVar("Result")

_SUFFIX = ".result"


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
        """Return the store of what becomes a folder: hidden beside it.

        Parameters
        ----------
        out : pathlib.Path
            The folder, which need not be there yet.
        """
        whole = out.resolve()
        return cls(whole.parent / f".{whole.name}.tasks")

    def holds(self, key: str) -> bool:
        """Tell whether a result is there.

        Parameters
        ----------
        key : str
            Of :func:`task_key`.
        """
        return _file(self.folder, key).exists()

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
    def told_with_errors(self) -> Iterator[None]:
        """Say with an error that leaves a block which results are kept."""
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


def _file(folder: Path, key: str) -> Path:
    return folder / f"{key}{_SUFFIX}"


def _kept(folder: Path, key: Callable[[], str], call: Callable[[], Result]) -> Result:
    file = _file(folder, key())
    with suppress(Exception):  # not there, damaged, or of a module that is gone: made again
        kept: Result = pickle.loads(file.read_bytes())  # this user's own
        return kept
    result = call()
    with whole_file(file) as partial_file:
        file.parent.mkdir(parents=True, exist_ok=True)
        with partial_file.open("wb") as stream:
            pickle.dump(result, stream, protocol=pickle.HIGHEST_PROTOCOL)
            stream.flush()
            os.fsync(stream.fileno())  # or a name may outlive its content when the power fails
    return result
