"""A simulated bench in the time of a clock, computed as far as its devices are read."""

from jointz.rig.sim.benches.compiled_bench import CompiledBench
from jointz.rig.sim.sensors.sampled_time import Sample, SampledTime

_NAN = float("nan")


class RunningBench(SampledTime):
    """A bench from the first read or command on."""

    def __init__(
        self, plant: CompiledBench, *, period_ns: int, timeout_s: float, one_motor: bool
    ) -> None:
        super().__init__(period_ns)
        self._advance = plant.sample
        self._timeout = round(timeout_s * 1e9) // period_ns
        self._one_motor = one_motor
        self._torque = 0.0
        self._angle = _NAN if one_motor else 0.0
        self._commanded = 0
        self._newest: Sample | None = None
        self._faults = 0

    def command(self, torque_nm: float, now_ns: int) -> None:
        """Command a torque of the actuator."""
        self.look(now_ns)
        self._torque = torque_nm
        if self._one_motor:
            self._angle = _NAN
        self._commanded = self.samples - 1

    def move_to(self, angle_rad: float, now_ns: int) -> None:
        """Command an angle of the positioner."""
        self.look(now_ns)
        self._angle = angle_rad
        if self._one_motor:
            self._torque = _NAN
        self._commanded = self.samples - 1

    def hold_still(self, now_ns: int) -> None:
        """Hold the positioner where it is."""
        if self._one_motor:
            self.release(now_ns)
        elif self._newest is not None:
            self.move_to(self._newest[3], now_ns)

    def release(self, now_ns: int) -> None:
        """Release the torque of the actuator."""
        self.command(_NAN if self._one_motor else 0.0, now_ns)

    def fail(self, bits: int) -> None:
        """Set fault bits of the actuator: it goes to zero torque by itself."""
        self._faults |= bits

    def _step(self) -> None:
        if self._faults or self.samples - 1 - self._commanded >= self._timeout:
            self._torque = _NAN if self._one_motor else 0.0
            if self._one_motor:
                self._angle = _NAN
        newest = self._advance(self._torque, self._angle)
        for queue in self._queues:
            queue.append(newest)
        self._newest = newest
        self.samples += 1
