"""Base class of physics in the time of a clock, computed as far as its samples are needed."""

from abc import ABC, abstractmethod

from jointz.rig.sim.walking.plant import MotorMeasured

#: Device time (ns, 0 at the first sample), what the motor measures, and more readings: of a
#: person angle, contact (0 or 1) and internal moment, of a bench torque, the far side's angle and
#: no third (NaN). Behind them, of a person with such sensors, encoder and gyroscopes.
Sample = tuple[int, MotorMeasured, float, float, float, *tuple[float, ...]]


class SampledTime(ABC):
    """Samples on whole multiples of their period of the clock, appended to all queues.

    The first look or command decides which of them is the first sample, time 0 of the
    devices' clock, so that a session starts the same under any clock. :meth:`look` at host time
    t computes all samples up to t; a command between two samples acts from the earlier one on.
    """

    def __init__(self, period_ns: int) -> None:
        self._period_ns = period_ns
        self._queues: list[list[Sample]] = []
        self._first_ns = 0
        self.samples = 0
        self.due_ns = 0

    def queue(self) -> list[Sample]:
        """Return a new list to which every sample from now on is appended."""
        samples: list[Sample] = []
        self._queues.append(samples)
        return samples

    def forget(self, queue: list[Sample]) -> None:
        """Append no more to a list."""
        self._queues = [kept for kept in self._queues if kept is not queue]

    def look(self, now_ns: int) -> None:
        """Compute all samples up to a time of the host."""
        if self.samples == 0:
            self._first_ns = now_ns // self._period_ns * self._period_ns
        due_ns = self._first_ns + self.samples * self._period_ns
        while due_ns <= now_ns:
            self._step()
            due_ns += self._period_ns
        self.due_ns = due_ns

    @abstractmethod
    def command(self, torque_nm: float, now_ns: int) -> None:
        """Command a torque of the actuator."""

    @abstractmethod
    def release(self, now_ns: int) -> None:
        """Release the torque of the actuator."""

    @abstractmethod
    def fail(self, bits: int) -> None:
        """Set fault bits of the actuator: it goes to zero torque by itself."""

    @abstractmethod
    def _step(self) -> None:
        """Compute the next sample, append it to the queues and count it."""
