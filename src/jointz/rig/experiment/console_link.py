"""The operator's page and a session: every command is checked, obeyed and written down.

The session's journal is all that the page is told of commands; of the motion it reads the log.
Neither asks anything of the loop.
"""

import time
from collections.abc import Callable

from jointz.core.protocols.protocol_models import WithoutConsole
from jointz.rig.experiment.control_box import Command, ControlBox, Order, read_setting
from jointz.rig.experiment.files.journal import Journal
from jointz.rig.experiment.trial_kinds import AnyTrial

#: A page that gives no sign of life for so long is lost.
LOST_AFTER_NS = 3_000_000_000
_POLL_S = 0.02
_SECOND_NS = 1_000_000_000

Tick = Callable[[int, int, int], bool]


class ConsoleLink:
    """Obeys a page, between conditions and in the loop."""

    def __init__(
        self,
        box: ControlBox,
        journal: Journal,
        *,
        request_stop: Callable[[], None],
        without_console: WithoutConsole,
    ) -> None:
        self._box = box
        self._journal = journal
        self._request_stop = request_stop
        self._stops_when_lost = without_console == "stop"
        self._condition = ""
        self._stopping = self._lost = False
        self._refused, self._told_ns = 0, 0

    def await_start(self, condition: str, text: str) -> None:
        """Write down what is to be done and return when the page says that it is."""
        self._condition = condition
        self._write("prompted", text=text)
        while not self._box.stop_asked:
            command = self._box.take()
            if command is None:
                time.sleep(_POLL_S)
            elif command.order is Order.START:
                self._write("started")
                return
            else:
                self._note_or_refuse(command, "nothing runs")
        self._write("stop_asked", slot=-1)
        raise KeyboardInterrupt

    def attended(self, trial: AnyTrial, condition: str) -> Tick:
        """Return the tick of a trial with a look at the page before it."""
        self._condition = condition
        first_slot = -1

        def tick(slot: int, host_ns: int, skipped: int) -> bool:
            nonlocal first_slot
            if first_slot < 0:  # as in the log, which counts from the trial's first tick
                first_slot = slot
            self._look(trial, slot - first_slot, host_ns)
            return trial.tick(slot, host_ns, skipped)

        return tick

    def _look(self, trial: AnyTrial, slot: int, host_ns: int) -> None:
        box = self._box
        if box.stop_asked and not self._stopping:
            self._stop(slot, host_ns, "stop_asked")
        command = box.take()
        if command is not None:
            self._obey(command, trial, slot, host_ns)
        if box.refused != self._refused and host_ns - self._told_ns > _SECOND_NS:
            self._refused, self._told_ns = box.refused, host_ns
            self._write("control_refused", slot=slot, count=box.refused)
        self._check_life(slot, host_ns)

    def _obey(self, command: Command, trial: AnyTrial, slot: int, host_ns: int) -> None:
        if command.order in (Order.PAUSE, Order.GO_ON):
            done = trial.pause(on=command.order is Order.PAUSE)
            answer = {Order.PAUSE: "paused", Order.GO_ON: "went_on"}[command.order]
            if done:
                self._write(answer, slot=slot, host_ns=host_ns)
                return
        why = "not in this trial"
        if command.order in (Order.SET, Order.UNDO):
            why = _change_parameter(command, trial)
            if not why:  # the controller has written it down
                return
        self._note_or_refuse(command, why, slot=slot)

    def _note_or_refuse(self, command: Command, why: str, *, slot: int = -1) -> None:
        if command.order is Order.NOTE:
            self._write("note", slot=slot, text=command.text)
        else:
            self._write("control_refused", slot=slot, order=command.order.name.lower(), reason=why)

    def _check_life(self, slot: int, host_ns: int) -> None:
        """Record when the page is lost or back; before its first sign of life it cannot be lost."""
        beat_ns = self._box.beat_ns
        lost = beat_ns > 0 and time.monotonic_ns() - beat_ns > LOST_AFTER_NS
        if lost == self._lost:
            return
        self._lost = lost
        self._write("console_lost" if lost else "console_back", slot=slot)
        if lost and self._stops_when_lost and not self._stopping:
            self._stop(slot, host_ns, "stopped_without_console")

    def _stop(self, slot: int, host_ns: int, event: str) -> None:
        self._stopping = True
        # First the stop, then the words about it.
        self._request_stop()
        self._write(event, slot=slot, host_ns=host_ns)

    def _write(self, event: str, **details: object) -> None:
        self._journal.write(event, condition=self._condition, time_ns=time.time_ns(), **details)


def _change_parameter(command: Command, trial: AnyTrial) -> str:
    """Set a parameter or undo the last change; return why it was refused, "" if it was not."""
    if command.order is Order.UNDO:
        return trial.undo_parameter()
    try:
        name, value = read_setting(command.text)
    except ValueError:
        return f"{command.text!r} is no parameter with a number"
    return trial.set_parameter(name, value)
