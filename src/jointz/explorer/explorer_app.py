"""The explorer of results: what all its pages share, and the work behind them."""

import asyncio
from collections.abc import Callable, Coroutine, Mapping
from concurrent.futures import Executor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from functools import partial
from typing import Any, TypeVar

from jointz.core.errors import JointzError
from jointz.core.events import PulseRecord
from jointz.core.study import Study, UserExclusion
from jointz.explorer.exclusions import FILE, Action, decide
from jointz.explorer.reestimation import Wanted, estimate_again, estimate_otherwise
from jointz.explorer.results_files import Exploration
from jointz.explorer.traces import PulseKey, PulseTrace
from jointz.io.study_reader import open_study
from jointz.results.study_analysis import StudyAnalysis

Found = TypeVar("Found")

#: Traces of so many people are kept: 4 MB each.
_MOST_TRACED = 20


class Explorer:
    """Results that several pages look at: one state, and work that blocks none of them."""

    def __init__(self, found: Exploration, pool: Executor | None) -> None:
        self._found = found
        self._pool = pool
        self._analysis = found.current()
        self._traces: dict[str, Mapping[PulseKey, PulseTrace]] = {}
        self._tasks: set[asyncio.Task[None]] = set()
        self._failed: set[str] = set()
        self._stamp = self._file_stamp()
        self._changed = found.changed()
        self._waiting = frozenset(found.stale())
        self.version = 0
        self.problem = ""
        self.working: dict[str, str] = {}

    @property
    def found(self) -> Exploration:
        """The results, the study and what was estimated again."""
        return self._found

    @property
    def analysis(self) -> StudyAnalysis:
        """The numbers as they stand now."""
        return self._analysis

    @property
    def changed(self) -> tuple[PulseRecord, ...]:
        """Pulses about which the study says otherwise than when it was analysed."""
        return self._changed

    def waiting(self, person_id: str) -> bool:
        """Tell whether a participant's numbers are older than the exclusions that stand."""
        return person_id in self._waiting

    def traces(self, person_id: str) -> Mapping[PulseKey, PulseTrace] | None:
        """Return a participant's traces, None until they are there."""
        return self._traces.get(person_id)

    def want(self, person_id: str) -> None:
        """Have a participant's traces made, and numbers of all whose exclusions have changed."""
        if self._found.study is None:
            return
        missing = [person_id] if person_id not in self._traces else []
        for person in dict.fromkeys([*missing, *self._found.stale()]):
            if person not in self.working and person not in self._failed:
                self._begin(person, self._estimate(person))

    async def decide(self, pulse: PulseRecord, action: Action, *, reason: str) -> bool:
        """Exclude or restore a pulse in the study, and estimate its participant again."""
        study = self._found.study
        if study is None:
            return False
        try:
            changed = await asyncio.to_thread(decide, study, pulse, action, reason=reason)
        except JointzError as exc:
            self._say(str(exc))
            return False
        self._stamp = self._file_stamp()
        self._take(changed)
        self.want(pulse.participant)
        return True

    async def look(self) -> None:
        """See whether someone else has changed the exclusions, and follow."""
        stamp = self._file_stamp()
        study = self._found.study
        if study is None or stamp == self._stamp:
            return
        self._stamp = stamp
        try:
            changed = await asyncio.to_thread(open_study, study.root)
        except JointzError as exc:
            self._say(str(exc))
            return
        if changed.sha256 != study.sha256:
            self._say("study.toml was changed: analyse it again, and open the results anew.")
            return
        self._take(changed)

    def compare(self, method: str) -> None:
        """Have everybody estimated by one more method."""
        if method in self._found.more_methods():
            for person in self._found.people:
                self._begin(f"{method} {person}", self._estimate_by(method, person))

    def dismiss(self) -> None:
        """Forget what went wrong; what failed may be tried again."""
        self._failed.clear()
        self._say("")

    def _take(self, study: Study) -> None:
        self._found = self._found.with_study(study)
        self._failed.clear()
        self._compare_with_study()
        self._say("")

    def _compare_with_study(self) -> None:
        """See whose numbers, as pages show them, are older than the exclusions."""
        self._changed = self._found.changed()
        older = self._found.otherwise(self._analysis.pulses)
        self._waiting = frozenset(pulse.participant for pulse in older)

    async def _settle(self) -> None:
        """Put together what pages show; means over people take a moment."""
        while True:
            found = self._found
            analysis = await asyncio.to_thread(found.current)
            if found is self._found:
                break
        self._analysis = analysis
        self._compare_with_study()

    def _say(self, problem: str) -> None:
        self.problem = problem
        self.version += 1

    def _begin(self, what: str, work: Coroutine[Any, Any, None]) -> None:
        self.working[what] = what
        self.version += 1
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _estimate(self, person: str) -> None:
        """Estimate until the exclusions are those that the numbers were made with."""
        wanted = Wanted.of(self._found.analysed)
        try:
            while True:
                study = self._found.study
                if study is None:
                    return
                made = await self.call(partial(estimate_again, study, person, wanted))
                if _lines(study, person) == _lines(self._found.study, person):
                    break
            if person in self._found.stale() or person in self._found.again:
                self._found = self._found.with_result(person, made.result)
            self._keep(person, made.traces)
            await self._settle()
            for method in {m for m, other in self._found.others if other == person}:
                self._begin(f"{method} {person}", self._estimate_by(method, person))
        except Exception as exc:  # noqa: BLE001 - or every page would try again without end
            self._failed.add(person)
            self._say(_told(exc))
        finally:
            self._done(person)

    async def _estimate_by(self, method: str, person: str) -> None:
        wanted = Wanted.of(self._found.analysed)
        try:
            study = self._found.study
            if study is not None:
                cells = await self.call(
                    partial(estimate_otherwise, study, person, wanted, method=method)
                )
                self._found = self._found.with_other(method, person, cells)
                await self._settle()
        except Exception as exc:  # noqa: BLE001 - nobody else would tell
            self._say(_told(exc))
        finally:
            self._done(f"{method} {person}")

    async def call(self, work: Callable[[], Found]) -> Found:
        """Have something done where it blocks no page."""
        try:
            return await asyncio.get_running_loop().run_in_executor(self._pool, work)
        except BrokenProcessPool:  # a worker was killed, most likely for want of memory
            self._pool = None
            return await asyncio.to_thread(work)

    def _keep(self, person: str, traces: Mapping[PulseKey, PulseTrace]) -> None:
        self._traces.pop(person, None)
        self._traces[person] = traces
        while len(self._traces) > _MOST_TRACED:
            del self._traces[next(iter(self._traces))]

    def _done(self, what: str) -> None:
        self.working.pop(what, None)
        self.version += 1

    def _file_stamp(self) -> tuple[int, int] | None:
        study = self._found.study
        with suppress(OSError):
            if study is not None:
                stat = (study.root / FILE).stat()
                return stat.st_mtime_ns, stat.st_size
        return None


def _told(exc: Exception) -> str:
    if isinstance(exc, JointzError):
        return str(exc)
    return f"{type(exc).__name__}: {exc}. This is a bug in jointz."


def _lines(study: Study | None, person: str) -> tuple[UserExclusion, ...]:
    lines = () if study is None else study.user_exclusions
    return tuple(line for line in lines if line.participant == person)
