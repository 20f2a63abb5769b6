"""Half-widths of a participant's K, B and J from the pulses so far, beside the wanted ones."""

from dataclasses import asdict, dataclass, replace
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
from jointz.io.study_reader import open_study
from jointz.report.wording import ABSOLUTE
from jointz.results.estimates import relative_half_width
from jointz.results.study_analysis import StudyAnalysis
from jointz.rig.devices.interface import Rig
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
    wish_pct: float | None  # half-width that is wanted; None without a plan
    n_used: int  # pulses used


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


def estimate_so_far(settings: RunSettings, rig: Rig) -> LiveEstimate:
    """Estimate a participant from the logs of a session, as ``jointz analyze`` would.

    Raises DataError if nothing can be read or estimated yet.
    """
    with TemporaryDirectory(dir=_MEMORY if _MEMORY.is_dir() else None) as folder:
        root = Path(folder) / "study"
        write_study_so_far(settings, rig, root)
        study = open_study(root)
        recordings = read_participant(study, rig.wearer.id, {})
    request = participant_settings(
        study, rig.wearer.id, recommended_method(study), resamples=2, seed=0
    )
    result = analyze_participant(
        rig.wearer.id, recordings, replace(request, methods=request.methods[:1])
    )
    cells = result.cells[request.methods[0]]
    analysis = StudyAnalysis(
        cells, log_posteriors=result.log_posteriors, settings={"coupling": request.coupling}
    )
    return LiveEstimate(
        len(result.pulses),
        _minutes_per_pulse(result),
        _values(analysis, settings.protocol.planned_half_width_pct),
        tuple(_messages(result, analysis)),
    )


def _minutes_per_pulse(result: ParticipantResult) -> float | None:
    gaps_s = np.diff(sorted(pulse.onset_s for pulse in result.pulses))
    return float(np.median(gaps_s)) / 60.0 if gaps_s.size else None


def _values(analysis: StudyAnalysis, wishes: PlannedHalfWidths | None) -> tuple[LiveValue, ...]:
    sds = relative_sds(analysis)
    wanted = {(n, point): pct for n, own in (wishes or {}).items() for point, pct in own.items()}

    def half_width_pct(label: str, name: str, point: str) -> float | None:
        pct = 100.0 * relative_half_width(sds.get((label, name, point), np.inf))
        return pct if np.isfinite(pct) else None

    return tuple(
        LiveValue(
            cell.timing_point,
            name,
            half_width_pct(cell.label, name, cell.timing_point),
            wanted.get((name, cell.timing_point)),
            cell.n_used,
        )
        for cell in analysis.cells
        for name in ABSOLUTE
    )


def _messages(result: ParticipantResult, analysis: StudyAnalysis) -> list[str]:
    """Return doubts and failures in words, the most urgent first."""
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
    return [*doubts, *sorted(failures)]
