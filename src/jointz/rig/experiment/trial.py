"""One uninterrupted stretch of walking with pulses, a controller or neither, tick by tick."""

from collections.abc import Callable
from dataclasses import dataclass
from math import exp, pi, tanh

from jointz.core.channels import MOTION_SENSORS
from jointz.core.clock import Clock
from jointz.core.codes import Trip
from jointz.core.errors import SafetyStop
from jointz.core.limits import LOOK_AHEAD_S
from jointz.core.protocols.protocol_models import GaitSpec
from jointz.core.session_log import WALKING_EXTRAS, Flag
from jointz.core.study import TorqueModelSpec
from jointz.rig.devices.interface import Devices
from jointz.rig.experiment.controller_runner import ControllerRunner
from jointz.rig.experiment.files.recorder import Recorder
from jointz.rig.experiment.gait.gait_watch import CONTACT_LEVELS, GaitWatch
from jointz.rig.experiment.gait.unperturbed_angle import UnperturbedAngle
from jointz.rig.experiment.pulse_runner import PulseRunner
from jointz.rig.experiment.safety import SafetyGate
from jointz.rig.experiment.streams import NO_ACTUATOR_SAMPLE, NO_SENSOR_SAMPLE, Streams

_NAN = float("nan")
_STEADY, _SHAM, _OVERRUN = int(Flag.STEADY), int(Flag.SHAM), int(Flag.OVERRUN)
_CLAMPED, _FADING = int(Flag.CLAMPED), int(Flag.FADING)
#: Answer of a trial that has no parameters.
NO_CONTROLLER = "this trial has no controller"
#: Accepted strides after the last pulse.
COOL_DOWN_STRIDES = 5
#: No accepted stride for so long: the participant stands, or the footswitch is lost.
_NO_STRIDE_NS = 20_000_000_000

#: Called after every accepted stride with strides and completed pulses.
StrideCallback = Callable[[int, int], None]


@dataclass(frozen=True, slots=True)
class TrialSettings:
    """Settings of a walking trial."""

    gait: GaitSpec  # gait settings of the protocol
    period_ns: int  # period of the loop
    # accepted strides of a trial without pulses; with pulses, it ends ``COOL_DOWN_STRIDES`` after
    # the last one
    strides: int
    # levels of the footswitch in its own unit: off, on
    contact_levels: tuple[float, float] = CONTACT_LEVELS


class Motor:
    """The actuator of a trial with everything between a wanted torque and its command."""

    def __init__(self, devices: Devices, gate: SafetyGate) -> None:
        if devices.actuator is None:
            raise ValueError("expected devices with an actuator.")
        described = devices.actuator.describe()
        self.gate = gate
        self.command_torque = devices.actuator.command_torque
        self.stop = devices.actuator.stop
        self.applied = AppliedTorque(
            described.torque_model, sample_period_s=1.0 / described.sample_rate_hz
        )
        self.zero_torque = ZeroTorque(described.torque_model)


#: Where a device has another name than what it measures besides.
_DEVICE_OF = {"moment": "torque"}


def walking_extras(devices: Devices) -> tuple[str, ...]:
    """Return what is measured in walking besides angle, contact and actuator."""
    return tuple(
        name for name in WALKING_EXTRAS if getattr(devices, _DEVICE_OF.get(name, name)) is not None
    )


class Trial:
    """Reads, decides, commands and records, once a tick.

    Every decision is taken on the time of the tick's slot, so that the same
    samples make the same trial under a real and under a virtual clock.
    """

    def __init__(
        self,
        course: TrialSettings,
        *,
        devices: Devices,
        motor: Motor | None,
        pulses: PulseRunner | None,
        recorder: Recorder,
        clock: Clock,
        progress: StrideCallback,
        controller: ControllerRunner | None = None,
    ) -> None:
        if devices.angle is None or devices.contact is None:
            raise ValueError("expected devices with a goniometer and a footswitch.")
        self._period_ns = course.period_ns
        # What is measured to be recorded: nothing in the loop depends on it.
        self._streams = Streams(devices, dispensable=("torque", *MOTION_SENSORS))
        self._extras = [_DEVICE_OF.get(name, name) for name in walking_extras(devices)]
        self._watch = GaitWatch(course.gait, course.contact_levels)
        self._motor = motor
        self._pulses = pulses
        self._controller = controller
        self._unperturbed: UnperturbedAngle | None = None
        if pulses is not None and motor is not None and motor.gate.displacement_rad is not None:
            self._unperturbed = UnperturbedAngle(course.period_ns)
        self._displaced = False  # whether the displacement of a pulse is followed
        self._strides = course.strides
        self._recorder = recorder
        self._now_ns = clock.now_ns
        self._progress = progress
        self._first_slot = -1
        self._busy_us = 0.0
        self._requested = self._sent = self._command = 0.0
        self._flags = 0
        self._stopping = False
        self._last_needed = 0

    @property
    def strides(self) -> int:
        """Strides accepted so far."""
        return self._watch.strides.strides

    @property
    def _pulse_is_felt(self) -> bool:
        """Whether a pulse with torque is on; shams have none."""
        pulse = None if self._pulses is None else self._pulses.active
        return pulse is not None and not pulse.sham

    def request_stop(self) -> None:
        """End the trial soon: a pulse or a controller's torque is faded out first."""
        self._stopping = True

    def pause(self, *, on: bool) -> bool:
        """Begin no more pulses, or fade the controller out, while the participant walks on."""
        runner = self._pulses or self._controller
        if runner is None:
            return False
        runner.pause(on=on)
        return True

    def set_parameter(self, name: str, value: float) -> str:
        """Change a parameter of the controller; return why it is refused, "" if it is not."""
        controller = self._controller
        return NO_CONTROLLER if controller is None else controller.set_parameter(name, value)

    def undo_parameter(self) -> str:
        """Take back the last change of a parameter; return why not, "" if it was."""
        return NO_CONTROLLER if self._controller is None else self._controller.undo()

    def tick(self, slot: int, host_ns: int, skipped: int) -> bool:
        """Read, decide, command and record in one slot."""
        if self._first_slot < 0:
            self._first_slot = slot
        slot -= self._first_slot
        slot_ns = slot * self._period_ns
        age_s = self._streams.read(slot_ns)
        watch = self._watch
        stride = watch.update(slot_ns, self._streams.angle, self._streams.contact)
        self._flags = (_STEADY if watch.steady else 0) | (_OVERRUN if skipped else 0)
        running = not self._stopping
        if self._unperturbed is not None:
            self._learn(self._unperturbed, slot_ns, accepted=stride)
        if self._motor is not None:  # torque that is on has to fade first
            running = self._act(self._motor, slot, slot_ns, age_s=age_s, skipped=skipped)
        self._record(slot, host_ns)
        if stride:
            running = self._after_stride() and running
        self._check_walking(slot_ns)
        self._busy_us = (self._now_ns() - host_ns) * 1e-3
        return running

    def _learn(self, unperturbed: UnperturbedAngle, slot_ns: int, *, accepted: bool) -> None:
        """Learn the angle without pulses; before it is known no pulse may begin."""
        pulses, watch = self._pulses, self._watch
        if pulses is None:
            return
        unperturbed.learn(
            slot_ns,
            watch.strides,
            (self._streams.newest_angle.value, self._streams.newest_actuator.velocity),
            accepted=accepted,
            retracted=watch.retracted,
            pulse=self._pulse_is_felt,
        )
        pulses.withheld = "" if unperturbed.known else "unperturbed angle not known yet"

    def _displacement(self, slot_ns: int) -> float | None:
        """Return where the pulse that is on is about to displace the knee to, rad.

        If it were cut now, the knee would coast; a pulse whose rest takes it back may go on as long
        as that brings it less far. None where no pulse with torque is on, or without a limit.
        """
        unperturbed, pulses = self._unperturbed, self._pulses
        if unperturbed is None or pulses is None:
            return None
        if not self._pulse_is_felt:
            self._displaced = False
            return None
        streams = self._streams
        measured = (streams.newest_angle.value, streams.newest_actuator.velocity)
        if self._displaced:
            unperturbed.follow(slot_ns, measured)
        else:
            unperturbed.begin(slot_ns, self._watch.strides, measured)
            self._displaced = True
        coasting = unperturbed.displacement + LOOK_AHEAD_S * unperturbed.rate
        going_on = coasting + pulses.displacement_to_come(slot_ns)
        ahead = min(coasting, going_on, key=abs)
        # What is no number is too far: max would leave it out.
        return ahead if ahead != ahead else max(unperturbed.displacement, ahead, key=abs)

    def _act(self, motor: Motor, slot: int, slot_ns: int, *, age_s: float, skipped: int) -> bool:
        """Decide on a torque and send it; False when no more is to come."""
        pulses, controller, gate = self._pulses, self._controller, motor.gate
        wanted = 0.0 if controller is None else self._controlled(controller, slot, slot_ns)
        if pulses is not None:
            if self._watch.retracted:
                pulses.retract_stride()
            wanted = pulses.torque(slot, slot_ns, self._watch)
            if pulses.active is not None and pulses.active.sham:
                self._flags |= _SHAM
        newest = self._streams.newest_actuator
        requested = motor.zero_torque.request(wanted, newest.velocity)
        if skipped:
            gate.overran(skipped)
        sent = gate.check(
            requested,
            newest if self._streams.actuator else None,
            angle=self._streams.newest_angle.value,
            age_s=age_s,
            steady=self._watch.steady and not self._stopping,
            # Not its torque: a pulse may pass through zero.
            pulse_active=self._pulse_is_felt,
            displacement=self._displacement(slot_ns),
        )
        fades = gate.fading and sent != 0.0
        if controller is not None:  # a limit of the rate may make its fade longer
            late = bool(gate.flags & _CLAMPED) and abs(sent) > abs(requested)
            fades = controller.fading or late
        over = gate.tripped is not None or (self._stopping and not fades)
        if over:
            sent = 0.0
            motor.stop()  # a device in fault takes no more commands
        else:
            motor.command_torque(sent)
        self._command, self._requested, self._sent = wanted, requested, sent
        self._flags |= gate.flags
        if controller is not None and controller.failure:  # after the zero was sent
            gate.detail += f"; {controller.name} raised {controller.failure}"
            controller.write_failure()
        if pulses is not None and (gate.fading or gate.cut):
            pulses.abort(self._why_aborted(gate), cut=gate.cut)
        return not over

    def _controlled(self, controller: ControllerRunner, slot: int, slot_ns: int) -> float:
        """Return the torque that the controller wants, N*m."""
        streams, watch = self._streams, self._watch
        torque = controller.torque(
            slot,
            slot_ns,
            watch,
            angle=streams.newest_angle.value,
            velocity=streams.newest_actuator.velocity,
            contact=streams.newest_contact.value,
            steady=watch.steady and not self._stopping,
            clamped_nm=None if self._sent == self._requested else self._sent,
        )
        if controller.fading:
            self._flags |= _FADING
        return torque

    def _why_aborted(self, gate: SafetyGate) -> str:
        if gate.cut:
            return f"displacement above safety.displacement_rad = {gate.displacement_rad:g} rad"
        if self._stopping:
            return "stopped"
        return "too much of the time under pulses" if self._watch.steady else "gait not steady"

    def _after_stride(self) -> bool:
        """Count an accepted stride; False if it was the last that is needed."""
        pulses, strides = self._pulses, self.strides
        if pulses is None:
            self._progress(strides, 0)
            if self._controller is not None and strides >= self._strides:
                self._stopping = True  # its torque fades before the trial ends
                return True
            return strides < self._strides
        pulses.stride()
        pulses.decide(strides)
        self._progress(strides, pulses.completed)
        if not pulses.done:
            self._last_needed = strides + COOL_DOWN_STRIDES
        return strides < self._last_needed

    def _check_walking(self, slot_ns: int) -> None:
        if slot_ns - self._watch.last_stride_ns > _NO_STRIDE_NS:
            raise SafetyStop(
                Trip.NO_STRIDES,
                f"no accepted stride for {_NO_STRIDE_NS * 1e-9:.0f} s. Check that the participant "
                "walks and the footswitch is connected.",
            )

    def _record(self, slot: int, host_ns: int) -> None:
        parts = range(self._streams.parts)
        self._recorder.write(*[self._part(slot, host_ns, part) for part in parts])

    def _part(self, slot: int, host_ns: int, part: int) -> tuple[float, ...]:
        """Return one record: the tick, and the sample of this number of every device."""
        streams, watch, pulses, motor = self._streams, self._watch, self._pulses, self._motor
        actuator, angle, contact = streams.actuator, streams.angle, streams.contact
        a = actuator[part] if part < len(actuator) else NO_ACTUATOR_SAMPLE
        g = angle[part] if part < len(angle) else NO_SENSOR_SAMPLE
        c = contact[part] if part < len(contact) else NO_SENSOR_SAMPLE
        extras: list[float] = []  # the joint's moment, or more of its motion
        for name in self._extras:
            samples = getattr(streams, name)
            one = samples[part] if part < len(samples) else NO_SENSOR_SAMPLE
            extras += one.device_time_ns, one.value
        return (
            host_ns,
            a.device_time_ns,
            g.device_time_ns,
            c.device_time_ns,
            a.angle,
            g.value,
            slot,
            self._busy_us,
            a.velocity,
            a.current,
            a.voltage,
            a.temperature_c,
            c.value,
            self._requested,
            self._sent,
            self._command,
            motor.applied.update(a.current, a.velocity) if motor and part < len(actuator) else _NAN,
            watch.phase_pct,
            watch.shadow_phase_pct,
            a.faults,
            watch.strides.strides,
            pulses.active.number if pulses and pulses.active else 0,
            self._flags,
            part,
            *extras,
        )


#: Friction turns its sign smoothly over this velocity: a step would make the motor chatter.
_SMOOTH_RAD_S = 0.2
#: Share of the friction that is compensated: more could drive the joint by itself.
_COMPENSATED = 0.8
#: The acceleration of equation 4.1 is differentiated velocity, low-passed here.
_ACCELERATION_HZ = 20.0


class AppliedTorque:
    """Torque on the joint out of current and velocity, sample by sample.

    Equation 4.1 with the acceleration from the differentiated and low-passed
    velocity. Good enough to act on; for estimates torque is computed again from
    the record, without delay.
    """

    def __init__(self, model: TorqueModelSpec, *, sample_period_s: float) -> None:
        self._model = model
        self._constant = model.gear_ratio * model.torque_constant
        self._rate_hz = 1.0 / sample_period_s
        self._share = 1.0 - exp(-2.0 * pi * _ACCELERATION_HZ * sample_period_s)
        self._velocity: float | None = None
        self._acceleration = 0.0

    def update(self, current: float, velocity: float) -> float:
        """Process a sample and return the torque on the joint, N*m."""
        model = self._model
        if self._velocity is not None:
            raw = (velocity - self._velocity) * self._rate_hz
            self._acceleration += self._share * (raw - self._acceleration)
        self._velocity = velocity
        friction = model.coulomb_friction + model.gear_friction * abs(current)
        sign = 1.0 if velocity > 0.0 else -1.0 if velocity < 0.0 else 0.0
        return (
            model.bias
            + self._constant * current
            - friction * sign
            - model.viscous_friction * velocity
            - model.rotor_inertia * self._acceleration
        )


class ZeroTorque:
    """Zero-torque control: compensates the friction that the wearer would feel."""

    def __init__(self, model: TorqueModelSpec) -> None:
        self._coulomb = _COMPENSATED * model.coulomb_friction
        self._viscous = _COMPENSATED * model.viscous_friction
        gain = model.gear_ratio * model.torque_constant
        self._per_torque = _COMPENSATED * model.gear_friction / abs(gain)

    def request(self, torque_nm: float, velocity: float) -> float:
        """Return what to ask of the motor so that the joint feels a torque."""
        friction = self._coulomb + self._per_torque * abs(torque_nm)
        return torque_nm + friction * tanh(velocity / _SMOOTH_RAD_S) + self._viscous * velocity
