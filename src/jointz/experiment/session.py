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
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from jointz.core.clock import Clock
from jointz.core.errors import DeviceError, OutputError, SafetyStop
from jointz.core.limits import tightened
from jointz.core.protocol import ConditionSpec
from jointz.core.protocol import Protocol as ProtocolSpec
from jointz.core.provenance import software
from jointz.core.session_log import BENCH, WALKING
from jointz.devices.interface import Devices, Rig
from jointz.experiment.bench_plan import TimedPulse, make_bench_plan
from jointz.experiment.journal import (
    Event,
    Journal,
    is_completed,
    pulses_begun,
    pulses_done,
    read_journal,
    segments_begun,
)
from jointz.experiment.loop import ControlLoop, undisturbed
from jointz.experiment.plan import PlannedPulse, make_plan
from jointz.experiment.recorder import Recorder
from jointz.experiment.safety import SafetyGate
from jointz.experiment.trial_setup import AnyTrial, TrialSetup, bench_trial, walking_trial

SESSION_FILE, PLAN_FILE, JOURNAL_FILE = "session.json", "plan.json", "journal.jsonl"

#: Called with the trial and how far it is: of walking accepted strides, completed pulses and
#: planned pulses; of a bench trial seconds done, the same again and seconds in all.
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

    def stream(self, wearer: str, purpose: str) -> np.random.Generator:
        """Return the random numbers of one purpose of a wearer; nothing else draws from them.

        Parameters
        ----------
        wearer, purpose : str
            Whose, and what they are for; "" is the plan of all conditions.
        """
        key = (zlib.crc32(wearer.encode()), *((zlib.crc32(purpose.encode()),) if purpose else ()))
        return np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=key))


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
    """Return the plan that a walking session wrote down, condition by condition.

    Parameters
    ----------
    folder : pathlib.Path
        Of the session.
    """
    return {
        name: tuple(PlannedPulse.from_dict(entry) for entry in pulses)
        for name, pulses in _written_plan(folder).items()
    }


def bench_plan_of(folder: Path) -> dict[str, tuple[TimedPulse, ...]]:
    """Return the plan that a session on a bench wrote down, trial by trial.

    Parameters
    ----------
    folder : pathlib.Path
        Of the session.
    """
    return {
        name: tuple(TimedPulse.from_dict(entry) for entry in pulses)
        for name, pulses in _written_plan(folder).items()
    }


def _written_plan(folder: Path) -> dict[str, list[dict[str, Any]]]:
    plan: dict[str, list[dict[str, Any]]] = json.loads(
        (folder / PLAN_FILE).read_text(encoding="utf-8")
    )
    return plan


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
        self._trial: AnyTrial | None = None
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
        with Journal(folder / JOURNAL_FILE) as journal:
            for condition in self._plan.protocol.conditions:
                events = read_journal(folder / JOURNAL_FILE)
                left = [name for name in condition.trial_names if not is_completed(events, name)]
                if left:
                    self._operator.prompt(condition.prompt)
                for name in left:
                    self._run_trial_of(condition, name, events, journal)

    def _write_down_once(self) -> None:
        """Write the plan and what the session is of; an interrupted session has them already."""
        folder, protocol = self._plan.folder, self._plan.protocol
        _write_json_once(folder / PLAN_FILE, self._make_plans())
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

    def _make_plans(self) -> dict[str, list[dict[str, Any]]]:
        """Return the pulses of every trial that has some."""
        plan, wearer = self._plan, self._rig.wearer.id
        pulse, bench = plan.protocol.pulse, plan.protocol.kind == "bench"
        rng = plan.stream(wearer, "")
        plans = {}
        for condition in plan.protocol.conditions:
            if condition.perturbations is None or pulse is None:
                continue
            for name in condition.trial_names:
                made: Sequence[TimedPulse | PlannedPulse] = (
                    make_bench_plan(condition, pulse, rng)
                    if bench
                    else make_plan(condition.perturbations, pulse, rng)
                )
                plans[name] = [one.to_dict() for one in made]
        return plans

    def _run_trial_of(
        self, condition: ConditionSpec, name: str, events: list[Event], journal: Journal
    ) -> None:
        protocol, segment = self._plan.protocol, segments_begun(events, name)
        clock = self._clocks()
        devices = self._rig.open(name, worn=condition.worn, segment=segment, clock=clock)
        walking = protocol.kind == "walking"
        with ExitStack() as stack:
            stack.enter_context(_journaled(journal, name, segment))
            for device in devices.all():
                stack.callback(device.close)
            journal.write("segment_started", condition=name, segment=segment)
            gate = self._gate(devices, self._felt(events, name) if walking else 0)
            recorder = stack.enter_context(
                Recorder(
                    log_path(self._plan.folder, name, segment),
                    self._header(condition, name, segment, devices),
                    WALKING if walking else BENCH,
                )
            )
            setup = TrialSetup(
                protocol=protocol,
                condition=condition,
                name=name,
                segment=segment,
                devices=devices,
                gate=gate,
                recorder=recorder,
                clock=clock,
            )
            if walking:
                self._trial = self._walking(setup, events, journal)
            else:
                self._trial = bench_trial(
                    setup,
                    bench_plan_of(self._plan.folder).get(name, ()),
                    rng=self._plan.stream(self._rig.wearer.id, f"references of {name}"),
                    progress=lambda done, total: self._progress(name, done, done, total),
                )
            self._run_trial(self._trial, devices, gate, clock)
            journal.write("condition_completed", condition=name, segment=segment)

    def _walking(self, setup: TrialSetup, events: list[Event], journal: Journal) -> AnyTrial:
        pulses = plan_of(self._plan.folder).get(setup.name, ())
        done = pulses_done(events, setup.name)
        return walking_trial(
            setup,
            [pulse for pulse in pulses if pulse.number not in done],
            journal=journal,
            progress=lambda strides, completed: self._progress(
                setup.name, strides, len(done) + completed, len(pulses)
            ),
        )

    def _run_trial(
        self, trial: AnyTrial, devices: Devices, gate: SafetyGate | None, clock: Clock
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

    def _felt(self, events: list[Event], name: str) -> int:
        """Return how many pulses the wearer felt in earlier stretches of a condition."""
        shams = {p.number for p in plan_of(self._plan.folder).get(name, ()) if p.sham}
        return sum(number not in shams for number in pulses_begun(events, name))

    def _gate(self, devices: Devices, pulses_before: int) -> SafetyGate | None:
        if devices.actuator is None:
            return None
        described = devices.actuator.describe()
        model = described.torque_model
        return SafetyGate(
            tightened(described.limits, self._plan.protocol.safety),
            control_period_s=self._plan.period_ns * 1e-9,
            torque_per_ampere=abs(model.gear_ratio * model.torque_constant),
            pulses_before=pulses_before,
        )

    def _header(
        self, condition: ConditionSpec, name: str, segment: int, devices: Devices
    ) -> dict[str, Any]:
        return {
            "participant": self._rig.wearer.id,
            "condition": name,
            "of_condition": condition.name,
            "segment": segment,
            "control_hz": self._plan.protocol.rates.control_hz,
            "devices": devices.to_dict(),
        }


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
