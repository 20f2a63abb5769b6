"""Schedule of the planned pulses while a participant walks."""

from collections import deque
from collections.abc import Iterable

from jointz.core.protocols.protocol_models import PerturbationPlan
from jointz.rig.experiment.plan import PlannedPulse

#: A pulse whose timing point has passed by more than this is missed, % of the cycle; a slow
#: loop needs the phase that passes from tick to tick.
LATE_PCT = 1.0


class Scheduler:
    """Decides at every tick whether a pulse begins.

    A pulse becomes due when enough strides have passed since the one before it,
    and fires in that stride when the phase reaches its timing point. Where the
    phase is unknown then, the pulse is missed and goes to the end of the queue. A
    gap is never shorter than planned; a missed pulse makes the next one longer.
    """

    __slots__ = ("_due", "_late_pct", "_since", "queue")

    def __init__(
        self,
        pulses: Iterable[PlannedPulse],
        plan: PerturbationPlan,
        *,
        late_pct: float = LATE_PCT,
    ) -> None:
        self._late_pct = late_pct
        self.queue = deque(pulses)
        self._due = False
        # The first gap counts from the end of the warm-up.
        self._since = -plan.warm_up_strides

    def stride(self) -> PlannedPulse | None:
        """Count an accepted stride."""
        missed = self.miss() if self._due else None
        self._since += 1
        self._due = bool(self.queue) and self._since >= self.queue[0].gap_strides
        return missed

    def retract_stride(self) -> None:
        """Take back the last stride, whose heel strike was spurious."""
        self._since -= 1
        self._due = self._due and self._since >= self.queue[0].gap_strides

    def pulse_at(self, phase_pct: float) -> PlannedPulse | None:
        """Return the pulse that begins now, if any."""
        if not self._due:
            return None
        late = phase_pct - self.queue[0].gait_pct
        if not 0.0 <= late <= self._late_pct:
            return None
        self._due = False
        self._since = 0
        return self.queue.popleft()

    def miss(self) -> PlannedPulse | None:
        """Move the pulse that is due to the end of the queue and return it."""
        if not self._due:
            return None
        self._due = False
        missed = self.queue.popleft()
        self.queue.append(missed)
        return missed

    def withdraw(self, variant: tuple[str, str, float]) -> list[PlannedPulse]:
        """Take all pulses of a timing point, shape and amplitude out of the queue."""
        withdrawn = [pulse for pulse in self.queue if pulse.variant == variant]
        self.replace(pulse for pulse in self.queue if pulse.variant != variant)
        return withdrawn

    def replace(self, pulses: Iterable[PlannedPulse]) -> None:
        """Take other pulses into the queue; none becomes due by it."""
        self.queue = deque(pulses)
        self._due = self._due and bool(self.queue) and self._since >= self.queue[0].gap_strides

    def requeue(self, pulse: PlannedPulse) -> None:
        """Append a pulse that was broken off to the queue."""
        self.queue.append(pulse)
