"""Analyse a study: recordings in, impedance with intervals out."""

import os
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from typing import Any

from jointz.analysis.participant_jobs import Asked, Outcome, hashed, outcomes
from jointz.analysis.population_step import damage_notes, study_statistics
from jointz.analysis.saved_analysis import Analysis
from jointz.core import provenance
from jointz.core.codes import Exclusion, Failure
from jointz.core.errors import DataError, EngineError, OutputError, StudyError, WorkerLostError
from jointz.core.study import Study
from jointz.identify.appraisal.certificate_draws import Injection
from jointz.identify.appraisal.certificate_study import assembled, replicates_for
from jointz.identify.bench.bench_cells import METHOD as FULL_RECORD
from jointz.identify.methods.cells import BENCH_ONLY, METHODS, failed_parameters
from jointz.identify.participant import ParticipantResult
from jointz.identify.preparation.assignment import label_names
from jointz.identify.recommended.walking_estimator import BASELINE as PREDICTED
from jointz.identify.recommended.walking_estimator import METHOD as RECOMMENDED
from jointz.io.study_reader import open_study
from jointz.results.certificate_result import VirtualEstimate
from jointz.results.estimates import CellEstimate
from jointz.results.person_estimates import person_cells
from jointz.results.statistics.pooled_estimates import has_budget
from jointz.stats.partial_pooling import pool_people
from jointz.stats.population import population_means
from jointz.tasks.engine import Engine, Serial
from jointz.tasks.progress import Progress
from jointz.tasks.task_store import TaskStore

DEFAULT_RESAMPLES = 1000
#: Known responses put into a study's own strides: enough for a report, not for a study of the
#: method (:func:`jointz.analysis.certify.certify`).
_INJECTIONS = 10

#: Of a participant whose analysis ended with an error.
_NOTHING = ParticipantResult(cells={}, single=(), pulses=(), strides=(), gaps=())


def analyze(
    study: Study | str | os.PathLike[str],
    *,
    method: str = "recommended",
    resamples: int = DEFAULT_RESAMPLES,
    seed: int = 0,
    salvage: bool = False,
    engine: Engine | None = None,
    store: TaskStore | None = None,
    progress: Progress | None = None,
) -> Analysis:
    """Estimate the joint impedance of every participant of a study.

    Participants are read, analysed and released one by one, or as many at a time as an
    engine has workers: memory does not grow with their number.

    Parameters
    ----------
    study : Study or path
        An opened study, or its folder.
    method : str
        ``recommended`` or a name of :data:`jointz.identify.methods.cells.METHODS`.
    resamples : int
        Bootstrap resamples a cell.
    seed : int
        Of the bootstrap.
    salvage : bool
        Whether to make damaged recordings again first, from the logs of their sessions
        (:func:`jointz.session.salvage.salvage_recordings`).
    engine : Engine, optional
        Does several participants at once (:func:`jointz.tasks.engine.open_engine`); results
        do not depend on it.
    store : TaskStore, optional
        Where participants that are done are kept: a run that was killed goes on from there.
    progress : callable, optional
        Called with (participants done, of how many, what comes next).

    Returns
    -------
    Analysis
        Estimates, comparison, everything left out, provenance.

    Raises
    ------
    StudyError
        When recordings cannot be trusted; all of them in one message.
    DataError
        When the method is not one for this study, or for its baseline.
    EngineError
        When the engine cannot go on; whoever is done stays in the store.
    ValueError
        For an unknown method or fewer than 2 resamples.
    """
    if salvage:
        from jointz.session.salvage import salvage_recordings

        salvage_recordings(study.root if isinstance(study, Study) else study)
    opened = study if isinstance(study, Study) else open_study(study)
    name = _chosen(opened, check_method(method))
    if resamples < 2:
        raise ValueError(f"resamples: expected at least 2, got {resamples}.")
    found = _Found(seed)
    exclusions = opened.root / "exclusions.csv"
    if exclusions.is_file():
        found.inputs[exclusions.name] = hashed(opened, exclusions.name)
    people = [person.id for person in opened.spec.participants]
    injections = replicates_for(len(people), virtual=_INJECTIONS)
    asked = Asked(opened, name, resamples=resamples, seed=seed, injections=injections)
    with closing(outcomes(asked, people, engine=engine or Serial(), store=store)) as coming:
        for done, (person_id, outcome) in enumerate(coming):
            if progress:
                progress(done, len(people), person_id)
            found.take(person_id, outcome, last_hope=len(people) == len(found.broken) + 1)
            del outcome  # recordings would stay in memory with it
    if found.problems:
        raise StudyError(str(opened.root), found.problems)
    if progress:
        progress(len(people), len(people), "done")
    analysis = _assembled(opened, name, found, resamples=resamples, seed=seed)
    return _with_people_together(opened, analysis, found.virtual, injections=injections, seed=seed)


@dataclass(slots=True)
class _Found:
    """What came out for everybody so far; of whom nothing did, ``broken`` says why."""

    seed: int
    results: dict[str, ParticipantResult] = field(default_factory=dict)
    virtual: dict[str, list[VirtualEstimate]] = field(default_factory=dict)
    inputs: dict[str, dict[str, Any]] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)
    broken: dict[str, str] = field(default_factory=dict)

    def take(self, person_id: str, outcome: Callable[[], Outcome], *, last_hope: bool) -> None:
        """Wait for a participant; one whose analysis breaks keeps nobody else back."""
        try:
            found = outcome()
        except (OutputError, EngineError):  # everybody's: no result can be kept, or none made
            raise
        except StudyError as exc:
            self.problems += exc.problems
            return
        except DataError as exc:
            self.problems.append(str(exc))
            return
        except Exception as exc:
            if last_hope:
                raise
            self.results[person_id] = _NOTHING
            self.broken[person_id] = self._why(person_id, exc)
            return
        self.inputs |= found.inputs
        self.results[person_id], self.virtual[person_id] = found.result, found.virtual

    def _why(self, person_id: str, exc: Exception) -> str:
        """Say what broke an analysis; want of memory is no bug."""
        if isinstance(exc, WorkerLostError):
            return str(exc)
        if isinstance(exc, MemoryError):
            return (
                f"{person_id}: too little memory ({exc}). Use fewer workers, or a larger machine."
            )
        return (
            f"{person_id} (seed {self.seed}): the program failed ({type(exc).__name__}: {exc}). "
            "Please report it; the others are not concerned."
        )


def _with_people_together(
    study: Study,
    analysis: Analysis,
    virtual: Mapping[str, Sequence[VirtualEstimate]],
    *,
    injections: int,
    seed: int,
) -> Analysis:
    """Add what the people of a walking study tell of each other, and its certificate."""
    if analysis.settings["method"] != RECOMMENDED:
        return analysis
    certificate = assembled(
        virtual,
        Injection(),
        replicates=injections,
        seed=seed,
        window_s=study.spec.perturbations.window_s,
    )
    analysis = replace(analysis, certificate=certificate)
    if len(virtual) < 2 or not any(map(has_budget, analysis.cells)):
        return analysis
    together = pool_people(person_cells(analysis.cells))
    return replace(analysis, population=together.population, pooled=together.cells)


def check_method(method: str) -> str:
    """Return a method if there is one of that name."""
    if method not in METHODS:
        raise ValueError(f"method: expected one of {', '.join(METHODS)}; got {method!r}.")
    return method


def _chosen(study: Study, method: str) -> str:
    """Return the method by its name; what is recommended depends on the study."""
    baseline = study.spec.perturbations.baseline
    name = _recommended(study) if method == RECOMMENDED else method
    if study.spec.kind == "walking" and name in BENCH_ONLY:
        raise DataError(f"method: {name} is for bench studies; this study walks. Choose another.")
    if baseline == PREDICTED and name not in (RECOMMENDED, *BENCH_ONLY):
        raise DataError(
            f'method: {name} has no baseline "{PREDICTED}"; only {RECOMMENDED} has, in walking '
            "that torque perturbs. Choose another under perturbations.baseline."
        )
    return name


def _recommended(study: Study) -> str:
    """Return what is recommended for a study."""
    perturbations = study.spec.perturbations
    # A load that torque moves is one system; groups, and steps of the angle, are not.
    torque = perturbations.source != "angle"
    if study.spec.kind == "walking":
        asked = perturbations.baseline or PREDICTED
        return RECOMMENDED if torque and asked == PREDICTED else "dissertation"
    return FULL_RECORD if torque and perturbations.group is None else "dissertation"


def _assembled(
    study: Study,
    method: str,
    found: _Found,
    *,
    resamples: int,
    seed: int,
) -> Analysis:
    results, broken = found.results, found.broken
    cells = _completed(study, method, results, broken)
    others = {m for r in results.values() for m in r.cells if m != method}
    comparison = [
        cell
        for name in METHODS
        if name in others
        for cell in _completed(study, name, results, broken)
    ]
    statistics = study_statistics(study, method, cells, results.values())
    pulses = tuple(p for r in results.values() for p in r.pulses)
    statistics["notes"] += [*broken.values(), *damage_notes(found.inputs.values(), pulses)]
    strides = tuple(s for r in results.values() for s in r.strides)
    gaps = tuple(g for r in results.values() for g in r.gaps)
    single = tuple(p for r in results.values() for p in r.single)
    return Analysis(
        cells=tuple(cells),
        comparison=tuple(comparison),
        population=population_means(person_cells(cells)) if study.spec.of_people else (),
        pulses=pulses,
        strides=strides,
        gaps=gaps,
        single=single,
        models=tuple(m for r in results.values() for m in r.models),
        statistics=statistics,
        settings=_settings_record(study, method, resamples=resamples, seed=seed),
        provenance={
            **provenance.software(),
            "created": provenance.now(),
            "study_sha256": study.sha256,
            "study": study.spec.model_dump(mode="json", exclude_none=True),
            "inputs": list(found.inputs.values()),
            "seed": seed,
        },
    )


def _completed(
    study: Study,
    method: str,
    results: dict[str, ParticipantResult],
    broken: Collection[str],
) -> list[CellEstimate]:
    """Order the cells and add a failed one wherever a session and side has none."""
    labels = _expected_labels(study, method, results)
    cells: list[CellEstimate] = []
    for person_id, result in results.items():
        there = {(c.session, c.side, c.timing_point): c for c in result.cells.get(method, ())}
        for unit in result.units or (("", ""),):
            failure = _why_missing(study, person_id, result, unit)
            if person_id in broken:
                failure = Failure.ANALYSIS_BROKE
            cells += [
                there.get((*unit, label))
                or _missing(study, person_id, label, method, failure, unit)
                for label in labels
            ]
    return cells


def _expected_labels(study: Study, method: str, results: dict[str, ParticipantResult]) -> list[str]:
    spec = study.spec
    seen = list(
        dict.fromkeys(c.timing_point for r in results.values() for c in r.cells.get(method, ()))
    )
    if spec.kind == "bench" and spec.perturbations.group is None:
        return sorted(seen) or ["all_pulses"]
    return label_names(spec.perturbations, seen)


def _why_missing(
    study: Study, person_id: str, result: ParticipantResult, unit: tuple[str, str]
) -> Failure:
    """Return why a participant's session and side have no cell at a timing point."""
    pulses = [p for p in result.pulses if (p.session, p.side) == unit]
    conditions = {r.condition for r in study.spec.recordings if r.participant == person_id}
    if any(p.code == Exclusion.NO_HEEL_STRIKES for p in pulses):
        return Failure.NO_HEEL_STRIKES  # no pulse could be given its timing point
    if not {"perturbed", None} & conditions:
        return Failure.NO_PERTURBED_RECORDING
    # Pulses of which none could be given a timing point are there, each with its code.
    nameless = bool(pulses) and not any(p.timing_point for p in pulses)
    return Failure.ALL_PULSES_EXCLUDED if nameless else Failure.NO_PULSES


def _missing(
    study: Study,
    person_id: str,
    label: str,
    method: str,
    failure: Failure,
    unit: tuple[str, str],
) -> CellEstimate:
    mass = study.spec.participant(person_id).mass_kg
    return CellEstimate(
        participant=person_id,
        timing_point=label,
        onset_gait_pct=None,
        parameters=failed_parameters(
            failure, mass_kg=mass, wants_per_mass=study.spec.kind == "walking"
        ),
        vaf_pct=None,
        n_used=0,
        n_excluded=0,
        method=method,
        baseline=_baseline(study, method),
        session=unit[0],
        side=unit[1],
    )


def _baseline(study: Study, method: str) -> str:
    """Return what is subtracted: as the study asks, else the method's own."""
    own = METHODS[method].baseline_for(walking=study.spec.kind == "walking")
    return study.spec.perturbations.baseline or own


def _settings_record(study: Study, method: str, *, resamples: int, seed: int) -> dict[str, Any]:
    spec = study.spec
    return {
        "study": study.root.resolve().name,
        "joint": spec.joint,
        "kind": spec.kind,
        "positive": spec.positive,
        "torque_acts_on": spec.torque_acts_on,
        "method": method,
        "baseline": _baseline(study, method),
        "resamples": resamples,
        "seed": seed,
        "ci_level": 0.95,
        "window_s": spec.perturbations.window_s,
        "cutoff_hz": spec.perturbations.cutoff_hz,
        "timing_points": dict(spec.perturbations.timing_points or {}),
        "calibration": spec.calibration.model_dump(exclude_none=True),
    }
