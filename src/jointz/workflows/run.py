"""Run an experiment and write its study: ``jointz run``."""

import json
import os
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal

from jointz.core.clock import VirtualClock
from jointz.core.device_limits import limits_on_device
from jointz.core.errors import DataError
from jointz.core.protocol import Protocol
from jointz.core.provenance import now
from jointz.core.run_report import RunReport
from jointz.core.study import TorqueModelSpec
from jointz.devices.interface import Wearer
from jointz.experiment.driver_errors import drivers_answer_for
from jointz.experiment.session import Operator
from jointz.experiment.whole_files import write_whole
from jointz.io.protocols import load_protocol
from jointz.workflows.rigs import RigSettings, open_rig, rig_settings
from jointz.workflows.run_claim import REPORT_FILE, STUDY_FILE, claimed
from jointz.workflows.run_settings import RunSettings
from jointz.workflows.study_file import exclusions_csv, study_toml
from jointz.workflows.worker_pool import RunProgress, run_people

TRUTH_FILE = "ground_truth.json"
_MOST_PARTICIPANTS = 1000


class NoOperator:
    """Nobody to prompt: simulated people know what to do."""

    def prompt(self, text: str) -> None:
        """Return at once.

        Parameters
        ----------
        text : str
            Not shown.
        """


@dataclass(frozen=True, slots=True)
class StudyRun:
    """A finished experiment.

    Parameters
    ----------
    study : pathlib.Path
        The study's folder, ready for :func:`jointz.analyze`.
    report : RunReport
        What was done.
    """

    study: Path
    report: RunReport


def run(  # noqa: PLR0913 - the options of the command, all by keyword
    protocol: str | Path | Protocol,
    *,
    device: str = "sim",
    out: str | os.PathLike[str],
    seed: int | None = None,
    preset: str = "nominal",
    clock: Literal["fast", "real"] = "fast",
    participants: int | None = None,
    workers: int = 1,
    resume: bool = False,
    attended: bool = False,
    operator: Operator | None = None,
    progress: RunProgress | None = None,
) -> StudyRun:
    """Run an experiment and write it as a study.

    Parameters
    ----------
    protocol : str, path or Protocol
        Name of a built-in protocol, a file, or the protocol itself.
    device : str
        ``sim``: a simulated walking human with an exoskeleton.
    out : path
        The study's folder; must not exist unless ``resume``.
    seed : int, optional
        Of plan and simulation; the protocol's own by default.
    preset : str
        Of the simulation: ``clean``, ``nominal``, ``hard``, ``anthropometric``.
    clock : {"fast", "real"}
        As fast as it can, or in real time.
    participants : int, optional
        How many; the protocol's own number by default.
    workers : int
        Participants simulated at once, each in a process of its own; numbers do
        not depend on it.
    resume : bool
        Go on with a run that was interrupted; starts where nothing is there.
    attended : bool
        Whether an operator's page starts, pauses and stops (``jointz console``).
    operator : Operator, optional
        Asked before every condition.
    progress : callable, optional
        Called with (participant, condition, strides, pulses done, pulses planned).

    Returns
    -------
    StudyRun
        Where the study is, and what was done.

    Raises
    ------
    ProtocolError
        When the protocol has problems.
    DataError
        When an argument is out of range, or ``resume`` meets another run.
    OutputError
        When the folder exists, another process runs it, or it cannot be written.
    DeviceError
        When a device failed or the safety gate tripped.
    """
    spec = protocol if isinstance(protocol, Protocol) else load_protocol(protocol)
    chosen = spec.seed if seed is None else seed
    rig = rig_settings(spec, device, preset, chosen)
    count = _count(spec, participants)
    if not 1 <= count <= _MOST_PARTICIPANTS or workers < 1:
        raise DataError(
            f"expected 1 to {_MOST_PARTICIPANTS} participants and at least one worker, got "
            f"{count}, {workers}."
        )
    settings = RunSettings(spec, rig.seed, clock, Path(out), attended)
    check = partial(_refuse_beyond_limits, spec, rig)
    with claimed(settings, rig, count, resume=resume, check=check):
        reports = run_people(
            settings,
            rig,
            count,
            workers=workers,
            operator=operator or NoOperator(),
            progress=progress,
        )
        return _finish(settings, rig, reports)


def _count(protocol: Protocol, participants: int | None) -> int:
    """Return how many wearers or loads there are."""
    if protocol.kind == "walking":
        return protocol.participants if participants is None else participants
    if participants is not None:
        raise DataError(f"{protocol.name}: a bench has loads, not participants. Leave them out.")
    return max(1, len(protocol.loads))


def _refuse_beyond_limits(protocol: Protocol, rig: RigSettings) -> None:
    """Refuse what the devices cannot do before anything is written and anybody is prompted."""
    worn = next((one for one in protocol.conditions if one.worn), None)
    if worn is None:
        return
    opened = open_rig(rig, 0)
    drivers: dict[str, object] = {"rig": opened}
    with ExitStack() as stack:
        stack.enter_context(drivers_answer_for(drivers))
        devices = opened.open(worn.trial_names[0], worn=True, segment=0, clock=VirtualClock())
        drivers |= devices.named()
        for device in devices.all():
            stack.callback(device.close)
        if devices.actuator is not None:
            described = devices.actuator.describe()
            limits_on_device(
                protocol,
                described.limits,
                torque_per_ampere=described.torque_model.torque_per_ampere,
            )


def _finish(settings: RunSettings, rig: RigSettings, reports: list[dict[str, Any]]) -> StudyRun:
    """Write what belongs to the whole study; ``study.toml`` comes last and says it is complete."""
    protocol, study = settings.protocol, settings.study
    report = RunReport(
        protocol=protocol.name,
        seed=settings.seed,
        onsets=tuple(row for r in reports for row in r["onsets"]),
        gaps=tuple(row for r in reports for row in r["gaps"]),
        timing=tuple(row for r in reports for row in r["timing"]),
    )
    write_whole(study / REPORT_FILE, json.dumps(report.to_dict(), indent=1))
    rigs = [open_rig(rig, number) for number in range(len(reports))]
    people: list[Wearer] = [one.wearer for one in rigs]
    truth = {p.id: r["truth"] for p, r in zip(people, reports, strict=True) if r["truth"]}
    if truth:
        content = {"protocol": protocol.name, "preset": rig.preset, "participants": truth}
        write_whole(study / TRUTH_FILE, json.dumps(content))
    aborted = [row for r in reports for row in r["aborted"]]
    if aborted and not (study / "exclusions.csv").exists():
        write_whole(study / "exclusions.csv", exclusions_csv(aborted, now()))
    models = [r["torque_model"] for r in reports if r["torque_model"]]
    text = study_toml(
        protocol,
        people,
        {one.wearer.id: one.calibration for one in rigs},
        TorqueModelSpec.model_validate(models[0]) if models else None,
        devices=next((r["devices"] for r in reports if "devices" in r), None),
        worn=next((one.device for one in rigs), None),
    )
    if not (study / STUDY_FILE).exists():
        write_whole(study / STUDY_FILE, text)
    return StudyRun(study, report)
