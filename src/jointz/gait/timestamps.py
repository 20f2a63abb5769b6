"""Time stamps of a recording: rate, gaps, unbroken stretches, uniform grids.

The nominal rate of a recording is never assumed; everything here follows from
the time stamps that were logged. Jittered stamps are resampled linearly, not
by spline, and never across a hole (SCIENCE.md, section 4).
"""

import numpy as np

#: A step longer than this many median steps is a hole.
_GAP_STEPS = 1.75

#: Steps this far from the median are jitter, as a share of the median.
_JITTER = 0.02

#: A long step that this share of all steps reach is the clock's habit, not a hole.
_HABIT = 0.05
_HABIT_COUNT = 10


def rate_hz(time: np.ndarray) -> float:
    """Return the sampling rate: from the mean step of an even clock, else the median one."""
    steps = np.diff(time)
    if _even(steps, 1.0 + 2 * _JITTER):
        return steps.size / float(time[-1] - time[0])  # no digit lost to rounded stamps
    return 1.0 / float(np.median(steps))


def longest_step_s(time: np.ndarray) -> float:
    """Return the longest step between samples that is not a gap.

    It is 1.75 median steps. A clock that rounds its stamps (900 Hz written in
    whole milliseconds) or alternates short and long periods has long steps that
    are no holes: where more than one step in twenty, and at least ten, are long,
    1.75 of these are allowed.
    """
    steps = np.diff(time)
    if _even(steps, _GAP_STEPS):
        return _GAP_STEPS * float(steps.mean())
    usual = float(np.median(steps))
    rank = steps.size - 1 - max(_HABIT_COUNT, int(_HABIT * steps.size))
    if rank > 0:
        usual = max(usual, float(np.partition(steps, rank)[rank]))
    return _GAP_STEPS * usual


def _even(steps: np.ndarray, ratio: float) -> bool:
    """Tell whether no step is longer than ``ratio`` times the shortest."""
    return bool(steps.size) and float(steps.max()) <= ratio * float(steps.min())


def find_gaps(time: np.ndarray) -> np.ndarray:
    """Return the gaps in the time stamps, (n, 2): last sample before and first after, s."""
    if len(time) < 2:
        return np.empty((0, 2))
    steps = np.diff(time)
    if _even(steps, _GAP_STEPS):
        return np.empty((0, 2))
    at = np.flatnonzero(steps > longest_step_s(time))
    return np.column_stack([time[at], time[at + 1]])


def stretches(time: np.ndarray, finite: np.ndarray) -> list[slice]:
    """Cut a recording into its longest unbroken stretches."""
    if len(time) > 1 and finite.all() and _even(np.diff(time), _GAP_STEPS):
        return [slice(0, len(time))]
    good = np.flatnonzero(finite)
    if good.size == 0:
        return []
    broken = np.diff(good) > 1
    if len(time) > 1:
        broken |= np.diff(time[good]) > longest_step_s(time)
    cuts = np.flatnonzero(broken)
    first = good[np.concatenate([[0], cuts + 1])]
    last = good[np.concatenate([cuts, [good.size - 1]])]
    return [slice(int(a), int(b) + 1) for a, b in zip(first, last, strict=True)]


def is_uniform(time: np.ndarray, *, step_s: float | None = None) -> bool:
    """Tell whether every step is within 2 % of the expected one, and none is lost over time.

    A clock that drifts by more than a sample against an even one is not uniform,
    however even its single steps are.
    """
    if len(time) < 2:
        return True
    steps = np.diff(time)
    expected = float(np.median(steps)) if step_s is None else step_s
    if max(steps.max() - expected, expected - steps.min()) > _JITTER * expected:
        return False
    late = expected * np.arange(len(time))
    np.subtract(time - time[0], late, out=late)
    return bool(np.ptp(late) <= expected)


def resample_stretch(
    time: np.ndarray, values: np.ndarray, *, step_s: float | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Put one unbroken stretch on a uniform grid, linearly.

    A stretch whose steps are all within 2 % of the wanted one is returned as it
    is. Linear interpolation low-passes white noise a little and never
    overshoots; a spline through jittered stamps does (SCIENCE.md, section 4).
    """
    if len(time) < 2 or is_uniform(time, step_s=step_s):
        return time, values
    step = float(np.median(np.diff(time))) if step_s is None else step_s
    count = int((time[-1] - time[0]) / step * (1.0 + 1e-12) + 1e-9) + 1
    grid = time[0] + step * np.arange(count)
    rows = np.asarray(values, dtype=float).reshape(-1, len(time))
    resampled = np.stack([np.interp(grid, time, row) for row in rows])
    return grid, resampled.reshape(*np.shape(values)[:-1], count)
