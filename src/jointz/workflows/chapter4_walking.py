"""Chapter IV's experiment on simulated people: run, analysed by both methods, truth beside."""

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from jointz.core.analysis import StudyAnalysis
from jointz.core.estimates import CellEstimate
from jointz.core.protocol import Protocol
from jointz.core.study import Study
from jointz.io.study import open_study
from jointz.workflows.analysis import DEFAULT_RESAMPLES, Progress, analyze
from jointz.workflows.chapter4_gait import PersonGait, people_gait
from jointz.workflows.engine import open_engine
from jointz.workflows.run import TRUTH_FILE, run
from jointz.workflows.worker_pool import RunProgress

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
    """A simulated study of chapter IV.

    Parameters
    ----------
    people : tuple of str
        Ids, in the order of the columns of tables 4.1 to 4.4.
    estimates : pandas.DataFrame
        One row a source (``dissertation``, ``recommended``, ``truth``), participant, timing
        point and parameter of :data:`PARAMETERS`: value, interval, status, VAF. No value where
        the estimate was refused.
    population : pandas.DataFrame
        Means over people by the recommended method, as of
        :meth:`jointz.core.analysis.StudyAnalysis.population_frame`.
    gait : mapping of str to PersonGait
        Every person's unperturbed strides, without and with the device.
    """

    people: tuple[str, ...]
    estimates: pd.DataFrame
    population: pd.DataFrame
    gait: Mapping[str, PersonGait]

    def of(self, source: str, parameter: str) -> pd.DataFrame:
        """Return the rows of a source and parameter.

        Parameters
        ----------
        source : str
            ``dissertation``, ``recommended`` or ``truth``.
        parameter : str
            Of :data:`PARAMETERS`.
        """
        return rows_of(self.estimates, source, parameter)

    def at(
        self, source: str, parameter: str, timing_point: str, *, column: str = "value"
    ) -> list[float]:
        """Return what people have at a timing point; who has nothing is left out.

        Parameters
        ----------
        source, parameter, timing_point : str
            Of what.
        column : str
            Such as ``vaf_pct``.
        """
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
    """Run the protocol of chapter IV on simulated people and analyse it once.

    Parameters
    ----------
    folder : pathlib.Path
        Where the study is written; a folder ``walking`` in it must not be there.
    seed : int
        Of plan, simulation and bootstrap.
    preset : str
        ``clean``, ``nominal`` or ``hard``.
    progress : callable, optional
        Called with (done, of how many, what comes next) during the analysis.
    run_progress : callable, optional
        Told of every stride of the experiment.
    protocol : str or Protocol
        Another one than the built-in, such as a shorter one.
    resamples : int
        Of the dissertation's bootstrap.

    Returns
    -------
    WalkedStudy
        Values by both methods, beside the truth.
    """
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
    with open_engine(tasks=people, needs="jointz.workflows.participants") as engine:
        analysis = analyze(study, seed=seed, resamples=resamples, engine=engine, progress=progress)
    return walked(study, analysis)


def rows_of(estimates: pd.DataFrame, source: str, parameter: str) -> pd.DataFrame:
    """Return the rows of a source and parameter.

    Parameters
    ----------
    estimates : pandas.DataFrame
        Of :data:`COLUMNS`.
    source, parameter : str
        Which.
    """
    wanted = (estimates["source"] == source) & (estimates["parameter"] == parameter)
    return estimates[wanted]


def walked(study: Study, analysis: StudyAnalysis) -> WalkedStudy:
    """Set what an analysis found beside the truth of its simulated study.

    Parameters
    ----------
    study : Study
        With ``ground_truth.json``.
    analysis : StudyAnalysis
        By the recommended method, the dissertation's beside.
    """
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
    """Return the estimates of a method, one row a cell and parameter.

    Parameters
    ----------
    source : str
        What the rows are called.
    cells : sequence of CellEstimate
        Of one method.
    """
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

    Parameters
    ----------
    study : pathlib.Path
        Its folder.
    masses : mapping of str to float or None
        Participant -> mass, kg; whoever has none has no values per kg.

    Notes
    -----
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
