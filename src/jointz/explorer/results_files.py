"""Look through results: which pulses made them, and what becomes of them without one."""

import json
import os
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from jointz.analysis.saved_analysis import load
from jointz.core.errors import DataError
from jointz.core.events import PulseRecord
from jointz.core.study import Study
from jointz.explorer.exclusions import excluded
from jointz.explorer.reestimation import with_again
from jointz.identify.methods.cells import BENCH_ONLY, METHODS
from jointz.identify.participant import ParticipantResult
from jointz.io.study_reader import open_study
from jointz.results.estimates import CellEstimate
from jointz.results.study_analysis import StudyAnalysis


@dataclass(frozen=True, slots=True, eq=False)
class Exploration:
    """Results that are looked through."""

    folder: Path  # the results folder; nothing in it is changed
    analysed: StudyAnalysis  # as it stands there
    # what was analysed, with the exclusions that stand there now; None where it is not known
    study: Study | None
    # participants that were estimated again
    again: Mapping[str, ParticipantResult] = field(default_factory=dict)
    # (Method, participant) -> cells by methods that the results do not hold
    others: Mapping[tuple[str, str], tuple[CellEstimate, ...]] = field(default_factory=dict)

    @property
    def people(self) -> tuple[str, ...]:
        """Participants, in the order of the study."""
        return tuple(dict.fromkeys(cell.participant for cell in self.analysed.cells))

    @property
    def labels(self) -> tuple[str, ...]:
        """Participants with their sessions and sides, in the order of the study."""
        return tuple(dict.fromkeys(cell.label for cell in self.analysed.cells))

    def current(self) -> StudyAnalysis:
        """Return the analysis with what was estimated again."""
        analysis = self.analysed
        if self.study is not None and self.again:
            analysis = with_again(analysis, self.study, self.again)
        others = tuple(cell for cells in self.others.values() for cell in cells)
        return replace(analysis, comparison=(*analysis.comparison, *others)) if others else analysis

    def stale(self) -> tuple[str, ...]:
        """Return participants whose numbers were made with other exclusions than now stand."""
        made = [p for p in self.analysed.pulses if p.participant not in self.again]
        made += [pulse for result in self.again.values() for pulse in result.pulses]
        found = {pulse.participant for pulse in self.otherwise(made)}
        return tuple(person for person in self.people if person in found)

    def changed(self) -> tuple[PulseRecord, ...]:
        """Return pulses about which the study says otherwise than when it was analysed."""
        return self.otherwise(self.analysed.pulses)

    def otherwise(self, pulses: Sequence[PulseRecord]) -> tuple[PulseRecord, ...]:
        """Return those of some pulses about which the study says otherwise now."""
        if self.study is None:
            return ()
        now = excluded(self.study, pulses)
        return tuple(p for p, out in zip(pulses, now, strict=True) if (p.code == "user") != out)

    def with_study(self, study: Study) -> "Exploration":
        """Return results with the study as it stands now."""
        return replace(self, study=study)

    def with_result(self, person_id: str, result: ParticipantResult) -> "Exploration":
        """Return results with a participant estimated again."""
        return replace(self, again={**self.again, person_id: result})

    def with_other(
        self, method: str, person_id: str, cells: tuple[CellEstimate, ...]
    ) -> "Exploration":
        """Return results with a participant estimated by one more method."""
        return replace(self, others={**self.others, (method, person_id): cells})

    def methods(self) -> tuple[str, ...]:
        """Return the methods there are numbers of, the chosen one first."""
        names = [str(self.analysed.settings["method"])]
        names += [cell.method for cell in self.analysed.comparison]
        return tuple(dict.fromkeys([*names, *(method for method, _ in self.others)]))

    def more_methods(self) -> tuple[str, ...]:
        """Return methods that could be added to compare with."""
        own = self.analysed.settings
        # A study that fixes its baseline compares nothing: it would differ in more than the method.
        fixed = self.study is None or self.study.spec.perturbations.baseline is not None
        if fixed or own["kind"] != "walking":
            return ()
        there = self.methods()
        return tuple(m for m in METHODS if m not in BENCH_ONLY and m not in there)

    def command(self) -> str:
        """Return the command line that makes the same numbers."""
        settings = self.analysed.settings
        where = "STUDY" if self.study is None else str(self.study.root)
        words = ["jointz", "analyze", where, "--out", str(self.folder)]
        for name in ("method", "resamples", "seed"):
            words += [f"--{name}", str(settings[name])]
        return shlex.join([*words, "--overwrite"])


def open_results(
    results: str | os.PathLike[str], *, study: str | os.PathLike[str] | None = None
) -> Exploration:
    """Open a results folder, and the study it was made from."""
    folder = Path(results)
    analysis = load(folder)
    return Exploration(folder, analysis, _study_of(analysis, folder, study))


def _study_of(
    analysis: StudyAnalysis, folder: Path, named: str | os.PathLike[str] | None
) -> Study | None:
    """Return the study that was analysed; one that is named must be it."""
    if named is not None:
        study = open_study(named)
        if study.sha256 != analysis.provenance.get("study_sha256"):
            raise DataError(
                f"{study.root}: expected the study that {folder} was made from, found another "
                "study.toml, or one that was changed since. Name that study, or analyse this "
                "one again: jointz analyze."
            )
        return study
    name = str(analysis.settings.get("study", ""))
    above = folder.resolve().parent
    if not name or Path(name).name != name:
        return None
    for place in (above / name, above.parent / name, Path.cwd() / name):
        if (place / "study.toml").is_file():
            study = open_study(place)
            if study.sha256 == analysis.provenance.get("study_sha256"):
                return study
    return None


def cell_of(
    analysis: StudyAnalysis, label: str, timing_point: str, *, method: str | None = None
) -> CellEstimate | None:
    """Return a cell of the chosen method, or of one it is compared with."""
    wanted = (label, timing_point, method or analysis.settings["method"])
    for cell in (*analysis.cells, *analysis.comparison):
        if (cell.label, cell.timing_point, cell.method) == wanted:
            return cell
    return None


def pulses_of(analysis: StudyAnalysis, label: str, timing_point: str) -> tuple[PulseRecord, ...]:
    """Return the pulses of a participant at a timing point, in order of time."""
    wanted = (label, timing_point)
    found = [p for p in analysis.pulses if (p.label, p.timing_point) == wanted]
    return tuple(sorted(found, key=lambda pulse: (pulse.recording, pulse.onset_s)))
