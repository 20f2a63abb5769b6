"""Half-widths of a participant's K, B and J from the pulses so far, beside the wanted ones."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np

from jointz.analysis.page.uncertainty_section import relative_sds
from jointz.analysis.participant_jobs import (
    participant_settings,
    read_participant,
    recommended_method,
)
from jointz.core.codes import Doubt
from jointz.core.study import PlannedHalfWidths
from jointz.identify.participant import ParticipantResult, analyze_participant
from jointz.identify.walking.information import PULSES
from jointz.identify.walking.posterior import LastFit
from jointz.io.study_reader import open_study
from jointz.report.wording import ABSOLUTE, SYMBOLS
from jointz.results.estimates import CellEstimate, relative_half_width
from jointz.results.study_analysis import StudyAnalysis
from jointz.rig.devices.interface import Rig
from jointz.rig.experiment.files.journal import Event
from jointz.rig.live_estimates.study_so_far import write_study_so_far
from jointz.rig.session.run_settings import RunSettings

#: A disk in memory: forcing recordings to a real one would hold up the log of the session.
_MEMORY: Final = Path("/dev/shm")


@dataclass(frozen=True, slots=True)
class LiveValue:
    """One parameter at one timing point."""

    timing_point: str
    parameter: str
    half_width_pct: float | None  # half of the 95 % interval, % of the value; None: not known
    least_pct: float | None  # half-width that no number of pulses would go below
    wish_pct: float | None  # half-width that is wanted; None without a plan
    n_used: int  # pulses used

    @property
    def holds(self) -> bool:
        """True if the half-width is as narrow as wished, or nothing is wished."""
        now = self.half_width_pct
        return self.wish_pct is None or (now is not None and now <= self.wish_pct)

    @property
    def out_of_reach(self) -> bool:
        """True if no number of pulses would fulfil the wish."""
        least, wish = self.least_pct, self.wish_pct
        return wish is not None and least is not None and least >= wish


@dataclass(frozen=True, slots=True)
class LiveEstimate:
    """Estimate from the pulses so far."""

    n_pulses: int  # pulses recorded, those excluded too
    minutes_per_pulse: float | None  # median time from pulse to pulse; None for fewer than two
    values: tuple[LiveValue, ...]
    messages: tuple[str, ...]  # doubts, failures and notes, for the operator

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for JSON."""
        return asdict(self)


def estimate_so_far(
    settings: RunSettings,
    rig: Rig,
    *,
    question: Event | None = None,
    last_fit: LastFit | None = None,
) -> LiveEstimate:
    """Estimate a participant from the logs of a session, as ``jointz analyze`` would.

    With the question of a decision, from what stood in journal and log when it was asked. With the
    last fit of the same session, the search begins there and tries one hypothesis.
    Raises DataError if nothing can be read or estimated yet.
    """
    with TemporaryDirectory(dir=_MEMORY if _MEMORY.is_dir() else None) as folder:
        root = Path(folder) / "study"
        write_study_so_far(settings, rig, root, question=question)
        study = open_study(root)
        recordings = read_participant(study, rig.wearer.id, {})
    request = participant_settings(
        study, rig.wearer.id, recommended_method(study), resamples=2, seed=0
    )
    result = analyze_participant(
        rig.wearer.id, recordings, replace(request, methods=request.methods[:1], last_fit=last_fit)
    )
    cells = result.cells[request.methods[0]]
    analysis = StudyAnalysis(
        cells, log_posteriors=result.log_posteriors, settings={"coupling": request.coupling}
    )
    values = _values(analysis, settings.protocol.wishes)
    return LiveEstimate(
        len(result.pulses),
        _minutes_per_pulse(result),
        values,
        tuple(_messages(result, analysis, values)),
    )


def _minutes_per_pulse(result: ParticipantResult) -> float | None:
    gaps_s = np.diff(sorted(pulse.onset_s for pulse in result.pulses))
    return float(np.median(gaps_s)) / 60.0 if gaps_s.size else None


def _values(analysis: StudyAnalysis, wishes: PlannedHalfWidths | None) -> tuple[LiveValue, ...]:
    sds = relative_sds(analysis)
    wanted: dict[tuple[str, str], float] = {
        (n, point): pct for n, own in (wishes or {}).items() for point, pct in own.items()
    }
    values = []
    for cell, name in product(analysis.cells, ABSOLUTE):
        point = cell.timing_point
        sd = sds.get((cell.label, name, point), np.inf)
        left = np.sqrt(max(sd**2 - _by_pulses(cell, name) ** 2, 0.0))
        now, least = (100.0 * relative_half_width(one) for one in (sd, left))
        known = bool(np.isfinite(now))
        values.append(
            LiveValue(
                point,
                name,
                now if known else None,
                least if known else None,
                wanted.get((name, point)),
                cell.n_used,
            )
        )
    return tuple(values)


def _by_pulses(cell: CellEstimate, name: str) -> float:
    """Return the relative sd that endless pulses would take away.

    Twice as many take away half of its square.
    """
    estimate, parts = cell.parameter(name), cell.through_instruments.get(name, {})
    if estimate is None or not estimate.unbounded:
        return 0.0
    return float(np.sqrt(2.0)) * parts.get(PULSES, 0.0) / abs(estimate.unbounded)


def _messages(
    result: ParticipantResult, analysis: StudyAnalysis, values: Sequence[LiveValue]
) -> list[str]:
    """Return doubts, failures and wishes out of reach in words, the most urgent first."""
    failures = {
        f"{cell.timing_point}: {p.status.partition(':')[2].replace('_', ' ')}"
        for cell in analysis.cells
        for p in cell.parameters
        if p.status.startswith("failed:")
    }
    doubts = [
        text
        for posterior in result.log_posteriors
        for text in (
            *(found.advice for found in posterior.unlikely),
            *(Doubt(code).meaning for code in posterior.doubts),
        )
    ]
    return [*doubts, *sorted(failures), *_out_of_reach(values)]


def _out_of_reach(values: Sequence[LiveValue]) -> Iterator[str]:
    """Say which wishes no number of pulses would fulfil."""
    for value in values:
        if value.out_of_reach and value.wish_pct is not None and value.least_pct is not None:
            letter = SYMBOLS[ABSOLUTE.index(value.parameter)]
            yield (
                f"{value.timing_point}: pulses alone bring {letter} to ±{value.least_pct:.0f} % at "
                f"best, and ±{value.wish_pct:.0f} % is wanted: calibrate, or add a sensor"
            )
