"""Summaries of the samples of a column and of the stamps of a clock."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from jointz.gait.timestamps import find_gaps, is_uniform, rate_hz
from jointz.inspection.content import Column
from jointz.inspection.inspection_result import SeenClock

_POINTS = 32
_BLOCK = 1 << 20  # samples
_LARGEST_LEVELS = 12
_LEVEL_SHARE = 0.05  # largest number of levels as a share of the samples
_END_SHARE = 0.01  # share of samples at the largest or smallest number of saturated signals
_LONGEST_RUN = 5
_REPEATED_SHARE = 0.5
_LARGE = 1e300  # above it sums and differences may overflow
_SHORTEST = 50  # fewest samples to judge saturation
#: Largest possible numbers of a joint's sensors, by SI unit.
_LARGEST: Mapping[str, float] = {
    "N*m": 5e3, "A": 1e3, "rad": 1e3, "rad/s": 1e5, "N": 1e6, "V": 1e4,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class SignalSummary:
    """Summary of the samples of a column."""

    n: int  # number of samples
    n_missing: int  # number of samples without a finite number; for text, of empty ones
    low: float | None  # smallest finite number, in the unit of the file
    high: float | None  # largest finite number, in the unit of the file
    levels: tuple[str, ...]  # different values of a text, or of few different numbers
    rises: bool  # whether it never decreases and mostly increases
    whole: bool  # whether all numbers are whole
    notes: tuple[str, ...]  # remarks for the user
    # means of equal parts, in the unit of the file; None without a finite number
    outline: tuple[float | None, ...]


def signal_summary(column: Column) -> SignalSummary:
    """Summarise the samples of a column."""
    if column.is_text:
        return _text_summary(column.values)
    values = column.values
    good = np.isfinite(values)
    finite = values if good.all() else values[good]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (None, None)
    before, after = finite[:-1], finite[1:]
    return SignalSummary(
        n=values.size,
        n_missing=int(values.size - finite.size),
        low=low,
        high=high,
        levels=_levels(finite),
        rises=bool(after.size and (after >= before).all() and (after > before).mean() > 0.5),
        whole=bool(finite.size) and all(np.array_equal(b, np.round(b)) for b in _blocks(finite)),
        notes=tuple(_notes(values, finite)),
        outline=_outline(values),
    )


def _text_summary(values: np.ndarray) -> SignalSummary:
    found: dict[str, None] = {}
    for value in values:
        if value and len(found) <= _LARGEST_LEVELS:
            found[str(value)] = None
    missing = int(sum(not v for v in values))
    levels = tuple(found)
    notes = ("constant",) if len(found) == 1 and values.size > 1 else ()
    return SignalSummary(values.size, missing, None, None, levels, False, False, notes, ())  # noqa: FBT003


def _levels(finite: np.ndarray) -> tuple[str, ...]:
    different = finite[:0]
    for block in _blocks(finite):
        different = np.union1d(different, block)
        if different.size > min(_LARGEST_LEVELS, max(2, _LEVEL_SHARE * finite.size)):
            return ()
    return tuple(f"{value:.10g}" for value in different)


def _blocks(values: np.ndarray) -> Iterator[np.ndarray]:
    """Yield parts of a column, so that what is computed of them stays small."""
    return (values[k : k + _BLOCK] for k in range(0, values.size, _BLOCK))


def _outline(values: np.ndarray) -> tuple[float | None, ...]:
    parts = np.array_split(values, min(_POINTS, max(values.size, 1)))
    kept = (part[np.isfinite(part)] for part in parts)
    return tuple(_mean(part) if part.size else None for part in kept)


def _mean(part: np.ndarray) -> float:
    """Return a mean to four digits, without overflow."""
    mean = float((part / part.size).sum()) if np.abs(part).max() > _LARGE else float(part.mean())
    rounded = float(f"{mean:.4g}")
    return rounded if np.isfinite(rounded) else mean


def _notes(values: np.ndarray, finite: np.ndarray) -> list[str]:
    if not finite.size:
        return ["holds no number"]
    notes = []
    endless = int(np.isinf(values).sum())
    if endless:
        notes.append(f"{endless} infinite number(s)")
    if values.size > 1 and finite.min() == finite.max():
        return [*notes, f"constant at {finite[0]:.6g}"]
    if np.unique(finite[:1000]).size > _LARGEST_LEVELS:
        notes += [*_saturated(finite), *_repeated(finite)]
    return notes


def _saturated(finite: np.ndarray) -> list[str]:
    """Return notes about many samples at the largest or smallest number."""
    if finite.size < _SHORTEST:
        return []
    notes = []
    for name, end in (("largest", finite.max()), ("smallest", finite.min())):
        at = finite == end
        if end == 0 or at.mean() < _END_SHARE:
            continue
        longest = _longest_run(at)
        if longest >= _LONGEST_RUN:
            notes.append(
                f"{100 * at.mean():.1f} % of the samples are at the {name} number, {end:.6g}, "
                f"up to {longest} in a row: saturated?"
            )
    return notes


def _longest_run(flags: np.ndarray) -> int:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return int((edges[1::2] - edges[::2]).max()) if edges.size else 0


def _repeated(finite: np.ndarray) -> list[str]:
    """Return a note about samples that repeat the previous one, as from a slower source."""
    moving, part = finite != finite[0], finite
    if moving.sum() > _SHORTEST:
        part = finite[moving.argmax() : moving.size - 1 - moving[::-1].argmax()]
    share = float((part[1:] == part[:-1]).mean()) if part.size > 1 else 0.0
    if share < _REPEATED_SHARE or np.unique(part[:1000]).size < len(part[:1000]) * 0.05:
        return []
    each = 1 / max(1 - share, 1 / part.size)
    return [f"repeats its last value in {100 * share:.0f} % of the samples: its source gives a "
            f"new one about every {each:.1f} samples"]  # fmt: skip


def overflow_note(course: SignalSummary, si_unit: str, factor: float) -> str:
    """Return a sentence about impossibly large numbers of a column, "" if there are none."""
    largest = _LARGEST.get(si_unit)
    ends = [end for end in (course.low, course.high) if end is not None]
    worst = max(ends, key=abs, default=0.0)
    if largest is None or abs(worst) * abs(factor) <= largest:
        return ""
    return f"{worst:.4g} is no possible reading: did the sensor overflow?"


def clock_of(group: str, n: int, source: str, time_s: np.ndarray) -> SeenClock:
    """Summarise the stamps of a clock."""
    samples = np.flatnonzero(np.isfinite(time_s))
    finite = time_s[samples]
    steps = np.diff(finite)
    if not steps.size or not (steps > 0).any():
        return SeenClock(group, source, n)
    usual = float(np.median(steps[steps > 0]))
    back_steps = np.flatnonzero(steps <= 0)
    restarts = [
        int(k) + 1 for k in back_steps if steps[k] < -usual and _rises_after(finite, int(k) + 1)
    ]
    parts = np.split(finite, restarts)
    n_back = len(back_steps) - len(restarts) + int(time_s.size - finite.size)
    gaps = [g for part in parts for g in _gaps(part)]
    inside = steps[(steps > 0) & (steps < 1.75 * usual)]
    longest = max(parts, key=len)
    ordered = len(longest) > 1 and bool((np.diff(longest) > 0).all())
    return SeenClock(
        group,
        source,
        n,
        rate_hz=float(f"{rate_hz(longest) if ordered else 1 / usual:.8g}"),
        start_s=float(finite[0]),
        end_s=float(finite[-1]),
        uniform=ordered and not gaps and is_uniform(longest),
        jitter_ms=float(f"{1e3 * inside.std():.4g}") if inside.size else None,
        gaps=tuple(gaps),
        restarts=tuple(map(int, samples[restarts])),
        n_back=n_back,
    )


def _rises_after(time: np.ndarray, at: int) -> bool:
    behind = time[at : at + 3]
    return bool(behind.size > 1 and (np.diff(behind) > 0).all())


def _gaps(part: np.ndarray) -> list[tuple[float, float]]:
    if len(part) < 3 or (np.diff(part) <= 0).any():
        return []
    return [(float(a), float(b)) for a, b in find_gaps(part)]
