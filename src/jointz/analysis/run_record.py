"""Record of the run that wrote a study, from the files of ``jointz run`` beside ``study.toml``."""

from collections.abc import Mapping
from typing import Any, Final

from jointz.analysis.page.report_page import run_section
from jointz.core.study import Study
from jointz.io.small_files import read_json
from jointz.results.run_report import RunReport

#: Device of ``run.json`` -> whether it is simulated; another device is if it knows a truth.
_SIMULATED: Final = {"sim": True, "hardware": False}
_FILES: Final = ("run.json", "ground_truth.json", "run_report.json")


def run_record(study: Study) -> tuple[dict[str, Any], list[str]]:
    """Return ``simulated`` and the ``report`` of the run, as far as known, and notes."""
    people = {person.id for person in study.spec.participants}
    record: dict[str, Any] = {}
    notes = []
    for file in (study.root / name for name in _FILES):
        if not file.exists():
            continue
        try:
            content = read_json(file, "", finite=False)
            record = _entry(file.name, content, people) | record  # run.json knows best
        except Exception as exc:  # noqa: BLE001 - the file may hold anything
            text = str(exc).partition("\n")[0].removeprefix(f"{file}: ").rstrip(". ")
            problem = f"{type(exc).__name__}: {text}"
            notes.append(
                f"{file.name}: not used, as it is damaged or not from jointz run ({problem}). "
                "Restore it from a copy, or remove it."
            )
    return record, notes


def _entry(name: str, content: Mapping[str, Any], people: set[str]) -> dict[str, Any]:
    if name == "run.json":
        device, _ = content["device"], content["protocol"]
        return {"simulated": _SIMULATED[device]} if device in _SIMULATED else {}
    if name == "ground_truth.json":
        known = set(content["participants"]) & people and content["preset"]
        entry: dict[str, Any] = {"simulated": True}
    else:
        parts = ("onsets", "gaps", "timing")
        own = {p: [row for row in content[p] if row["participant"] in people] for p in parts}
        report = RunReport.from_dict({**content, **own})
        known = run_section(report) and own["timing"]  # raises what the page would
        entry = {"report": report.to_dict()}
    if not known:
        raise ValueError("names no participant of the study")
    return entry
