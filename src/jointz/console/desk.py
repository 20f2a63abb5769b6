"""What an operator may ask for: every word of it checked before it reaches a session."""

import shlex
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, field_validator

from jointz.console.session_process import SessionProcess
from jointz.core.errors import DataError
from jointz.experiment.control_box import LONGEST_TEXT_BYTES, ControlSender, Order
from jointz.experiment.files.journal import read_journal
from jointz.experiment.files.session_files import CONTROL_FILE, JOURNAL_FILE
from jointz.session.live.live_session import LiveSession, control_files
from jointz.session.run_settings import SESSIONS

#: States of a session that ended before its end, and of one whose loop looks for the page.
BROKEN_OFF = frozenset({"stopped", "tripped", "failed"})
_MOVING = frozenset({"running", "paused"})
_BEAT_S = 0.2
#: A session that is still being loaded, or closes its devices, is waited for.
_PATIENCE_S, _LOOK_S = 30.0, 0.05


class _Asked(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class StartCondition(_Asked):
    """The participant is ready; names the condition that the page shows."""

    order: Literal["start"]
    condition: str


class Pause(_Asked):
    """No more pulses for now."""

    order: Literal["pause"]


class GoOn(_Asked):
    """Pulses again."""

    order: Literal["go_on"]


class Note(_Asked):
    """Something to write into the journal."""

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


class ReArm(_Asked):
    """Go on after a trip, stop or failure; names what the page says was the reason."""

    order: Literal["rearm"]
    reason: str


_ANY: TypeAdapter[StartCondition | Pause | GoOn | Note | ReArm] = TypeAdapter(
    Annotated[StartCondition | Pause | GoOn | Note | ReArm, Field(discriminator="order")]
)
_ORDERS = {"start": Order.START, "pause": Order.PAUSE, "go_on": Order.GO_ON, "note": Order.NOTE}


class Desk:
    """Passes on what was asked for."""

    def __init__(
        self, study: Path, process: SessionProcess, look: Callable[[], dict[str, Any]]
    ) -> None:
        self._study = study
        self._process = process
        self._look = look
        self._lock = threading.Lock()

    def stop(self) -> int:
        """Ask for a stop, at once, and return of how many sessions."""
        asked = 0
        for file in control_files(self._study):
            try:
                sender = ControlSender(file)
            except DataError:  # another one may still be reached
                continue
            sender.stop()
            sender.close()
            asked += 1
        return asked

    def unheard(self, asked: int) -> str:
        """Return why no session has received a stop; empty where one has."""
        if not self._process.alive():
            return (
                "No session runs: nobody has received the stop. If a device still moves, use the "
                "emergency stop."
            )
        if not asked:
            return (
                "The session has not received the stop: it is still being loaded, is over, or "
                "takes none from a page. Use the emergency stop."
            )
        return ""

    def leave(self) -> str:
        """End the session that this page began where nobody has started it; the page closes."""
        if self._process.is_own and self._ended_unstarted():
            return (
                "The page is closed, and with it its session, which nobody had started. Nothing "
                "was recorded; the same arguments with --resume begin it."
            )
        number = self._process.number
        if number is None:
            return "The page is closed. No session runs."
        told = self._look()
        again = f"jointz console --out {shlex.quote(str(self._study))} shows it again."
        if told.get("without_console") == "stop" and told["state"] in _MOVING:
            return (
                f"The page is closed. The session (process {number}) stops without it, as its "
                f"protocol says; {again}"
            )
        return f"The page is closed. The session goes on (process {number}); {again}"

    def _ended_unstarted(self) -> bool:
        """Stop a session that waits for its first start; one that is loaded still comes to that."""
        until, asked = time.monotonic() + _PATIENCE_S, 0
        while self._process.is_own:
            # A start that came with the stop does not undo it: the session ends all the same.
            if (not asked and self._was_started()) or time.monotonic() > until:
                return False
            asked += self.stop()
            time.sleep(_LOOK_S)
        return not self._was_started()

    def _was_started(self) -> bool:
        """Tell whether anybody ever pressed start; what cannot be read may have been."""
        journals = (self._study / SESSIONS).glob(f"*/{JOURNAL_FILE}")
        try:
            return any(e["event"] == "started" for path in journals for e in read_journal(path))
        except (OSError, DataError):
            return True

    def ask(self, message: bytes) -> None:
        """Check a command and pass it on."""
        try:
            asked = _ANY.validate_json(message)
        except ValidationError as exc:
            problems = "; ".join(error["msg"] for error in exc.errors(include_url=False))
            raise DataError(f"command: {problems}.") from exc
        with self._lock:
            told = self._look()
            if isinstance(asked, ReArm):
                self._rearm(asked, told["state"], told.get("reason", ""))
                return
            _see_that_it_fits(asked, told["state"], told.get("condition", ""))
            self._send(told["participant"], asked)

    def _rearm(self, asked: ReArm, state: str, reason: str) -> None:
        if state not in BROKEN_OFF:
            raise DataError(f"re-arm: the session is {state}.")
        if asked.reason != reason:
            raise DataError("re-arm: something else has happened since. Read it first.")
        self._process.start(resume=True)

    def _send(self, participant: str, asked: StartCondition | Pause | GoOn | Note) -> None:
        if not participant or not self._process.alive():
            raise DataError("no session runs that could take it.")
        sender = ControlSender(self._study / SESSIONS / participant / CONTROL_FILE)
        try:
            sender.send(_ORDERS[asked.order], asked.text if isinstance(asked, Note) else "")
        finally:
            sender.close()


def _see_that_it_fits(
    asked: StartCondition | Pause | GoOn | Note, state: str, condition: str
) -> None:
    """Refuse what a page asked for when the session was elsewhere already."""
    if isinstance(asked, StartCondition) and (state, condition) != ("waiting", asked.condition):
        raise DataError(f"start of {asked.condition!r}: the session is {state} ({condition}).")
    if isinstance(asked, Pause) and state != "running":
        raise DataError(f"pause: the session is {state}.")
    if isinstance(asked, GoOn) and state != "paused":
        raise DataError(f"go on: the session is {state}.")


class Beat:
    """Gives the session signs of life, as long as somebody looks at the page."""

    def __init__(self, live: LiveSession, somebody: Callable[[], bool]) -> None:
        self._live = live
        self._somebody = somebody
        self._path: Path | None = None
        self._inode = -1
        self._sender: ControlSender | None = None

    def run(self) -> None:
        """Go on for as long as the page's process lives."""
        while True:
            time.sleep(_BEAT_S)
            if self._somebody():
                self.beat()

    def beat(self) -> None:
        """Give one sign of life to the session that runs."""
        folder = self._live.folder
        if folder is None:
            return
        try:
            self._reopen(folder / CONTROL_FILE)
        except (OSError, DataError):  # none yet, or no more
            return
        if self._sender is not None:
            self._sender.beat()

    def close(self) -> None:
        """Let go of the box."""
        if self._sender is not None:
            self._sender.close()
        self._sender, self._path = None, None

    def _reopen(self, path: Path) -> None:
        """Hold the file that is there now: a session that goes on makes a new one."""
        inode = path.stat().st_ino
        if path == self._path and inode == self._inode:
            return
        self.close()
        self._sender = ControlSender(path)
        self._path, self._inode = path, inode
