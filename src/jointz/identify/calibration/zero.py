"""Angle that the goniometer shows at the joint's true zero."""

import numpy as np

from jointz.identify.calibration.calibration_step import (
    RefusedError,
    calibration_step,
    checked_channels,
    step_series,
)
from jointz.identify.calibration.steady_fit import linear_fit
from jointz.results.bench.calibration_failure import CalibrationFailure
from jointz.results.bench.calibration_fit import CalibrationFit, decided

#: The angle may move so much over the record before it counts as drift, rad.
_DRIFT_RAD = np.radians(0.5)
#: Means of a second may differ so much before it counts as movement, rad.
_STILL_RAD = np.radians(1.0)
_CLEAR_SDS = 4.0
_LARGEST_SD_RAD = float(np.radians(0.5))
_SECOND_S, _SHORTEST_S = 1.0, 5.0
_METHOD = "mean of the record; sd from means of blocks longer than the noise is correlated"


@calibration_step("zero", "angle_zero_rad")
def fit_zero(time: np.ndarray, angle: np.ndarray) -> CalibrationFit:
    """Estimate the angle that the goniometer shows while the joint rests at its zero.

    No record tells how near the posture was to the anatomical zero: that is not in the sd.
    """
    time, angle = checked_channels(time, angle=angle)
    duration_s = float(time[-1] - time[0])
    if duration_s < _SHORTEST_S:
        detail = f"expected {_SHORTEST_S:g} s or more, found {duration_s:.2g} s"
        raise RefusedError(CalibrationFailure.TOO_SHORT, detail)
    centred = time - time.mean()
    _check_still(time, angle - np.polynomial.Polynomial.fit(centred, angle, 1)(centred))
    line = linear_fit(time, angle, np.column_stack([np.ones(time.size), centred]))
    moved = duration_s * line.values[1]
    moved_sd = duration_s * line.sd(1)
    if abs(moved) > max(_DRIFT_RAD, _CLEAR_SDS * moved_sd):
        detail = f"the angle moves by {np.degrees(moved):.2g} deg over the record"
        raise RefusedError(CalibrationFailure.DRIFT, detail)
    level = linear_fit(time, angle, np.ones((time.size, 1)))
    clear = max(abs(moved) - 2.0 * moved_sd, 0.0)  # what noise alone does not explain
    parts = {"noise": level.sd(0), "drift": clear / np.sqrt(12.0)}
    value = float(level.values[0])
    return CalibrationFit(
        step="zero",
        entries=(decided("angle_zero_rad", value, parts, largest_sd=_LARGEST_SD_RAD),),
        method=_METHOD,
        n_samples=time.size,
        notes=("How near the posture was to the anatomical zero is not in the sd.",),
        settings={"n_blocks": level.n_blocks},
        series=step_series(
            time,
            np.degrees(angle),
            np.full(time.size, np.degrees(value)),
            x_label="time (s)",
            y_label="angle shown (deg)",
        ),
    )


def _check_still(time: np.ndarray, angle: np.ndarray) -> None:
    """Refuse a joint that moved: medians of a second that differ by more than noise can."""
    seconds = ((time - time[0]) / _SECOND_S).astype(int)
    counts = np.bincount(seconds)
    full = np.flatnonzero(counts >= np.median(counts) / 2)
    apart = float(np.ptp([np.median(angle[seconds == second]) for second in full]))
    if apart > _STILL_RAD:
        detail = f"means of a second differ by {np.degrees(apart):.2g} deg"
        raise RefusedError(CalibrationFailure.NOT_STILL, detail)
