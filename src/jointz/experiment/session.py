"""A participant's session: conditions in order, each kept on disk as it happens.

The folder of a session holds what was planned and what was done::

    session.json     protocol, wearer, devices, calibration, seed, software
    plan.json        the pulses of every condition, in order
    journal.jsonl    what happened, one line an event
    logs/            the records, a file for every uninterrupted stretch

Nothing of it is ever rewritten; a session that was interrupted goes on in a new
stretch with the pulses that the journal does not count as done.
"""

import json
import os
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from jointz.core.clock import Clock
from jointz.core.errors import DeviceError, OutputError, ProtocolError, SafetyStop
from jointz.core.limits import tightened
from jointz.core.protocol import ConditionSpec, GaitSpec
from jointz.core.protocol import Protocol as ProtocolSpec
from jointz.core.provenance import software
from jointz.devices.interface import Devices, Rig
from jointz.experiment.journal import (
    Event,
    Journal,
    is_completed,
    pulses_done,
    read_journal,
    segments_begun,
)
from jointz.experiment.loop import ControlLoop, undisturbed
from jointz.experiment.plan import PlannedPulse, make_plan
from jointz.experiment.pulse_runner import PulseRunner
from jointz.experiment.recorder import Recorder
from jointz.experiment.safety import SafetyGate
from jointz.experiment.scheduler import Scheduler
from jointz.experiment.trial import Course, Motor, Trial, TrialProgress

SESSION_FILE, PLAN_FILE, JOURNAL_FILE = "session.json", "plan.json", "journal.jsonl"

#: Called with the condition, accepted strides, completed pulses and planned pulses.
Progress = Callable[[str, int, int, int], None]


class Operator(Protocol):
    """Who runs the experiment."""

    def prompt(self, text: str) -> None:
        """Show what is to be done before a condition and return when it is.

        Parameters
        ----------
        text : str
            The protocol's words.
        """
        ...


@dataclass(frozen=True, slots=True)
class SessionPlan:
    """What a session is to do.

    Parameters
    ----------
    protocol : Protocol
        Of the experiment.
    seed : int
        Of the plan.
    folder : pathlib.Path
        Where the session is kept.
    """

    protocol: ProtocolSpec
    seed: int
    folder: Path

    @property
    def period_ns(self) -> int:
        """Period of the loop, ns."""
        return round(1e9 / self.protocol.rates.control_hz)

    @property
    def gait(self) -> GaitSpec:
        """How the participant walks."""
        if self.protocol.gait is None:
            raise ProtocolError(self.protocol.name, ["gait: missing; a walking session needs it."])
        return self.protocol.gait


def log_path(folder: Path, condition: str, segment: int) -> Path:
    """Return where the log of a stretch is kept.

    Parameters
    ----------
    folder : pathlib.Path
        Of the session.
    condition : str
        Name of the condition.
    segment : int
        Number of the stretch, from 0.
    """
    return folder / "logs" / f"{condition}-{segment}.jzlog"


def plan_of(folder: Path) -> dict[str, tuple[PlannedPulse, ...]]:
    """Return the plan that a session wrote down, condition by condition.

    Parameters
    ----------
    folder : pathlib.Path
        Of the session.
    """
    written = json.loads((folder / PLAN_FILE).read_text(encoding="utf-8"))
    return {
        name: tuple(PlannedPulse.from_dict(entry) for entry in pulses)
        for name, pulses in written.items()
    }


class Session:
    """Runs what is still to be done of a session.

    Parameters
    ----------
    plan : SessionPlan
        What to do.
    rig : Rig
        The participant and the devices.
    clocks : callable
        Makes the clock of a stretch.
    operator : Operator
        Asked before every condition.
    progress : callable
        Told after every accepted stride.
    real_time : bool
        Whether to keep the machine's scheduler and garbage collector out of the loop.
    """

    def __init__(
        self,
        plan: SessionPlan,
        rig: Rig,
        *,
        clocks: Callable[[], Clock],
        operator: Operator,
        progress: Progress,
        real_time: bool,
    ) -> None:
        self._plan = plan
        self._rig = rig
        self._clocks = clocks
        self._operator = operator
        self._progress = progress
        self._real_time = real_time
        self._trial: Trial | None = None
        self._stop_requested = False

    def request_stop(self) -> None:
        """End the session soon, fading out a pulse that is on."""
        self._stop_requested = True
        if self._trial is not None:
            self._trial.request_stop()

    def run(self) -> None:
        """Run all conditions that are not done yet.

        Raises
        ------
        DeviceError
            When a device failed or the safety gate tripped.
        OutputError
            When the disk does not take the records.
        KeyboardInterrupt
            When a stop was requested.
        """
        folder = self._plan.folder
        (folder / "logs").mkdir(parents=True, exist_ok=True)
        self._write_down_once()
        journal_file = folder / JOURNAL_FILE
        pulses = plan_of(folder)
        with Journal(journal_file) as journal:
            for condition in self._plan.protocol.conditions:
                events = read_journal(journal_file)
                if not is_completed(events, condition.name):
                    self._operator.prompt(condition.prompt)
                    self._run_condition(condition, pulses.get(condition.name, ()), events, journal)

    def _write_down_once(self) -> None:
        """Write the plan and what the session is of; an interrupted session has them already."""
        folder, protocol = self._plan.folder, self._plan.protocol
        name_hash = zlib.crc32(self._rig.wearer.id.encode())
        rng = np.random.default_rng(np.random.SeedSequence(self._plan.seed, spawn_key=(name_hash,)))
        plans = {}
        for condition in protocol.conditions:
            if condition.perturbations is not None and protocol.pulse is not None:
                made = make_plan(condition.perturbations, protocol.pulse, rng)
                plans[condition.name] = [pulse.to_dict() for pulse in made]
        _write_json_once(folder / PLAN_FILE, plans)
        wearer = self._rig.wearer
        about = {
            "wearer": {"id": wearer.id, "mass_kg": wearer.mass_kg, "height_m": wearer.height_m},
            "protocol": protocol.model_dump(mode="json"),
            "seed": self._plan.seed,
            "calibration": self._rig.calibration.model_dump(exclude_none=True),
            "rig": dict(self._rig.notes()),
            "software": software(),
        }
        _write_json_once(folder / SESSION_FILE, about)

    def _run_condition(
        self,
        condition: ConditionSpec,
        pulses: tuple[PlannedPulse, ...],
        events: list[Event],
        journal: Journal,
    ) -> None:
        segment = segments_begun(events, condition.name)
        done = pulses_done(events, condition.name)
        left = [pulse for pulse in pulses if pulse.number not in done]
        clock = self._clocks()
        devices = self._rig.open(condition.name, worn=condition.worn, segment=segment, clock=clock)
        with ExitStack() as stack:
            stack.enter_context(_journaled(journal, condition.name, segment))
            for device in devices.all():
                stack.callback(device.close)
            journal.write("segment_started", condition=condition.name, segment=segment)
            gate = self._gate(devices)
            path = log_path(self._plan.folder, condition.name, segment)
            recorder = stack.enter_context(
                Recorder(path, self._header(condition, segment, devices))
            )
            self._trial = Trial(
                Course(self._plan.gait, self._plan.period_ns, condition.strides or 0),
                devices=devices,
                motor=None if gate is None else Motor(devices, gate),
                pulses=self._pulse_runner(condition, segment, left, journal),
                recorder=recorder,
                clock=clock,
                progress=self._told(condition.name, len(done), len(pulses)),
            )
            self._run_trial(self._trial, devices, gate, clock)
            journal.write("condition_completed", condition=condition.name, segment=segment)

    def _run_trial(
        self, trial: Trial, devices: Devices, gate: SafetyGate | None, clock: Clock
    ) -> None:
        """Run the loop; whatever happens, the devices are stopped first of all."""
        if self._stop_requested:
            raise KeyboardInterrupt
        try:
            for device in devices.all():
                device.configure()
            for device in devices.all():
                device.activate()
            with undisturbed() if self._real_time else nullcontext():
                ControlLoop(clock, self._plan.period_ns).run(trial.tick)
        finally:
            for device in devices.all():
                device.stop()
        if gate is not None and gate.tripped is not None:
            raise SafetyStop(gate.tripped, gate.detail)
        if self._stop_requested:
            raise KeyboardInterrupt

    def _gate(self, devices: Devices) -> SafetyGate | None:
        if devices.actuator is None:
            return None
        described = devices.actuator.describe()
        model = described.torque_model
        return SafetyGate(
            tightened(described.limits, self._plan.protocol.safety),
            control_period_s=self._plan.period_ns * 1e-9,
            torque_per_ampere=abs(model.gear_ratio * model.torque_constant),
        )

    def _pulse_runner(
        self,
        condition: ConditionSpec,
        segment: int,
        left: list[PlannedPulse],
        journal: Journal,
    ) -> PulseRunner | None:
        plan, pulse = condition.perturbations, self._plan.protocol.pulse
        if plan is None or pulse is None:
            return None
        return PulseRunner(
            condition.name,
            segment,
            pulse,
            Scheduler(left, warm_up_strides=plan.warm_up_strides),
            journal=journal,
            period_ns=self._plan.period_ns,
        )

    def _header(self, condition: ConditionSpec, segment: int, devices: Devices) -> dict[str, Any]:
        return {
            "participant": self._rig.wearer.id,
            "condition": condition.name,
            "segment": segment,
            "control_hz": self._plan.protocol.rates.control_hz,
            "devices": devices.to_dict(),
        }

    def _told(self, condition: str, done: int, planned: int) -> TrialProgress:
        def told(strides: int, completed: int) -> None:
            self._progress(condition, strides, done + completed, planned)

        return told


@contextmanager
def _journaled(journal: Journal, condition: str, segment: int) -> Iterator[None]:
    """Write down what ended a stretch before its time."""

    def note(event: str, why: str) -> None:
        journal.write(event, condition=condition, segment=segment, reason=why)

    try:
        yield
    except KeyboardInterrupt:
        note("stopped", "asked for")
        raise
    except DeviceError as exc:
        note("tripped", str(exc))
        raise
    except OSError as exc:
        # The journal most likely lies on the same disk and cannot be written either.
        raise OutputError(
            f"{exc.filename or 'log'}: the records could not be written ({exc.strerror or exc}). "
            "The devices were stopped. Make room, then go on with --resume."
        ) from exc
    except Exception as exc:
        note("failed", f"{type(exc).__name__}: {exc}")
        raise


def _write_json_once(file: Path, content: Mapping[str, Any]) -> None:
    """Write a file that is there whole or not at all; one that is there stays."""
    if file.exists():
        return
    partial = file.with_suffix(".partial")
    with partial.open("w", encoding="utf-8") as stream:
        json.dump(content, stream, indent=1)
        stream.flush()
        os.fsync(stream.fileno())
    partial.replace(file)
