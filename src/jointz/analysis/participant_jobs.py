"""One participant after the other, or several at once in processes of their own."""

import ctypes
import sys
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import cache, partial
from typing import Any

from jointz.analysis.likelihood_pulses import likelihood_pulses
from jointz.analysis.rate_checks import check_strides
from jointz.analysis.study_pulses import pulse_tables
from jointz.core.errors import DataError, StudyError
from jointz.core.recording import history_of
from jointz.core.study import Study
from jointz.identify.appraisal.certificate_draws import Injection
from jointz.identify.appraisal.certificate_study import certify_participant
from jointz.identify.bench.bench_cells import METHOD as FULL_RECORD
from jointz.identify.participant import ParticipantResult, analyze_participant
from jointz.identify.preparation.sources import ParticipantSettings, RecordingInput
from jointz.identify.study_kinds import KINDS
from jointz.io.formats.columns import damaged, file_sha256
from jointz.io.recordings import read_recording
from jointz.io.study_reader import named_as_written, shown_file
from jointz.results.certificate_result import VirtualEstimate
from jointz.tasks.engine import Engine, Serial, Task, done_in_turn, on_one_thread
from jointz.tasks.task_store import TaskStore, task_key


@dataclass(frozen=True, slots=True, eq=False)
class Asked:
    """What is to be done for every participant."""

    study: Study
    method: str  # by its own name
    resamples: int  # of the bootstrap
    seed: int
    injections: int  # known responses put into each participant's own strides


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What came out for a participant."""

    result: ParticipantResult  # without its evidence, which is large
    virtual: list[VirtualEstimate]  # known responses injected and estimated
    inputs: dict[str, dict[str, Any]]  # every file read, with its hash


def outcomes(
    asked: Asked, people: Sequence[str], *, engine: Engine, store: TaskStore | None
) -> Generator[tuple[str, Callable[[], Outcome]]]:
    """Yield every participant, in order, with a function that gives the outcome.

    A function raises DataError for recordings that cannot be trusted, and EngineError where
    nobody else's outcome will come either.

    Memory does not grow with the number of participants: one a worker is in it, and with
    one worker alone another that is read ahead.
    """
    if isinstance(engine, Serial):
        yield from _in_turn(asked, people, store)
        return
    # Workers may have been started in another folder.
    study = replace(asked.study, root=asked.study.root.absolute())
    sent = replace(asked, study=study)
    tasks = (
        Task(
            f"{person_id} (seed {asked.seed})",
            partial(_read_and_analyzed, sent, person_id),
            key=partial(_key, sent, person_id),
        )
        for person_id in people
    )
    coming = done_in_turn(engine, tasks, store=store)
    for person_id in people:
        yield person_id, lambda: next(coming).result()


def _key(asked: Asked, person_id: str) -> str:
    """Return the name of a participant's outcome; made by the worker, which reads the files."""
    entries = [e for e in asked.study.spec.recordings if e.participant == person_id]
    files = [file for e in entries for file in (e.file, e.perturbations) if file is not None]
    inputs = {"study.toml": asked.study.sha256}
    for file in files:
        with suppress(OSError, DataError):  # one that cannot be read is told when it is read
            inputs[file] = hashed(asked.study, file)["sha256"]
    own = [e for e in asked.study.user_exclusions if e.participant == person_id]
    settings = {
        "method": asked.method,
        "resamples": asked.resamples,
        "seed": asked.seed,
        "injections": asked.injections,
        "exclusions": [asdict(e) for e in own],
    }
    return task_key(what=f"analyze {person_id}", inputs=inputs, settings=settings)


def _in_turn(
    asked: Asked, people: Sequence[str], store: TaskStore | None
) -> Generator[tuple[str, Callable[[], Outcome]]]:
    """Read one participant ahead in a thread, while the one before is analysed."""
    with ThreadPoolExecutor(max_workers=1) as reader:

        def start(person_id: str) -> tuple[_Ahead, Future[None]]:
            ahead = _Ahead(asked, person_id, store)
            return ahead, reader.submit(ahead.read)

        coming = start(people[0])
        for person_id, following in zip(people, [*people[1:], None], strict=True):
            current, reading = coming
            wait([reading])
            if following is not None:
                coming = start(following)
            _give_back_memory()
            yield person_id, partial(current.outcome, reading)


class _Ahead:
    """A participant whose recordings are read ahead, unless the outcome is kept."""

    def __init__(self, asked: Asked, person_id: str, store: TaskStore | None) -> None:
        self._asked, self._person_id, self._store = asked, person_id, store
        self._key = cache(partial(_key, asked, person_id))
        self._inputs: dict[str, dict[str, Any]] = {}
        self._recordings: list[RecordingInput] | None = None

    def read(self) -> None:
        """Read the recordings where they will be needed."""
        if self._store is None or not self._store.holds(self._key()):
            self._recordings = self._read()

    def outcome(self, reading: Future[None]) -> Outcome:
        """Return the outcome, or raise what the reading raised."""
        reading.result()
        call = partial(on_one_thread, self._made)
        return call() if self._store is None else self._store.kept(self._key, call)()

    def _made(self) -> Outcome:
        recordings = self._recordings
        if recordings is None:  # the one that was kept is damaged
            recordings = self._read()
        return _outcome(self._asked, self._person_id, recordings, self._inputs)

    def _read(self) -> list[RecordingInput]:
        return read_participant(self._asked.study, self._person_id, self._inputs)


def _read_and_analyzed(asked: Asked, person_id: str) -> Outcome:
    inputs: dict[str, dict[str, Any]] = {}
    _give_back_memory()
    recordings = read_participant(asked.study, person_id, inputs)
    return _outcome(asked, person_id, recordings, inputs)


def _outcome(
    asked: Asked,
    person_id: str,
    recordings: list[RecordingInput],
    inputs: dict[str, dict[str, Any]],
) -> Outcome:
    settings = participant_settings(
        asked.study, person_id, asked.method, resamples=asked.resamples, seed=asked.seed
    )
    found = _analyzed(person_id, recordings, settings)
    virtual = certify_participant(
        found.evidence, Injection(), replicates=asked.injections, seed=asked.seed
    )
    return Outcome(replace(found, evidence=()), virtual, inputs)


def participant_settings(
    study: Study, person_id: str, method: str, *, resamples: int, seed: int
) -> ParticipantSettings:
    """Return what the study asks for about one participant."""
    spec = study.spec
    kind = KINDS[spec.kind]
    # Beside the dissertation's method, the one that differs in nothing but the baseline.
    compared = method != "dissertation" and (kind.by_gait or method == FULL_RECORD)
    others = ["dissertation"] if compared else ["matched_strides"] if kind.by_gait else []
    own = spec.perturbations.baseline is None
    return ParticipantSettings(
        kind=kind,
        perturbations=spec.perturbations,
        group_edges=study.group_edges,
        torque_model=spec.torque_model,
        methods=(method, *(others if own else [])),
        n_resamples=resamples,
        seed=seed,
        mass_kg=spec.participant(person_id).mass_kg,
        user_exclusions=tuple(e for e in study.user_exclusions if e.participant == person_id),
        joint=spec.joint,
        positive=spec.positive,
        person=spec.participant(person_id),
        device=spec.device,
    )


def read_participant(
    study: Study, person_id: str, inputs: dict[str, dict[str, Any]]
) -> list[RecordingInput]:
    """Read all recordings of one participant; all unreadable ones in one error."""
    found: list[RecordingInput] = []
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
        if entry.perturbations is not None:
            inputs[entry.perturbations] = hashed(study, entry.perturbations)
        calibration = study.spec.calibration_of(entry)
        found += [RecordingInput(p, calibration, t) for p, t in zip(pieces, tables, strict=True)]
        inputs[entry.file] = {
            "file": entry.file,
            "name": shown_file(entry.file),
            "sha256": pieces[0].attrs["sha256"],
            "history": history_of(pieces[0]),
        }
    if problems:
        raise StudyError(str(study.root), problems)
    return found


def _analyzed(
    person_id: str, recordings: list[RecordingInput], settings: ParticipantSettings
) -> ParticipantResult:
    """Analyse one participant; its recordings are gone before the next but one are read."""
    result = analyze_participant(person_id, recordings, settings)
    method = settings.methods[0]
    if method != FULL_RECORD:
        return result
    single = likelihood_pulses(
        recordings,
        result.single,
        result.cells[method],
        perturbations=settings.perturbations,
        torque_model=settings.torque_model,
    )
    return replace(result, single=single)


def _give_back_memory() -> None:
    """Hand freed memory back to the system, where the C library can.

    glibc keeps what the threads of a parallel reader freed; without this ten
    participants take a quarter more memory than one.
    """
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(0)


def hashed(study: Study, file: str) -> dict[str, Any]:
    """Return a file of a study, its name and its hash."""
    with named_as_written(study.root, file) as path:
        try:
            sha256 = file_sha256(path)
        except OSError as exc:
            raise damaged(path, exc) from exc
    return {"file": file, "name": shown_file(file), "sha256": sha256}
