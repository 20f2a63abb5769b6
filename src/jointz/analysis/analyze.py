"""Analysis of a study: from recordings to impedance with intervals."""

import os
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass, field, replace
from typing import Any, Final

from jointz.analysis.mass_checks import (
    likely_masses_kg,
    mass_questions,
    mass_remarks,
    without_values_per_kg,
)
from jointz.analysis.page.report_page import run_section
from jointz.analysis.participant_jobs import (
    EstimationRequest,
    Outcome,
    hashed,
    outcomes,
    recommended_method,
)
from jointz.analysis.planned_half_widths import planned_beside_reached
from jointz.analysis.rig_hooks import certificates, salvage_recordings
from jointz.analysis.saved_analysis import Analysis
from jointz.analysis.study_statistics import damage_notes, study_statistics
from jointz.core import provenance
from jointz.core.codes import Exclusion, Failure
from jointz.core.errors import DataError, EngineError, OutputError, StudyError, WorkerLostError
from jointz.core.method_names import BAYESIAN, PREDICTED, RECOMMENDED, method_called
from jointz.core.priors import PriorsSpec
from jointz.core.study import Study
from jointz.identify.estimators import METHODS
from jointz.identify.participant import ParticipantResult
from jointz.identify.preparation.assignment import label_names
from jointz.identify.regression.cell_parameters import failed_parameters
from jointz.identify.study_kinds import KINDS
from jointz.identify.walking.coupling import COUPLINGS
from jointz.io.small_files import read_json
from jointz.io.study_reader import open_study
from jointz.results.estimates import CellEstimate
from jointz.results.run_report import RunReport
from jointz.stats.population import population_means
from jointz.tasks.engine import Engine, Serial
from jointz.tasks.progress import Progress
from jointz.tasks.task_store import TaskStore
from jointz.terminal.progress_bars import shown_progress

DEFAULT_RESAMPLES = 1000
#: Number of simulated people of a certificate.
VIRTUAL_PEOPLE = 10
#: Begins the note of an analysis that should have a certificate and has none.
NO_CERTIFICATE = "no certificate: "

#: Result of a participant whose analysis ended with an error.
_EMPTY_RESULT = ParticipantResult(cells={}, single=(), pulses=(), strides=(), gaps=())


def analyze(  # noqa: PLR0913 - a public face, keywords only
    study: Study | str | os.PathLike[str],
    *,
    method: str = "recommended",
    resamples: int = DEFAULT_RESAMPLES,
    seed: int = 0,
    certify: bool | int = False,
    salvage: bool = False,
    engine: Engine | None = None,
    store: TaskStore | None = None,
    progress: Progress | bool | None = True,
) -> Analysis:
    """Estimate the joint impedance of every participant of a study.

    Participants are read, analysed and released one by one, or as many at a time as an
    engine has workers, so that memory does not grow with their number.

    Parameters
    ----------
    study : Study or path
        An opened study, or its folder.
    method : str
        ``recommended``, the right one for the study (``bayesian`` for walking, ``full_record``
        for loads on a bench), or a name of :data:`jointz.identify.estimators.METHODS`.
        ``bayesian`` assumes the coupling of device and leg that the study states (a strap unless
        it states one); ``strapped`` and ``rigid`` are the same method with that coupling.
    resamples : int
        Bootstrap resamples for each cell.
    seed : int
        Seed of the bootstrap.
    certify : bool or int
        Whether to add a certificate (:func:`jointz.certify`), of 10 simulated people or of this
        number; walking studies of the knee by ``bayesian`` only.
    salvage : bool
        Whether to recover damaged recordings first, from the logs of their sessions
        (:func:`jointz.analysis.rig_hooks.salvage_recordings`).
    engine : Engine, optional
        Engine that analyses several participants at once
        (:func:`jointz.tasks.engine.open_engine`); results do not depend on it.
    store : TaskStore, optional
        Store of finished participants, from which a killed run continues.
    progress : bool or callable
        Whether to draw a progress bar in a terminal or notebook; a function is called with
        (participants done, number of participants, what comes next).

    Returns
    -------
    Analysis
        Estimates, comparison, exclusions, provenance.

    Raises
    ------
    StudyError
        If recordings cannot be trusted; one message names all of them.
    DataError
        If the method does not suit the study or its baseline, or no simulated person can
        repeat its kind for a certificate. If its pulses cannot be repeated, a note says so.
    EngineError
        If the engine cannot continue; finished participants stay in the store.
    ValueError
        If the method is unknown, or ``resamples`` is less than 2.
    """
    if salvage:
        salvage_recordings(study.root if isinstance(study, Study) else study)
    opened = study if isinstance(study, Study) else open_study(study)
    requested_method = _chosen(opened, check_method(method))
    simulated = VIRTUAL_PEOPLE if certify is True else int(certify)
    if simulated < 0:
        raise ValueError(f"certify: expected true, false or a number of people, got {certify}.")
    if simulated:
        certificates().check_certifiable(opened, method_called(requested_method))
    if resamples < 2:
        raise ValueError(f"resamples: expected at least 2, got {resamples}.")
    outputs = _Outputs(seed)
    exclusions = opened.root / "exclusions.csv"
    if exclusions.is_file():
        outputs.inputs[exclusions.name] = hashed(opened, exclusions.name)
    people = [person.id for person in opened.spec.participants]
    engine = engine or Serial()
    request = EstimationRequest(opened, requested_method, resamples=resamples, seed=seed)
    total = len(people) + simulated
    with shown_progress(progress=progress) as show:
        with closing(outcomes(request, people, engine=engine, store=store)) as pending:
            for done, (person_id, outcome) in enumerate(pending):
                show(done, total, person_id)
                outputs.add(person_id, outcome, last=len(people) == len(outputs.errors) + 1)
                del outcome  # it would keep the recordings in memory
        if outputs.problems:
            raise StudyError(str(opened.root), outputs.problems)
        analysis = _assembled(request, outputs)
        if simulated:
            try:
                certificate = certificates().certificate_of(
                    opened,
                    analysis,
                    people=simulated,
                    seed=seed,
                    engine=engine,
                    store=store,
                    show=lambda done, text: show(len(people) + done, total, text),
                )
                analysis = replace(analysis, certificate=certificate)
            except DataError as exc:  # the analysis is not lost
                analysis.statistics["notes"].append(f"{NO_CERTIFICATE}{exc}")
        show(total, total, "done")
    return analysis


@dataclass(slots=True)
class _Outputs:
    """Results of the participants so far."""

    seed: int
    results: dict[str, ParticipantResult] = field(default_factory=dict)
    inputs: dict[str, dict[str, Any]] = field(default_factory=dict)  # file -> its name and hash
    problems: list[str] = field(default_factory=list)  # of recordings that cannot be trusted
    errors: dict[str, str] = field(default_factory=dict)  # participant without a result -> message

    def add(self, person_id: str, outcome: Callable[[], Outcome], *, last: bool) -> None:
        """Wait for a participant; an error of one does not stop the others."""
        try:
            completed = outcome()
        except (OutputError, EngineError):  # these concern all participants
            raise
        except StudyError as exc:
            self.problems += exc.problems
        except DataError as exc:
            self.problems.append(str(exc))
        except Exception as exc:
            if last:  # nobody else has a result
                raise
            self.results[person_id] = _EMPTY_RESULT
            self.errors[person_id] = self._message(person_id, exc)
        else:
            self.inputs |= completed.inputs
            self.results[person_id] = completed.result

    def _message(self, person_id: str, exc: Exception) -> str:
        """Explain why an analysis failed; too little memory is no bug."""
        if isinstance(exc, WorkerLostError):
            return str(exc)
        if isinstance(exc, MemoryError):
            return (
                f"{person_id}: too little memory ({exc}). Use fewer workers, or a larger machine."
            )
        return (
            f"{person_id} (seed {self.seed}): the program failed ({type(exc).__name__}: {exc}). "
            "Please report it; the results of the other participants are not affected."
        )


def check_method(method: str) -> str:
    """Return a method if it exists."""
    if method != RECOMMENDED and method_called(method) not in METHODS:
        known = ", ".join((RECOMMENDED, *METHODS))
        raise ValueError(f"method: expected one of {known}; got {method!r}.")
    return method


def _chosen(study: Study, method: str) -> str:
    """Return the method that is asked for; the recommended one depends on the study."""
    baseline = study.spec.perturbations.baseline
    if method in (RECOMMENDED, BAYESIAN):
        ask_for_coupling(study)
    requested_method = recommended_method(study) if method == RECOMMENDED else method
    name = method_called(requested_method)
    kind, kinds = study.spec.kind, METHODS[name].kinds
    if kind not in kinds:
        raise DataError(
            f"method: {name} is for {kinds[0]} studies; this is a {kind} study. Choose another."
        )
    own = METHODS[name].baseline_for(KINDS[kind])
    if own == PREDICTED and baseline not in (None, PREDICTED):
        raise DataError(
            f'method: {name} has the baseline "{PREDICTED}" only, and perturbations.baseline is '
            f'"{baseline}". Remove it, or choose another method.'
        )
    if own == PREDICTED and study.spec.perturbations.source == "angle":
        raise DataError(
            f"method: {name} is for perturbations of torque; perturbations.source is "
            '"angle". Choose another method.'
        )
    if baseline == PREDICTED and own != PREDICTED and "walking" in kinds:
        raise DataError(
            f'method: {name} has no baseline "{PREDICTED}". Choose another under '
            f"perturbations.baseline, or the method {BAYESIAN}."
        )
    return requested_method


def _assembled(request: EstimationRequest, outputs: _Outputs) -> Analysis:
    study, method, results = request.study, request.method, outputs.results
    cells = _completed(study, method, outputs)
    questions = mass_questions(study, cells)
    cells = without_values_per_kg(cells, questions)
    methods = {m for r in results.values() for m in r.cells if m != method}
    loaded = {addition.session for addition in study.spec.additions if addition.session}
    own = [cell for cell in cells if cell.session not in loaded]
    statistics = study_statistics(study, method, own, results.values())
    pulses = tuple(p for r in results.values() for p in r.pulses)
    inputs = list(outputs.inputs.values())
    posteriors = tuple(p for r in results.values() for p in r.log_posteriors)
    if planned := planned_beside_reached(study.spec.planned_half_width_pct, cells):
        statistics["planned_half_widths"] = planned
    run, run_notes = run_record(study)
    statistics["notes"][:0] = [*run_notes, *questions.values(), *mass_remarks(study, questions)]
    if loaded:
        statistics["notes"].append(
            f"Session {' and '.join(sorted(loaded))}: with a known addition to the joint, left out "
            "of means and tests. jointz verify compares it with the others."
        )
    statistics["notes"] += [*outputs.errors.values(), *damage_notes(inputs, pulses)]
    return Analysis(
        cells=tuple(cells),
        comparison=tuple(
            c
            for name in METHODS
            if name in methods
            for c in without_values_per_kg(_completed(study, name, outputs), questions)
        ),
        population=population_means(
            own,
            [p for p in posteriors if p.session not in loaded],
            likely_masses_kg(study, questions),
        )
        if study.spec.of_people
        else (),
        pulses=pulses,
        strides=tuple(s for r in results.values() for s in r.strides),
        gaps=tuple(g for r in results.values() for g in r.gaps),
        single=tuple(p for r in results.values() for p in r.single),
        log_posteriors=posteriors,
        mean_strides=tuple(m for r in results.values() for m in r.mean_strides),
        statistics=statistics,
        settings=_settings_record(request),
        provenance={
            **provenance.software(),
            "created": provenance.now(),
            "study_sha256": study.sha256,
            "study": study.spec.model_dump(mode="json", exclude_none=True),
            "inputs": inputs,
            "seed": request.seed,
            **_priors_record(request),
            **({"run": run} if run else {}),
        },
    )


def _priors_record(request: EstimationRequest) -> dict[str, Any]:
    """Return the priors, if the method has any."""
    if request.method != BAYESIAN:
        return {}
    priors = COUPLINGS[request.coupling].spec(request.study.spec.priors or PriorsSpec())
    return {"priors": priors.model_dump(mode="json")}


def _completed(study: Study, method: str, outputs: _Outputs) -> list[CellEstimate]:
    """Return the cells in order, with a failed one where a session and side has none."""
    labels = _expected_labels(study, method, outputs.results)
    cells: list[CellEstimate] = []
    for person_id, result in outputs.results.items():
        existing = {(c.session, c.side, c.timing_point): c for c in result.cells.get(method, ())}
        for unit in result.units or (("", ""),):
            failure = _failure(study, person_id, result, unit)
            if person_id in outputs.errors:
                failure = Failure.ANALYSIS_BROKE
            cells += [
                existing.get((*unit, label))
                or _failed_cell(study, person_id, label, method, failure, unit)
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


def _failure(
    study: Study, person_id: str, result: ParticipantResult, unit: tuple[str, str]
) -> Failure:
    """Return why a participant's session and side have no cell at a timing point."""
    pulses = [p for p in result.pulses if (p.session, p.side) == unit]
    conditions = {r.condition for r in study.spec.recordings if r.participant == person_id}
    if any(p.code == Exclusion.NO_HEEL_STRIKES for p in pulses):
        return Failure.NO_HEEL_STRIKES  # so no pulse has a timing point
    if not {"perturbed", None} & conditions:
        return Failure.NO_PERTURBED_RECORDING
    # There may be pulses that all lack a timing point, each with its code.
    unassigned = bool(pulses) and not any(p.timing_point for p in pulses)
    return Failure.ALL_PULSES_EXCLUDED if unassigned else Failure.NO_PULSES


def _failed_cell(
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
    """Return the baseline of the study, else the method's own."""
    own = METHODS[method].baseline_for(KINDS[study.spec.kind])
    return study.spec.perturbations.baseline or own


def _settings_record(request: EstimationRequest) -> dict[str, Any]:
    spec = request.study.spec
    return {
        "study": request.study.root.resolve().name,
        "joint": spec.joint,
        "kind": spec.kind,
        "positive": spec.positive,
        "torque_acts_on": spec.torque_acts_on,
        "method": request.method,
        **({"coupling": request.coupling} if request.method == BAYESIAN else {}),
        "baseline": _baseline(request.study, request.method),
        "resamples": request.resamples,
        "seed": request.seed,
        "ci_level": 0.95,
        "window_s": spec.perturbations.window_s,
        "cutoff_hz": spec.perturbations.cutoff_hz,
        "timing_points": dict(spec.perturbations.timing_points or {}),
        "calibration": spec.calibration.model_dump(exclude_none=True),
    }


_TRUTH_FILE = "ground_truth.json"


def ask_for_coupling(study: Study) -> None:
    """Refuse a simulated study of rigid coupling that was written before the key existed."""
    if study.spec.kind != "walking" or study.spec.coupling is not None:
        return
    preset = _rigid_preset(study)
    if preset is not None:
        raise DataError(
            f"{study.root / 'study.toml'}: coupling is missing, and {_TRUTH_FILE} names the "
            f'simulated people "{preset}", to whom the device is coupled rigidly. Add the line '
            'coupling = "rigid" above the first [table] of study.toml.'
        )


def _rigid_preset(study: Study) -> str | None:
    """Return the name of a preset without strap; None where the study is of other people."""
    try:
        truth: Any = read_json(study.root / _TRUTH_FILE, "")
        conditions = [c for person in truth["participants"].values() for c in person.values()]
        bodies = [condition["settings"]["body"] for condition in conditions]
        preset = str(truth["preset"])
    except (ValueError, KeyError, TypeError, AttributeError):
        return None
    return preset if bodies and not any(bodies) else None


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
