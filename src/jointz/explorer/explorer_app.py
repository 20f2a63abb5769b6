"""State that all pages of the explorer share, and the work behind them."""

import asyncio
import time
from collections.abc import Callable, Coroutine, Mapping
from concurrent.futures import Executor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from functools import partial
from typing import Any, TypeVar

from jointz.analysis.pulse_traces import PulseKey, PulseTrace, ReestimationRequest, read_traces
from jointz.core.errors import JointzError
from jointz.core.events import PulseRecord
from jointz.core.study import Study
from jointz.explorer.exclusions import FILE, Action, decide
from jointz.explorer.reestimation import estimate_by_method, reestimate
from jointz.explorer.results_files import Exploration
from jointz.io.study_reader import open_study

Result = TypeVar("Result")

#: Traces of so many people are kept, 4 MB each.
_MOST_TRACED = 20


class Explorer:
    """Results that several pages show: one state, and work that blocks no page."""

    def __init__(self, results: Exploration, pool: Executor | None) -> None:
        self.results = results  # the results, the study and new estimates
        self._pool = pool
        self.analysis = results.current()  # the current numbers
        self._traces: dict[str, Mapping[PulseKey, PulseTrace]] = {}
        self._tasks: set[asyncio.Task[None]] = set()
        self._failed: set[str] = set()
        self._stamp = self._file_stamp()
        self.changed = results.changed()  # pulses excluded or restored since the analysis
        self.stale = results.stale()  # people whose numbers are older than the exclusions
        # One estimation at a time: another process is left to read recordings.
        self._estimating = asyncio.Lock()
        self.seconds: float | None = None  # that the last estimation took
        self.version = 0
        self.problem = ""
        self.working: dict[str, float] = {}  # what is done -> when it began, s

    def traces(self, person_id: str) -> Mapping[PulseKey, PulseTrace] | None:
        """Return a participant's traces, None until they are ready."""
        return self._traces.get(person_id)

    def request(self, person_id: str) -> None:
        """Start to read a participant's recordings, unless the traces are there."""
        if self.results.study is None or person_id in self._traces:
            return
        if (task := f"reading the recordings of {person_id}") not in {*self.working, *self._failed}:
            self._begin(task, self._read(person_id))

    def reestimate(self) -> None:
        """Start to estimate all participants whose exclusions have changed."""
        for person in self.stale:
            if (task := f"estimating {person}") not in self.working:
                self._begin(task, self._estimate(person))

    async def decide(self, pulse: PulseRecord, action: Action, *, reason: str) -> bool:
        """Exclude or restore a pulse in the study; the numbers wait for :meth:`reestimate`."""
        study = self.results.study
        if study is None:
            return False
        try:
            changed = await asyncio.to_thread(decide, study, pulse, action, reason=reason)
        except JointzError as exc:
            self._say(str(exc))
            return False
        self._stamp = self._file_stamp()
        self._use_study(changed)
        return True

    async def check_study(self) -> None:
        """Follow changes of the exclusions by other pages and programs."""
        stamp = self._file_stamp()
        study = self.results.study
        if study is None or stamp == self._stamp:
            return
        self._stamp = stamp
        try:
            changed = await asyncio.to_thread(open_study, study.root)
        except JointzError as exc:
            self._say(str(exc))
            return
        if changed.sha256 != study.sha256:
            self._say("study.toml was changed. Analyse the study again, and open the new results.")
            return
        self._use_study(changed)

    def compare(self, method: str) -> None:
        """Estimate all participants by another method, on the pulses of the numbers shown."""
        if self.stale:
            self._say("Re-estimate first: the numbers shown are from before the exclusions.")
        elif method in self.results.more_methods():
            for person in self.results.people:
                self._begin(f"estimating {person} by {method}", self._estimate_by(method, person))

    def dismiss(self) -> None:
        """Forget errors, so that failed work may be tried again."""
        self._failed.clear()
        self._say("")

    def _use_study(self, study: Study) -> None:
        self.results = self.results.with_study(study)
        self._failed.clear()
        self._compare_with_study()
        self._say("")

    def _compare_with_study(self) -> None:
        """Find numbers on the pages that are older than the exclusions."""
        self.changed = self.results.changed()
        older = self.results.changed(self.analysis.pulses)
        self.stale = tuple(dict.fromkeys(pulse.participant for pulse in older))

    async def _update_analysis(self) -> None:
        """Compute the analysis that pages show; means over people take a moment."""
        while True:
            results = self.results
            analysis = await asyncio.to_thread(results.current)
            if results is self.results:
                break
        self.analysis = analysis
        self._compare_with_study()

    def _say(self, problem: str) -> None:
        self.problem = problem
        self.version += 1

    def _begin(self, task: str, work: Coroutine[Any, Any, None]) -> None:
        self.working[task] = time.monotonic()
        self.version += 1
        running = asyncio.get_running_loop().create_task(self._run(task, work))
        self._tasks.add(running)
        running.add_done_callback(self._tasks.discard)

    async def _run(self, task: str, work: Coroutine[Any, Any, None]) -> None:
        try:
            await work
        except Exception as exc:  # noqa: BLE001 - or every page would try again without end
            self._failed.add(task)
            bug = f"{type(exc).__name__}: {exc}. This is a bug in jointz."
            self._say(str(exc) if isinstance(exc, JointzError) else bug)
        finally:
            self.working.pop(task, None)
            self.version += 1

    async def _read(self, person: str) -> None:
        """Read until the numbers did not change meanwhile."""
        request, analysis = ReestimationRequest.of(self.results.analysed), None
        while (study := self.results.study) is not None and analysis is not self.analysis:
            analysis = self.analysis
            traces = await self.call(partial(read_traces, study, person, request, analysis))
            self._traces[person] = traces
        while len(self._traces) > _MOST_TRACED:
            del self._traces[next(iter(self._traces))]

    async def _estimate(self, person: str) -> None:
        request = ReestimationRequest.of(self.results.analysed)
        async with self._estimating:
            study, began = self.results.study, time.monotonic()
            if study is None:
                return
            result = await self.call(partial(reestimate, study, person, request))
            self.seconds = time.monotonic() - began
        self.results = self.results.with_result(person, result)
        await self._update_analysis()
        await self._read(person)
        for method in {method for method, other in self.results.others if other == person}:
            self._begin(f"estimating {person} by {method}", self._estimate_by(method, person))

    async def _estimate_by(self, method: str, person: str) -> None:
        request = ReestimationRequest.of(self.results.analysed)
        study = self.results.study
        if study is not None:
            work = partial(estimate_by_method, study, person, request, method=method)
            async with self._estimating:
                cells = await self.call(work)
            self.results = self.results.with_other(method, person, cells)
            await self._update_analysis()

    async def call(self, work: Callable[[], Result]) -> Result:
        """Run work where it blocks no page."""
        try:
            return await asyncio.get_running_loop().run_in_executor(self._pool, work)
        except BrokenProcessPool:  # a worker was killed, most likely because memory ran out
            self._pool = None
            return await asyncio.to_thread(work)

    def _file_stamp(self) -> tuple[int, int] | None:
        study = self.results.study
        with suppress(OSError):
            if study is not None:
                stat = (study.root / FILE).stat()
                return stat.st_mtime_ns, stat.st_size
        return None
