"""One trial on a bench, tick by tick."""

from collections.abc import Callable

from jointz.core.clock import Clock
from jointz.core.session_log import Flag
from jointz.rig.devices.interface import Devices
from jointz.rig.experiment.bench.bench_plan import BenchSchedule
from jointz.rig.experiment.files.recorder import Recorder
from jointz.rig.experiment.safety import SafetyGate
from jointz.rig.experiment.streams import NO_ACTUATOR_SAMPLE, NO_SENSOR_SAMPLE, Streams

_LEAD, _OVERRUN = int(Flag.LEAD), int(Flag.OVERRUN)

#: Called now and then with seconds done and seconds in all.
BenchProgress = Callable[[int, int], None]


class BenchTrial:
    """Reads, commands what the course asks for, and records, once a tick."""

    def __init__(
        self,
        course: BenchSchedule,
        *,
        period_ns: int,
        devices: Devices,
        gate: SafetyGate,
        recorder: Recorder,
        clock: Clock,
        progress: BenchProgress,
    ) -> None:
        if devices.actuator is None:
            raise ValueError("expected devices with an actuator.")
        self._course = course
        self._period_ns = period_ns
        self._streams = Streams(devices)
        self._has_angle_sensor = devices.angle is not None
        self._has_contact = devices.contact is not None
        self._gate = gate
        self._command_torque = devices.actuator.command_torque
        self._stop_actuator = devices.actuator.stop
        self._positioner = devices.positioner if course.position_controlled else None
        self._recorder = recorder
        self._now_ns = clock.now_ns
        self._progress = progress
        self._ticks_a_second = round(1e9 / period_ns)
        self._first_slot = -1
        self._busy_us = 0.0
        self._sent = 0.0
        self._stopping = False

    def request_stop(self) -> None:
        """End the trial soon: torque is faded out first."""
        self._stopping = True

    def pause(self, *, on: bool) -> bool:
        """Return False: a trial of a bench is one record, there is nothing to pause."""
        del on
        return False

    def set_parameter(self, name: str, value: float) -> str:
        """Refuse: a bench follows its references."""
        del name, value
        return "this trial has no controller"

    def undo_parameter(self) -> str:
        """Refuse: a bench follows its references."""
        return "this trial has no controller"

    def tick(self, slot: int, host_ns: int, skipped: int) -> bool:
        """Read, decide, command and record in one slot."""
        if self._first_slot < 0:
            self._first_slot = slot
        slot -= self._first_slot
        course = self._course
        last = len(course.torque) - 1
        place = slot if slot < last else last
        age_s = self._streams.read(slot * self._period_ns)
        requested = course.torque[place] + course.command[place]
        running = self._act(requested, place, age_s=age_s, skipped=skipped)
        self._record(slot, place, host_ns, requested=requested, overran=skipped > 0)
        if slot % self._ticks_a_second == 0:
            self._progress(slot // self._ticks_a_second, last // self._ticks_a_second)
        self._busy_us = (self._now_ns() - host_ns) * 1e-3
        return running and slot < last

    def _act(self, requested: float, place: int, *, age_s: float, skipped: int) -> bool:
        """Send torque and position; False when no more is to come."""
        gate, streams, course = self._gate, self._streams, self._course
        newest = streams.newest_actuator
        if skipped:
            gate.overran(skipped)
        sent = gate.check(
            requested,
            newest if streams.actuator else None,
            angle=streams.newest_angle.value if self._has_angle_sensor else newest.angle,
            age_s=age_s,
            steady=not self._stopping,
            # Every torque of a bench fades on a stop; its own pulses alone count as pulses.
            pulse_active=self._stopping or course.command[place] != 0.0,
        )
        self._sent = sent
        if gate.tripped is not None or (self._stopping and sent == 0.0):
            self._stop_actuator()  # a device in fault takes no more commands
            return False
        if course.torque_controlled:
            self._command_torque(sent)
        if self._positioner is not None and not self._stopping:
            self._positioner.command_position(course.position[place])
        return True

    def _record(
        self, slot: int, place: int, host_ns: int, *, requested: float, overran: bool
    ) -> None:
        course = self._course
        flags = self._gate.flags | (_OVERRUN if overran else 0)
        if not course.first <= slot < course.stop:
            flags |= _LEAD
        tick = (slot, place, host_ns, requested, flags)
        self._recorder.write(*[self._part(part, tick) for part in range(self._streams.parts)])

    def _part(self, part: int, tick: tuple[int, int, int, float, int]) -> tuple[float, ...]:
        """Return one record: the tick, and the sample of this number of every device."""
        streams, course = self._streams, self._course
        slot, place, host_ns, requested, flags = tick
        actuator, angle, torque = streams.actuator, streams.angle, streams.torque
        position = streams.positioner
        a = actuator[part] if part < len(actuator) else NO_ACTUATOR_SAMPLE
        g = angle[part] if part < len(angle) else NO_SENSOR_SAMPLE
        t = torque[part] if part < len(torque) else NO_SENSOR_SAMPLE
        p = position[part] if part < len(position) else NO_SENSOR_SAMPLE
        record = (
            host_ns,
            a.device_time_ns,
            g.device_time_ns,
            t.device_time_ns,
            p.device_time_ns,
            a.angle,
            g.value,
            p.value,
            t.value,
            slot,
            self._busy_us,
            a.velocity,
            a.current,
            a.voltage,
            a.temperature_c,
            requested,
            self._sent,
            course.command[place],
            course.torque[place],
            course.position[place],
            a.faults,
            course.pulse[place],
            flags,
            part,
        )
        if not self._has_contact:
            return record
        contact = streams.contact
        c = contact[part] if part < len(contact) else NO_SENSOR_SAMPLE
        return (*record, c.device_time_ns, c.value)
