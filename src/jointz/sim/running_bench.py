"""A bench that runs on the time of a clock, as far as somebody looks at it."""

from typing import Protocol

from jointz.sim.running_plant import Sample

_NAN = float("nan")


class BenchPlant(Protocol):
    """The physics of a bench."""

    def sample(self, torque_nm: float, angle_rad: float) -> Sample:
        """Compute the next sample.

        Parameters
        ----------
        torque_nm, angle_rad : float, N*m, rad
            Commands since the sample before; NaN where there is none.
        """
        ...


class RunningBench:
    """A bench from the first look on; as :class:`jointz.sim.running_plant.RunningPlant` runs.

    Parameters
    ----------
    plant : BenchPlant
        The physics.
    period_ns : int, ns
        From sample to sample.
    timeout_s : float, s
        Without a command for so long the actuator goes to zero torque.
    one_motor : bool
        Whether the same motor gives torque and moves: the newest of two commands counts.

    Attributes
    ----------
    samples : int
        Computed so far.
    due_ns : int, ns
        When, by the host's clock, the next one comes.
    """

    def __init__(
        self, plant: BenchPlant, *, period_ns: int, timeout_s: float, one_motor: bool
    ) -> None:
        self._advance = plant.sample
        self._period_ns = period_ns
        self._timeout = round(timeout_s * 1e9) // period_ns
        self._one_motor = one_motor
        self._torque = 0.0
        self._angle = _NAN if one_motor else 0.0
        self._commanded = 0
        self._queues: list[list[Sample]] = []
        self._newest: Sample | None = None
        self._faults = 0
        self._first_ns = 0
        self.samples = 0
        self.due_ns = 0

    def queue(self) -> list[Sample]:
        """Return a new list to which every sample from now on is appended."""
        samples: list[Sample] = []
        self._queues.append(samples)
        return samples

    def forget(self, queue: list[Sample]) -> None:
        """Append no more to a list.

        Parameters
        ----------
        queue : list of Sample
            From :meth:`queue`.
        """
        self._queues = [kept for kept in self._queues if kept is not queue]

    def look(self, now_ns: int) -> None:
        """Compute all samples up to a time of the host.

        Parameters
        ----------
        now_ns : int, ns
            By the clock.
        """
        if self.samples == 0:
            self._first_ns = now_ns // self._period_ns * self._period_ns
        due_ns = self._first_ns + self.samples * self._period_ns
        while due_ns <= now_ns:
            self._step()
            due_ns += self._period_ns
        self.due_ns = due_ns

    def command(self, torque_nm: float, now_ns: int) -> None:
        """Ask the actuator for a torque.

        Parameters
        ----------
        torque_nm : float, N*m
            Wanted.
        now_ns : int, ns
            By the clock.
        """
        if now_ns >= self.due_ns:
            self.look(now_ns)
        self._torque = torque_nm
        if self._one_motor:
            self._angle = _NAN
        self._commanded = self.samples - 1

    def move_to(self, angle_rad: float, now_ns: int) -> None:
        """Ask the positioner for an angle.

        Parameters
        ----------
        angle_rad : float, rad
            Wanted.
        now_ns : int, ns
            By the clock.
        """
        if now_ns >= self.due_ns:
            self.look(now_ns)
        self._angle = angle_rad
        if self._one_motor:
            self._torque = _NAN
        self._commanded = self.samples - 1

    def hold_still(self, now_ns: int) -> None:
        """Let the positioner stay where it is.

        Parameters
        ----------
        now_ns : int, ns
            By the clock.
        """
        if self._one_motor:
            self.release(now_ns)
        elif self._newest is not None:
            self.move_to(self._newest[3], now_ns)

    def release(self, now_ns: int) -> None:
        """Let the actuator give no torque any more.

        Parameters
        ----------
        now_ns : int, ns
            By the clock.
        """
        self.command(_NAN if self._one_motor else 0.0, now_ns)

    def fail(self, bits: int) -> None:
        """Set fault bits of the actuator: it goes to zero torque by itself.

        Parameters
        ----------
        bits : int
            See :class:`jointz.sim.layout.Fault`.
        """
        self._faults |= bits

    def _step(self) -> None:
        if self._faults or self.samples - 1 - self._commanded >= self._timeout:
            self._torque = _NAN if self._one_motor else 0.0
            if self._one_motor:
                self._angle = _NAN
        taken = self._advance(self._torque, self._angle)
        for queue in self._queues:
            queue.append(taken)
        self._newest = taken
        self.samples += 1
