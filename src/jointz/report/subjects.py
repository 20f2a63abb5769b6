"""What a report calls those who were measured: people walking or at rest, or loads on a bench."""

from dataclasses import dataclass
from typing import Final

from jointz.core.codes import Failure
from jointz.report.wording import format_count
from jointz.results.study_analysis import StudyAnalysis


@dataclass(frozen=True, slots=True)
class Subjects:
    """Words for the columns ``participant`` and ``timing_point``."""

    one: str = "participant"  # who was measured
    many: str = "participants"
    point: str = "timing point"  # at what
    points: str = "timing points"
    bench: bool = False  # whether they were measured on a bench: there is no gait cycle
    loads: bool = False  # whether they are loads: neither people nor a joint

    def counted(self, count: int) -> str:
        """Return a number of them in words."""
        return format_count(count, self.one, self.many)


_PEOPLE: Final = Subjects()
_PEOPLE_IN_CASES: Final = Subjects(point="case", points="cases", bench=True)
_PEOPLE_IN_GROUPS: Final = Subjects(point="group", points="groups", bench=True)
_LOADS: Final = Subjects("load", "loads", "trajectory", "trajectories", bench=True, loads=True)
_GROUPS: Final = Subjects("load", "loads", "group", "groups", bench=True, loads=True)


def subjects(analysis: StudyAnalysis) -> Subjects:
    """Return the words for a study."""
    if analysis.settings.get("kind") != "bench":
        return _PEOPLE
    study = analysis.provenance.get("study") or {}
    grouped = bool((study.get("perturbations") or {}).get("group"))
    if study.get("subjects") == "people":
        return _PEOPLE_IN_GROUPS if grouped else _PEOPLE_IN_CASES
    return _GROUPS if grouped else _LOADS


def nobody_perturbed(analysis: StudyAnalysis) -> bool:
    """Tell whether there is no impedance to report because nobody was perturbed."""
    statuses = {p.status for c in analysis.cells for p in c.parameters}
    return statuses == {Failure.NO_PERTURBED_RECORDING.status}


def report_title(analysis: StudyAnalysis) -> str:
    """Return the title of a study's report."""
    if subjects(analysis).loads:
        return "Impedance of loads on the bench"
    return f"Impedance of the {analysis.settings.get('joint', 'joint')}"
