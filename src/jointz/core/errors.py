"""Exceptions of jointz.

    JointzError
    ├── DataError (ValueError)      input that cannot be trusted; exit status 2
    │   ├── StudyError              a study.toml, with all its problems
    │   ├── ProtocolError           a protocol, with all its problems
    │   ├── DeviceFileError         a device.toml, with all its problems
    │   ├── TooLargeError           a file that unpacks to more than the memory limit
    │   └── UnitError               a unit that is unknown or does not fit
    ├── EstimationError             a fit without an estimate; exit status 1
    ├── OutputError                 an output path that must not be used; exit status 2
    │   └── WriteError              the system refused to write; exit status 1
    ├── DeviceError                 a device that failed or refused a command; exit status 3
    │   ├── NotConnectedError       it does not answer
    │   └── SafetyStop              the safety gate ended the trial
    ├── WorkerLostError             a worker process was killed; exit status 1
    └── EngineError                 the engine that runs the tasks failed; exit status 1

A message says where, what was expected, what was found and what to do.
"""

from collections.abc import Sequence
from typing import Any


def install_advice(extra: str) -> str:
    """Return how to install the libraries of an extra of jointz."""
    return f'Install it: pip install "jointz[{extra}]".'


class JointzError(Exception):
    """Base of all errors that jointz raises on purpose; catch it to handle any of them."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Support pickling, so that a worker process can hand its error to the caller."""
        # The default calls ``__init__`` with ``args``, which hold the message only.
        return _restore_error, (type(self), self.args, self.__dict__)


def _restore_error(
    kind: type[JointzError], args: tuple[Any, ...], state: dict[str, Any]
) -> JointzError:
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
        The file with the error.
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
    """All problems of one file, in one message; ``problems`` has a sentence each."""

    def __init__(self, where: str, problems: Sequence[str]) -> None:
        self.problems = tuple(problems)
        count = len(self.problems)
        head = f"{where}: {count} problem{'s' if count != 1 else ''}"
        super().__init__("\n".join([head, *(f"  - {p}" for p in self.problems)]), path=where)


class StudyError(_ProblemsError):
    """One or more problems of a study; ``problems`` has a sentence each."""


class ProtocolError(_ProblemsError):
    """One or more problems of a protocol; ``problems`` has a sentence each."""


class DeviceFileError(_ProblemsError):
    """One or more problems of a ``device.toml``; ``problems`` has a sentence each."""


class TooLargeError(DataError):
    """A file that unpacks to more than the memory limit."""


class UnitError(DataError):
    """A unit that is unknown or does not fit, such as kg for an angle."""


class EstimationError(JointzError):
    """A fit without an estimate.

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
    """An output path that must not be used, such as a file that exists already."""


class WriteError(OutputError):
    """The system refused to write: disk full, no permission, name too long.

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
    """A device that failed or refused a command.

    Parameters
    ----------
    device : str
        Name of the device.
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
    """A worker process was killed."""


class EngineError(JointzError):
    """The engine that runs the tasks failed; neither a task nor the input is to blame."""
