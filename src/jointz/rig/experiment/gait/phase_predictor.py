"""Phase of the gait cycle in real time.

:class:`StridePhase` tells it from heel strikes and fires pulses.
:class:`KneePhase` tells it from the knee angle alone and only looks on: what it
would have said is recorded beside the other.
"""

from collections import deque
from typing import Any

from jointz.core.protocols.protocol_models import GaitSpec

_SHORTEST_S, _LONGEST_S = 0.5, 2.5  # a stride of anybody
#: Strikes in a row outside the accepted band after which the cadence is learnt anew.
_STRANGERS = 3
#: A spurious strike so near to the middle, in halves of the stride, makes two strides of it.
_HALF = (0.9, 1.1)

_PEAK_PCT = 72.2  # of the cycle, where a knee is most flexed
_UNKNOWN = 1  # ns: when a spurious strike came, where nothing hangs on it
_FLEXED_RAD = 0.6  # swing flexes a knee by more than this, stance by less
_EXTENDED_RAD = 0.5  # swing flexion is over; the distance keeps noise from ending it early


class StridePhase:
    """Time since the last heel strike over the mean of the last strides.

    A stride is accepted when its duration lies in a band around that mean, and between
    0.5 and 2.5 s. A strike that comes too early is spurious: the phase is unknown until
    the next one that comes in time. A stride that is too long has lost a strike: the
    phase is unknown until gait is steady again. Where stride after stride has a strike
    in its middle, two strides pass for one, because a strike was missed while the mean
    was learnt: it is learnt anew.
    """

    def __init__(self, gait: GaitSpec) -> None:
        self._low, self._high = gait.accepted_band
        self._steady_after = gait.steady_after_strides
        self._durations: deque[int] = deque(maxlen=gait.strides_in_mean)
        self._last_ns = 0
        self._steady_run = 0
        self._strangers = 0
        self._spurious_after_ns = 0
        self.mean_ns = 0.0
        self.strides = self.spurious = self.missing = 0
        self._undo = self._state()

    @property
    def last_strike_ns(self) -> int:
        """When the last heel strike was, 0 before the first."""
        return self._last_ns

    def strike(self, time_ns: int) -> bool:
        """Process a heel strike and return whether it ended an accepted stride."""
        self._undo = self._state()
        duration = time_ns - self._last_ns
        if not self._last_ns:
            self._last_ns = time_ns
            return False
        low, high = self._band()
        if low <= duration <= high:
            self._accept(duration, time_ns)
            return True
        if duration < low:
            self.spurious += 1
            self._spurious_after_ns = duration
        else:
            self.missing += 1
            self._steady_run = 0
            self._spurious_after_ns = 0
            self._last_ns = time_ns
        self._strangers += 1
        if self._strangers >= _STRANGERS:
            self._forget(time_ns)
        return False

    def retract(self) -> None:
        """Take back the last strike, which was none: the phase is unknown until the next."""
        durations, self._last_ns, self._steady_run, self._strangers, *counts = self._undo
        self.strides, spurious, self.missing, self.mean_ns = counts
        self._durations = deque(durations, maxlen=self._durations.maxlen)
        self._spurious_after_ns = _UNKNOWN
        self.spurious = spurious + 1

    def steady(self, time_ns: int) -> bool:
        """Return whether the phase is known: gait is steady and no strike is overdue."""
        return (
            self._steady_run >= self._steady_after
            and not self._spurious_after_ns
            and time_ns - self._last_ns <= self._high * self.mean_ns
        )

    def phase_pct(self, time_ns: int) -> float:
        """Return time since the last strike over the mean stride, %; above 100 when it is late."""
        return 100.0 * (time_ns - self._last_ns) / self.mean_ns

    def _state(self) -> tuple[Any, ...]:
        kept = (tuple(self._durations), self._last_ns, self._steady_run, self._strangers)
        return (*kept, self.strides, self.spurious, self.missing, self.mean_ns)

    def _band(self) -> tuple[float, float]:
        shortest, longest = _SHORTEST_S * 1e9, _LONGEST_S * 1e9
        if not self._durations:
            return shortest, longest
        return max(shortest, self._low * self.mean_ns), min(longest, self._high * self.mean_ns)

    def _accept(self, duration_ns: int, time_ns: int) -> None:
        self._durations.append(duration_ns)
        self.mean_ns = sum(self._durations) / len(self._durations)
        self._last_ns = time_ns
        self._steady_run += 1
        if not _HALF[0] <= 2.0 * self._spurious_after_ns / duration_ns <= _HALF[1]:
            self._strangers = 0
        self._spurious_after_ns = 0
        self.strides += 1

    def _forget(self, time_ns: int) -> None:
        self._durations.clear()
        self.mean_ns = 0.0
        self._steady_run = self._strangers = 0
        self._spurious_after_ns = 0
        self._last_ns = time_ns


class KneePhase:
    """Time since the last swing flexion peak of the knee over the mean time between peaks.

    Needs no footswitch. In shadow: recorded, never acted on.
    """

    def __init__(self, gait: GaitSpec) -> None:
        self._durations: deque[int] = deque(maxlen=gait.strides_in_mean)
        self._peak = 0.0
        self._peak_ns = self._last_ns = 0
        self._mean_ns = 0.0

    def update(self, time_ns: int, angle: float) -> None:
        """Process a sample of the knee angle."""
        if angle > _FLEXED_RAD:
            if angle > self._peak:
                self._peak, self._peak_ns = angle, time_ns
        elif self._peak and angle < _EXTENDED_RAD:
            self._peak = 0.0
            self._end_stride()

    def phase_pct(self, time_ns: int) -> float:
        """Return the phase, % of the cycle; NaN while unknown."""
        if not self._mean_ns:
            return float("nan")
        return (_PEAK_PCT + 100.0 * (time_ns - self._last_ns) / self._mean_ns) % 100.0

    def _end_stride(self) -> None:
        duration = self._peak_ns - self._last_ns if self._last_ns else 0
        if _SHORTEST_S * 1e9 <= duration <= _LONGEST_S * 1e9:
            self._durations.append(duration)
            self._mean_ns = sum(self._durations) / len(self._durations)
        elif 0 < duration < _SHORTEST_S * 1e9:
            return
        self._last_ns = self._peak_ns
