"""A session that is still running, as a study of what it has recorded so far."""

from pathlib import Path
from typing import Any

from jointz.core.protocols.protocol_models import ConditionSpec
from jointz.core.provenance import now
from jointz.rig.devices.interface import Rig
from jointz.rig.experiment.files.journal import Event, read_journal, segments_begun
from jointz.rig.experiment.files.session_files import JOURNAL_FILE, has_content, log_path
from jointz.rig.session.recordings_report import open_recordings, write_condition
from jointz.rig.session.run_claim import STUDY_FILE
from jointz.rig.session.run_settings import RunSettings
from jointz.rig.session.study_file import exclusions_csv, study_toml


def write_study_so_far(
    settings: RunSettings, rig: Rig, out: Path, *, question: Event | None = None
) -> None:
    """Write recordings, pulses and ``study.toml`` of what a participant's logs hold.

    By now, or when the question of a decision was asked.
    """
    folder = settings.session_folder(rig.wearer.id)
    events = read_journal(folder / JOURNAL_FILE)
    until: dict[str, int] = {}
    if question is not None:
        events = events[: _place(events, question)]
        file = log_path(folder, question["condition"], question["segment"])
        until[file.name] = question["slot"]
    begun = tuple(c for c in settings.protocol.conditions if _has_log(folder, c, events))
    protocol = settings.protocol.model_copy(update={"conditions": begun, "live": None})
    session = open_recordings(folder, protocol, events, salvage=True, until=until)
    devices: dict[str, Any] = {}
    aborted: list[dict[str, Any]] = []
    out.mkdir()
    for condition in begun:
        record = session.record(condition)
        write_condition(out, session, condition, record)
        aborted += session.aborted_rows(condition, record)
        devices = record.logs[0].header["devices"]
    if aborted:
        (out / "exclusions.csv").write_text(exclusions_csv(aborted, now()), encoding="utf-8")
    model = (devices.get("actuator") or {}).get("torque_model")
    text = study_toml(protocol, [rig], [rig.calibration], model, devices=devices)
    (out / STUDY_FILE).write_text(text, encoding="utf-8")


def _place(events: list[Event], question: Event) -> int:
    """Return how many events stood in the journal before a question."""
    places = (
        place
        for place, event in enumerate(events)
        if event["event"] == "decision_asked" and event.items() >= question.items()
    )
    return next(places, len(events))  # not written yet: it is asked first


def _has_log(folder: Path, condition: ConditionSpec, events: list[Event]) -> bool:
    return any(
        segments_begun(events, name) and has_content(log_path(folder, name, 0))
        for name in condition.trial_names
    )
