"""Every error jointz raises.

    JointzError
    ├── DataError (ValueError)      input that cannot be trusted; exit status 2
    │   ├── StudyError              a study.toml, with all its problems
    │   ├── ProtocolError           a protocol, with all its problems
    │   ├── DeviceFileError         a device.toml, with all its problems
    │   ├── EntryError              an entry.toml and its files, with all their problems
    │   ├── TooLargeError           a file that unpacks to more than the memory limit
    │   └── UnitError               a unit that cannot be read or does not fit
    ├── DeviceError                 a device that cannot go on; exit status 3
    │   ├── NotConnectedError       it does not answer
    │   └── SafetyStop              the safety gate ended the trial
    ├── WorkerLostError             a process that worked for this one was killed; exit status 1
    ├── EngineError                 what does the tasks of a job cannot go on; exit status 1
    ├── EstimationError             a single fit that has no answer
    └── OutputError                 a place to write to that may not be used; exit status 2
        └── WriteError              the system did not let it be written; exit status 1

A message says where, what was expected, what was found and what to do.
"""

from collections.abc import Sequence
from typing import Any


class JointzError(Exception):
    """Base of all errors that jointz raises on purpose."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Support pickling, whatever arguments ``__init__`` takes."""
        return _revived, (type(self), self.args, self.__dict__)


def _revived(kind: type[JointzError], args: tuple[Any, ...], state: dict[str, Any]) -> JointzError:
    error = kind.__new__(kind, *args)
    error.__dict__.update(state)
    return error


class DataError(JointzError, ValueError):
    """Input that cannot be trusted.

    Parameters
    ----------
    message : str
        Where, what was expected, what was found, what to do.
    path : str, optional
        The file the trouble is in.
    channel : str, optional
        The channel or column.
    row : int, optional
        The row of the file, counted from 1, header included.
    """

    def __init__(
        self,
        message: str,
        *,
        path: str | None = None,
        channel: str | None = None,
        row: int | None = None,
    ) -> None:
        super().__init__(message)
        self.path = path
        self.channel = channel
        self.row = row


class _ProblemsError(DataError):
    """One or more problems, all of them in one message."""

    def __init__(self, where: str, problems: Sequence[str]) -> None:
        self.problems = tuple(problems)
        count = len(self.problems)
        head = f"{where}: {count} problem{'s' if count != 1 else ''}"
        super().__init__("\n".join([head, *(f"  - {p}" for p in self.problems)]), path=where)


class StudyError(_ProblemsError):
    """One or more problems of a study."""


class ProtocolError(_ProblemsError):
    """One or more problems of a protocol."""


class DeviceFileError(_ProblemsError):
    """One or more problems of a ``device.toml``."""


class EntryError(_ProblemsError):
    """One or more problems of an ``entry.toml`` or of the files that it names."""


class TooLargeError(DataError):
    """A file that unpacks to more than the memory limit."""


class UnitError(DataError):
    """A unit that cannot be read, or that measures something else."""


class EstimationError(JointzError):
    """A fit that has no answer; ``code`` says why.

    Parameters
    ----------
    code : str
        A stable code from :mod:`jointz.core.codes`.
    message : str
        Why, and what to do.
    """

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = code


class OutputError(JointzError):
    """A place to write to that exists or that may not be replaced."""


class WriteError(OutputError):
    """The system did not let something be written: disk full, permission, name too long.

    Parameters
    ----------
    what : str
        The file or folder.
    cause : OSError
        What the system said.
    todo : str
        What to do.
    """

    def __init__(self, what: str, cause: OSError, todo: str = "Make room.") -> None:
        super().__init__(f"{what}: cannot be written ({cause.strerror or cause}). {todo}")


class DeviceError(JointzError):
    """A device that cannot go on.

    Parameters
    ----------
    device : str
        Which.
    message : str
        What happened, and what to do.
    """

    def __init__(self, device: str, message: str) -> None:
        super().__init__(f"{device}: {message}")
        self.device = device


class NotConnectedError(DeviceError):
    """A device that does not answer."""


class SafetyStop(DeviceError):  # noqa: N818 - it states the event
    """The safety gate ended the trial.

    Parameters
    ----------
    code : str
        A stable code from :class:`jointz.core.codes.Trip`.
    message : str
        Which limit, the value, and what to do.
    """

    def __init__(self, code: str, message: str) -> None:
        super().__init__("safety", f"{code}: {message}")
        self.code = code


class WorkerLostError(JointzError):
    """A process that worked for this one was killed."""


class EngineError(JointzError):
    """The engine that runs the tasks cannot continue; neither a task nor the input is to blame."""
