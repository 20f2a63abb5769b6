"""Samples that several clocks time, brought onto the clock of the torque."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.interpolate import make_interp_spline

from jointz.core.channels import LEVEL_CHANNELS
from jointz.core.errors import DataError
from jointz.core.study import ChannelSpec, ClockSpec, JoinedSpec, RecordingSpec, Study
from jointz.io.formats.columns import RawTable
from jointz.io.study_files import in_part

#: Longest gap that is interpolated, in sample periods of the clock.
_HOLE_PERIODS = 1.5
#: Events closer together than this give an offset only.
_SHORTEST_SPAN_S = 5.0
_LARGEST_RESIDUAL_S = 0.01  # of an event; more is a mistake in it
_LARGEST_DRIFT = 1e-3  # between two clocks; more is a mistake in the events
#: The clock of the first of these channels is that of the recording.
_LEADING = ("torque", "current", "angle")
#: Signals with edges, over which a spline rings.
_WITH_EDGES = ("ground_reaction_force", "reference")
#: Steps to which time stamps are printed, s.
_PRINTED_S = (1e-2, 1e-3, 1e-4)
#: Least rate of a signal; a lower one has times in another unit.
_LEAST_RATE_HZ = 5.0
_DEGREE = 5  # of a spline; it follows half of the band between 0 and the Nyquist frequency to .1 %
_JITTER = 0.02  # of the steps; a spline overshoots where stamps jitter by more


@dataclass(frozen=True, slots=True)
class ClockSource:
    """Channels of one file that share a clock, and the way of its times to the recording's."""

    study: Study  # of the recording, with the time, rate and layout of this source
    names: tuple[str, ...]  # of the channels
    file: str
    offset_s: float = 0.0
    rate: float = 1.0


@dataclass(frozen=True, slots=True)
class ClockedSamples:
    """Samples in SI with the times of their clock."""

    source: ClockSource
    table: RawTable
    time_s: np.ndarray  # (n,) by the clock of the recording
    channels: Mapping[str, np.ndarray]  # each (n,)
    units: Mapping[str, str]
    labels: Mapping[str, np.ndarray]  # each (n,) of text


def clock_sources(study: Study, entry: RecordingSpec) -> Iterator[ClockSource]:
    """Yield the sources of a recording's channels by clock; ``study`` is that of the recording."""
    joined = entry.joined_channels
    own = {n: c.time for n, c in study.spec.channels.items() if n not in joined}
    for clock in dict.fromkeys([None, *own.values()]):
        names = tuple(n for n, other in own.items() if other == clock)
        source = ClockSource(study, names, entry.file)
        yield source if clock is None else _timed_by(source, clock)
    for one in entry.joined:
        names = tuple(name for name in one.channels if name != "time")
        stamps = in_part(one.channels["time"], entry.part)
        yield ClockSource(_timed(study, stamps, files=one.files), names, one.file, *clock_of(one))


def _timed_by(source: ClockSource, clock: ClockSpec) -> ClockSource:
    if clock.column is None:
        study = _timed(source.study, None, sample_rate_hz=clock.rate_hz)
        return replace(source, study=study, offset_s=clock.start_s)
    stamps = ChannelSpec(column=clock.column, unit=clock.unit)
    return replace(source, study=_timed(source.study, stamps))


def _timed(study: Study, stamps: ChannelSpec | None, **spec: Any) -> Study:
    """Return the study with another channel of time, or with a rate in its place."""
    channels = {n: c for n, c in study.spec.channels.items() if n != "time"}
    if stamps is not None:
        channels["time"] = stamps
    changes = {"channels": channels, "sample_rate_hz": None, **spec}
    return replace(study, spec=study.spec.model_copy(update=changes))


def clock_of(joined: JoinedSpec) -> tuple[float, float]:
    """Return offset (s) and rate that bring a file's times to those of its recording."""
    if joined.offset_s is not None:
        return joined.offset_s, 1.0
    of_recording, of_file = np.array(joined.events_s).T
    if np.ptp(of_file) < _SHORTEST_SPAN_S:
        rate, offset_s = 1.0, float((of_recording - of_file).mean())
    else:
        rate, offset_s = (float(one) for one in np.polyfit(of_file, of_recording, 1))
    if abs(rate - 1.0) > _LARGEST_DRIFT:
        raise DataError(
            f"{joined.file}: by events_s its clock runs {100.0 * (rate - 1.0):+.2g} % off the "
            "recording's, expected at most 0.1 %. Correct the times of the events.",
            path=joined.file,
        )
    off_s = float(np.abs(of_recording - offset_s - rate * of_file).max())
    if off_s > _LARGEST_RESIDUAL_S:
        raise DataError(
            f"{joined.file}: events_s do not fit together: one is {1e3 * off_s:.3g} ms off, "
            f"expected at most {1e3 * _LARGEST_RESIDUAL_S:g} ms. Correct the times of the events.",
            path=joined.file,
        )
    return offset_s, rate


def _leading(parts: Sequence[ClockedSamples]) -> ClockedSamples:
    """Return the samples whose clock is that of the recording: those of the torque."""
    leads = (part for name in _LEADING for part in parts if name in part.channels)
    return next(leads, parts[0])


def on_one_clock(parts: Sequence[ClockedSamples]) -> tuple[ClockedSamples, list[dict[str, Any]]]:
    """Return all samples at the times of the torque's, and what was done as steps of a history.

    Between two samples a signal is interpolated by a spline, a level holds; in holes and beyond
    the ends of a clock there is no value. Samples that share the torque's clock are left as they
    are.
    """
    if len(parts) > 1:
        parts = [_without_padding(part) for part in parts]
    base = _leading(parts)
    others = [part for part in parts if part is not base]
    channels, units, labels = dict(base.channels), dict(base.units), dict(base.labels)
    steps: list[dict[str, Any]] = []
    for part in others:
        _check_order(base, part)
        for name, values in part.channels.items():
            channels[name] = _at_times(part.time_s, values, base.time_s, name)
        # Labels beyond the ends are those at the ends: they cut the recording, and set no times.
        at = np.searchsorted(part.time_s, base.time_s, side="right") - 1
        labels |= {name: texts[np.maximum(at, 0)] for name, texts in part.labels.items()}
        units |= part.units
        steps.append(_step(part))
    return replace(base, channels=channels, units=units, labels=labels), steps


def _without_padding(part: ClockedSamples) -> ClockedSamples:
    """Return samples without the empty rows that pad them to the length of other columns."""
    n = part.time_s.size
    there = np.isfinite([part.time_s, *part.channels.values()]).any(axis=0)
    kept = int(np.flatnonzero(there)[-1]) + 1 if there.any() else n
    if kept == n:
        return part
    return replace(
        part,
        time_s=part.time_s[:kept],
        channels={name: values[:kept] for name, values in part.channels.items()},
        labels={name: texts[:kept] for name, texts in part.labels.items()},
    )


def _step(part: ClockedSamples) -> dict[str, Any]:
    """Return what was done to the samples of a clock; its period is the grain of its lag."""
    steps = np.diff(part.time_s)
    period_s = float(steps[steps <= _HOLE_PERIODS * np.median(steps)].mean())
    return {
        "step": "joined",
        "file": part.source.file,
        "sha256": part.table.sha256,
        "offset_s": part.source.offset_s,
        "rate": part.source.rate,
        "channels": sorted(part.channels),
        "sampled_hz": 1.0 / period_s,
    }


def _check_order(base: ClockedSamples, part: ClockedSamples) -> None:
    for one, other in ((base, part), (part, base)):
        if one.time_s.size < 2 or not (np.diff(one.time_s) > 0.0).all():
            raise DataError(
                f"{one.source.file}: {', '.join(one.channels)}: expected two samples or more whose "
                f"times rise, because {', '.join(other.channels)} have another clock. Repair its "
                "time; where time begins again, give each part a file of its own.",
                path=one.source.file,
            )
    own_s, times = part.time_s, base.time_s
    if own_s[0] > times[-1] or own_s[-1] < times[0]:
        remedy = "offset_s or events_s" if part.source.file != base.source.file else "time"
        raise DataError(
            f"{part.source.file}: {', '.join(part.channels)} lie at {own_s[0]:.6g} to "
            f"{own_s[-1]:.6g} s, {base.source.file} at {times[0]:.6g} to {times[-1]:.6g} s: they "
            f"do not overlap. Correct {remedy}.",
            path=part.source.file,
        )
    rate_hz = 1.0 / float(np.median(np.diff(own_s)))
    if rate_hz < _LEAST_RATE_HZ and not set(part.channels) <= {*LEVEL_CHANNELS}:
        raise DataError(
            f"{part.source.file}: {', '.join(part.channels)}: by its time it is sampled at "
            f"{rate_hz:.3g} Hz, expected at least {_LEAST_RATE_HZ:g} Hz. Give the unit of its time "
            "(ms taken for s?).",
            path=part.source.file,
        )


def _at_times(own_s: np.ndarray, values: np.ndarray, time_s: np.ndarray, name: str) -> np.ndarray:
    """Return a channel at other times, NaN where its own clock has a hole or no sample."""
    found = np.full(time_s.size, np.nan)
    for part in _stretches(own_s, np.isfinite(values)):
        first, last = np.searchsorted(time_s, own_s[part][[0, -1]], side="left")
        last += int(last < time_s.size and time_s[last] == own_s[part.stop - 1])
        wanted = time_s[first:last]
        found[first:last] = _interpolated(own_s[part], values[part], wanted, name)
    return found


def _stretches(own_s: np.ndarray, finite: np.ndarray) -> Iterator[slice]:
    """Yield the unbroken stretches of two samples or more."""
    steps = np.diff(own_s)
    broken = (steps > _HOLE_PERIODS * float(np.median(steps))) | ~(finite[1:] & finite[:-1])
    for a, b in pairwise([0, *(np.flatnonzero(broken) + 1).tolist(), own_s.size]):
        if b - a > 1:
            yield slice(a, b)


def _interpolated(
    own_s: np.ndarray, values: np.ndarray, wanted: np.ndarray, name: str
) -> np.ndarray:
    if name in LEVEL_CHANNELS:
        return np.asarray(values[np.searchsorted(own_s, wanted, side="right") - 1])
    even_s = _even(own_s)
    if name in _WITH_EDGES or even_s is None or own_s.size <= _DEGREE:
        return np.asarray(np.interp(wanted, own_s, values))
    return np.asarray(make_interp_spline(even_s, values, k=_DEGREE)(wanted))


def _even(own_s: np.ndarray) -> np.ndarray | None:
    """Return even stamps, also where they were printed to a step; None where they jitter."""
    steps = np.diff(own_s)
    usual = float(np.median(steps))
    if np.abs(steps - usual).max() <= _JITTER * usual:
        return own_s
    count = np.arange(own_s.size)
    even_s = np.asarray(np.polynomial.Polynomial.fit(count, own_s, 1)(count))
    for step_s in _PRINTED_S:
        printed = np.abs(steps / step_s - np.round(steps / step_s)).max() < _JITTER
        if printed and np.abs(own_s - even_s).max() <= 0.51 * step_s:
            return even_s
    return None
