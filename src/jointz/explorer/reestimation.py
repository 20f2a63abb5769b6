"""One participant estimated again, as ``jointz analyze`` would, with every pulse's traces."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from jointz.analysis.participant_jobs import participant_settings, read_participant
from jointz.core.errors import DataError
from jointz.core.study import Study
from jointz.explorer.traces import PulseKey, PulseTrace, pulse_traces
from jointz.identify.bench.bench_cells import METHOD as FULL_RECORD
from jointz.identify.participant import ParticipantResult, analyze_participant
from jointz.identify.recommended.walking_estimator import METHOD as RECOMMENDED
from jointz.results.estimates import CellEstimate
from jointz.results.person_estimates import person_cells
from jointz.results.statistics.pooled_estimates import has_budget
from jointz.results.study_analysis import StudyAnalysis
from jointz.stats.partial_pooling import pool_people
from jointz.stats.population import population_means
from jointz.tasks.engine import on_one_thread


@dataclass(frozen=True, slots=True, eq=False)
class Again:
    """A participant estimated again."""

    participant: str  # the id
    # estimates of every method, without evidence; pulses of a bench by themselves are not in it
    result: ParticipantResult
    traces: Mapping[PulseKey, PulseTrace]  # what each pulse was estimated from


@dataclass(frozen=True, slots=True)
class Wanted:
    """How to estimate."""

    method: str  # by its own name
    resamples: int  # of the bootstrap
    seed: int
    # file -> what it was when the study was analysed; another one is refused
    sha256: Mapping[str, str]

    @classmethod
    def of(cls, analysis: StudyAnalysis) -> "Wanted":
        """Return how an analysis was made."""
        settings, provenance = analysis.settings, analysis.provenance
        inputs = {str(entry["file"]): str(entry["sha256"]) for entry in provenance["inputs"]}
        return cls(settings["method"], settings["resamples"], settings["seed"], inputs)


def estimate_again(study: Study, person_id: str, wanted: Wanted) -> Again:
    """Estimate a participant again, with the exclusions that stand in the study now."""
    settings = participant_settings(
        study, person_id, wanted.method, resamples=wanted.resamples, seed=wanted.seed
    )
    inputs: dict[str, dict[str, Any]] = {}
    recordings = read_participant(study, person_id, inputs)
    _check_same(inputs, wanted.sha256)
    result = on_one_thread(partial(analyze_participant, person_id, recordings, settings))
    traces = on_one_thread(partial(pulse_traces, person_id, recordings, settings, result))
    return Again(person_id, replace(result, evidence=()), traces)


def estimate_otherwise(
    study: Study, person_id: str, wanted: Wanted, *, method: str
) -> tuple[CellEstimate, ...]:
    """Estimate a participant by one more method, to compare."""
    settings = participant_settings(
        study, person_id, method, resamples=wanted.resamples, seed=wanted.seed
    )
    inputs: dict[str, dict[str, Any]] = {}
    recordings = read_participant(study, person_id, inputs)
    _check_same(inputs, wanted.sha256)
    alone = replace(settings, methods=(method,))
    found = on_one_thread(partial(analyze_participant, person_id, recordings, alone))
    return tuple(found.cells[method])


def _check_same(inputs: Mapping[str, Mapping[str, Any]], sha256: Mapping[str, str]) -> None:
    changed = [name for name, now in inputs.items() if sha256.get(name) != now["sha256"]]
    if changed:
        raise DataError(
            f"{', '.join(changed)}: expected what was analysed, found another content. "
            "Analyse the study again: jointz analyze."
        )


def with_again(
    analysis: StudyAnalysis, study: Study, results: Mapping[str, ParticipantResult]
) -> StudyAnalysis:
    """Return an analysis with participants estimated again, and the means that follow.

    Certificate, statistics and provenance are the old ones; :func:`jointz.analyze` makes them
    anew.
    """
    method = str(analysis.settings["method"])
    found = {
        (cell.label, cell.timing_point, name): cell
        for result in results.values()
        for name, cells in result.cells.items()
        for cell in cells
    }
    old = {cell.label for cell in analysis.cells}
    new = {label for label, _, name in found if name == method}
    if new - old or any(has_budget(c) and not c.prior_effects for c in analysis.cells):
        raise DataError(
            "the results are of an earlier version of jointz, and would be mixed with new "
            "estimates. Analyse the study again: jointz analyze."
        )
    cells = _renewed(analysis.cells, found)
    people = list(dict.fromkeys(cell.participant for cell in cells))
    pulses = {p: tuple(r.pulses) for p, r in results.items()}
    strides = {p: tuple(r.strides) for p, r in results.items()}
    # Pulses of a bench by themselves stay those of the analysis where whole trials are explained.
    single = {} if method == FULL_RECORD else {p: r.single for p, r in results.items()}
    models = {p: r.models for p, r in results.items()}
    changed = replace(
        analysis,
        cells=cells,
        comparison=_renewed(analysis.comparison, found),
        population=population_means(person_cells(cells)) if study.spec.kind == "walking" else (),
        pulses=_replaced(people, analysis.pulses, pulses),
        strides=_replaced(people, analysis.strides, strides),
        single=_replaced(people, analysis.single, single),
        models=_replaced(people, analysis.models, models),
        pooled=(),
    )
    if method != RECOMMENDED or len(people) < 2 or not any(map(has_budget, cells)):
        return changed
    together = pool_people(person_cells(cells))
    return replace(changed, population=together.population, pooled=together.cells)


def _renewed(
    cells: tuple[CellEstimate, ...], found: Mapping[tuple[str, str, str], CellEstimate]
) -> tuple[CellEstimate, ...]:
    # A point without a pulse has none whatever is left out: its cell stays.
    return tuple(found.get((c.label, c.timing_point, c.method), c) for c in cells)


def _replaced(people: list[str], old: tuple[Any, ...], new: Mapping[str, Any]) -> tuple[Any, ...]:
    return tuple(
        record
        for person in people
        for record in new.get(person, [r for r in old if r.participant == person])
    )
