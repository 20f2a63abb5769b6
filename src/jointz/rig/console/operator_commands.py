"""Commands of an operator, checked before they reach a session."""

import shlex
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, field_validator

from jointz.core.errors import DataError
from jointz.rig.console.session_process import SessionProcess
from jointz.rig.experiment.control_box import LONGEST_TEXT_BYTES, ControlSender, Order, setting_text
from jointz.rig.experiment.files.journal import read_journal
from jointz.rig.experiment.files.session_files import CONTROL_FILE, JOURNAL_FILE
from jointz.rig.session.live.live_session import LiveSession, control_files
from jointz.rig.session.run_settings import SESSIONS

#: States of a session that was ended early, and of one whose loop watches the page.
BROKEN_OFF = frozenset({"stopped", "tripped", "failed"})
_MOVING = frozenset({"running", "paused"})
#: States of a session that has taken a stop, or that was stopped before.
_STOPPED = frozenset({"stopping", "stopped", "tripped"})
#: Time in which a session confirms a stop; a loop takes one tick.
CONFIRMED_WITHIN_S = 1.0
_BEAT_S = 0.2
#: Time to wait for a session that is loading or closing its devices.
_PATIENCE_S, _LOOK_S = 30.0, 0.05
#: Characters in the name of a parameter; in UTF-8 they fit into a command with their value.
_LONGEST_NAME = 48


class _Command(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class StartCondition(_Command):
    """Start the condition that the page shows: the participant is ready."""

    order: Literal["start"]
    condition: str


class Pause(_Command):
    """Pause the pulses."""

    order: Literal["pause"]


class GoOn(_Command):
    """Continue the pulses."""

    order: Literal["go_on"]


class Note(_Command):
    """Add a note to the journal."""

    order: Literal["note"]
    text: Annotated[str, Field(min_length=1)]

    @field_validator("text")
    @classmethod
    def _prints(cls, text: str) -> str:
        if not text.isprintable() or not text.strip():
            raise ValueError("expected text on one line")
        if len(text.encode()) > LONGEST_TEXT_BYTES:
            raise ValueError(f"expected at most {LONGEST_TEXT_BYTES} bytes; write two notes")
        return text


class SetParameter(_Command):
    """Change a parameter of the controller that runs; it moves at the rate that it declares."""

    order: Literal["set"]
    name: Annotated[str, Field(min_length=1, max_length=_LONGEST_NAME)]
    value: Annotated[float, Field(allow_inf_nan=False)]

    @field_validator("name")
    @classmethod
    def _prints(cls, name: str) -> str:
        if not name.isprintable() or not name.strip():
            raise ValueError("expected the name of a parameter")
        return name


class UndoParameter(_Command):
    """Set the parameter that was changed last back to its value before."""

    order: Literal["undo"]


class ReArm(_Command):
    """Continue after a trip, stop or failure with the reason that the page shows."""

    order: Literal["rearm"]
    reason: str


#: Commands that a session obeys; a re-arm starts one anew.
_SessionCommand = StartCondition | Pause | GoOn | Note | SetParameter | UndoParameter
_COMMANDS: TypeAdapter[_SessionCommand | ReArm] = TypeAdapter(
    Annotated[_SessionCommand | ReArm, Field(discriminator="order")]
)


class OperatorCommands:
    """Passes commands on to a session."""

    def __init__(
        self, study: Path, process: SessionProcess, look: Callable[[], dict[str, Any]]
    ) -> None:
        self._study = study
        self._process = process
        self._look = look
        self._lock = threading.Lock()

    def stop(self) -> int:
        """Request a stop at once, and return the number of sessions that it was sent to."""
        n_sent = 0
        for file in control_files(self._study):
            try:
                sender = ControlSender(file)
            except DataError:  # other sessions may still be reached
                continue
            sender.stop()
            sender.close()
            n_sent += 1
        return n_sent

    def unheard(self, n_sent: int) -> str:
        """Return why no session has received a stop; empty if one has."""
        if not self._process.alive():
            return (
                "No session runs: nobody has received the stop. If a device still moves, use the "
                "emergency stop."
            )
        if not n_sent:
            return (
                "The session has not received the stop: it is still loading, is over, or does not "
                "accept stops from a page. Use the emergency stop."
            )
        return ""

    def is_confirmed(self) -> bool:
        """Tell whether the session has written that it is stopping or was stopped."""
        status = self._look()
        return status["state"] in _STOPPED and not status.get("unconfirmed")

    def unconfirmed(self, n_sent: int) -> str:
        """Return why a stop that was sent is not confirmed in time."""
        return self.unheard(n_sent) or (
            f"The session has not confirmed the stop within {CONFIRMED_WITHIN_S:g} s: it hangs, or "
            "it is still opening its devices. Press the emergency stop, or switch the power off."
        )

    def leave(self) -> str:
        """End the session of this page if it was never started, and say what becomes of it."""
        if self._process.is_own and self._ended_unstarted():
            return (
                "The page is closed, and with it its session, which nobody had started. Nothing "
                "was recorded; the same arguments with --resume begin it."
            )
        number = self._process.number
        if number is None:
            return "The page is closed. No session runs."
        status = self._look()
        reopen = f"jointz console --out {shlex.quote(str(self._study))} shows it again."
        if status.get("without_console") == "stop" and status["state"] in _MOVING:
            return (
                f"The page is closed. The session (process {number}) stops without it, as its "
                f"protocol says; {reopen}"
            )
        return f"The page is closed. The session goes on (process {number}); {reopen}"

    def _ended_unstarted(self) -> bool:
        """Stop a session that waits for its first start, or that is still loading."""
        until, n_sent = time.monotonic() + _PATIENCE_S, 0
        while self._process.is_own:
            # A start at the same time does not undo the stop: the session ends in any case.
            if (not n_sent and self._was_started()) or time.monotonic() > until:
                return False
            n_sent += self.stop()
            time.sleep(_LOOK_S)
        return not self._was_started()

    def _was_started(self) -> bool:
        """Tell whether start was ever pressed; assume so if a journal cannot be read."""
        journals = (self._study / SESSIONS).glob(f"*/{JOURNAL_FILE}")
        try:
            return any(e["event"] == "started" for path in journals for e in read_journal(path))
        except (OSError, DataError):
            return True

    def ask(self, message: bytes) -> None:
        """Check a command and pass it on."""
        try:
            command = _COMMANDS.validate_json(message)
        except ValidationError as exc:
            problems = "; ".join(error["msg"] for error in exc.errors(include_url=False))
            raise DataError(f"command: {problems}.") from exc
        with self._lock:
            status = self._look()
            if isinstance(command, ReArm):
                self._rearm(command, status["state"], status.get("reason", ""))
                return
            _check_state(command, status["state"], status.get("condition", ""))
            if isinstance(command, SetParameter | UndoParameter):
                _check_parameter(command, status.get("controller"))
            self._send(status["participant"], command)

    def _rearm(self, command: ReArm, state: str, reason: str) -> None:
        if state not in BROKEN_OFF:
            raise DataError(f"re-arm: the session is {state}.")
        if command.reason != reason:
            raise DataError("re-arm: something else has happened since. Read it first.")
        self._process.start(resume=True)

    def _send(self, participant: str, command: _SessionCommand) -> None:
        if not participant or not self._process.alive():
            raise DataError("no session runs that could take it.")
        sender = ControlSender(self._study / SESSIONS / participant / CONTROL_FILE)
        try:
            sender.send(Order[command.order.upper()], _text_of(command))
        finally:
            sender.close()


def _text_of(command: _SessionCommand) -> str:
    if isinstance(command, SetParameter):
        return setting_text(command.name, command.value)
    return command.text if isinstance(command, Note) else ""


def _check_state(command: _SessionCommand, state: str, condition: str) -> None:
    """Refuse a command that does not fit the state of the session."""
    if isinstance(command, StartCondition) and (state, condition) != ("waiting", command.condition):
        raise DataError(f"start of {command.condition!r}: the session is {state} ({condition}).")
    if isinstance(command, Pause) and state != "running":
        raise DataError(f"pause: the session is {state}.")
    if isinstance(command, GoOn) and state != "paused":
        raise DataError(f"go on: the session is {state}.")
    if isinstance(command, SetParameter | UndoParameter) and state not in _MOVING:
        raise DataError(f"{command.order}: the session is {state}.")


def _check_parameter(
    command: SetParameter | UndoParameter, controller: Mapping[str, Any] | None
) -> None:
    """Say at once what the session would refuse; the session checks it again."""
    if controller is None:
        raise DataError(f"{command.order}: no controller runs.")
    if isinstance(command, UndoParameter):
        return
    parameters = controller["parameters"]
    if command.name not in parameters:
        raise DataError(
            f"set: {controller['name']} has no parameter {command.name!r}; "
            f"it has {', '.join(parameters) or 'none'}."
        )
    low, high = parameters[command.name]["low"], parameters[command.name]["high"]
    if not low <= command.value <= high:
        raise DataError(f"{command.name}: {command.value:g}; expected {low:g} to {high:g}.")


class Heartbeat:
    """Sends signs of life to the session while a browser shows the page."""

    def __init__(self, live: LiveSession, somebody: Callable[[], bool]) -> None:
        self._live = live
        self._somebody = somebody
        self._path: Path | None = None
        self._inode = -1
        self._sender: ControlSender | None = None

    def run(self) -> None:
        """Send signs of life while the page's process lives."""
        while True:
            time.sleep(_BEAT_S)
            if self._somebody():
                self.beat()

    def beat(self) -> None:
        """Send one sign of life to the running session."""
        folder = self._live.folder
        if folder is None:
            return
        try:
            self._reopen(folder / CONTROL_FILE)
        except (OSError, DataError):  # no session yet, or no longer
            return
        if self._sender is not None:
            self._sender.beat()

    def close(self) -> None:
        """Close the connection."""
        if self._sender is not None:
            self._sender.close()
        self._sender, self._path = None, None

    def _reopen(self, path: Path) -> None:
        """Open the current file: a resumed session makes a new one."""
        inode = path.stat().st_ino
        if path == self._path and inode == self._inode:
            return
        self.close()
        self._sender = ControlSender(path)
        self._path, self._inode = path, inode
