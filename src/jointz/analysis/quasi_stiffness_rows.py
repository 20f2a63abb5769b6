"""Rows of ``quasi_stiffness.csv``, for people who were not perturbed."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.special import stdtrit

from jointz.identify.over_cycle.stride_curves import StrideCurves
from jointz.results.statistics.quasi_stiffness_fit import QuasiStiffness
from jointz.stats.quasi_stiffness import quasi_stiffness

LEVEL = 0.95
#: Fewer strides than this give no interval.
_FEWEST_STRIDES = 5


def quasi_stiffness_rows(
    curves: Sequence[StrideCurves], timing_points: Mapping[str, float]
) -> list[dict[str, Any]]:
    """Return the slopes and secants of every participant's mean stride.

    Intervals are t intervals of the delete-one jackknife over strides. They are those of the mean
    stride, assume independent strides, which consecutive ones are not quite, and do not include
    errors of motion capture and inverse dynamics.
    """
    return [row for one in curves for row in _rows(one, timing_points)]


def _rows(curves: StrideCurves, timing_points: Mapping[str, float]) -> Iterator[dict[str, Any]]:
    mean = curves.angle.mean(axis=0), curves.moment.mean(axis=0)
    whole = _of_stride(*mean, timing_points)
    halves = _half_widths(curves, timing_points)
    for estimate, half in zip(whole.estimates, halves, strict=True):
        value = estimate.value
        low, high = (None, None) if value is None or half is None else (value - half, value + half)
        yield {
            "participant": curves.participant,
            "side": curves.side,
            "timing_point": estimate.timing_point,
            "onset_gait_pct": estimate.onset_gait_pct,
            "measure": estimate.measure,
            "value": value,
            "unit": "N*m/rad",
            "ci_low": low,
            "ci_high": high,
            "ci_level": LEVEL,
            "r_squared": estimate.r_squared,
            "angle_range_rad": estimate.angle_range_rad,
            "n_strides": len(curves.angle),
            "status": estimate.status,
            "doubts": " ".join(estimate.doubts),
            "session": curves.session,
        }


def _of_stride(
    angle: np.ndarray, moment: np.ndarray, timing_points: Mapping[str, float]
) -> QuasiStiffness:
    return quasi_stiffness(angle, moment, timing_points=timing_points, moment_unit="N*m")


def _half_widths(
    curves: StrideCurves, timing_points: Mapping[str, float]
) -> Sequence[float | None]:
    """Return half of each interval; None if strides are too few or a value is missing."""
    n = len(curves.angle)
    n_estimates = 3 * len(timing_points)
    if n < _FEWEST_STRIDES:
        return [None] * n_estimates
    means = (
        (n * values.mean(axis=0) - values) / (n - 1) for values in (curves.angle, curves.moment)
    )
    left_out = np.array(
        [
            [
                np.nan if e.value is None else e.value
                for e in _of_stride(angle, moment, timing_points).estimates
            ]
            for angle, moment in zip(*means, strict=True)
        ]
    )
    errors = np.sqrt((n - 1) / n * ((left_out - left_out.mean(axis=0)) ** 2).sum(axis=0))
    halves = float(stdtrit(n - 1, (1.0 + LEVEL) / 2.0)) * errors
    return [float(half) if np.isfinite(half) else None for half in halves]
