"""Chapter IV's experiment on simulated people: run, analysed by both methods, truth beside."""

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from jointz.analysis.analyze import DEFAULT_RESAMPLES, analyze
from jointz.core.protocols.protocol import Protocol
from jointz.core.study import Study
from jointz.io.study_reader import open_study
from jointz.reproduction.chapter4.gait_claims import PersonGait, people_gait
from jointz.results.estimates import CellEstimate
from jointz.results.study_analysis import StudyAnalysis
from jointz.session.run import TRUTH_FILE, run
from jointz.tasks.open_engine import open_engine
from jointz.tasks.progress import Progress, RunProgress

#: What tables 4.1 to 4.3 hold, and its unit.
PARAMETERS: Mapping[str, str] = {
    "stiffness_per_mass": "N*m/rad/kg",
    "damping_per_mass": "N*m*s/rad/kg",
    "inertia": "kg*m^2",
}
#: Value per kg -> what it is of.
_WHOLE = {"stiffness_per_mass": "stiffness", "damping_per_mass": "damping"}
COLUMNS = (
    "source",
    "participant",
    "timing_point",
    "onset_gait_pct",
    "parameter",
    "value",
    "ci_low",
    "ci_high",
    "status",
    "vaf_pct",
)


@dataclass(frozen=True, slots=True, eq=False)
class WalkedStudy:
    """A simulated study of chapter IV."""

    people: tuple[str, ...]  # ids, in the order of the columns of tables 4.1 to 4.4
    # one row a source (``dissertation``, ``recommended``, ``truth``), participant, timing point and
    # parameter of :data:`PARAMETERS`: value, interval, status, VAF. No value where the estimate was
    # refused
    estimates: pd.DataFrame
    # means over people by the recommended method, as of
    # :meth:`jointz.results.study_analysis.StudyAnalysis.population_frame`
    population: pd.DataFrame
    # every person's unperturbed strides, without and with the device
    gait: Mapping[str, PersonGait]

    def of(self, source: str, parameter: str) -> pd.DataFrame:
        """Return the rows of a source and parameter."""
        return rows_of(self.estimates, source, parameter)

    def at(
        self, source: str, parameter: str, timing_point: str, *, column: str = "value"
    ) -> list[float]:
        """Return what people have at a timing point; who has nothing is left out."""
        rows = self.of(source, parameter)
        values = rows.loc[rows["timing_point"] == timing_point, column].dropna()
        return [float(value) for value in values]


def walking_study(
    folder: Path,
    seed: int,
    preset: str,
    progress: Progress | None = None,
    *,
    run_progress: RunProgress | None = None,
    protocol: str | Protocol = "walking",
    resamples: int = DEFAULT_RESAMPLES,
) -> WalkedStudy:
    """Run the protocol of chapter IV on simulated people and analyse it once."""
    made = run(
        protocol,
        out=folder / "walking",
        seed=seed,
        preset=preset,
        workers=os.cpu_count() or 1,
        progress=run_progress,
    )
    study = open_study(made.study)
    people = len(study.spec.participants)
    with open_engine(tasks=people, needs="jointz.analysis.participant_jobs") as engine:
        analysis = analyze(study, seed=seed, resamples=resamples, engine=engine, progress=progress)
    return walked(study, analysis)


def rows_of(estimates: pd.DataFrame, source: str, parameter: str) -> pd.DataFrame:
    """Return the rows of a source and parameter."""
    wanted = (estimates["source"] == source) & (estimates["parameter"] == parameter)
    return estimates[wanted]


def walked(study: Study, analysis: StudyAnalysis) -> WalkedStudy:
    """Set what an analysis found beside the truth of its simulated study."""
    masses = {person.id: person.mass_kg for person in study.spec.participants}
    rows = [
        *estimated("recommended", analysis.cells),
        *estimated("dissertation", [c for c in analysis.comparison if c.method == "dissertation"]),
        *true_values(study.root, masses),
    ]
    return WalkedStudy(
        people=tuple(masses),
        estimates=pd.DataFrame(rows, columns=list(COLUMNS)),
        population=analysis.population_frame(),
        gait=people_gait(study, analysis.strides),
    )


def estimated(source: str, cells: Sequence[CellEstimate]) -> list[dict[str, Any]]:
    """Return the estimates of a method, one row a cell and parameter."""
    return [
        {
            "source": source,
            "participant": cell.participant,
            "timing_point": cell.timing_point,
            "onset_gait_pct": cell.onset_gait_pct,
            "parameter": p.name,
            "value": p.value if p.stands else None,
            "ci_low": p.ci_low if p.stands else None,
            "ci_high": p.ci_high if p.stands else None,
            "status": p.status,
            "vaf_pct": cell.vaf_pct,
        }
        for cell in cells
        for p in cell.parameters
        if p.name in PARAMETERS
    ]


def true_values(study: Path, masses: Mapping[str, float | None]) -> list[dict[str, Any]]:
    """Return the truth of a simulated study in the rows of :func:`estimated`.

    The mean over the pulses of a timing point, each over its window, weighted with what the
    response tells of the parameter there: what a fit with constant parameters should find.
    """
    content = json.loads((study / TRUTH_FILE).read_text(encoding="utf-8"))
    rows = []
    for person, mass in masses.items():
        points = content["participants"][person]["perturbed"]["timing_points"]
        for point, truth in points.items():
            for name in PARAMETERS:
                whole = truth[_WHOLE.get(name, name)]
                per = mass if name in _WHOLE else 1.0
                if per is not None:
                    rows.append(
                        {
                            "source": "truth",
                            "participant": person,
                            "timing_point": point,
                            "onset_gait_pct": truth["onset_gait_pct"],
                            "parameter": name,
                            "value": whole / per,
                            "status": "ok",
                        }
                    )
    return rows
