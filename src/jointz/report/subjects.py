"""Words for the participants of a study, and the order of their timing points."""

import json
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import reduce
from operator import getitem
from typing import Final

import numpy as np
from pydantic import ValidationError

from jointz.core.codes import Failure
from jointz.core.errors import DataError
from jointz.core.gait_phases import ALL_POINTS, circular_mean_pct
from jointz.core.study import CalibrationSpec, StudySpec
from jointz.report.wording import format_count
from jointz.results.estimates import CellEstimate
from jointz.results.study_analysis import StudyAnalysis


@dataclass(frozen=True, slots=True)
class Subjects:
    """Words for the columns ``participant`` and ``timing_point``."""

    one: str = "participant"
    many: str = "participants"
    point: str = "timing point"
    points: str = "timing points"
    bench: bool = False  # whether it is a bench, without a gait cycle
    loads: bool = False  # whether the participants are loads, without a joint
    simulated: bool = False  # whether nobody and nothing was measured

    def counted(self, count: int) -> str:
        """Return a number of participants in words."""
        lead = "simulated " if self.simulated else ""
        return format_count(count, f"{lead}{self.one}", f"{lead}{self.many}")


_PEOPLE: Final = Subjects()
_PEOPLE_IN_CASES: Final = Subjects(point="case", points="cases", bench=True)
_PEOPLE_IN_GROUPS: Final = Subjects(point="group", points="groups", bench=True)
_LOADS: Final = Subjects("load", "loads", "trajectory", "trajectories", bench=True, loads=True)
_LOADS_IN_GROUPS: Final = Subjects("load", "loads", "group", "groups", bench=True, loads=True)


#: The study of results that do not say which.
_NOT_STATED: Final = StudySpec.model_construct(
    joint="", kind="walking", channels={}, participants=(), recordings=()
)


def study_spec(analysis: StudyAnalysis) -> StudySpec:
    """Return the study file as the provenance holds it, one without entries if it does not.

    Keys that this version does not know are left out; raise DataError for another file.
    """
    record = analysis.provenance.get("study")
    if not record:
        return _NOT_STATED
    try:
        return _known_spec(json.dumps(record))
    except (ValidationError, LookupError, TypeError, AttributeError) as exc:
        raise DataError(
            f"provenance.json: study cannot be read by this version ({exc}). Analyse the study "
            "again."
        ) from exc


def _known_spec(text: str) -> StudySpec:
    """Return a study file as its text holds it, without keys that this version does not know."""
    try:
        return StudySpec.model_validate_json(text)
    except ValidationError as exc:
        record = json.loads(text)
        for error in exc.errors():
            *place, key = error["loc"]
            reduce(getitem, place, record).pop(key)
        return StudySpec.model_validate_json(json.dumps(record))


def calibrations(analysis: StudyAnalysis) -> list[CalibrationSpec]:
    """Return the calibration of each recording with a device; that of the study without any."""
    study = study_spec(analysis)
    worn = [r for r in study.recordings if r.condition != "no_device"]
    return [study.calibration_of(r) for r in worn] or [study.calibration]


def subjects(analysis: StudyAnalysis) -> Subjects:
    """Return the words for a study."""
    return replace(_words(analysis), simulated=analysis.simulated)


def _words(analysis: StudyAnalysis) -> Subjects:
    if analysis.settings.get("kind") != "bench":
        return _PEOPLE
    study = study_spec(analysis)
    grouped = bool(study.perturbations.group)
    if study.subjects == "people":
        return _PEOPLE_IN_GROUPS if grouped else _PEOPLE_IN_CASES
    return _LOADS_IN_GROUPS if grouped else _LOADS


def nobody_perturbed(analysis: StudyAnalysis) -> bool:
    """Return whether nobody was perturbed, so that there is no impedance to report."""
    statuses = {p.status for c in analysis.cells for p in c.parameters}
    return statuses == {Failure.NO_PERTURBED_RECORDING.status}


def report_title(analysis: StudyAnalysis) -> str:
    """Return the title of a study's report."""
    if subjects(analysis).loads:
        return "Impedance of loads on the bench"
    return f"Impedance of the {analysis.settings.get('joint', 'joint')}"


def shown_parameters(cells: Iterable[CellEstimate]) -> list[str]:
    """Return the parameters to draw: values per kg where there are any, else absolute."""
    available = {p.name for cell in cells for p in cell.parameters if p.available}
    choices = (("stiffness_per_mass", "stiffness"), ("damping_per_mass", "damping"), ("inertia",))
    first = (next((name for name in names if name in available), None) for names in choices)
    return [name for name in first if name]


def timing_points(cells: Iterable[CellEstimate]) -> list[str]:
    """Return timing points in the order of the gait cycle, groups in the order of the cells."""
    onsets: dict[str, list[float]] = {}
    for cell in cells:
        if cell.timing_point != ALL_POINTS:
            known = [] if cell.onset_gait_pct is None else [cell.onset_gait_pct]
            onsets.setdefault(cell.timing_point, []).extend(known)
    if not any(onsets.values()):
        return list(onsets)
    # A timing point without a measured onset has no place on the cycle and goes last.
    place = {name: circular_mean_pct(own) if own else np.inf for name, own in onsets.items()}
    return sorted(onsets, key=place.__getitem__)
