"""Descriptive statistics of a study: onset accuracy, strides, fit."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from jointz.core.events import GapRecord, PulseRecord, StrideRecord
from jointz.core.gait_phases import phase_difference
from jointz.core.grouping import by_key
from jointz.results.estimates import CellEstimate


def onset_errors(pulses: Sequence[PulseRecord]) -> dict[tuple[str, float], np.ndarray]:
    """Return measured minus planned onset of the pulses at every timing point."""
    groups: dict[tuple[str, float], list[float]] = {}
    for pulse in pulses:
        if pulse.target_pct is not None:
            measured = np.nan if pulse.measured_pct is None else pulse.measured_pct
            error = phase_difference(measured, pulse.target_pct)
            groups.setdefault((pulse.timing_point, pulse.target_pct), []).append(error)
    return {key: np.array(groups[key]) for key in sorted(groups, key=lambda key: key[1])}


def onset_accuracy(pulses: Sequence[PulseRecord]) -> list[dict[str, Any]]:
    """Return measured against planned onset at every timing point."""
    rows = []
    for (name, target), errors in onset_errors(pulses).items():
        known = errors[~np.isnan(errors)]
        rows.append(
            {
                "timing_point": name,
                "target_pct": target,
                "n": known.size,
                "n_missing": errors.size - known.size,
                "mean_pct": target + float(known.mean()) if known.size else None,
                "sd_pct": float(known.std(ddof=1)) if known.size > 1 else None,
            }
        )
    return rows


def stride_summary(
    strides: Sequence[StrideRecord], gaps: Sequence[GapRecord]
) -> list[dict[str, Any]]:
    """Return how many strides each recording holds, their mean, and its gaps."""
    groups = by_key(((s.participant, s.recording, s.condition), s) for s in strides)
    return [_summary(key, rows, gaps) for key, rows in groups.items()]


def vaf_summary(cells: Sequence[CellEstimate]) -> dict[str, float | None]:
    """Return mean, standard deviation and median of the VAF over cells, %."""
    vaf = [cell.vaf_pct for cell in cells if cell.vaf_pct is not None]
    return {
        "mean_pct": float(np.mean(vaf)) if vaf else None,
        "sd_pct": float(np.std(vaf, ddof=1)) if len(vaf) > 1 else None,
        "median_pct": float(np.median(vaf)) if vaf else None,
    }


def _summary(
    key: tuple[str, str, str], strides: Sequence[StrideRecord], gaps: Sequence[GapRecord]
) -> dict[str, Any]:
    lengths = [s.duration_s for s in strides if not s.code]
    ends = [s.start_s for s in strides] + [s.start_s + s.duration_s for s in strides]
    holes = [g.duration_s for g in gaps if (g.participant, g.recording) == key[:2]]
    return {
        "participant": key[0],
        "recording": key[1],
        "condition": key[2],
        "n_strikes": len({round(end, 6) for end in ends}),
        "n_accepted": len(lengths),
        "n_rejected": len(strides) - len(lengths),
        "mean_s": float(np.mean(lengths)) if lengths else None,
        "sd_s": float(np.std(lengths, ddof=1)) if len(lengths) > 1 else None,
        "n_gaps": len(holes),
        "longest_gap_s": max(holes, default=0.0),
    }
