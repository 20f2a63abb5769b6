"""Results of an analysis, the study behind them, and new estimates."""

import os
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from jointz.analysis.pulse_traces import requested_method
from jointz.analysis.saved_analysis import load, study_of
from jointz.core.codes import LISTED
from jointz.core.events import PulseRecord
from jointz.core.method_names import WITH_POSTERIOR
from jointz.core.study import Study
from jointz.explorer.exclusions import excluded
from jointz.explorer.reestimation import with_new_estimates
from jointz.identify.estimators import METHODS
from jointz.identify.participant import ParticipantResult
from jointz.results.estimates import CellEstimate
from jointz.results.study_analysis import StudyAnalysis


@dataclass(frozen=True, slots=True, eq=False)
class Exploration:
    """Results to explore."""

    folder: Path  # the results folder; nothing in it is changed
    analysed: StudyAnalysis  # content of the folder
    study: Study | None  # the analysed study with its current exclusions; None if not found
    # participant -> new estimates
    reestimated: Mapping[str, ParticipantResult] = field(default_factory=dict)
    # (method, participant) -> cells by methods that the results do not hold
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
        """Return the analysis with all new estimates."""
        analysis = self.analysed
        if self.study is not None and self.reestimated:
            analysis = with_new_estimates(analysis, self.study, self.reestimated)
        others = tuple(cell for cells in self.others.values() for cell in cells)
        return replace(analysis, comparison=(*analysis.comparison, *others)) if others else analysis

    def stale(self) -> tuple[str, ...]:
        """Return participants whose numbers are older than the exclusions of the study."""
        pulses = [p for p in self.analysed.pulses if p.participant not in self.reestimated]
        pulses += [pulse for result in self.reestimated.values() for pulse in result.pulses]
        changed = {pulse.participant for pulse in self.changed(pulses)}
        return tuple(person for person in self.people if person in changed)

    def changed(self, pulses: Sequence[PulseRecord] | None = None) -> tuple[PulseRecord, ...]:
        """Return pulses, by default those analysed, that are now excluded or restored."""
        if self.study is None:
            return ()
        pulses = self.analysed.pulses if pulses is None else pulses
        now = excluded(self.study, pulses)
        return tuple(p for p, out in zip(pulses, now, strict=True) if (p.code in LISTED) != out)

    def with_study(self, study: Study) -> "Exploration":
        """Return results with the current study."""
        return replace(self, study=study)

    def with_result(self, person_id: str, result: ParticipantResult) -> "Exploration":
        """Return results with new estimates of a participant."""
        return replace(self, reestimated={**self.reestimated, person_id: result})

    def with_other(
        self, method: str, person_id: str, cells: tuple[CellEstimate, ...]
    ) -> "Exploration":
        """Return results with a participant's estimates by another method."""
        return replace(self, others={**self.others, (method, person_id): cells})

    def methods(self) -> tuple[str, ...]:
        """Return the methods with estimates, the chosen one first."""
        names = [str(self.analysed.settings["method"])]
        names += [cell.method for cell in self.analysed.comparison]
        return tuple(dict.fromkeys([*names, *(method for method, _ in self.others)]))

    def more_methods(self) -> tuple[str, ...]:
        """Return methods that can be added for comparison."""
        # With a fixed baseline, methods would differ in more than the method.
        fixed = self.study is None or self.study.spec.perturbations.baseline is not None
        if fixed or self.analysed.settings["kind"] != "walking":
            return ()
        present = set(self.methods())
        if present & WITH_POSTERIOR:
            present |= WITH_POSTERIOR  # one method by two names
        return tuple(m for m in METHODS.serving("walking") if m not in present)

    def command(self) -> str:
        """Return the command line that gives the same numbers."""
        settings = self.analysed.settings
        where = "STUDY" if self.study is None else str(self.study.root)
        words = ["jointz", "analyze", where, "--out", str(self.folder)]
        words += ["--method", requested_method(self.analysed)]
        for name in ("resamples", "seed"):
            words += [f"--{name}", str(settings[name])]
        return shlex.join([*words, "--overwrite"])


def open_results(
    results: str | os.PathLike[str], *, study: str | os.PathLike[str] | None = None
) -> Exploration:
    """Open a results folder, and the study that was analysed."""
    folder = Path(results)
    analysis = load(folder)
    return Exploration(folder, analysis, study_of(analysis, folder, study))


def cell_of(
    analysis: StudyAnalysis, label: str, timing_point: str, *, method: str | None = None
) -> CellEstimate | None:
    """Return a cell of the chosen method, or of one it is compared with."""
    key = (label, timing_point, method or analysis.settings["method"])
    cells = (*analysis.cells, *analysis.comparison)
    return next((c for c in cells if (c.label, c.timing_point, c.method) == key), None)


def pulses_of(analysis: StudyAnalysis, label: str, timing_point: str) -> tuple[PulseRecord, ...]:
    """Return the pulses of a participant at a timing point, in order of time."""
    key = (label, timing_point)
    pulses = [p for p in analysis.pulses if (p.label, p.timing_point) == key]
    return tuple(sorted(pulses, key=lambda pulse: (pulse.recording, pulse.onset_s)))
