"""Analysis of the participants, one after the other or several at once in processes."""

import ctypes
import sys
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import cache, partial
from typing import Any

from jointz.analysis.rate_checks import check_strides
from jointz.analysis.study_pulses import pulse_tables
from jointz.core.errors import DataError, StudyError
from jointz.core.method_names import BAYESIAN, COUPLING_OF, FULL_RECORD, PREDICTED, method_called
from jointz.core.priors import PriorsSpec
from jointz.core.recording import history_of
from jointz.core.study import Study
from jointz.identify.participant import ParticipantResult, analyze_participant
from jointz.identify.preparation.sources import ParticipantSettings, RecordingInput
from jointz.identify.study_kinds import KINDS
from jointz.io.formats.columns import damaged, file_sha256
from jointz.io.recordings import read_recording
from jointz.io.study_files import named_as_written, shown_file
from jointz.tasks.engine import Engine, Serial, Task, done_in_turn, on_one_thread
from jointz.tasks.task_store import TaskStore, task_key


@dataclass(frozen=True, slots=True, eq=False)
class EstimationRequest:
    """Study, method and settings of an analysis, the same for every participant."""

    study: Study
    requested_method: str  # the method; ``strapped`` and ``rigid`` are the method of walking
    resamples: int  # number of resamples of the bootstrap
    seed: int

    @property
    def method(self) -> str:
        """Name of the method."""
        return method_called(self.requested_method)

    @property
    def coupling(self) -> str:
        """Coupling of device and leg that the method assumes."""
        return coupling_of(self.study, self.requested_method)


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """Result for a participant."""

    result: ParticipantResult
    inputs: dict[str, dict[str, Any]]  # file -> its name and hash


def outcomes(
    request: EstimationRequest, people: Sequence[str], *, engine: Engine, store: TaskStore | None
) -> Generator[tuple[str, Callable[[], Outcome]]]:
    """Yield every participant, in order, with a function that returns the outcome.

    The function raises DataError for recordings that cannot be trusted, and EngineError if no
    other outcome will come either. Memory does not grow with the number of participants: it holds
    one for each worker; a single worker holds another one that is read ahead.
    """
    if isinstance(engine, Serial):
        yield from _in_turn(request, people, store)
        return
    # Workers may have been started in another folder.
    study = replace(request.study, root=request.study.root.absolute())
    request = replace(request, study=study)
    tasks = (
        Task(
            f"{person_id} (seed {request.seed})",
            partial(_read_and_estimate, request, person_id),
            key=partial(_key, request, person_id),
        )
        for person_id in people
    )
    pending = done_in_turn(engine, tasks, store=store)
    for person_id in people:
        yield person_id, lambda: next(pending).result()


def _key(request: EstimationRequest, person_id: str) -> str:
    """Return the key of a participant's outcome; workers call it, as it reads the files."""
    study = request.study
    entries = [e for e in study.spec.recordings if e.participant == person_id]
    files = [file for e in entries for file in (e.file, *e.other_files)]
    inputs = {"study.toml": study.sha256}
    for file in files:
        with suppress(OSError, DataError):  # reported when the file is read
            inputs[file] = hashed(study, file)["sha256"]
    exclusions = [asdict(e) for e in study.user_exclusions if e.participant == person_id]
    settings = {
        "method": request.method,
        "coupling": request.coupling,
        "resamples": request.resamples,
        "seed": request.seed,
        "exclusions": exclusions,
    }
    return task_key(what=f"analyze {person_id}", inputs=inputs, settings=settings)


def _in_turn(
    request: EstimationRequest, people: Sequence[str], store: TaskStore | None
) -> Generator[tuple[str, Callable[[], Outcome]]]:
    """Read one participant ahead in a thread while the previous one is analysed."""
    with ThreadPoolExecutor(max_workers=1) as reader:

        def start(person_id: str) -> tuple[_ReadAhead, Future[None]]:
            participant = _ReadAhead(request, person_id, store)
            return participant, reader.submit(participant.read)

        following = start(people[0])
        for person_id, next_id in zip(people, [*people[1:], None], strict=True):
            current, reading = following
            wait([reading])
            if next_id is not None:
                following = start(next_id)
            _release_memory()
            yield person_id, partial(current.outcome, reading)


class _ReadAhead:
    """Participant whose recordings are read ahead, unless the store has the outcome."""

    def __init__(self, request: EstimationRequest, person_id: str, store: TaskStore | None) -> None:
        self._request, self._person_id, self._store = request, person_id, store
        self._key = cache(partial(_key, request, person_id))
        self._inputs: dict[str, dict[str, Any]] = {}
        self._recordings: list[RecordingInput] | None = None

    def read(self) -> None:
        """Read the recordings if they are needed."""
        if self._store is None or not self._store.holds(self._key()):
            self._recordings = self._read()

    def outcome(self, reading: Future[None]) -> Outcome:
        """Return the outcome, or raise the error of the reading."""
        reading.result()
        call = partial(on_one_thread, self._estimate)
        return call() if self._store is None else self._store.kept(self._key, call)()

    def _estimate(self) -> Outcome:
        # The recordings are missing here if the outcome in the store turns out to be damaged.
        recordings = self._read() if self._recordings is None else self._recordings
        return _outcome(self._request, self._person_id, recordings, self._inputs)

    def _read(self) -> list[RecordingInput]:
        return read_participant(self._request.study, self._person_id, self._inputs)


def _read_and_estimate(request: EstimationRequest, person_id: str) -> Outcome:
    inputs: dict[str, dict[str, Any]] = {}
    _release_memory()
    recordings = read_participant(request.study, person_id, inputs)
    return _outcome(request, person_id, recordings, inputs)


def _outcome(
    request: EstimationRequest,
    person_id: str,
    recordings: list[RecordingInput],
    inputs: dict[str, dict[str, Any]],
) -> Outcome:
    settings = participant_settings(
        request.study,
        person_id,
        request.requested_method,
        resamples=request.resamples,
        seed=request.seed,
    )
    result = _analyzed(person_id, recordings, settings)
    return Outcome(result, inputs)


def recommended_method(study: Study) -> str:
    """Return the recommended method of a study."""
    perturbations = study.spec.perturbations
    # A load moved by torque is one system; groups, and steps of the angle, are not.
    torque = perturbations.source != "angle"
    if study.spec.kind == "walking":
        baseline = perturbations.baseline or PREDICTED
        if not torque or baseline != PREDICTED:
            return "dissertation"
        return BAYESIAN
    return FULL_RECORD if torque and perturbations.group is None else "dissertation"


def coupling_of(study: Study, method: str) -> str:
    """Return the coupling of device and leg that a method assumes in a study."""
    return COUPLING_OF.get(method) or study.spec.coupling or "strap"


def participant_settings(
    study: Study, person_id: str, method: str, *, resamples: int, seed: int
) -> ParticipantSettings:
    """Return the settings of the study for one participant.

    A method may be named by the coupling that it assumes: ``strapped``, ``rigid``.
    """
    spec = study.spec
    coupling = coupling_of(study, method)
    requested_method = coupling != coupling_of(study, BAYESIAN)
    method = method_called(method)
    kind = KINDS[spec.kind]
    # The dissertation's method is compared with one that differs in the baseline only.
    compared = method != "dissertation" and (kind.by_gait or method == FULL_RECORD)
    others = ["dissertation"] if compared else ["matched_strides"] if kind.by_gait else []
    default_baseline = spec.perturbations.baseline is None
    return ParticipantSettings(
        kind=kind,
        perturbations=spec.perturbations,
        group_edges=study.group_edges,
        torque_model=spec.torque_model,
        methods=(method, *(others if default_baseline else [])),
        method_asked_for=requested_method or method != recommended_method(study),
        n_resamples=resamples,
        seed=seed,
        mass_kg=spec.participant(person_id).mass_kg,
        user_exclusions=tuple(e for e in study.user_exclusions if e.participant == person_id),
        joint=spec.joint,
        positive=spec.positive,
        person=spec.participant(person_id),
        device=spec.device,
        priors=spec.priors or PriorsSpec(),
        coupling=coupling,
    )


def read_participant(
    study: Study, person_id: str, inputs: dict[str, dict[str, Any]]
) -> list[RecordingInput]:
    """Read all recordings of one participant; one error names all that cannot be read."""
    recordings: list[RecordingInput] = []
    problems: list[str] = []
    for entry in study.spec.recordings:
        if entry.participant != person_id:
            continue
        try:
            pieces = read_recording(study, entry)
            check_strides(study, entry, pieces)
            tables = pulse_tables(study, entry, pieces)
        except DataError as exc:
            problems.append(str(exc))
            continue
        for file in (entry.perturbations, entry.heel_strikes):
            if file is not None:
                inputs[file] = hashed(study, file)
        calibration = study.spec.calibration_of(entry)
        recordings += [
            RecordingInput(piece, calibration, table)
            for piece, table in zip(pieces, tables, strict=True)
        ]
        inputs[entry.label] = {
            "file": entry.label,
            "name": shown_file(entry.file),
            "sha256": pieces[0].attrs["sha256"],
            "history": history_of(pieces[0]),
        }
    if problems:
        raise StudyError(str(study.root), problems)
    return recordings


def _analyzed(
    person_id: str, recordings: list[RecordingInput], settings: ParticipantSettings
) -> ParticipantResult:
    """Analyse one participant; on a bench also each pulse by its likelihood."""
    result = analyze_participant(person_id, recordings, settings)
    method = settings.methods[0]
    if method != FULL_RECORD:
        return result
    from jointz.analysis.likelihood_pulses import likelihood_pulses  # needed by benches only

    single = likelihood_pulses(
        recordings,
        result.single,
        result.cells[method],
        perturbations=settings.perturbations,
        torque_model=settings.torque_model,
    )
    return replace(result, single=single)


def _release_memory() -> None:
    """Return freed memory to the system, if the C library can.

    glibc keeps the memory that the threads of a parallel reader freed; without this, ten
    participants take a quarter more memory than one.
    """
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(0)


def hashed(study: Study, file: str) -> dict[str, Any]:
    """Return a file of a study with its name and hash."""
    with named_as_written(study.root, file) as path:
        try:
            sha256 = file_sha256(path)
        except OSError as exc:
            raise damaged(path, exc) from exc
    return {"file": file, "name": shown_file(file), "sha256": sha256}
