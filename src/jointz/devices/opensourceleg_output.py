"""Torque output of a polled actuator, with a zero that does not wait for a library that hangs."""

import logging
import threading
import time
from collections.abc import Callable
from contextlib import suppress

#: How often the watchdog looks, s.
LOOK_S = 0.005
#: How long the polling thread may be late with a zero before another thread writes it, s.
_LATE_S = 0.02
#: A zero that is not confirmed after so many looks is reported.
_REPORT_LOOKS = 10
#: How long a thread goes on writing zero before another one replaces it, s: it may hang.
_ATTEMPT_S = 1.0
_log = logging.getLogger(__name__)


class TorqueOutput:
    """Writes torques, and knows whether the last of them was a zero that the library took.

    Only the polling thread writes other torques than zero.
    """

    def __init__(
        self, name: str, write: Callable[[float], None], may_be_on: Callable[[], bool]
    ) -> None:
        self._name, self._write, self._may_be_on = name, write, may_be_on
        self._begun = self._ended = self._zeroed = 0  # writes other than zero; the last undone
        self._late_looks = 0
        self._attempt = threading.Thread()
        self._attempted_s = 0.0

    @property
    def is_zero(self) -> bool:
        """True if the library took a zero after the last other torque."""
        return self._zeroed == self._begun

    def write(self, torque_nm: float) -> None:
        """Write a torque, N*m; what the library raises is raised."""
        if torque_nm:
            self._begun += 1
            try:
                self._write(torque_nm)
            finally:
                self._ended = self._begun
            return
        begun = self._begun
        was_idle = self._ended == begun  # else a torque may still arrive after the zero
        self._write(0.0)
        if was_idle and begun == self._begun:
            self._zeroed = begun

    def settle(self) -> None:
        """Wait a moment for the zero, written by this call where the polling thread is late."""
        if not self._is_zero_within(_LATE_S):
            self._attempt_zero()
            self._is_zero_within(_LATE_S)

    def look(self) -> None:
        """Write the zero that the polling thread is late with; called by the watchdog."""
        if self._may_be_on() or self.is_zero:
            self._late_looks = 0
            return
        self._late_looks += 1
        if self._late_looks * LOOK_S >= _LATE_S:
            self._attempt_zero()
        if self._late_looks == _REPORT_LOOKS:
            _log.error(
                "%s: did not confirm zero torque. Use the emergency stop; zero is sent again and "
                "again.",
                self._name,
            )

    def _is_zero_within(self, patience_s: float) -> bool:
        until_s = time.perf_counter() + patience_s
        while not self.is_zero and time.perf_counter() < until_s:
            time.sleep(0.0005)
        return self.is_zero

    def _attempt_zero(self) -> None:
        """Start a thread that writes zero until it is confirmed, and another one a second later."""
        now_s = time.perf_counter()
        if not self._attempt.is_alive() or now_s - self._attempted_s > _ATTEMPT_S:
            thread = threading.Thread(target=self._zero, name=f"zero {self._name}", daemon=True)
            with suppress(RuntimeError):  # no thread can be had now; the next look tries again
                thread.start()
                self._attempt, self._attempted_s = thread, now_s

    def _zero(self) -> None:
        until_s = time.perf_counter() + _ATTEMPT_S
        while not (self.is_zero or self._may_be_on()) and time.perf_counter() < until_s:
            with suppress(Exception):  # what a bus raises
                self.write(0.0)
            time.sleep(LOOK_S)
