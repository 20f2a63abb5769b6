"""A participant's session: conditions in order, each kept on disk as it happens.

The folder of a session holds what was planned and what was done::

    session.json     protocol, wearer, devices, calibration, seed, software
    plan.json        the pulses of every condition, in order
    *.copy           of both, with a checksum
    journal.jsonl    what happened, one line an event
    logs/            the records, a file for every uninterrupted stretch

Nothing of it is ever rewritten; a session that was interrupted goes on in a new
stretch with the pulses that the journal does not count as done.
"""

import time
import zlib
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol

import numpy as np

from jointz.core.clock import Clock
from jointz.core.errors import DeviceError, SafetyStop, WriteError
from jointz.core.protocols.device_limits import limits_on_device
from jointz.core.protocols.protocol import Protocol as ProtocolSpec
from jointz.core.protocols.protocol_models import ConditionSpec
from jointz.core.protocols.pulse_models import variants_of
from jointz.core.provenance import software
from jointz.core.stop_signals import signals_held
from jointz.rig.devices.interface import Device, Devices, Rig
from jointz.rig.experiment.console_link import ConsoleLink
from jointz.rig.experiment.control_box import ControlBox
from jointz.rig.experiment.decisions import (
    Advisor,
    DecisionSettings,
    PulseHistory,
    is_stop,
    pulses_needed,
)
from jointz.rig.experiment.driver_errors import drivers_answer_for
from jointz.rig.experiment.files.journal import (
    Event,
    Journal,
    events_of,
    is_completed,
    last_controller,
    pulses_begun,
    pulses_done,
    read_journal,
    segments_begun,
    write_salvaged,
)
from jointz.rig.experiment.files.recorder import Recorder
from jointz.rig.experiment.files.session_files import (
    CONTROL_FILE,
    JOURNAL_FILE,
    keep_description,
    keep_plan,
    log_path,
)
from jointz.rig.experiment.files.whole_files import make_folder
from jointz.rig.experiment.loop import ControlLoop, undisturbed
from jointz.rig.experiment.plan import written_pulse
from jointz.rig.experiment.safety import SafetyGate
from jointz.rig.experiment.trial_kinds import AnyTrial, TrialSetup, trial_kind

#: Called with the trial and how far it is: of walking accepted strides, completed pulses and
#: planned pulses; of a bench trial seconds done, the same again and seconds in all.
Progress = Callable[[str, int, int, int], None]


class Operator(Protocol):
    """The operator of the experiment."""

    def prompt(self, text: str) -> None:
        """Show what is to be done before a condition and return when it is."""


@dataclass(frozen=True, slots=True)
class SessionPlan:
    """Protocol, seed and folder of a session."""

    protocol: ProtocolSpec  # protocol of the experiment
    seed: int  # seed of the plan
    folder: Path  # folder of the session

    @property
    def period_ns(self) -> int:
        """Period of the loop, ns."""
        return round(1e9 / self.protocol.rates.control_hz)

    def stream(self, wearer: str, purpose: str) -> np.random.Generator:
        """Return the random numbers of one purpose of a wearer; nothing else draws from them."""
        key = (zlib.crc32(wearer.encode()), *((zlib.crc32(purpose.encode()),) if purpose else ()))
        return np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=key))


class Session:
    """Runs what is still to be done of a session."""

    def __init__(
        self,
        plan: SessionPlan,
        rig: Rig,
        *,
        clocks: Callable[[], Clock],
        operator: Operator,
        progress: Progress,
        real_time: bool,
        attended: bool = False,
        advisor: Advisor | None = None,
    ) -> None:
        self._plan = plan
        self._advisor = advisor
        self._kind = trial_kind(plan.protocol)
        self._rig = rig
        self._clocks = clocks
        self._operator = operator
        self._progress = progress
        self._real_time = real_time
        self._attended = attended
        self._link: ConsoleLink | None = None
        self._trial: AnyTrial | None = None
        self._stop_requested = False

    def request_stop(self) -> None:
        """End the session soon, fading out a pulse that is on."""
        self._stop_requested = True
        if self._trial is None:
            raise KeyboardInterrupt
        self._trial.request_stop()

    def run(self) -> None:
        """Run all conditions that are not done yet."""
        folder = self._plan.folder
        make_folder(folder / "logs")
        with Journal(folder / JOURNAL_FILE) as journal, self._linked(journal):
            with drivers_answer_for({"rig": self._rig}):
                self._write_down_once(journal)
            for condition in self._plan.protocol.conditions:
                events = read_journal(folder / JOURNAL_FILE)
                open_trials = [
                    name for name in condition.trial_names if not is_completed(events, name)
                ]
                if open_trials and self._link is not None:
                    self._link.await_start(open_trials[0], condition.prompt)
                elif open_trials:
                    self._operator.prompt(condition.prompt)
                for name in open_trials:
                    self._run_trial_of(condition, name, events, journal)

    @contextmanager
    def _linked(self, journal: Journal) -> Iterator[None]:
        """Obey the operator's page, where there is one."""
        if not self._attended:
            yield
            return
        with ControlBox(self._plan.folder / CONTROL_FILE) as box:
            self._link = ConsoleLink(
                box,
                journal,
                request_stop=self.request_stop,
                without_console=self._plan.protocol.without_console,
            )
            yield

    def _write_down_once(self, journal: Journal) -> None:
        """Write the plan and what the session is of; an interrupted session has them already."""
        folder, protocol, wearer = self._plan.folder, self._plan.protocol, self._rig.wearer
        damage = [keep_plan(folder, self._make_plans())]
        about = {
            "wearer": {"id": wearer.id, "mass_kg": wearer.mass_kg, "height_m": wearer.height_m},
            "protocol": protocol.model_dump(mode="json"),
            "seed": self._plan.seed,
            "calibration": self._rig.calibration.model_dump(exclude_none=True),
            "rig": dict(self._rig.notes()),
            "software": software(),
        }
        damage.append(keep_description(folder, about))
        write_salvaged(journal, read_journal(folder / JOURNAL_FILE), filter(None, damage))

    def _make_plans(self) -> dict[str, list[dict[str, Any]]]:
        """Return the pulses of every trial that has some."""
        protocol, rng = self._plan.protocol, self._plan.stream(self._rig.wearer.id, "")
        if not protocol.shapes:
            return {}
        return {
            name: [
                written_pulse(planned)
                for planned in self._kind.make_plan(condition, protocol.shapes, rng)
            ]
            for condition in protocol.conditions
            if condition.perturbations is not None
            for name in condition.trial_names
        }

    def _run_trial_of(
        self, condition: ConditionSpec, name: str, events: list[Event], journal: Journal
    ) -> None:
        segment, clock = segments_begun(events, name), self._clocks()
        drivers: dict[str, object] = {"rig": self._rig}
        note = partial(self._note, journal, condition=name, segment=segment)
        with ExitStack() as stack:
            stack.enter_context(_journaled(note))
            stack.enter_context(drivers_answer_for(drivers))
            devices = self._rig.open(name, worn=condition.worn, segment=segment, clock=clock)
            drivers |= devices.named()
            for device in devices.all():
                stack.push(partial(_close, device))
            planned = self._kind.read_plan(self._plan.folder, events).get(name, ())
            needed = pulses_needed(planned, events, name)
            pulses = tuple(pulse for pulse in planned if pulse.number in needed)
            shams = {pulse.number for pulse in pulses if pulse.amplitude_nm == 0.0}
            felt = sum(number not in shams for number in pulses_begun(events, name))
            gate = self._gate(devices, pulses_before=felt)
            note("segment_started")
            recorder = stack.enter_context(
                Recorder(
                    log_path(self._plan.folder, name, segment),
                    self._header(condition, name, segment, devices),
                    self._kind.layout(devices),
                )
            )
            calibration = self._rig.calibration
            zero, gain = calibration.angle_zero_rad, calibration.angle_gain
            setup = TrialSetup(
                protocol=self._plan.protocol,
                condition=condition,
                name=name,
                segment=segment,
                devices=devices,
                gate=gate,
                recorder=recorder,
                clock=clock,
                journal=journal,
                pulses=pulses,
                done=pulses_done(events, name),
                rng=self._plan.stream(self._rig.wearer.id, f"references of {name}"),
                contact_levels_v=calibration.contact_levels_v,
                wearer=self._rig.wearer,
                angle_zero_rad=None if zero is None else zero.value,
                angle_gain=1.0 if gain is None else gain.value,
                controlled_by=last_controller(events, name),
                decisions=self._decisions(name, planned, events),
            )
            trial = self._kind.trial(setup, partial(self._progress, name))
            self._run_trial(trial, setup, note)
            # How long the log is then: one that is found shorter has lost something.
            note("condition_completed", log_bytes=recorder.size_bytes)

    def _decisions(
        self, name: str, planned: Sequence[Any], events: list[Event]
    ) -> DecisionSettings | None:
        """Return how a trial decides on its pulses; None where they come as planned."""
        protocol, wearer = self._plan.protocol, self._rig.wearer.id
        if self._advisor is None or protocol.live is None or not protocol.live.decides:
            return None
        return DecisionSettings(
            protocol.live,
            self._advisor,
            waits=not self._real_time,
            rng=lambda number: self._plan.stream(wearer, f"decision {number} of {name}"),
            history=PulseHistory.of_journal(planned, events, name),
            variants=variants_of(protocol.shapes),
            asked=max((e["number"] for e in events_of(events, "decision_asked", name)), default=0),
            pulses_at_last=max(
                (e["n_done"] for e in events_of(events, "decided", name)), default=0
            ),
            stopped=any(is_stop(event, name) for event in events),
        )

    def _note(self, journal: Journal, event: str, **details: Any) -> None:
        """Write an event down, with the time of day where the time is a real one."""
        moment = {"time_ns": time.time_ns()} if self._real_time else {}
        journal.write(event, **details, **moment)

    def _run_trial(self, trial: AnyTrial, setup: TrialSetup, note: Callable[..., None]) -> None:
        """Run the loop; whatever happens, the devices are stopped first of all."""
        self._trial = trial
        devices, gate = setup.devices, setup.gate
        tick = trial.tick if self._link is None else self._link.attended(trial, setup.name)
        not_stopped = set(devices.named())
        with ExitStack() as stack:
            stack.callback(setattr, self, "_trial", None)
            stack.callback(_confirm_stop, note, not_stopped)
            # The last is called first: the actuator is stopped before all others.
            for name, device in reversed(devices.named().items()):
                stack.push(partial(_stop, name, device, not_stopped))
            if self._stop_requested:  # its interrupt was lost in a library's callback
                raise KeyboardInterrupt
            for device in devices.all():
                device.configure()
            for device in devices.all():
                device.activate()
            with undisturbed() if self._real_time else nullcontext() as scheduling:
                if scheduling is not None:
                    note("loop_started", scheduling=scheduling)
                ControlLoop(setup.clock, self._plan.period_ns).run(tick)
        if gate is not None and gate.tripped is not None:
            raise SafetyStop(gate.tripped, gate.detail)
        if self._stop_requested:
            raise KeyboardInterrupt

    def _gate(self, devices: Devices, *, pulses_before: int) -> SafetyGate | None:
        if devices.actuator is None:
            return None
        described = devices.actuator.describe()
        torque_per_ampere = described.torque_model.torque_per_ampere
        return SafetyGate(
            limits_on_device(
                self._plan.protocol, described.limits, torque_per_ampere=torque_per_ampere
            ),
            control_period_s=self._plan.period_ns * 1e-9,
            torque_per_ampere=torque_per_ampere,
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


def _confirm_stop(note: Callable[..., None], not_stopped: Collection[str]) -> None:
    """Write down that all devices were stopped; without it a page calls for the emergency stop."""
    if not not_stopped:
        with suppress(WriteError):  # what ended the trial is told first, and a full disk once
            note("devices_stopped")


def _stop(
    name: str,
    device: Device,
    not_stopped: set[str],
    kind: type[BaseException] | None,
    error: BaseException | None,
    trace: TracebackType | None,
) -> None:
    """Stop a device; one that cannot be stopped is what the operator must hear of first."""
    del kind, trace
    failure: Exception | None = None
    try:
        with signals_held():
            try:
                device.stop()
                if getattr(device, "stop_confirmed", True):
                    not_stopped.remove(name)
                else:
                    failure = TimeoutError("it did not confirm its stop")
            except Exception as exc:  # noqa: BLE001 - told below
                failure = exc
    finally:  # a Ctrl-C that waited comes now, and must not be heard instead
        if failure is not None:
            before = f" What came before: {error}" if error else ""
            what = f"{type(failure).__name__}: {failure}"
            raise DeviceError(
                name, f"could not be stopped ({what}). Switch its power off.{before}"
            ) from failure


def _close(
    device: Device,
    kind: type[BaseException] | None,
    error: BaseException | None,
    trace: TracebackType | None,
) -> None:
    """Close a device; what went wrong before matters more than a device that does not close."""
    del kind, trace
    try:
        with signals_held():
            device.close()
    except Exception as exc:
        if error is None:
            raise
        error.add_note(f"A device could not be closed either ({exc}).")


@contextmanager
def _journaled(note: Callable[..., None]) -> Iterator[None]:
    """Write down what ended a stretch before its time."""
    try:
        yield
    except KeyboardInterrupt:
        note("stopped", reason="asked for")
        raise
    except WriteError as exc:
        # Not into the journal: it most likely lies on the same disk.
        exc.add_note("The devices were stopped.")
        raise
    except DeviceError as exc:
        _note_end(note, "tripped", exc, reason=str(exc))
        raise
    except Exception as exc:
        _note_end(note, "failed", exc, reason=f"{type(exc).__name__}: {exc}")
        raise


def _note_end(note: Callable[..., None], event: str, error: Exception, *, reason: str) -> None:
    """Write down what ended a stretch; a journal that finds no room must not hide what it was."""
    try:
        note(event, reason=reason)
    except WriteError as exc:
        error.add_note(f"The journal could not be written either ({exc}).")
