"""Protocol and registry of the methods of ``jointz analyze``.

A method registers by an entry point of the group ``jointz.estimators``: its name is that of the
method, its value an :class:`Estimator` or a class that makes one without arguments. It is loaded
when it is used.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Protocol, runtime_checkable

from jointz.core.events import PulseEstimate, PulseRecord
from jointz.identify.preparation.sources import ParticipantSettings, Source
from jointz.identify.study_kinds import StudyKind
from jointz.results.estimates import CellEstimate
from jointz.results.log_posterior import LogPosterior

GROUP = "jointz.estimators"
_METHODS = "jointz.identify.regression"
#: Method -> estimator of the methods of jointz; pyproject.toml registers the same.
BUILT_IN: Mapping[str, str] = {
    "bayesian": "jointz.identify.walking.bayesian_method:BayesianMethod",
    "dissertation": f"{_METHODS}.cell_regressions:DISSERTATION",
    "pre_pulse": f"{_METHODS}.cell_regressions:PRE_PULSE",
    "matched_strides": f"{_METHODS}.cell_regressions:MATCHED_STRIDES",
    "pilot": f"{_METHODS}.cell_regressions:PILOT",
    "least_squares": f"{_METHODS}.cell_regressions:LEAST_SQUARES",
    "instrumental_variable": f"{_METHODS}.cell_instruments:INSTRUMENTAL_VARIABLE",
    "full_record": f"{_METHODS}.full_record_method:FullRecordMethod",
}


@dataclass(frozen=True, slots=True)
class ParticipantData:
    """A participant's prepared recordings, in walking those of one session and side."""

    participant: str
    sources: Sequence[Source]


@dataclass(frozen=True, slots=True)
class Estimates:
    """Estimates of one method."""

    cells: tuple[CellEstimate, ...]  # one for each timing point, case or group that has a pulse
    pulses: Sequence[PulseRecord]  # all pulses of the data with their final codes
    single: tuple[PulseEstimate, ...] = ()  # estimates from single pulses of a bench
    notes: tuple[str, ...] = ()  # what was not used
    log_posterior: LogPosterior | None = None  # joint posterior of K, B and J of all timing points


@runtime_checkable
class Estimator(Protocol):
    """A method; :class:`~jointz.identify.regression.cell_estimator.CellMethod` does most of it."""

    @property
    def name(self) -> str:
        """The name, as given to ``--method``."""

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of study that it serves: ``walking``, ``bench``."""

    def baseline_for(self, kind: StudyKind) -> str:
        """Return the baseline that it needs unless the study sets another."""

    def estimate(self, data: ParticipantData, settings: ParticipantSettings) -> Estimates:
        """Estimate every timing point; a failure to estimate is a cell with a code."""


class Methods(Mapping[str, Estimator]):
    """All methods by name; those of other packages follow those of jointz."""

    def __getitem__(self, name: str) -> Estimator:
        return _load(_entries()[name])

    def __contains__(self, name: object) -> bool:
        return name in _entries()

    def __iter__(self) -> Iterator[str]:
        return iter(_entries())

    def __len__(self) -> int:
        return len(_entries())

    def serving(self, kind: str) -> tuple[str, ...]:
        """Return the methods for a kind of study."""
        return tuple(name for name, estimator in self.items() if kind in estimator.kinds)


#: The methods; the first is the default.
METHODS = Methods()


@cache
def _entries() -> Mapping[str, EntryPoint]:
    """Return the entry points by method; other packages cannot replace the methods of jointz."""
    built_in = {name: EntryPoint(name, value, GROUP) for name, value in BUILT_IN.items()}
    return built_in | {e.name: e for e in entry_points(group=GROUP) if e.name not in built_in}


@cache
def _load(entry: EntryPoint) -> Estimator:
    loaded = entry.load()
    estimator = loaded() if isinstance(loaded, type) else loaded
    if not isinstance(estimator, Estimator) or estimator.name != entry.name:
        raise TypeError(
            f"{GROUP}: {entry.name} = {entry.value}: expected an Estimator named {entry.name!r} "
            f"(name, kinds, baseline_for, estimate), got {estimator!r}. Correct the entry point."
        )
    return estimator
