"""Kinds of trials: walking (with pulses or a controller) and bench; see :class:`TrialKind`."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Protocol

import numpy as np

from jointz.core.clock import Clock
from jointz.core.errors import DataError, ProtocolError
from jointz.core.protocols.protocol import Protocol as ProtocolSpec
from jointz.core.protocols.protocol_checks import trial_duration_s
from jointz.core.protocols.protocol_models import ConditionSpec, ControllerSpec
from jointz.core.protocols.pulse_models import Pulse
from jointz.core.protocols.reference_signal_models import Noise
from jointz.core.session_log import BENCH, BENCH_CONTACT, WALKING_LAYOUTS, Layout
from jointz.rig.devices.interface import Devices, Wearer
from jointz.rig.experiment.bench.bench_plan import TimedPulse, bench_course, make_bench_plan
from jointz.rig.experiment.bench.bench_trial import BenchTrial
from jointz.rig.experiment.bench.reference_signals import endless_noise
from jointz.rig.experiment.controller_runner import ControllerRunner, RunnerSettings
from jointz.rig.experiment.controllers import (
    Controller,
    ControlParameter,
    ControlState,
    make_controller,
)
from jointz.rig.experiment.decisions import (
    Decisions,
    DecisionSettings,
    as_decided,
)
from jointz.rig.experiment.files.journal import Event, Journal
from jointz.rig.experiment.files.recorder import Recorder
from jointz.rig.experiment.files.session_files import PLAN_FILE
from jointz.rig.experiment.files.whole_files import read_twice
from jointz.rig.experiment.gait.gait_watch import CONTACT_LEVELS
from jointz.rig.experiment.plan import PlannedPulse, make_plan
from jointz.rig.experiment.pulse_runner import PulseRunner
from jointz.rig.experiment.safety import SafetyGate
from jointz.rig.experiment.scheduler import LATE_PCT, Scheduler
from jointz.rig.experiment.trial import Motor, Trial, TrialSettings, walking_extras

#: Called with accepted strides, completed pulses and planned pulses of walking; with seconds done,
#: the same again and seconds in all of a bench.
ProgressCallback = Callable[[int, int, int], None]


class AnyTrial(Protocol):
    """A trial of any kind, as a session runs it."""

    @property
    def tick(self) -> Callable[[int, int, int], bool]:
        """Called in every slot; False when the trial is over."""

    def request_stop(self) -> None:
        """End the trial soon; torque is faded out first."""

    def pause(self, *, on: bool) -> bool:
        """Begin no more pulses, or go on with them; False where there is nothing to pause."""

    def set_parameter(self, name: str, value: float) -> str:
        """Change a parameter of a controller; return why it is refused, "" if it is not."""

    def undo_parameter(self) -> str:
        """Take back the last change of a parameter; return why not, "" if it was."""


@dataclass(frozen=True, slots=True)
class TrialSetup:
    """Parts of a trial of any kind."""

    protocol: ProtocolSpec
    condition: ConditionSpec
    name: str  # name of the trial
    segment: int  # number of this stretch of the trial
    devices: Devices  # not yet active
    gate: SafetyGate | None  # None without an actuator
    recorder: Recorder
    clock: Clock
    journal: Journal
    pulses: Sequence[Any]  # planned pulses of the trial
    done: Mapping[int, Any]  # number of a completed pulse -> its event in the journal
    rng: np.random.Generator  # random numbers for the references
    # calibrated levels of a footswitch of kind ``voltage``: off, on; None if not calibrated
    contact_levels_v: tuple[float, float] | None = None
    wearer: Wearer = Wearer("")  # noqa: RUF009 - frozen
    angle_zero_rad: float | None = None  # what the goniometer shows at the joint's zero, if known
    angle_gain: float = 1.0  # measured over true angle
    controlled_by: Any = None  # description of the controller of an earlier stretch
    decisions: DecisionSettings | None = None  # None: the pulses come as planned

    @property
    def contact_levels(self) -> tuple[float, float]:
        """Levels of the footswitch, off and on, in its own unit."""
        switch = self.devices.contact
        if switch is None or self.contact_levels_v is None or switch.describe().kind != "voltage":
            return CONTACT_LEVELS
        return self.contact_levels_v

    @property
    def period_ns(self) -> int:
        """Period of the loop, ns."""
        return round(1e9 / self.protocol.rates.control_hz)


def walking_trial(setup: TrialSetup, progress: ProgressCallback) -> Trial:
    """Return a stretch of walking with the pulses that are not done yet, or with a controller."""
    protocol, condition, done = setup.protocol, setup.condition, len(setup.done)
    if protocol.gait is None:
        raise ProtocolError(protocol.name, ["gait: missing; a walking session needs it."])
    pulses = None
    if condition.perturbations is not None and protocol.shapes:
        pulses = PulseRunner(
            setup.name,
            setup.segment,
            protocol.shapes,
            Scheduler(
                [pulse for pulse in setup.pulses if pulse.number not in setup.done],
                condition.perturbations,
                late_pct=max(LATE_PCT, setup.period_ns * 1e-7 / protocol.gait.shortest_stride_s),
            ),
            journal=setup.journal,
            period_ns=setup.period_ns,
            inertia=protocol.expected_joint.inertia if protocol.expected_joint else None,
            decisions=None
            if setup.decisions is None
            else Decisions(setup.decisions, condition.perturbations.timing_points or {}),
        )
    return Trial(
        TrialSettings(protocol.gait, setup.period_ns, condition.strides or 0, setup.contact_levels),
        devices=setup.devices,
        motor=None if setup.gate is None else Motor(setup.devices, setup.gate),
        pulses=pulses,
        recorder=setup.recorder,
        clock=setup.clock,
        progress=lambda strides, completed: progress(strides, done + completed, len(setup.pulses)),
        controller=_controller_runner(setup),
    )


def _controller_runner(setup: TrialSetup) -> ControllerRunner | None:
    """Return the runner of the condition's controller or random torque; None without either."""
    spec, noise = setup.condition.controller, setup.condition.torque_nm
    controller: Controller
    if spec is not None:
        controller = _protocol_controller(spec, setup)
    elif isinstance(noise, Noise):
        # A new random sequence for every stretch: a resumed one does not repeat the torque.
        rng = setup.rng.spawn(setup.segment + 1)[-1]
        controller = RandomTorque(noise, rate_hz=setup.protocol.rates.control_hz, rng=rng)
        spec = ControllerSpec(name="random_torque")
    else:
        return None
    if setup.gate is None:
        raise ProtocolError(setup.protocol.name, [f"{setup.name} needs an actuator."])
    settings = RunnerSettings(
        setup.period_ns, setup.gate.fade_s, setup.angle_zero_rad, setup.angle_gain
    )
    return ControllerRunner(
        setup.name, setup.segment, spec, controller, journal=setup.journal, settings=settings
    )


def _protocol_controller(spec: ControllerSpec, setup: TrialSetup) -> Controller:
    """Return the controller that the protocol names; refuse one that changed between stretches."""
    controller = make_controller(spec, protocol=setup.protocol, wearer=setup.wearer)
    before = setup.controlled_by
    if before is not None and before != json.loads(json.dumps(dict(controller.describe()))):
        raise DataError(
            f"{setup.name}: '{spec.name}' is another controller than in the stretch before: its "
            "profile, settings or version changed. Restore them, or begin another study."
        )
    return controller


def bench_trial(setup: TrialSetup, progress: ProgressCallback) -> BenchTrial:
    """Return a trial on a bench, from its beginning."""
    if setup.gate is None:
        raise ProtocolError(setup.protocol.name, ["a bench needs an actuator; the rig has none."])
    course = bench_course(
        setup.condition,
        setup.pulses,
        setup.protocol.pulse,
        duration_s=trial_duration_s(setup.protocol, setup.condition),
        rate_hz=setup.protocol.rates.control_hz,
        rng=setup.rng,
    )
    return BenchTrial(
        course,
        period_ns=setup.period_ns,
        devices=setup.devices,
        gate=setup.gate,
        recorder=setup.recorder,
        clock=setup.clock,
        progress=lambda seconds, total: progress(seconds, seconds, total),
    )


def _walking_plan(
    condition: ConditionSpec, pulses: tuple[Pulse, ...], rng: np.random.Generator
) -> tuple[PlannedPulse, ...]:
    plan = condition.perturbations
    return () if plan is None else make_plan(plan, pulses, rng)


@dataclass(frozen=True, slots=True)
class TrialKind:
    """Differences between trials of walking and those of a bench."""

    pulse: type[PlannedPulse] | type[TimedPulse]  # class of its planned pulses
    make_plan: Callable[[ConditionSpec, tuple[Pulse, ...], np.random.Generator], Sequence[Any]]
    layout: Callable[[Devices], Layout]  # layout of the records of a log, given the devices
    trial: Callable[[TrialSetup, ProgressCallback], AnyTrial]
    # whether an interrupted trial continues in a new stretch; otherwise it is repeated as a whole
    resumes: bool

    def read_plan(self, folder: Path, events: Sequence[Event] = ()) -> dict[str, tuple[Any, ...]]:
        """Return the plan that a session wrote down, trial by trial, with what was decided."""
        plan = read_twice(folder / PLAN_FILE)[0]
        return {
            name: as_decided(tuple(self.pulse(**one) for one in pulses), events, name)
            for name, pulses in plan.items()
        }


def _walking_layout(devices: Devices) -> Layout:
    return WALKING_LAYOUTS[walking_extras(devices)]


WALKING_TRIALS = TrialKind(
    PlannedPulse, _walking_plan, _walking_layout, walking_trial, resumes=True
)
BENCH_TRIALS = TrialKind(
    TimedPulse,
    make_bench_plan,
    lambda devices: BENCH if devices.contact is None else BENCH_CONTACT,
    bench_trial,
    resumes=False,
)


def trial_kind(protocol: ProtocolSpec) -> TrialKind:
    """Return the kind of the trials of a protocol."""
    return WALKING_TRIALS if protocol.by_gait else BENCH_TRIALS


class RandomTorque:
    """Gives the next sample of a noise in every tick, whatever the wearer does."""

    parameters: ClassVar[Mapping[str, ControlParameter]] = {}

    def __init__(self, noise: Noise, *, rate_hz: float, rng: np.random.Generator) -> None:
        self._noise = noise
        self._samples = endless_noise(noise, rate_hz=rate_hz, rng=rng)
        self._next = next(self._samples)  # the filter is made now, not in a tick

    def torque(self, state: ControlState, values: Mapping[str, float]) -> float:
        """Return the torque, N*m."""
        del state, values
        torque_nm, self._next = self._next, next(self._samples)
        return torque_nm

    def describe(self) -> Mapping[str, Any]:
        """Return the reference."""
        return {"torque_nm": self._noise.model_dump(mode="json")}
