"""Traces of one participant's pulses, and new estimates, as by ``jointz analyze``."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from jointz.analysis.device_effect import device_effect
from jointz.analysis.level_tests import level_tests
from jointz.analysis.mass_checks import likely_masses_kg, mass_questions, without_values_per_kg
from jointz.analysis.pulse_traces import ReestimationRequest, read_inputs
from jointz.core.errors import DataError
from jointz.core.method_names import (
    BAYESIAN,
    FULL_RECORD,
    RIGID,
    STRAPPED,
)
from jointz.core.study import Study
from jointz.identify.participant import ParticipantResult, analyze_participant
from jointz.results.estimates import CellEstimate
from jointz.results.study_analysis import StudyAnalysis
from jointz.stats.population import population_means
from jointz.tasks.engine import on_one_thread

_EARLIER = (
    "the results were made by an earlier version of jointz and cannot be combined with new "
    "estimates. Analyse the study again: jointz analyze."
)


def reestimate(study: Study, person_id: str, request: ReestimationRequest) -> ParticipantResult:
    """Estimate a participant with the current exclusions of the study."""
    if request.is_earlier_method:
        raise DataError(_EARLIER)
    settings, recordings = read_inputs(study, person_id, request)
    return on_one_thread(partial(analyze_participant, person_id, recordings, settings))


def estimate_by_method(
    study: Study, person_id: str, request: ReestimationRequest, *, method: str
) -> tuple[CellEstimate, ...]:
    """Estimate a participant by another method, for comparison."""
    settings, recordings = read_inputs(study, person_id, replace(request, method=method))
    single = replace(settings, methods=(method,))
    result = on_one_thread(partial(analyze_participant, person_id, recordings, single))
    cells = result.cells[method]
    return tuple(without_values_per_kg(cells, mass_questions(study, cells)))


def with_new_estimates(
    analysis: StudyAnalysis, study: Study, results: Mapping[str, ParticipantResult]
) -> StudyAnalysis:
    """Return an analysis with new estimates of participants, and the new means over people.

    Certificate, provenance and all statistics but the tests stay as analysed;
    :func:`jointz.analyze` updates them.
    """
    method = str(analysis.settings["method"])
    # Results of earlier versions keep the name of the method.
    written = {BAYESIAN: STRAPPED} if method == STRAPPED else {}
    new_cells = {
        (cell.label, cell.timing_point, cell.method): cell
        for result in results.values()
        for name, cells in result.cells.items()
        for cell in (replace(c, method=written.get(name, name)) for c in cells)
    }
    old = {cell.label for cell in analysis.cells}
    new = {label for label, _, name in new_cells if name == method}
    if method == RIGID or new - old:
        raise DataError(_EARLIER)
    cells = _updated(analysis.cells, new_cells)
    doubted = mass_questions(study, cells)
    cells = tuple(without_values_per_kg(cells, doubted))
    comparison = _updated(analysis.comparison, new_cells)
    people = list(dict.fromkeys(cell.participant for cell in cells))
    pulses = {p: tuple(r.pulses) for p, r in results.items()}
    strides = {p: tuple(r.strides) for p, r in results.items()}
    # Single pulses of a bench stay as analysed if the method explains whole trials.
    single = {} if method == FULL_RECORD else {p: r.single for p, r in results.items()}
    log_posteriors = {p: r.log_posteriors for p, r in results.items()}
    mean_strides = {p: r.mean_strides for p, r in results.items()}
    # Participants without a pulse have no cell.
    walkers = list(dict.fromkeys([*people, *(m.participant for m in analysis.mean_strides)]))
    strides_by_condition = _replaced(walkers, analysis.mean_strides, mean_strides)
    tests = ("level_tests", "device_effect")
    kept = {name: v for name, v in analysis.statistics.items() if name not in tests}
    posteriors = _replaced(people, analysis.log_posteriors, log_posteriors)
    return replace(
        analysis,
        cells=cells,
        comparison=tuple(without_values_per_kg(comparison, doubted)),
        population=population_means(cells, posteriors, likely_masses_kg(study, doubted))
        if study.spec.kind == "walking"
        else (),
        pulses=_replaced(people, analysis.pulses, pulses),
        strides=_replaced(people, analysis.strides, strides),
        single=_replaced(people, analysis.single, single),
        log_posteriors=posteriors,
        mean_strides=strides_by_condition,
        statistics={**kept, **level_tests(cells), **device_effect(strides_by_condition)},
    )


def _updated(
    cells: tuple[CellEstimate, ...], new: Mapping[tuple[str, str, str], CellEstimate]
) -> tuple[CellEstimate, ...]:
    # The cell of a point without pulses stays.
    return tuple(new.get((c.label, c.timing_point, c.method), c) for c in cells)


def _replaced(people: list[str], old: tuple[Any, ...], new: Mapping[str, Any]) -> tuple[Any, ...]:
    return tuple(
        record
        for person in people
        for record in new.get(person, [r for r in old if r.participant == person])
    )
