"""Phase of the gait cycle at any time."""

from dataclasses import dataclass

import numpy as np

from jointz.core.codes import Exclusion
from jointz.gait.strides import LONGEST, Strides

#: Accepted strides that make the mean, and how many of it they may lie back.
_STRIDES = 3
_OLDEST = 10.0


@dataclass(frozen=True, slots=True, eq=False)
class Phase:
    """Predicted phase of the gait cycle at given times."""

    # % of the gait cycle, 0 at heel strike; NaN if unknown. Also given with a ``code``, so that
    # excluded pulses can be counted at their timing point
    pct: np.ndarray
    elapsed_s: np.ndarray  # time since the last true heel strike
    mean_stride_s: np.ndarray  # mean of the last three accepted strides
    # reason not to trust the phase: ``no_recent_strides``, ``spurious_strike`` or
    # ``missing_strike``; "" for none
    code: tuple[str, ...]


def gait_phase(t: np.ndarray, strides: Strides) -> Phase:
    """Predict the phase of the gait cycle at each time from the strides before it.

    The time since the last heel strike over the mean of the last three accepted
    strides, modulo one (DESIGN.md, section 4). Only strides that ended at or
    before the time count. Codes, the first that applies:

    - ``no_recent_strides``: fewer than three accepted strides ended before, or
      the oldest of the three ended more than ten mean strides ago;
    - ``spurious_strike``: the last strike is false, that is, it ends a stride
      coded ``spurious_strike`` and begins none that is accepted. The phase then
      runs on from the last strike that is not false;
    - ``missing_strike``: more than 1.33 mean strides have passed, so a strike
      was due and is missing.
    """
    t = np.atleast_1d(np.asarray(t, dtype=float))
    mean, recent = _mean_stride(t, strides)
    elapsed, false_strike = _since_strike(t, strides)
    conditions = {
        Exclusion.NO_RECENT_STRIDES.value: ~recent,
        Exclusion.SPURIOUS_STRIKE.value: false_strike,
        Exclusion.MISSING_STRIKE.value: elapsed > LONGEST * mean,
    }
    code = np.select(list(conditions.values()), list(conditions), default="")
    return Phase(
        pct=100.0 * np.mod(elapsed / mean, 1.0),
        elapsed_s=elapsed,
        mean_stride_s=mean,
        code=tuple(code.tolist()),
    )


def stride_containing(t: np.ndarray, strides: Strides) -> np.ndarray:
    """Return the index of the stride that holds each time."""
    index = np.searchsorted(strides.strike_s, np.atleast_1d(t), side="right") - 1
    return np.where(index < strides.start_s.size, index, -1)


def measured_phase(t: np.ndarray, strides: Strides) -> np.ndarray:
    """Return the measured phase of each time within its stride, % of the gait cycle."""
    index = stride_containing(t, strides)
    inside = index >= 0
    inside[inside] = strides.accepted[index[inside]]
    pct = np.full(index.shape, np.nan)
    stride = index[inside]
    pct[inside] = 100.0 * (t[inside] - strides.start_s[stride]) / strides.duration_s[stride]
    return pct


def _mean_stride(t: np.ndarray, strides: Strides) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean of the last three accepted strides and whether they are recent."""
    end = strides.end_s[strides.accepted]
    total = np.concatenate([[0.0], np.cumsum(strides.duration_s[strides.accepted])])
    done = np.searchsorted(end, t, side="right")
    known = done >= _STRIDES
    mean = np.full(t.shape, np.nan)
    mean[known] = (total[done[known]] - total[done[known] - _STRIDES]) / _STRIDES
    recent = known.copy()
    recent[known] = t[known] - end[done[known] - _STRIDES] <= _OLDEST * mean[known]
    return mean, recent


def _since_strike(t: np.ndarray, strides: Strides) -> tuple[np.ndarray, np.ndarray]:
    """Return the time since the last true strike and whether a false one came after it."""
    strike = strides.strike_s
    elapsed = np.full(t.shape, np.nan)
    false_strike = np.zeros(t.shape, dtype=bool)
    if strike.size == 0:
        return elapsed, false_strike
    ends_short = np.array(strides.code) == Exclusion.SPURIOUS_STRIKE.value
    false = np.append(False, ends_short) & ~np.append(strides.accepted, False)
    true_before = np.maximum.accumulate(np.where(false, 0, np.arange(strike.size)))
    last = np.searchsorted(strike, t, side="right") - 1
    known = last >= 0
    elapsed[known] = t[known] - strike[true_before[last[known]]]
    false_strike[known] = false[last[known]]
    return elapsed, false_strike
