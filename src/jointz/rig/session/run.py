"""Run an experiment and write its study: ``jointz run``."""

import json
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import replace
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from queue import Empty
from types import FrameType
from typing import Any, Literal

from pydantic import ValidationError

from jointz.core.clock import RealClock, VirtualClock
from jointz.core.errors import DataError, OutputError
from jointz.core.protocols.device_limits import limits_on_device
from jointz.core.protocols.protocol import Protocol
from jointz.core.provenance import now
from jointz.core.stop_signals import CAN_WAIT, STOP_SIGNALS, hide_consequences, interrupt
from jointz.core.study import CalibrationSpec, TorqueModelSpec
from jointz.io.calibration_file import read_calibration
from jointz.io.protocols import load_protocol
from jointz.results.run_report import RunReport, StudyRun
from jointz.rig.devices.interface import Rig, Wearer
from jointz.rig.experiment.controllers import refuse_bad_controllers
from jointz.rig.experiment.driver_errors import drivers_answer_for
from jointz.rig.experiment.files.whole_files import read_object, write_whole
from jointz.rig.experiment.session import Operator
from jointz.rig.session.live_process import live_estimates
from jointz.rig.session.participant_run import REPORT_FILE as SESSION_REPORT
from jointz.rig.session.participant_run import run_participant
from jointz.rig.session.rigs.rig_settings import (
    RigSettings,
    hardware_settings,
    open_rig,
    rig_settings,
    with_calibration,
)
from jointz.rig.session.run_claim import REPORT_FILE, STUDY_FILE, claimed
from jointz.rig.session.run_settings import SESSIONS, RunSettings, recording_name
from jointz.rig.session.study_file import exclusions_csv, study_toml
from jointz.tasks.engine import Done, Engine, Processes, Serial, Task, done_in_turn
from jointz.tasks.open_engine import open_engine
from jointz.tasks.process_pool import spawn_context, spawned_pool
from jointz.tasks.progress import RunProgress
from jointz.terminal.progress_bars import shown_run_progress

TRUTH_FILE = "ground_truth.json"
_MOST_PARTICIPANTS = 1000


def run(  # noqa: PLR0913 - the options of the command, all by keyword
    protocol: str | Path | Protocol,
    *,
    device: str | None = None,
    config: str | os.PathLike[str] | None = None,
    out: str | os.PathLike[str],
    seed: int | None = None,
    preset: str | None = None,
    sensors: Collection[str] | None = None,
    clock: Literal["fast", "real"] | None = None,
    participants: int | None = None,
    workers: int = 1,
    scheduler: str | None = None,
    resume: bool = False,
    salvage: bool = False,
    attended: bool = False,
    live: bool | None = None,
    calibration: str | os.PathLike[str] | None = None,
    operator: Operator | None = None,
    progress: RunProgress | bool | None = True,
) -> StudyRun:
    """Run an experiment and write it as a study.

    Parameters
    ----------
    protocol : str, path or Protocol
        Name of a built-in protocol, a file, or the protocol itself.
    device : str, optional
        ``sim``: a simulated walking human with an exoskeleton; the default without ``config``.
    config : path, optional
        A ``device.toml``: the real devices that it names, on Linux only. None of their drivers was
        ever tried on hardware.
    out : path
        The study's folder; must not exist unless ``resume``.
    seed : int, optional
        Of plan and simulation; the protocol's own by default.
    preset : str, optional
        Of the simulation: ``clean``, ``nominal``, ``hard``, ``anthropometric``, ``realistic``; by
        default people are ``realistic``, and benches and calibrations ``nominal``.
    sensors : collection of str, optional
        Of simulated people: ``goniometer``, and with it ``encoder`` and ``gyroscopes``; by default
        those of the preset, of which ``realistic`` has all and the others the goniometer.
    clock : {"fast", "real"}, optional
        As fast as it can, the default of a simulation, or in real time, that of devices.
    participants : int, optional
        How many; by default those that ``config`` names, else the protocol's own number.
    workers : int
        Participants simulated at once, each in a process of its own; numbers do
        not depend on it. One on Windows, whose processes cannot be stopped gently.
    scheduler : str, optional
        Dask cluster that simulates them instead: ``tcp://host:port``, or ``local``. Its workers
        must see the study's folder under the same path.
    resume : bool
        Go on with a run that was interrupted; starts where nothing is there.
    salvage : bool
        With ``resume``: leave damaged records and lines out instead of refusing their file. The
        damaged files are kept.
    attended : bool
        Whether an operator's page starts, pauses and stops (``jointz console``).
    live : bool
        Whether a process beside the session estimates after new pulses, and writes the newest
        half-widths to ``live.json`` of the session's folder; by default where the protocol has
        ``[live]``, which says what an estimate may do. In real time one participant at a time.
    calibration : path, optional
        A file that ``jointz calibrate`` wrote: its entries stand over the rig's own in the study.
    operator : Operator, optional
        Asked before every condition; needed with real devices, unless ``attended``.
    progress : bool or callable
        Whether to draw progress in a terminal or notebook, unless there is an operator to ask; a
        function is called with (participant, condition, strides, pulses done, pulses planned).

    Returns
    -------
    StudyRun
        Where the study is, and what was done.

    Raises
    ------
    ProtocolError
        When the protocol has problems.
    DataError
        When an argument is out of range or does not go with real devices, ``config`` lacks
        what the protocol needs, or ``resume`` meets another run.
    OutputError
        When the folder exists, another process runs it, it cannot be written, or lacks what was
        recorded in the end.
    DeviceError
        When a device failed or the safety gate tripped.
    """
    if salvage and not resume:
        raise DataError("salvage: goes with resume, as a new run has nothing to salvage. Add it.")
    spec = protocol if isinstance(protocol, Protocol) else load_protocol(protocol)
    chosen = spec.seed if seed is None else seed
    count = _count(spec, participants)
    if not 1 <= count <= _MOST_PARTICIPANTS or workers < 1:
        raise DataError(
            f"expected 1 to {_MOST_PARTICIPANTS} participants and at least one worker, got "
            f"{count}, {workers}."
        )
    live = spec.live is not None if live is None else live
    if live and (spec.kind != "walking" or (workers > 1 and clock == "real") or scheduler):
        raise DataError(
            "live: estimates during walking, in real time one participant at a time, and not on a "
            "cluster. Leave it out (--no-live), or workers and scheduler."
        )
    if clock not in (None, "fast", "real"):
        raise DataError(f"clock: expected fast or real, got {clock!r}.")
    known = None if calibration is None else read_calibration(calibration)
    if config is None:
        rig = rig_settings(spec, device or "sim", preset, chosen, sensors)
    else:
        from jointz.rig.session.rigs.hardware_rig import read_hardware, refuse_with_devices

        if sensors is not None:
            raise DataError("sensors: those of a device file are its own. Leave them out.")
        refuse_with_devices(device=device, preset=preset, clock=clock, workers=workers)
        if operator is None and not attended:
            raise DataError("operator: missing; with real devices somebody has to be prompted.")
        hardware = read_hardware(config, spec, participants=participants, known=known)
        rig, count = hardware_settings(hardware, chosen), len(hardware.wearers)
    pace = clock or ("fast" if config is None else "real")
    if known is not None:
        rig = with_calibration(rig, known, count)
    settings = RunSettings(spec, rig.seed, pace, Path(out), attended, salvage, live)
    check = partial(_refuse_what_cannot_run, settings, rig, count)
    with (
        claimed(settings, rig, count, resume=resume, check=check),
        shown_run_progress(progress=operator is None if progress is True else progress) as shown,
    ):
        reports = run_people(
            settings,
            rig,
            count,
            workers=workers if CAN_WAIT else 1,
            scheduler=scheduler,
            operator=operator,
            progress=shown,
        )
        return _finish(settings, rig, reports)


def _count(protocol: Protocol, participants: int | None) -> int:
    """Return how many wearers or loads there are."""
    if protocol.kind != "bench":
        return protocol.participants if participants is None else participants
    if participants is not None:
        raise DataError(f"{protocol.name}: a bench has loads, not participants. Leave them out.")
    return max(1, len(protocol.loads))


def _refuse_what_cannot_run(settings: RunSettings, rig: RigSettings, count: int) -> None:
    """Refuse controllers that do not fit and limits that are exceeded, before all else."""
    if settings.protocol.kind == "control":
        wearers = (open_rig(rig, number).wearer for number in range(count))
        refuse_bad_controllers(settings.protocol, wearers)
    _refuse_beyond_limits(settings, rig)


def _refuse_beyond_limits(settings: RunSettings, rig: RigSettings) -> None:
    """Refuse what the devices cannot do before anything is written and anybody is prompted."""
    real = rig.hardware is not None
    conditions = settings.protocol.conditions
    worn = next((one for one in conditions if one.worn), conditions[0] if real else None)
    if worn is None:
        return
    opened = open_rig(rig, 0)
    drivers: dict[str, object] = {"rig": opened}
    clock = RealClock() if real else VirtualClock()
    with ExitStack() as stack:
        stack.enter_context(drivers_answer_for(drivers))
        devices = opened.open(worn.trial_names[0], worn=worn.worn, segment=0, clock=clock)
        drivers |= devices.named()
        for device in devices.all():
            stack.callback(device.close)
        if devices.actuator is not None:
            described = devices.actuator.describe()
            limits_on_device(
                settings.protocol,
                described.limits,
                torque_per_ampere=described.torque_model.torque_per_ampere,
            )
            if real:
                _refuse_another_torque_model(settings.study, described.torque_model)
        if real:  # whether they answer is better known before somebody is strapped in
            for device in devices.all():
                device.configure()


def _refuse_another_torque_model(study: Path, now: TorqueModelSpec) -> None:
    for file in sorted((study / SESSIONS).glob(f"*/{SESSION_REPORT}")):
        before = read_object(file).get("torque_model")
        if before is not None and before != now.model_dump():
            raise DataError(
                f"{file}: {file.parent.name} was measured with another torque_model, and a study "
                "has one. Restore it in the device file, or begin another study.",
                path=str(file),
            )


def _finish(settings: RunSettings, rig: RigSettings, reports: list[dict[str, Any]]) -> StudyRun:
    """Write what belongs to the whole study; ``study.toml`` comes last and says it is complete."""
    protocol, study = settings.protocol, settings.study
    rigs = [open_rig(rig, number) for number in range(len(reports))]
    people = [one.wearer for one in rigs]
    _check_recordings_exist(settings, people)
    report = RunReport(
        protocol=protocol.name,
        seed=settings.seed,
        onsets=tuple(row for r in reports for row in r["onsets"]),
        gaps=tuple(row for r in reports for row in r["gaps"]),
        timing=tuple(row for r in reports for row in r["timing"]),
        salvaged=tuple(text for r in reports for text in r.get("salvaged", ())),
        decisions=tuple(row for r in reports for row in r.get("decisions", ())),
    )
    write_whole(study / REPORT_FILE, json.dumps(report.to_dict(), indent=1))
    truth = {p.id: r["truth"] for p, r in zip(people, reports, strict=True) if r["truth"]}
    if truth:
        content = {"protocol": protocol.name, "preset": rig.preset, "participants": truth}
        write_whole(study / TRUTH_FILE, json.dumps(content))
    aborted = [row for r in reports for row in r["aborted"]]
    if aborted and not (study / "exclusions.csv").exists():
        write_whole(study / "exclusions.csv", exclusions_csv(aborted, now()))
    model = next((r["torque_model"] for r in reports if r["torque_model"]), None)
    devices = next((r["devices"] for r in reports if "devices" in r), None)
    calibrations = [_calibration(settings, one, r) for one, r in zip(rigs, reports, strict=True)]
    text = study_toml(protocol, rigs, calibrations, model, devices=devices)
    if not (study / STUDY_FILE).exists():
        write_whole(study / STUDY_FILE, text)
    return StudyRun(study, report)


def _check_recordings_exist(settings: RunSettings, people: Sequence[Wearer]) -> None:
    """Refuse to call a study complete whose recordings are elsewhere."""
    names = [recording_name(p.id, c.name) for p in people for c in settings.protocol.conditions]
    missing = [name for name in names if not (settings.study / name).is_file()]
    if missing:
        more = f" and {len(missing) - 1} more recordings" if len(missing) > 1 else ""
        raise OutputError(
            f"{settings.study.absolute()}: expected {missing[0]}{more}, found none, though the "
            "sessions ended. Every worker of a cluster must see this folder under this path: they "
            "may have written to disks of their own. What was removed here is made again from the "
            f"logs: delete {SESSION_REPORT} of its session, and resume (--resume, resume=True)."
        )


def _calibration(settings: RunSettings, rig: Rig, report: Mapping[str, Any]) -> CalibrationSpec:
    """Return what is known about the instruments of a wearer, as of the session's end."""
    written = report.get("calibration")
    try:  # an earlier version wrote none
        return rig.calibration if written is None else CalibrationSpec.model_validate(written)
    except ValidationError as exc:
        file = settings.session_folder(rig.wearer.id) / SESSION_REPORT
        raise DataError(
            f"{file}: damaged, its calibration cannot be read. Delete it: it is made again from "
            "the logs.",
            path=str(file),
        ) from exc


_POLL_S = 0.1
_AGAIN_S = 1.0
_WORKER: dict[str, Any] = {}


class NoOperator:
    """An operator for simulated people, who need no prompt."""

    def prompt(self, text: str) -> None:
        """Return at once."""


def run_people(
    settings: RunSettings,
    rig: RigSettings,
    count: int,
    *,
    workers: int,
    scheduler: str | None,
    operator: Operator | None,
    progress: RunProgress | None,
) -> list[dict[str, Any]]:
    """Run every participant and return their reports in order."""
    report = progress or _no_progress
    alone = scheduler is None and (workers == 1 or count == 1)
    call: Callable[..., dict[str, Any]] = _run_in_worker
    if alone:
        call = partial(_run_here, operator=operator or NoOperator(), report=report)
    else:  # workers may have been started in another folder
        settings = replace(settings, study=settings.study.absolute())
    tasks = [
        Task(f"participant {n + 1} (seed {rig.seed})", partial(call, settings, rig, n))
        for n in range(count)
    ]
    with _engine(scheduler, 1 if alone else min(workers, count), report) as engine:
        stops = rig.hardware is not None or settings.attended or (alone and operator is not None)
        return _reports(done_in_turn(engine, tasks), stops=stops)


def _reports(outcomes: Iterable[Done[dict[str, Any]]], *, stops: bool) -> list[dict[str, Any]]:
    """Return the reports; raise the first failure, with a note for every other one."""
    done: list[Done[dict[str, Any]]] = []
    failed: list[tuple[str, Exception]] = []
    for outcome in outcomes:
        done.append(outcome)
        if outcome.error is not None:
            failed.append((outcome.name, outcome.error))
            if stops:
                break
    for number, (name, error) in enumerate(failed):
        failed[0][1].add_note(f"{name} failed too: {error}" if number else f"It was {name}.")
    return [outcome.result() for outcome in done]


@contextmanager
def _engine(scheduler: str | None, workers: int, report: RunProgress) -> Iterator[Engine]:
    if scheduler is not None:
        with open_engine(scheduler, workers=workers, tasks=workers, needs=__name__) as engine:
            yield engine
        return
    if workers == 1:
        yield Serial()
        return
    # A session that was cut off goes on from its journal.
    with closing(Processes(workers, partial(_session_pool, workers, report))) as processes:
        yield processes


@contextmanager
def _session_pool(workers: int, report: RunProgress) -> Iterator[ProcessPoolExecutor]:
    """Yield a pool of processes that report the progress of their sessions and stop gently."""
    queue = spawn_context().Queue()
    over = threading.Event()
    threading.Thread(target=_pass_on, args=(queue, report, over), daemon=True).start()
    try:
        with spawned_pool(workers, _begin_worker, queue, needs=__name__) as pool:
            yield pool
    finally:
        over.set()


def _pass_on(queue: Any, report: RunProgress, over: threading.Event) -> None:
    while not over.is_set():
        with suppress(Empty):
            report(*queue.get(timeout=_POLL_S))


def _begin_worker(until: Connection, queue: Any) -> None:
    """Listen to the parent alone: a Ctrl-C reaches every process of a terminal."""
    queue.cancel_join_thread()  # progress that nobody reads any more must not keep us
    _WORKER.update(queue=queue, until=until, busy=threading.Lock())
    hide_consequences()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _outside_of_sessions)
    threading.Thread(target=_stop_with_parent, daemon=True).start()
    signal.pthread_sigmask(signal.SIG_UNBLOCK, STOP_SIGNALS)


def _outside_of_sessions(number: int, frame: FrameType | None) -> None:
    """Interrupt work outside of sessions; an idle worker need not be interrupted."""
    del number, frame
    if _WORKER["busy"].locked():
        interrupt()


def _stop_with_parent() -> None:
    """Stop the session when the parent wants it or is gone; without it nobody ends us."""
    _WORKER["until"].poll(None)
    while _WORKER["busy"].locked():
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(_AGAIN_S)  # an interrupt in a callback is lost
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    with _WORKER["busy"]:
        os._exit(1)


@contextmanager
def _stopped_gently() -> Iterator[None]:
    """Let the parent's end interrupt the block; workers of a cluster have no parent."""
    if not _WORKER:
        yield
        return
    with _WORKER["busy"]:
        if _WORKER["until"].poll():
            raise KeyboardInterrupt
        yield


def _run_in_worker(settings: RunSettings, rig: RigSettings, number: int) -> dict[str, Any]:
    with _stopped_gently():
        queue = _WORKER.get("queue")  # a cluster's workers have none
        report = _no_progress if queue is None else (lambda *progress: queue.put(progress))
        return _run_here(settings, rig, number, operator=NoOperator(), report=report)


def _run_here(
    settings: RunSettings, rig: RigSettings, number: int, *, operator: Operator, report: RunProgress
) -> dict[str, Any]:
    opened = open_rig(rig, number)
    progress = partial(report, opened.wearer.id)
    with live_estimates(settings, rig, number) as advisor:
        return run_participant(
            opened, settings, operator=operator, progress=progress, advisor=advisor
        )


def _no_progress(*_: object) -> None:
    """Report no progress."""
