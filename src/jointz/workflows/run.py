"""Run an experiment and write its study: ``jointz run``."""

import hashlib
import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from jointz.core.errors import DataError, OutputError
from jointz.core.protocol import Protocol
from jointz.core.provenance import now, software
from jointz.core.run_report import RunReport
from jointz.core.study import TorqueModelSpec
from jointz.devices.interface import Wearer
from jointz.experiment.session import Operator
from jointz.io.protocols import load_protocol
from jointz.workflows.rigs import RigSettings, open_rig, rig_settings
from jointz.workflows.run_settings import RunSettings
from jointz.workflows.study_file import exclusions_csv, study_toml
from jointz.workflows.worker_pool import RunProgress, run_people

RUN_FILE, REPORT_FILE = "run.json", "run_report.json"
TRUTH_FILE = "ground_truth.json"


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
        When the folder exists, or cannot be written.
    DeviceError
        When a device failed or the safety gate tripped.
    """
    spec = protocol if isinstance(protocol, Protocol) else load_protocol(protocol)
    chosen = spec.seed if seed is None else seed
    rig = rig_settings(spec, device, preset, chosen)
    count = _count(spec, participants)
    if count < 1 or workers < 1:
        raise DataError(f"expected at least one participant and worker, got {count}, {workers}.")
    study = Path(out)
    settings = RunSettings(spec, rig.seed, clock, study)
    _claim(study, _about(settings, rig, count), resume=resume)
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


def _about(settings: RunSettings, rig: RigSettings, count: int) -> dict[str, Any]:
    """Return what makes a run the same run."""
    # Without defaults: a key that a later version adds does not make it another protocol.
    protocol = settings.protocol.model_dump(mode="json", exclude_defaults=True)
    text = json.dumps(protocol, sort_keys=True)
    return {
        "protocol": settings.protocol.name,
        "protocol_sha256": hashlib.sha256(text.encode()).hexdigest(),
        "seed": rig.seed,
        "device": rig.device,
        "preset": rig.preset,
        "clock": settings.clock,
        "participants": count,
    }


def _claim(study: Path, about: dict[str, Any], *, resume: bool) -> None:
    """Make the folder, or see that the run in it is the same."""
    file = study / RUN_FILE
    if not study.exists() or (study.is_dir() and not any(study.iterdir())):
        _make_folder(study)
        _write_whole(file, json.dumps({**about, "started": now(), "software": software()}))
        return
    if not resume:
        raise OutputError(
            f"{study}: exists and is kept. Name another folder, or add --resume to go on with the "
            "run in it."
        )
    if not file.is_file():
        raise OutputError(f"{study}: holds no {RUN_FILE}: no run to go on with. Name another.")
    written = json.loads(file.read_text(encoding="utf-8"))
    other = [name for name, value in about.items() if written.get(name) != value]
    if other:
        told = "; ".join(f"{name} {written.get(name)!r}, now {about[name]!r}" for name in other)
        raise DataError(
            f"{study}: another run: {told}. Give the arguments it was started with.",
            path=str(file),
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
    _write_whole(study / REPORT_FILE, json.dumps(report.to_dict(), indent=1))
    rigs = [open_rig(rig, number) for number in range(len(reports))]
    people: list[Wearer] = [one.wearer for one in rigs]
    truth = {p.id: r["truth"] for p, r in zip(people, reports, strict=True) if r["truth"]}
    if truth:
        content = {"protocol": protocol.name, "preset": rig.preset, "participants": truth}
        _write_whole(study / TRUTH_FILE, json.dumps(content))
    aborted = [row for r in reports for row in r["aborted"]]
    if aborted and not (study / "exclusions.csv").exists():
        _write_whole(study / "exclusions.csv", exclusions_csv(aborted, now()))
    models = [r["torque_model"] for r in reports if r["torque_model"]]
    text = study_toml(
        protocol,
        people,
        {one.wearer.id: one.calibration for one in rigs},
        TorqueModelSpec.model_validate(models[0]) if models else None,
        devices=next((r["devices"] for r in reports if "devices" in r), None),
    )
    if not (study / "study.toml").exists():
        _write_whole(study / "study.toml", text)
    return StudyRun(study, report)


def _make_folder(study: Path) -> None:
    try:
        study.mkdir(parents=True, exist_ok=True)
    except OSError as exc:
        raise OutputError(
            f"{study}: cannot be made ({exc.strerror}). Name a place that can be written."
        ) from exc


def _write_whole(file: Path, text: str) -> None:
    partial = file.with_name(f".{file.name}.partial")
    try:
        partial.write_text(text, encoding="utf-8")
        os.replace(partial, file)
    except OSError as exc:
        raise OutputError(
            f"{file}: cannot be written ({exc.strerror}). Make room, then go on with --resume."
        ) from exc
    finally:
        partial.unlink(missing_ok=True)
