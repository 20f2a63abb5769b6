"""Angle and torque of a load on a bench: checks, even sampling, noise."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from jointz.core.errors import DataError, EstimationError

#: Fewest samples of a record that a fit can use.
FEWEST_SAMPLES = 50
#: A step this many times the usual one is a gap, not jitter.
_GAP = 3.0
#: Two trials whose sampling steps differ by more than this share were sampled differently.
_SAME_RATE = 0.01
#: Sum of squares of the coefficients of the fourth difference of white noise.
_FOURTH_DIFFERENCE = 70.0
_TRUSTED_SHARE = 0.98
#: Mean of the smallest 98 % of squares over the mean of all, for normal noise.
_TRUSTED_POWER = 0.8697


@dataclass(frozen=True, slots=True)
class BenchTrial:
    """One trial of a load: torque applied, angle and torque recorded on one clock.

    Parameters
    ----------
    time_s : (n,) float, s
        True time stamps; jitter is allowed.
    angle : (n,) float, rad
        Angle of the load.
    torque : (n,) float, N*m
        Measured torque on the load.
    angle_per_torque_sd : float, rad/(N*m)
        Sd of what the torque may still show as angle; it is common to all trials. They are fitted
        once more with so much of it, and what that changes enters the intervals.
    """

    time_s: np.ndarray
    angle: np.ndarray
    torque: np.ndarray
    angle_per_torque_sd: float = 0.0


@dataclass(frozen=True, slots=True)
class EvenRecord:
    """A trial on an even grid."""

    step_s: float  # time between samples
    time_s: np.ndarray  # times of the grid
    angle: np.ndarray  # measured angle, rad
    torque: np.ndarray  # measured torque, N*m
    # share of the power of white noise that fourth differences on the grid retain
    noise_seen: float = 1.0

    def noise_sd(self, values: np.ndarray) -> float:
        """Return the sd of the white noise on angle or torque, as it was before the grid."""
        return white_noise_sd(values) / float(np.sqrt(self.noise_seen))


def even_records(trials: Sequence[BenchTrial]) -> tuple[EvenRecord, ...]:
    """Return trials on even grids, by linear interpolation between true time stamps.

    The step is the mean step of a trial, so that the grid stays on the samples and
    interpolation changes their noise little. It is linear, for both records alike: a
    spline overshoots where stamps lie close together, and its errors would differ
    between a smooth angle and a noisy torque.
    """
    if not trials:
        raise DataError("bench: expected at least one trial, got none. Give the recorded trials.")
    checked = [_checked(trial, f"bench trial {i + 1}") for i, trial in enumerate(trials)]
    records = tuple(_resampled(trial) for trial in checked)
    for i, record in enumerate(records):
        if abs(record.step_s - records[0].step_s) > _SAME_RATE * records[0].step_s:
            raise DataError(
                f"bench trial {i + 1}: expected {1 / records[0].step_s:.5g} Hz as in the first "
                f"trial, got {1 / record.step_s:.5g} Hz. Fit trials of one sampling rate at a time."
            )
    return records


def _checked(trial: BenchTrial, where: str) -> BenchTrial:
    time, angle, torque = (
        np.asarray(x, dtype=float) for x in (trial.time_s, trial.angle, trial.torque)
    )
    if (
        not time.ndim == angle.ndim == torque.ndim == 1
        or not time.size == angle.size == torque.size
    ):
        raise DataError(
            f"{where}: expected time, angle and torque of one length, got shapes {time.shape}, "
            f"{angle.shape} and {torque.shape}. Give one value a sample."
        )
    if time.size < FEWEST_SAMPLES:
        raise DataError(
            f"{where}: expected at least {FEWEST_SAMPLES} samples, got {time.size}. Record longer."
        )
    for name, values in (("time", time), ("angle", angle), ("torque", torque)):
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            raise DataError(
                f"{where}: expected numbers, got {values[bad[0]]} in {name} at sample "
                f"{bad[0] + 1}. Cut the trial before it, or leave the trial out.",
                channel=name,
            )
    _check_time(time, where)
    for name, values in (("angle", angle), ("torque", torque)):
        if np.ptp(values) == 0.0:
            raise EstimationError(
                f"constant_{name}",
                f"{where}: the {name} is {values[0]:g} throughout. Look for a dead sensor, a "
                "locked output or a missing perturbation.",
            )
    return BenchTrial(time, angle, torque)


def _check_time(time: np.ndarray, where: str) -> None:
    steps = np.diff(time)
    backward = np.flatnonzero(steps <= 0)
    if backward.size:
        raise DataError(
            f"{where}: expected time to increase, got {time[backward[0] + 1]:.6g} s after "
            f"{time[backward[0]]:.6g} s at sample {backward[0] + 2}. Sort or separate the trials.",
            channel="time",
        )
    gap = int(np.argmax(steps))
    if steps[gap] > _GAP * np.median(steps):
        raise DataError(
            f"{where}: expected no gaps, got {steps[gap]:.4g} s without samples after "
            f"{time[gap]:.6g} s. Split the trial there.",
            channel="time",
        )


def _resampled(trial: BenchTrial) -> EvenRecord:
    count = trial.time_s.size
    step = float((trial.time_s[-1] - trial.time_s[0]) / (count - 1))
    # A grid in the middle of the jitter: it falls on the samples where the clock is even.
    start = float(np.median(trial.time_s - step * np.arange(count)))
    grid = start + step * np.arange(count)
    grid = grid[(grid >= trial.time_s[0]) & (grid <= trial.time_s[-1])]
    return EvenRecord(
        step_s=step,
        time_s=grid,
        angle=np.interp(grid, trial.time_s, trial.angle),
        torque=np.interp(grid, trial.time_s, trial.torque),
        noise_seen=_noise_seen(grid, trial.time_s),
    )


def _noise_seen(grid: np.ndarray, stamps: np.ndarray) -> float:
    """Return the share of power that fourth differences of white noise keep on the grid.

    Between stamps linear interpolation averages two values: fast noise shrinks, the slow
    noise that a fit meets does not. With 0.1 ms of jitter at 900 Hz a quarter goes.
    """
    left = np.clip(np.searchsorted(stamps, grid, side="right") - 1, 0, stamps.size - 2)
    share = (grid - stamps[left]) / (stamps[left + 1] - stamps[left])
    rows = np.arange(grid.size)
    weights = csr_array(
        (np.append(1.0 - share, share), (np.append(rows, rows), np.append(left, left + 1))),
        shape=(grid.size, stamps.size),
    )
    for _ in range(4):
        weights = weights[1:] - weights[:-1]
    return float((weights**2).sum() / weights.shape[0] / _FOURTH_DIFFERENCE)


def white_noise_sd(values: np.ndarray) -> float:
    """Return the sd of the white noise on a smooth record, out of its fourth differences.

    The largest 2 % of the squared differences are left out, and made up for: corners of
    a pulse and spikes are no noise. Slow noise reads low; signals above a sixth of the
    sampling rate read as noise.
    """
    squares = np.sort(np.diff(values, n=4) ** 2)
    trusted = squares[: max(1, int(_TRUSTED_SHARE * squares.size))]
    return float(np.sqrt(trusted.mean() / (_TRUSTED_POWER * _FOURTH_DIFFERENCE)))
