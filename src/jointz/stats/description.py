"""Descriptive statistics of a study: onset accuracy, strides, fit."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from jointz.core.estimates import CellEstimate
from jointz.core.events import GapRecord, PulseRecord, StrideRecord


def onset_accuracy(pulses: Sequence[PulseRecord]) -> list[dict[str, Any]]:
    """Return measured against planned onset at every timing point.

    Parameters
    ----------
    pulses : sequence of PulseRecord
        All pulses; those without a measured phase do not count.

    Returns
    -------
    list of dict
        ``timing_point``, ``target_pct``, ``n``, ``mean_pct`` and ``sd_pct`` of
        the measured onset, % of the gait cycle.
    """
    groups: dict[tuple[str, float], list[float]] = {}
    for pulse in pulses:
        if pulse.measured_pct is not None and pulse.target_pct is not None:
            error = (pulse.measured_pct - pulse.target_pct + 50.0) % 100.0 - 50.0
            groups.setdefault((pulse.timing_point, pulse.target_pct), []).append(error)
    return [
        {
            "timing_point": name,
            "target_pct": target,
            "n": len(errors),
            "mean_pct": target + float(np.mean(errors)),
            "sd_pct": float(np.std(errors, ddof=1)) if len(errors) > 1 else None,
        }
        for (name, target), errors in sorted(groups.items(), key=lambda item: item[0][1])
    ]


def stride_summary(
    strides: Sequence[StrideRecord], gaps: Sequence[GapRecord]
) -> list[dict[str, Any]]:
    """Return how many strides each recording holds, their mean, and its gaps.

    Parameters
    ----------
    strides : sequence of StrideRecord
        Every stride found.
    gaps : sequence of GapRecord
        Every gap found.

    Returns
    -------
    list of dict
        One a participant, recording and condition.
    """
    groups: dict[tuple[str, str, str], list[StrideRecord]] = {}
    for stride in strides:
        key = (stride.participant, stride.recording, stride.condition)
        groups.setdefault(key, []).append(stride)
    return [_summary(key, rows, gaps) for key, rows in groups.items()]


def vaf_summary(cells: Sequence[CellEstimate]) -> dict[str, float | None]:
    """Return mean, standard deviation and median of the VAF over cells, %.

    Parameters
    ----------
    cells : sequence of CellEstimate
        Those without a fit do not count.
    """
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
