"""Problems of a recording: pulses, direction of torque, obstacles to an analysis."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from jointz.core.recording import build_recording
from jointz.core.study import FilesSpec
from jointz.core.units import si_unit_of
from jointz.gait.sample_rate import (
    LONGEST_S,
    SHORTEST_S,
    format_rates,
    is_walking_stride,
    median_stride_s,
    rates_of_strides,
)
from jointz.identify.preparation.pulses import pulses_from_angle, runs_of
from jointz.inspection.content import GUESSED_SAMPLES
from jointz.inspection.guess import Assignment, Assignments, InspectedColumn, in_seconds, si_of
from jointz.inspection.inspection_result import SeenClock
from jointz.inspection.names import channel_scores, word_set
from jointz.inspection.pulse_columns import OwnPulses, PulseColumns, own_pulses
from jointz.inspection.signs import (
    clearness,
    is_clear,
    is_mostly_at_rest,
    kind_of_motion,
    repeat_s,
    responses,
    step_of,
    torque_side,
)

_FEWEST_PULSES = 3
_LEVEL_SHARE = 0.1  # of its span, within which the levels of a trigger lie
_CUTOFF_HZ = 20.0
FEWEST_SAMPLES = 100
_LONGEST_LIST = 3
_LATER_S = 0.05  # after an onset: the torque has risen
_MOST_ON = 0.25  # share of samples in pulses: a footswitch is on for longer
_TRIGGERS = word_set("trigger trig ttl sync marker digital")
_MOST_PULSES = 200  # that tell the direction of a torque
_CYCLE_POINTS = (2, 1001)
_HUNDRED = (95.0, 100.5)  # end of a cycle, %
#: Numbers that programs write for a missing sample.
_STAND_INS = (-99999.0, -9999.0, -999.0, 999.0, 9999.0, 99999.0)


@dataclass(frozen=True, slots=True)
class Pulses:
    """Pulses of a recording."""

    source: str = ""  # channel that shows the pulses, ``command`` or ``angle``; "" for none
    n: int = 0  # number of pulses; without a source, times that a command goes on at random
    why: str = ""  # reason for the source, in words


def find_pulses(assigned: Assignments, clock: SeenClock) -> Pulses:
    """Find pulses in the command, or else as steps of the angle."""
    if "command" in assigned:
        there = _is_on(assigned["command"][0].column.values)
        n = len(runs_of(there))
        if n and there.mean() < 0.5:
            return Pulses("command", n, f"the command is not zero {n} time(s)")
        return Pulses("", n, "the command is never zero for long" if n else "the command is zero")
    if "trigger" in assigned:
        n = _trigger_starts(assigned["trigger"][0].column.values).size
        return Pulses("trigger" if n else "", n, f"the trigger starts {n} time(s)")
    if "angle" not in assigned or "torque" not in assigned or clock.rate_hz is None:
        return Pulses()
    return _steps(assigned, clock)


def _steps(assigned: Assignments, clock: SeenClock) -> Pulses:
    time = _time(assigned, clock)
    if time is None or not _is_steady(clock) or (clock.rate_hz or 0.0) < 5 * _CUTOFF_HZ:
        return Pulses()
    angle = _si(assigned, "angle")
    if not is_mostly_at_rest(time, angle):
        return Pulses()  # walking, or a random position
    n = len(pulses_from_angle(build_recording(time, {"angle": angle}), cutoff_hz=_CUTOFF_HZ))
    part = f" in the first {time.size:,} samples" if time.size < clock.n else ""
    why = f"the angle steps {n} time(s){part}"
    return Pulses("angle", n, why) if n >= _FEWEST_PULSES else Pulses()


def _trigger_starts(values: np.ndarray) -> np.ndarray:
    """Return the samples at which a trigger leaves its idle level; none without two levels."""
    low, high = np.nanmin(values), np.nanmax(values)
    share = (values - low) / (high - low) if high > low else np.zeros(values.size)
    is_high = share > 0.5
    if ((share > _LEVEL_SHARE) & (share < 1.0 - _LEVEL_SHARE)).mean() > _LEVEL_SHARE:
        return np.empty(0, dtype=int)
    leaves = 1 if is_high.mean() < 0.5 else -1
    return np.flatnonzero(np.diff(is_high.astype(np.int8)) == leaves) + 1


def _is_on(values: np.ndarray) -> np.ndarray:
    return np.asarray(np.isfinite(values) & (values != 0))


def find_command(
    columns: Sequence[InspectedColumn], assigned: Assignments, clock: SeenClock
) -> Assignments:
    """Add the column that is zero but in pulses which the torque follows, whatever its name."""
    time = _time(assigned, clock)
    if time is None or "command" in assigned or not {"angle", "torque"} <= set(assigned):
        return assigned
    used = {id(c) for c, _ in assigned.values()}
    free = [c for c in columns if id(c) not in used and not c.column.is_text]
    for column in free if _is_steady(clock) else ():
        values = column.column.values[: time.size]
        there = _is_on(values)
        runs = runs_of(there)[:_MOST_PULSES]
        if len(runs) < _FEWEST_PULSES or there.mean() > _MOST_ON:
            continue
        stride_s = repeat_s(time, _si(assigned, "angle"))
        risen = responses(time, _si(assigned, "torque"), time[runs[:, 0]], stride_s)
        if not is_clear(clearness(risen * np.sign(values[runs.mean(axis=1).astype(int)]))):
            continue
        why, unit = "it is zero but in pulses, which the torque follows", column.words.unit
        if column.words.found & _TRIGGERS or si_unit_of(unit or "N*m")[0] != "N*m":
            return {**assigned, "trigger": (column, Assignment("trigger", why))}
        unit_why = "" if unit else "that of the torque"
        unit = unit or assigned["torque"][1].unit
        return {**assigned, "command": (column, Assignment("command", why, unit, unit_why))}
    return assigned


def likely_rates(assigned: Assignments, clock: SeenClock) -> dict[float, float]:
    """Return rates (Hz) at which strides have a usual duration, with that duration (s)."""
    n = min(clock.n, GUESSED_SAMPLES)
    recording = _steps_of_feet(assigned, np.arange(n, dtype=float))
    return {} if recording is None else rates_of_strides(recording)


def stride_notes(assigned: Assignments, clock: SeenClock, *, walking: bool) -> list[str]:
    """Return a note if strides are longer or shorter than those of walking people."""
    time = _time(assigned, clock)
    if not walking or time is None or not _is_steady(clock):
        return []
    recording = _steps_of_feet(assigned, time)
    stride = None if recording is None else median_stride_s(recording)
    if recording is None or stride is None or is_walking_stride(stride):
        return []
    likely = format_rates(rates_of_strides(recording))
    return [
        f"strides last {stride:.3g} s (median) at {clock.rate_hz:.6g} Hz; people walk with "
        f"{SHORTEST_S:g} to {LONGEST_S:g} s. Likely rate: {likely or 'unknown'}."
    ]


def _steps_of_feet(assigned: Assignments, time: np.ndarray) -> xr.Dataset | None:
    """Return the channels that show heel strikes, None if there are none."""
    names = [name for name in ("contact", "ground_reaction_force") if name in assigned]
    if not names or time.size < FEWEST_SAMPLES or not np.isfinite(time).all():
        return None
    kind = "voltage" if "contact" in assigned and assigned["contact"][1].unit else "contact"
    units = {name: si_of(assigned[name][1])[0] for name in names if assigned[name][1].unit}
    channels = {name: _si(assigned, name) for name in names}
    return build_recording(time, channels, units=units, contact_kind=kind)


def torque_over_command(assigned: Assignments, clock: SeenClock) -> float | None:
    """Return the median change of torque over that of the command at onsets, None where unknown.

    A torque per body mass has none.
    """
    time = _time(assigned, clock)
    if time is None or not {"command", "torque"} <= set(assigned):
        return None
    if assigned["torque"][1].unit.endswith("/kg"):
        return None
    command, torque = np.nan_to_num(_si(assigned, "command")), _si(assigned, "torque")
    begins = np.flatnonzero((command[1:] != 0) & (command[:-1] == 0)) + 1
    late = np.searchsorted(time, time[begins] + _LATER_S)
    begins, late = begins[late < time.size], late[late < time.size]
    held = command[late] != 0
    changes = (torque[late] - torque[begins - 1])[held] / command[late][held]
    changes = changes[np.isfinite(changes)]
    return float(np.median(changes)) if changes.size >= _FEWEST_PULSES else None


def pulses_of_table(
    assigned: Assignments, clock: SeenClock, table: PulseColumns, rows: np.ndarray
) -> OwnPulses | None:
    """Return the onsets of a recording in a pulse table, None without a clock or a torque."""
    time = _time(assigned, clock)
    if time is None or "torque" not in assigned or time.size < FEWEST_SAMPLES:
        return None
    command = assigned["command"][0].column.values if "command" in assigned else None
    return own_pulses(table, rows, time, _si(assigned, "torque"), command)


def pulse_response(
    assigned: Assignments, clock: SeenClock, own: OwnPulses | None
) -> tuple[float, float]:
    """Return how clearly pulses move the joint along the torque, and the inertia (kg m2)."""
    time = _time(assigned, clock)
    if time is None or not _is_steady(clock):
        return 0.0, np.nan
    onsets = None if own is None else own.onsets_s
    if onsets is None and "command" in assigned:
        onsets = time[runs_of(_is_on(_si(assigned, "command")))[:, 0]]
    if onsets is None and "trigger" in assigned:
        onsets = time[_trigger_starts(assigned["trigger"][0].column.values[:GUESSED_SAMPLES])]
    if onsets is None or not onsets.size:
        return 0.0, np.nan
    torque = _si(assigned, "torque" if "torque" in assigned else "current")
    return torque_side(time, _si(assigned, "angle"), torque, onsets[:_MOST_PULSES])


def motion_of(assigned: Assignments, clock: SeenClock) -> str:
    """Return how the angle moves: "gait", "sine", "aperiodic", or "" if it is unclear."""
    time = _time(assigned, clock)
    if time is None or "angle" not in assigned or time.size < 2 or not step_of(time) > 0:
        return ""
    assignment = assigned["angle"][1]
    is_range_sure = assignment.unit == "deg" or not assignment.unit_why
    return kind_of_motion(time, _si(assigned, "angle"), is_range_sure=is_range_sure)


def _is_steady(clock: SeenClock) -> bool:
    return not clock.restarts and not clock.n_back


def _time(assigned: Assignments, clock: SeenClock) -> np.ndarray | None:
    if "time" in assigned:
        return in_seconds(*assigned["time"])[:GUESSED_SAMPLES]
    n = min(clock.n, GUESSED_SAMPLES)
    return None if clock.rate_hz is None else np.arange(n) / clock.rate_hz


def _si(assigned: Assignments, channel: str) -> np.ndarray:
    inspected, assignment = assigned[channel]
    _, factor = si_of(assignment)
    return np.asarray(factor * inspected.column.values[:GUESSED_SAMPLES])


def not_a_recording(columns: Sequence[InspectedColumn], assigned: Assignments) -> tuple[str, str]:
    """Return why a table holds no course in time, and what takes it; two empty texts: it may."""
    rows = columns[0].course.n if columns else 0
    names = {c.title.casefold() for c in columns}
    if any("stiffness" in n or "damping" in n for n in names):
        return (
            "it is a table of estimates, one row a person and timing point; not a course in time.",
            "jointz compare takes it: --response COL --within COL --participant COL.",
        )
    if rows == 1 and {"mass", "height"} & {w for c in columns for w in c.words.found}:
        return (
            "it holds one row about a person; not a course in time.",
            "Copy mass and height into [[participants]] of a study: mass_kg, height_m.",
        )
    percent = _percent(columns)
    if percent and "time" not in assigned:
        return (
            f"it holds {rows} points over the cycle by column '{percent}', not strides in time; "
            "impedance needs pulses and what surrounds them.",
            "jointz identify stride takes a cycle of angle and torque.",
        )
    numbers = [c for c in columns if not c.column.is_text]
    if "time" not in assigned and len(numbers) > 1 and all(_stamps(c) for c in numbers):
        return (
            "all its columns only increase: they hold times of events, not signals.",
            "A study takes times of pulses from a table with the column onset_s: see the key "
            "perturbations of a recording.",
        )
    return "", ""


def _percent(columns: Sequence[InspectedColumn]) -> str:
    for inspected in columns:
        course, words = inspected.course, inspected.words
        few = course.rises and _CYCLE_POINTS[0] <= course.n <= _CYCLE_POINTS[1]
        low, high = course.low or 0.0, course.high or 0.0  # without a number it is no percentage
        strides = low >= 0 and _HUNDRED[0] <= high <= _HUNDRED[1]
        if (few or strides) and words.found & {"percent", "pct", "cycle", "gait", "phase"}:
            return inspected.title
    return ""


def _stamps(inspected: InspectedColumn) -> bool:
    """Tell whether a column only increases; numbers may be missing at its end."""
    return inspected.course.rises and not inspected.course.whole


def missing_channels(
    columns: Sequence[InspectedColumn], assigned: Assignments, clock: SeenClock
) -> list[str]:
    """Return what a study needs and the file does not have, a sentence each."""
    sentences = []
    names = {w for c in columns for w in c.words.found}
    is_unassigned = not {"angle", "torque"} & set(assigned)
    if columns and is_unassigned and not any(map(_has_name, columns)):
        sentences.append("its columns have no names: assign them to channels in [channels].")
    if "angle" not in assigned:
        why = "no column holds the joint's angle"
        if names & {"posx", "posy", "posz"}:
            why += " (there are markers: compute angles from them by inverse kinematics)"
        elif "motor_velocity" in assigned or "current" in assigned:
            why += " (it is a log of the actuator only)"
        why += _in_other_units(columns, "angle")
        sentences.append(f"{why}; every study needs it.")
    if "torque" not in assigned and "current" not in assigned:
        why = "no column holds a torque, or a motor current to compute it from"
        sentences.append(f"{why}{_in_other_units(columns, 'torque')}.")
    if "time" not in assigned and clock.rate_hz is None:
        sentences.append(
            f"no column holds time in numbers{_time_as_text(columns)}"
            f"{_in_other_units(columns, 'time')}, and the file states no rate: give it as "
            "sample_rate_hz."
        )
    return sentences


def _in_other_units(columns: Sequence[InspectedColumn], channel: str) -> str:
    """Return the columns with the name of a channel and a unit of another quantity."""
    named = [
        f"'{c.title}' is in '{c.words.unit}'"
        for c in columns
        if channel not in channel_scores(c.words)
        and channel in channel_scores(replace(c.words, unit=""))
    ]
    return f" (with such a name, {', '.join(named[:_LONGEST_LIST])})" if named else ""


def _time_as_text(columns: Sequence[InspectedColumn]) -> str:
    for inspected in columns:
        if "time" not in channel_scores(inspected.words):
            continue
        if not inspected.column.is_text:
            return f" (the stamps of column '{inspected.title}' repeat or go back)"
        if inspected.course.levels:
            example = next(iter(inspected.course.levels), "")
            return f" (column '{inspected.title}' holds text such as '{example}')"
    return ""


def _has_name(inspected: InspectedColumn) -> bool:
    """Tell whether a column has a name, not only a number."""
    return not inspected.title.rpartition(".")[2].isdecimal()


def bad_channels(assigned: Assignments, overflow: Mapping[str, str]) -> list[str]:
    """Return why channels cannot be used, a sentence each."""
    sentences = [
        f"column '{assigned[channel][0].key}' ({channel}): {note} Its samples cannot be trusted."
        for channel, note in overflow.items()
        if channel in ("torque", "angle", "current", "time")
    ]
    sentences += [
        f"column '{inspected.title}': {value:g} stands {n} times, far from all other numbers. If "
        f'it means a missing sample, give [files] missing = ["{value:g}"].'
        for inspected, _ in assigned.values()
        for value, n in _stand_ins(inspected)
    ]
    return sentences + [c.column.stray for c, _ in assigned.values() if c.column.stray]


def _stand_ins(inspected: InspectedColumn) -> list[tuple[float, int]]:
    """Return numbers such as 9999 that stand for missing samples, and how often."""
    values = inspected.column.values
    if inspected.column.is_text or inspected.course.low is None:
        return []
    seen = {value: int((values == value).sum()) for value in _STAND_INS}
    others = values[np.isfinite(values) & ~np.isin(values, _STAND_INS)]
    largest = float(np.abs(others).max()) if others.size else 0.0
    return [(v, n) for v, n in seen.items() if 0 < n < others.size and abs(v) > 3.0 * largest]


def clock_obstacles(assigned: Assignments, clock: SeenClock) -> list[str]:
    """Return the problems of the time stamps, a sentence each."""
    sentences = []
    if clock.n_back:
        sentences.append(
            f"{clock.n_back} time stamp(s) are missing, repeat or go back; time must increase."
        )
    cut = set()
    for channel in ("trial", "condition"):
        if channel in assigned:
            values = assigned[channel][0].column.values
            cut |= set((np.flatnonzero(values[1:] != values[:-1]) + 1).tolist())
    open_ends = [k for k in clock.restarts if k not in cut]
    if open_ends:
        sentences.append(
            f"time begins again {len(open_ends)} time(s), first at sample {open_ends[0] + 1}, and "
            "no column marks the end of a trial there: add one that counts trials, or split it."
        )
    return sentences


def command_advice(
    file: str,
    assigned: Assignments,
    clock: SeenClock,
    files: FilesSpec | None,
    *,
    acts_on: str,
) -> list[str]:
    """Return the commands that take the file without changes."""
    if "torque" not in assigned or ("time" not in assigned and clock.rate_hz is None):
        return []
    options = {name: _option(assigned, name) for name in assigned}
    own, by = f"{_quoted(file)}{_layout(files)}", "Taken as it is by"
    timed = f" --torque {options['torque']}{_clock(options, clock)}"
    commands = []
    if "angle" in assigned:
        command = f"--command {options['command']}" if "command" in options else ""
        perturbed = f"torque {command}" if command else "angle"
        commands.append(
            f"{by}: jointz identify joint {own} --angle {options['angle']}{timed} --torque-acts-on "
            f"{acts_on} --input {perturbed} --model kbj"
        )
    if {"current", "motor_velocity"} <= set(assigned):
        commands.append(
            "With the gear ratio in place of 1, taken by: jointz identify actuator "
            f"{own} --model friction --current {options['current']} --velocity "
            f"{options['motor_velocity']} --torque {options['torque']} --gear-ratio 1"
        )
    course = assigned["command"][0].course if "command" in assigned else None
    if course is not None and course.low != course.high:
        commands.append(
            f"{by}: jointz identify bandwidth {own} --command {options['command']}{timed}"
        )
    return commands


def _layout(files: FilesSpec | None) -> str:
    if files is None:
        return ""
    options = [
        (files.encoding is not None, f"--encoding {files.encoding}"),
        (files.delimiter not in (None, ","), f"--delimiter {_quoted(files.delimiter or '')}"),
        (files.decimal != ".", f"--decimal {files.decimal}"),
        (files.skip_rows > 0, f"--skip-rows {files.skip_rows}"),
        (not files.header, "--no-header"),
    ]
    return "".join(f" {option}" for needed, option in options if needed)


def _quoted(text: str) -> str:
    """Return a word quoted for a shell; a tab is written as an escape."""
    return "$'\\t'" if text == "\t" else shlex.quote(text)


def _clock(options: Mapping[str, str], clock: SeenClock) -> str:
    return f" --time {options['time']}" if "time" in options else f" --rate {clock.rate_hz:.8g}"


def _option(assigned: Assignments, name: str) -> str:
    inspected, assignment = assigned[name]
    return _quoted(f"{inspected.key}:{assignment.unit}" if assignment.unit else f"{inspected.key}")
