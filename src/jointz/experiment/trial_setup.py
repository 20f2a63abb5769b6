"""Put a trial together: of walking, or on a bench."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from jointz.core.clock import Clock
from jointz.core.errors import ProtocolError
from jointz.core.protocols.protocol import ConditionSpec
from jointz.core.protocols.protocol import Protocol as ProtocolSpec
from jointz.core.protocols.protocol_checks import trial_duration_s
from jointz.devices.interface import Devices
from jointz.experiment.bench.bench_plan import TimedPulse, bench_course
from jointz.experiment.bench.bench_trial import BenchProgress, BenchTrial
from jointz.experiment.files.journal import Journal
from jointz.experiment.files.recorder import Recorder
from jointz.experiment.gait.gait_watch import CONTACT_LEVELS
from jointz.experiment.plan import PlannedPulse
from jointz.experiment.pulse_runner import PulseRunner
from jointz.experiment.safety import SafetyGate
from jointz.experiment.scheduler import LATE_PCT, Scheduler
from jointz.experiment.trial import Course, Motor, Trial, TrialProgress


class AnyTrial(Protocol):
    """What a session runs."""

    @property
    def tick(self) -> Callable[[int, int, int], bool]:
        """Called in every slot; False when the trial is over."""
        ...

    def request_stop(self) -> None:
        """End the trial soon; torque is faded out first."""
        ...

    def pause(self, *, on: bool) -> bool:
        """Begin no more pulses, or go on with them."""
        ...


@dataclass(frozen=True, slots=True)
class TrialSetup:
    """What every trial is made of."""

    protocol: ProtocolSpec  # of the experiment
    condition: ConditionSpec  # of the trial
    name: str  # int: of the trial, and which stretch of it
    segment: int  # int
    devices: Devices  # not yet active
    gate: SafetyGate | None  # none without an actuator
    recorder: Recorder  # the log
    clock: Clock  # the host's
    # V: calibrated levels of a footswitch that gives volts, off and on
    contact_levels_v: tuple[float, float] | None = None

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


def walking_trial(
    setup: TrialSetup,
    left: Sequence[PlannedPulse],
    *,
    journal: Journal,
    progress: TrialProgress,
) -> Trial:
    """Return a stretch of a walking condition."""
    protocol, condition = setup.protocol, setup.condition
    if protocol.gait is None:
        raise ProtocolError(protocol.name, ["gait: missing; a walking session needs it."])
    pulses = None
    if condition.perturbations is not None and protocol.pulse is not None:
        pulses = PulseRunner(
            setup.name,
            setup.segment,
            protocol.pulse,
            Scheduler(
                left,
                warm_up_strides=condition.perturbations.warm_up_strides,
                late_pct=max(LATE_PCT, setup.period_ns * 1e-7 / protocol.gait.shortest_stride_s),
            ),
            journal=journal,
            period_ns=setup.period_ns,
        )
    return Trial(
        Course(protocol.gait, setup.period_ns, condition.strides or 0, setup.contact_levels),
        devices=setup.devices,
        motor=None if setup.gate is None else Motor(setup.devices, setup.gate),
        pulses=pulses,
        recorder=setup.recorder,
        clock=setup.clock,
        progress=progress,
    )


def bench_trial(
    setup: TrialSetup,
    pulses: Sequence[TimedPulse],
    *,
    rng: np.random.Generator,
    progress: BenchProgress,
) -> BenchTrial:
    """Return a trial on a bench."""
    if setup.gate is None:
        raise ProtocolError(setup.protocol.name, ["a bench needs an actuator; the rig has none."])
    course = bench_course(
        setup.condition,
        pulses,
        setup.protocol.pulse,
        duration_s=trial_duration_s(setup.protocol, setup.condition),
        rate_hz=setup.protocol.rates.control_hz,
        rng=rng,
    )
    return BenchTrial(
        course,
        period_ns=setup.period_ns,
        devices=setup.devices,
        gate=setup.gate,
        recorder=setup.recorder,
        clock=setup.clock,
        progress=progress,
    )
