"""What a file is good for: direction of torque, pulses, and what stands in the way."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from jointz.core.recording import build_recording
from jointz.core.study import FilesSpec
from jointz.gait.sample_rate import (
    LONGEST_S,
    SHORTEST_S,
    is_walking_stride,
    median_stride_s,
    rates_of_strides,
    told_rates,
)
from jointz.identify.preparation.pulses import pulses_from_angle
from jointz.inspection.guess import Looked, Taken, in_seconds, si_of
from jointz.inspection.inspection_result import SeenClock
from jointz.inspection.names import channel_scores

Given = Mapping[str, tuple[Looked, Taken]]

_SMOOTH_S = 0.01
_APART_S = 0.08
_EXPLAINED = 0.3
_FOLLOWS = 0.6
_FEWEST_PULSES = 3
_CUTOFF_HZ = 20.0
_FEWEST_SAMPLES = 100
_MOST_SHOWN = 3
_CYCLE_POINTS = (2, 1001)


@dataclass(frozen=True, slots=True)
class Pulses:
    """Where the pulses of a recording are."""

    source: str = ""  # ``command``, ``angle`` or "" for none that were found
    n: int = 0  # how many
    why: str = ""  # in words


def find_pulses(given: Given, clock: SeenClock) -> Pulses:
    """Look for pulses: in the command, else as steps of the angle."""
    if "command" in given:
        command = given["command"][0].column.values
        there = np.isfinite(command) & (command != 0)
        n = int((np.diff(there.astype(np.int8)) == 1).sum()) + int(bool(there.size and there[0]))
        if n and there.mean() < 0.5:
            return Pulses("command", n, f"the command is not zero {n} time(s)")
        return Pulses("", 0, "the command is never zero for long" if n else "the command is zero")
    if "angle" not in given or "torque" not in given or clock.rate_hz is None:
        return Pulses()
    return _steps(given, clock)


def _steps(given: Given, clock: SeenClock) -> Pulses:
    time = _time(given, clock)
    if time is None or clock.restarts or clock.n_back or (clock.rate_hz or 0.0) < 5 * _CUTOFF_HZ:
        return Pulses()
    recording = build_recording(time, {"angle": _si(given, "angle")})
    n = len(pulses_from_angle(recording, cutoff_hz=_CUTOFF_HZ))
    return Pulses("angle", n, f"the angle steps {n} time(s)") if n >= _FEWEST_PULSES else Pulses()


def likely_rates(given: Given, clock: SeenClock) -> dict[float, float]:
    """Return rates in Hz at which strides are usual, with their median stride in s."""
    recording = _steps_of_feet(given, np.arange(clock.n, dtype=float))
    return {} if recording is None else rates_of_strides(recording)


def stride_notes(given: Given, clock: SeenClock, *, walking: bool) -> list[str]:
    """Return a note where strides last longer or shorter than those of walking people."""
    time = _time(given, clock)
    if not walking or time is None or clock.restarts or clock.n_back:
        return []
    recording = _steps_of_feet(given, time)
    stride = None if recording is None else median_stride_s(recording)
    if recording is None or stride is None or is_walking_stride(stride):
        return []
    likely = told_rates(rates_of_strides(recording))
    return [
        f"strides last {stride:.3g} s (median) at {clock.rate_hz:.6g} Hz; people walk with "
        f"{SHORTEST_S:g} to {LONGEST_S:g} s. Likely rate: {likely or 'unknown'}."
    ]


def _steps_of_feet(given: Given, time: np.ndarray) -> xr.Dataset | None:
    """Return the channels that show heel strikes, None where there are none."""
    names = [name for name in ("contact", "ground_reaction_force") if name in given]
    if not names or time.size < _FEWEST_SAMPLES or not np.isfinite(time).all():
        return None
    kind = "voltage" if "contact" in given and given["contact"][1].unit else "contact"
    units = {name: si_of(given[name][1])[0] for name in names if given[name][1].unit}
    channels = {name: _si(given, name) for name in names}
    return build_recording(time, channels, units=units, contact_kind=kind)


def follows_command(given: Given) -> float | None:
    """Return the correlation of torque and command in pulses, None where it does not tell."""
    command, torque = _si(given, "command"), _si(given, "torque")
    both = np.isfinite(command) & np.isfinite(torque)
    command, torque = command[both], torque[both]
    if command.size < _FEWEST_SAMPLES or not command.std() or not torque.std():
        return None
    told = float(np.corrcoef(command, torque)[0, 1])
    return told if abs(told) > _FOLLOWS else None


def opposes(given: Given, clock: SeenClock) -> float | None:
    """Return how far the torque resists the angle's moves, None where it does not tell.

    The torque's changes over 80 ms are set against those of angle, velocity and acceleration.
    Where stiffness and inertia come out negative together, the torque is the joint's answer to the
    device; where both are positive, it is what the device does to the joint.
    """
    time = _time(given, clock)
    if time is None or clock.rate_hz is None or time.size < _FEWEST_SAMPLES:
        return None
    angle, torque = _si(given, "angle"), _si(given, "torque")
    both = np.isfinite(angle) & np.isfinite(torque)
    if not both.all() or clock.restarts or clock.n_back:
        return None
    half, apart = (max(1, round(s * clock.rate_hz)) for s in (_SMOOTH_S, _APART_S))
    angle, torque = _smoothed(angle, half), _smoothed(torque, half)
    velocity = np.gradient(angle) * clock.rate_hz
    terms = (angle, velocity, np.gradient(velocity) * clock.rate_hz)
    inside = slice(2 * half, -2 * half)
    moves = np.column_stack([term[apart:] - term[:-apart] for term in terms])[inside]
    answer = (torque[apart:] - torque[:-apart])[inside]
    if len(answer) < _FEWEST_SAMPLES or not answer.var():
        return None
    solved, *_ = np.linalg.lstsq(moves, answer, rcond=None)
    told = float(1 - (answer - moves @ solved).var() / answer.var())
    together = solved[0] * solved[2] > 0
    return told * float(np.sign(solved[0])) if told >= _EXPLAINED and together else None


def _smoothed(values: np.ndarray, n: int) -> np.ndarray:
    kernel = np.full(n, 1 / n)
    return np.convolve(np.convolve(values, kernel, "same"), kernel, "same")


def _time(given: Given, clock: SeenClock) -> np.ndarray | None:
    if "time" in given:
        return in_seconds(*given["time"])
    return None if clock.rate_hz is None else np.arange(clock.n) / clock.rate_hz


def _si(given: Given, channel: str) -> np.ndarray:
    looked, taken = given[channel]
    _, factor = si_of(taken)
    return np.asarray(factor * looked.column.values)


def not_a_recording(columns: Sequence[Looked], given: Given) -> tuple[str, str]:
    """Return why a table holds no course in time, and what takes it; two empty texts: it may."""
    rows = columns[0].course.n if columns else 0
    names = {str(c.column.title or c.key).casefold() for c in columns}
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
    if percent and "time" not in given:
        return (
            f"it holds one mean over the cycle, {rows} points of column '{percent}', not strides "
            "in time; impedance needs pulses and what surrounds them.",
            "jointz.stats.quasi_stiffness takes a mean cycle.",
        )
    numbers = [c for c in columns if not c.column.is_text]
    if "time" not in given and len(numbers) > 1 and all(_stamps(c) for c in numbers):
        return (
            "all its columns only grow: they hold times of events, not signals.",
            "Pulses come from such a file as a table with the column onset_s: see the key "
            "perturbations of a recording.",
        )
    return "", ""


def _percent(columns: Sequence[Looked]) -> str:
    for looked in columns:
        course, words = looked.course, looked.words
        few = _CYCLE_POINTS[0] <= course.n <= _CYCLE_POINTS[1]
        if few and course.rises and words.found & {"percent", "pct", "cycle", "gait"}:
            return str(looked.column.title or looked.key)
    return ""


def _stamps(looked: Looked) -> bool:
    """Whether a column only grows, whatever is missing at its end."""
    return looked.course.rises and not looked.course.whole


def missing_channels(columns: Sequence[Looked], given: Given, clock: SeenClock) -> list[str]:
    """Return what a study needs and the file has not, a sentence each."""
    found = []
    names = {w for c in columns for w in c.words.found}
    if columns and not {"angle", "torque"} & set(given) and not any(_named(c) for c in columns):
        found.append(
            "its columns have no names of their own: say in [channels] which of them is what."
        )
    if "angle" not in given:
        why = "no column holds the joint's angle"
        if names & {"posx", "posy", "posz"}:
            why += " (there are markers: inverse kinematics and dynamics make angles of them)"
        elif "motor_velocity" in given or "current" in given:
            why += " (it is a log of the actuator alone)"
        why += _in_other_units(columns, "angle")
        found.append(f"{why}; every study needs it.")
    if "torque" not in given and "current" not in given:
        why = "no column holds a torque, nor a motor's current to compute it from"
        found.append(f"{why}{_in_other_units(columns, 'torque')}.")
    if "time" not in given and clock.rate_hz is None:
        found.append(
            f"no column holds time in numbers{_time_as_text(columns)}"
            f"{_in_other_units(columns, 'time')}, and the file states no rate: give the one that "
            "you know as sample_rate_hz."
        )
    return found


def _in_other_units(columns: Sequence[Looked], channel: str) -> str:
    """Return which columns are named like a channel and measure something else."""
    named = [
        f"'{c.title}' is in '{c.words.unit}'"
        for c in columns
        if channel not in channel_scores(c.words)
        and channel in channel_scores(replace(c.words, unit=""))
    ]
    return f" (named like it, {', '.join(named[:_MOST_SHOWN])})" if named else ""


def _time_as_text(columns: Sequence[Looked]) -> str:
    for looked in columns:
        if looked.column.is_text and "time" in channel_scores(looked.words):
            example = next(iter(looked.course.levels), "")
            return f" (column '{looked.title}' holds text such as '{example}')"
    return ""


def _named(looked: Looked) -> bool:
    """Whether a column has a name that is more than its number."""
    last = (looked.column.title or str(looked.key)).rpartition(".")[2]
    return not last.isdecimal()


def bad_channels(given: Given, overflow: Mapping[str, str]) -> list[str]:
    """Return what makes channels that are there useless, a sentence each."""
    found = [
        f"column '{given[channel][0].key}' ({channel}): {note} Its samples cannot be trusted."
        for channel, note in overflow.items()
        if channel in ("torque", "angle", "current", "time")
    ]
    found += [looked.column.stray for looked, _ in given.values() if looked.column.stray]
    for channel in ("torque", "angle"):
        if channel in given and si_of(given[channel][1])[0].endswith("/kg"):
            found.append(
                f"column '{given[channel][0].key}' is a {channel} per body mass: multiply it by "
                "the mass before it goes into a study."
            )
    return found


def clock_obstacles(given: Given, clock: SeenClock) -> list[str]:
    """Return what is wrong with the time stamps, a sentence each."""
    found = []
    if clock.n_back:
        found.append(
            f"{clock.n_back} time stamp(s) are missing, repeat or go back; time must increase."
        )
    cut = set()
    for channel in ("trial", "condition"):
        if channel in given:
            values = given[channel][0].column.values
            cut |= set((np.flatnonzero(values[1:] != values[:-1]) + 1).tolist())
    open_ends = [k for k in clock.restarts if k not in cut]
    if open_ends:
        found.append(
            f"time begins again {len(open_ends)} time(s), first at sample {open_ends[0] + 1}, and "
            "no column says that a trial ends there: add one that counts trials, or cut the file."
        )
    return found


def command_advice(file: str, given: Given, files: FilesSpec | None, *, acts_on: str) -> list[str]:
    """Return the commands that take the file as it is."""
    if "torque" not in given:
        return []
    said = {name: _option(given, name) for name in given}
    own = f"{_quoted(file)}{_layout(files)}"
    commands = []
    if "angle" in given:
        commands.append(
            f"joint {own} --angle {said['angle']} --torque {said['torque']}{_clock(said)} "
            f"--torque-acts-on {acts_on} {_input(said)} --model kbj"
        )
    if {"current", "motor_velocity"} <= set(given):
        commands.append(
            f"actuator {own} --model friction --current {said['current']} --velocity "
            f"{said['motor_velocity']} --torque {said['torque']} --gear-ratio G"
        )
    if "command" in given and given["command"][0].course.low != given["command"][0].course.high:
        commands.append(
            f"bandwidth {own} --command {said['command']} --torque {said['torque']}{_clock(said)}"
        )
    return [f"Taken as it is by: jointz identify {command}" for command in commands]


def _layout(files: FilesSpec | None) -> str:
    if files is None:
        return ""
    options = [
        (files.delimiter not in (None, ","), f"--delimiter {_quoted(files.delimiter or '')}"),
        (files.decimal != ".", f"--decimal {files.decimal}"),
        (files.skip_rows > 0, f"--skip-rows {files.skip_rows}"),
        (not files.header, "--no-header"),
    ]
    return "".join(f" {option}" for needed, option in options if needed)


def _quoted(text: str) -> str:
    """Return a word as a shell takes it; a tab cannot be seen, and is written as such."""
    return "$'\\t'" if text == "\t" else shlex.quote(text)


def _clock(said: Mapping[str, str]) -> str:
    return f" --time {said['time']}" if "time" in said else " --rate HZ"


def _input(said: Mapping[str, str]) -> str:
    return f"--input torque --command {said['command']}" if "command" in said else "--input angle"


def _option(given: Given, name: str) -> str:
    looked, taken = given[name]
    return _quoted(f"{looked.key}:{taken.unit}" if taken.unit else f"{looked.key}")
