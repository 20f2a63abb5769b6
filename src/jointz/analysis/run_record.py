"""Record of the run that wrote a study, from the files of ``jointz run`` beside ``study.toml``."""

import json
from collections.abc import Mapping
from typing import Any

from jointz.analysis.page.report_page import run_section
from jointz.core.study import Study
from jointz.results.run_report import RunReport

_RUN_FILE, _REPORT_FILE, _TRUTH_FILE = "run.json", "run_report.json", "ground_truth.json"


def run_record(study: Study) -> tuple[dict[str, Any], list[str]]:
    """Return ``simulated`` and the ``report`` of the run, as far as known, and notes.

    None of the files can stop an analysis: one that is damaged or of another program is noted.
    """
    record: dict[str, Any] = {}
    notes = []
    for name, read in _READERS.items():
        file = study.root / name
        if not file.exists():
            continue
        try:
            content = json.loads(file.read_text(encoding="utf-8"))
            record = read(content, study) | record  # run.json knows best who was measured
        except Exception as exc:  # noqa: BLE001 - the file may hold anything
            notes.append(
                f"{name}: not used, as it is damaged or not from jointz run ({_problem(exc)}). "
                "Restore it from a copy, or remove it."
            )
    if "report" in record and (text := RunReport.from_dict(record["report"]).withdrawn_text):
        notes.append(f"{text}.")
    return record, notes


def _problem(exc: Exception) -> str:
    return f"{type(exc).__name__}: {str(exc).partition(chr(10))[0]}"


def _run(content: Mapping[str, Any], study: Study) -> dict[str, Any]:
    del study
    names = {name: content[name] for name in ("protocol", "device", "preset")}
    if not all(isinstance(value, str) for value in names.values()):
        raise TypeError(f"expected text, got {names}")
    known = {"sim": {"simulated": True}, "hardware": {"simulated": False}}
    return known.get(names["device"], {})  # another rig is simulated if it knows a truth


def _truth(content: Mapping[str, Any], study: Study) -> dict[str, Any]:
    people = {p.id for p in study.spec.participants}
    if not isinstance(content["preset"], str) or people.isdisjoint(content["participants"]):
        raise ValueError("names no participant of the study")
    return {"simulated": True}


def _report(content: Mapping[str, Any], study: Study) -> dict[str, Any]:
    """Return the report as far as it is of participants of the study."""
    people = {p.id for p in study.spec.participants}
    own = {
        part: [row for row in content[part] if row["participant"] in people]
        for part in ("onsets", "gaps", "timing")
    }
    report = RunReport.from_dict({**content, **own})
    if not (report.onsets or report.timing):
        raise ValueError("names no participant of the study")
    run_section(report)  # refuses what the page cannot show
    return {"report": report.to_dict()}


_READERS = {_RUN_FILE: _run, _TRUTH_FILE: _truth, _REPORT_FILE: _report}
