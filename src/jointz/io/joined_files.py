"""Files that another device wrote by its own clock, joined to a recording after the experiment."""

from collections.abc import Collection
from typing import Any

import numpy as np

from jointz.core.channels import is_turned
from jointz.core.errors import DataError
from jointz.core.study import JoinedSpec, RecordingSpec, Study
from jointz.io.column_units import unit_in_study
from jointz.io.formats.columns import RawTable, check_samples
from jointz.io.formats.registry import read_table
from jointz.io.study_files import named_as_written

#: Nothing is filled over a hole of more than this many of a file's own sample periods.
_HOLE_PERIODS = 1.5
#: Events closer together than this give an offset only.
_SHORTEST_SPAN_S = 5.0
_LARGEST_RESIDUAL_S = 0.01  # of an event; more is a mistake in it
_LARGEST_DRIFT = 1e-3  # between two clocks; more is a mistake in the events

#: Channels on the time of the recording, their units, and what was done.
Joined = tuple[dict[str, np.ndarray], dict[str, str], tuple[dict[str, Any], ...]]


def join_files(
    study: Study, entry: RecordingSpec, time_s: np.ndarray, *, taken: Collection[str]
) -> Joined:
    """Return what the joined files of a recording hold, at the times of its samples.

    Between two samples a value is interpolated; in holes of a file and beyond its ends it is NaN.
    """
    channels: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    history: list[dict[str, Any]] = []
    if entry.joined and not (np.diff(time_s) > 0.0).all():
        raise DataError(
            f"{entry.file}: its time does not rise throughout, so that no other file can be joined "
            "to it. Give each of its parts a file of its own.",
            path=entry.file,
        )
    for joined in entry.joined:
        # Where lines are skipped in the recording, they need not be in the other device's file.
        with named_as_written(study.root, joined.file) as path:
            columns = [one.column for one in joined.channels.values()]
            table = read_table(path, numeric=columns, files=joined.files)
            check_samples(path, table)
        found, units_of_file = _in_si(study, entry, joined, table)
        own_s = found.pop("time")
        if own_s.size < 2 or not (np.diff(own_s) > 0.0).all():
            raise DataError(
                f"{joined.file}: expected two samples or more whose times rise. Repair its time.",
                path=joined.file,
            )
        offset_s, rate = clock_of(joined)
        placed_s = offset_s + rate * own_s
        if twice := sorted(set(found) & {*taken, *channels}):
            raise DataError(
                f"{joined.file}: {', '.join(twice)}: {entry.file}, or another file joined to "
                "it, has the channel too. Leave one of them out.",
                path=joined.file,
            )
        if placed_s[0] > time_s[-1] or placed_s[-1] < time_s[0]:
            raise DataError(
                f"{joined.file}: by offset or events it lies at {placed_s[0]:.6g} to "
                f"{placed_s[-1]:.6g} s, {entry.file} at {time_s[0]:.6g} to {time_s[-1]:.6g} s: "
                "they do not overlap. Correct offset_s or events_s.",
                path=joined.file,
            )
        channels |= {name: _resampled(placed_s, one, time_s) for name, one in found.items()}
        units |= units_of_file
        history.append(
            {
                "step": "joined",
                "file": joined.file,
                "sha256": table.sha256,
                "offset_s": offset_s,
                "rate": rate,
            }
        )
    return channels, units, tuple(history)


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


def _in_si(
    study: Study, entry: RecordingSpec, joined: JoinedSpec, table: RawTable
) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    values, units = {}, {}
    for name, channel in joined.channels.items():
        unit = unit_in_study(study.spec, entry, (name, channel), table.units, file=joined.file)
        sign = -1.0 if is_turned(channel.positive, study.spec.positive, on_device=False) else 1.0
        own = np.asarray(table.columns[str(channel.column)], dtype=float)
        values[name] = sign * (unit.factor * own + unit.offset)
        units[name] = unit.si_unit
    return values, units


def _resampled(own_s: np.ndarray, values: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    found = np.interp(time_s, own_s, values, left=np.nan, right=np.nan)
    step_s = np.diff(own_s)
    for before in np.flatnonzero(step_s > _HOLE_PERIODS * float(np.median(step_s))):
        found[(time_s > own_s[before]) & (time_s < own_s[before + 1])] = np.nan
    return np.asarray(found)
