"""Strides between heel strikes, accepted or rejected."""

from collections import deque
from dataclasses import dataclass, field
from statistics import median

import numpy as np

from jointz.core.codes import Exclusion
from jointz.core.errors import DataError

#: Accepted durations, as multiples of the expected one.
SHORTEST, LONGEST = 0.75, 1.33

#: Accepted strides that make the expected duration, and agreeing rejected ones that restart it.
_MEMORY = 5

#: A hole shorter than this share of the expected stride leaves the stride standing.
_GAP_SHARE = 0.15


@dataclass(frozen=True, slots=True, eq=False)
class Strides:
    """Consecutive strides, each from one heel strike to the next."""

    start_s: np.ndarray  # heel strike at the start of each stride, (n,)
    duration_s: np.ndarray  # time to the next heel strike, (n,)
    accepted: np.ndarray  # whether each stride is accepted: its ``code`` is ""
    # whether a hole in the time stamps, of any length, overlaps each stride
    touches_gap: np.ndarray
    # reason for exclusion, a code of :class:`jointz.core.codes.Exclusion`; "" if accepted
    code: tuple[str, ...]
    detail: tuple[str, ...]  # details of the code, and of holes in accepted strides
    # listed heel strikes too soon after another, which bound no stride, s
    spurious_s: np.ndarray = field(default_factory=lambda: np.empty(0))

    @property
    def strike_s(self) -> np.ndarray:
        """Heel strikes that bound the strides, (n + 1,) s; empty without a stride."""
        if self.start_s.size == 0:
            return np.empty(0)
        return np.append(self.start_s, self.start_s[-1] + self.duration_s[-1])

    @property
    def end_s(self) -> np.ndarray:
        """Heel strike that ends each stride, (n,) s."""
        return self.strike_s[1:]


def find_strides(strike_s: np.ndarray, gaps: np.ndarray) -> Strides:
    """Cut a recording into strides and accept or reject each.

    A stride is accepted when it lasts 0.75 to 1.33 times the median of the last
    five accepted strides (at the start: the median of all intervals counts as
    one) and no hole lies inside. Too long is ``missing_strike``, too short
    ``spurious_strike``: a false strike inside a stride makes two short strides.
    A hole of 0.15 expected strides or more is ``gap``, whatever the duration; it neither
    moves nor restarts the band. After five rejected strides in a row that lie
    within 0.75 to 1.33 of their own median, the cadence has changed for good:
    the band restarts at that median, and the five stay rejected.
    """
    strike_s = np.asarray(strike_s, dtype=float)
    duration = np.diff(strike_s)
    if not np.all(duration > 0):
        at = int(np.flatnonzero(~(duration > 0))[0])
        raise DataError(
            f"heel strikes must increase, got {strike_s[at + 1]:.6g} s after {strike_s[at]:.6g} s. "
            "Sort the strikes, and separate trials whose time restarts."
        )
    longest_gap = _longest_gap(strike_s, np.asarray(gaps, dtype=float).reshape(-1, 2))
    verdicts = _judge(duration, longest_gap)
    return Strides(
        start_s=strike_s[:-1],
        duration_s=duration,
        accepted=np.array([code == "" for code, _ in verdicts], dtype=bool),
        touches_gap=longest_gap > 0,
        code=tuple(code for code, _ in verdicts),
        detail=tuple(detail for _, detail in verdicts),
    )


class _Band:
    """The expected duration, following the walker."""

    def __init__(self, seed: float) -> None:
        self._recent = deque([seed], maxlen=_MEMORY)
        self._rejected: deque[float] = deque(maxlen=_MEMORY)

    @property
    def expected(self) -> float:
        return median(self._recent)

    def accept(self, duration: float) -> None:
        self._recent.append(duration)
        self._rejected.clear()

    def reject(self, duration: float) -> None:
        self._rejected.append(duration)
        middle = median(self._rejected)
        agree = all(SHORTEST <= d / middle <= LONGEST for d in self._rejected)
        if len(self._rejected) == _MEMORY and agree:
            self._recent = deque([middle], maxlen=_MEMORY)
            self._rejected.clear()


def _judge(duration: np.ndarray, longest_gap: np.ndarray) -> list[tuple[str, str]]:
    if duration.size == 0:
        return []
    band = _Band(float(np.median(duration)))
    verdicts = []
    for length, gap in zip(duration.tolist(), longest_gap.tolist(), strict=True):
        expected = band.expected
        hole = f"gap of {gap:.3f} s" if gap else ""
        if gap >= _GAP_SHARE * expected:
            verdicts.append((Exclusion.GAP.value, hole))
            continue
        code, detail = _by_duration(length, expected)
        verdicts.append((code, "; ".join(filter(None, [detail, hole]))))
        if code:
            band.reject(length)
        else:
            band.accept(length)
    return verdicts


def _by_duration(length: float, expected: float) -> tuple[str, str]:
    ratio = length / expected
    if ratio > LONGEST:
        return Exclusion.MISSING_STRIKE.value, f"{ratio:.1f} x {expected:.2f} s"
    if ratio < SHORTEST:
        return Exclusion.SPURIOUS_STRIKE.value, f"{ratio:.2f} x {expected:.2f} s"
    return "", ""


def _longest_gap(strike_s: np.ndarray, gaps: np.ndarray) -> np.ndarray:
    """Return the longest gap that overlaps each stride, 0 without one."""
    length = gaps[:, 1] - gaps[:, 0]
    first = np.searchsorted(gaps[:, 1], strike_s[:-1], side="right")
    after = np.searchsorted(gaps[:, 0], strike_s[1:], side="left")
    return np.array(
        [length[a:b].max(initial=0.0) for a, b in zip(first, after, strict=True)], dtype=float
    )
