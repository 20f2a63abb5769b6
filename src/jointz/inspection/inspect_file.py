"""Inspection of a file: its content, its likely meaning, and a study to start from."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from jointz.core.study import FilesSpec
from jointz.gait.sample_rate import told_rates
from jointz.inspection.content import Content, GroupClock, read_content
from jointz.inspection.guess import (
    InspectedColumn,
    assign_channels,
    guessed_condition,
    guessed_joint,
    guessed_side,
    in_seconds,
    inspect_column,
    si_of,
)
from jointz.inspection.inspection_result import Inspection, SeenChannel, SeenClock
from jointz.inspection.names import GAIT_WORDS, Words, unreadable_unit, words_of
from jointz.inspection.problems import (
    Assignments,
    Pulses,
    bad_channels,
    clock_obstacles,
    command_advice,
    command_correlation,
    find_pulses,
    likely_rates,
    missing_channels,
    not_a_recording,
    stride_notes,
    torque_resistance,
)
from jointz.inspection.signals import clock_of, overflow_note
from jointz.inspection.study_draft import (
    Guess,
    Proposal,
    assignments_by_column,
    condition_levels,
    study_text,
)
from jointz.io.formats.losses import is_plain, plainly
from jointz.io.relative_paths import seen_from

_USUAL_JOINT = "knee"
_SAME_RATE = 0.05


def inspect_file(
    path: str | os.PathLike[str],
    *,
    layout: Mapping[str, Any] | None = None,
    study_folder: str | os.PathLike[str] | None = None,
) -> Inspection:
    """Inspect a file and propose a ``study.toml`` for it; the file is never changed.

    Parameters
    ----------
    path : path
        The file.
    layout : mapping, optional
        Known parts of a text file's layout, as under ``[files]``; the rest is detected.
    study_folder : path, optional
        Folder of ``study.toml``; by default that of the file.

    Returns
    -------
    Inspection
        Channels, clocks, notes, obstacles and the text of ``study.toml``.

    Raises
    ------
    DataError
        If the file is missing, unknown or damaged.
    """
    file = Path(path)
    content = read_content(file, layout)
    columns = tuple(inspect_column(column) for column in content.columns)
    names = words_of(f"{file.parent.resolve().name} {_stem(file)}")
    own = words_of(_stem(file))
    names = Words(names.found, names.joint, own.side)
    every, group = _groups(columns, content.clocks, names)
    assigned = every.get(group, {})
    timed = (
        content.files is not None and "time" in assigned
    )  # stamps are better than a line above them
    clocks = tuple(
        _clock(
            replace(c, rate_hz=None) if timed else c,
            every[c.group] if c.group == group or c.time_s is not None else {},
        )
        for c in content.clocks
    )
    clock = next((c for c in clocks if c.group == group), SeenClock(group, "", 0))
    overflow = _overflows(assigned)
    in_group = [c for c in columns if c.column.group == group]
    obstacles, todo = _verdict(in_group, assigned, clock, overflow)
    obstacles = (*_bad_name(file), *obstacles)
    proposal = _proposal(
        _name_in(file, study_folder), in_group, assigned, names=names, clock=clock,
        obstacles=obstacles, files=content.files, overflow=overflow,
    )  # fmt: skip
    walking = proposal.kind.value == "walking"
    return Inspection(
        file=plainly(file.name),
        layout=_layout(content.files),
        channels=_seen(columns, assigned, overflow),
        clocks=clocks,
        n_events=content.n_events,
        notes=(
            *content.notes,
            *_group_notes(content, group, assigned),
            *_rate_notes(content, clock),
            *stride_notes(assigned, clock, walking=walking),
        ),
        obstacles=obstacles,
        advice=todo or _advice(plainly(file.name), proposal),
        toml=study_text(proposal),
    )


def _stem(file: Path) -> str:
    return file.name.split(".")[0]


def _name_in(file: Path, folder: str | os.PathLike[str] | None) -> str:
    """Return the file's name in a study; bytes that are no letters are written as codes."""
    if folder is None:
        return plainly(file.name)
    return plainly(seen_from(file, Path(folder)))


def _bad_name(file: Path) -> list[str]:
    if is_plain(str(file.resolve())):
        return []
    return [
        "a study cannot name it: the name of the file or of a folder above it is not UTF-8. "
        "Rename it."
    ]


def _groups(
    columns: Sequence[InspectedColumn], clocks: Sequence[GroupClock], names: Words
) -> tuple[dict[str, Assignments], str]:
    """Return the channels of every group of signals, and the group with the most useful ones."""
    found: dict[str, Assignments] = {}
    for clock in clocks:
        own = [c for c in columns if c.column.group == clock.group]
        joint, _ = guessed_joint(own, names)
        side, _ = guessed_side(own, names, joint)
        found[clock.group] = assign_channels(own, names, joint=joint, side=side)
    return found, max(found, key=lambda group: _weight(found[group]), default="")


def _weight(assigned: Assignments) -> int:
    return len(assigned) + 10 * len({"angle", "torque"} & set(assigned))


def _clock(stated: GroupClock, assigned: Assignments) -> SeenClock:
    if stated.time_s is not None and stated.unit_stated:
        return clock_of(stated.group, stated.n, "the file's own stamps", stated.time_s)
    if stated.rate_hz is not None:
        start, n = stated.start_s, stated.n
        end = start + (n - 1) / stated.rate_hz if n else start
        return SeenClock(stated.group, "rate", n, stated.rate_hz, start, end, uniform=True)
    if "time" in assigned:
        inspected, assignment = assigned["time"]
        return clock_of(
            stated.group, stated.n, str(inspected.key), in_seconds(inspected, assignment)
        )
    return SeenClock(stated.group, "", stated.n)


def _rate_notes(content: Content, clock: SeenClock) -> list[str]:
    """Return a note if a line above the table and its stamps state different rates."""
    stated = next((c.rate_hz for c in content.clocks if content.files is not None), None)
    found = clock.rate_hz
    if stated is None or found is None or abs(found / stated - 1) < _SAME_RATE:
        return []
    return [
        f"a line above the table states {stated:g} Hz, the column of time runs at {found:.6g} Hz: "
        "which is right?"
    ]


def _overflows(assigned: Assignments) -> dict[str, str]:
    found = {}
    for channel, (inspected, assignment) in assigned.items():
        si_unit, factor = si_of(assignment)
        note = overflow_note(inspected.course, si_unit, factor)
        if note:
            found[channel] = note
    return found


def _verdict(
    columns: Sequence[InspectedColumn],
    assigned: Assignments,
    clock: SeenClock,
    overflow: Mapping[str, str],
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the obstacles to an analysis, and advice if the file is not a recording."""
    why, todo = not_a_recording(columns, assigned)
    if why:
        return (why,), (todo,)
    bad = [*bad_channels(assigned, overflow), *clock_obstacles(assigned, clock)]
    wrong = ("Repair the file first; its content cannot be trusted.",)
    return (*missing_channels(columns, assigned, clock), *bad), wrong if bad else ()


def _advice(file: str, proposal: Proposal) -> tuple[str, ...]:
    """Return commands that take the file, if an analysis of pulses in walking cannot."""
    if proposal.kind.value == "walking" and not proposal.obstacles:
        return ()
    acts_on = proposal.acts_on.value
    return tuple(command_advice(file, proposal.assigned, proposal.files, acts_on=acts_on))


def _proposal(
    file: str,
    columns: Sequence[InspectedColumn],
    assigned: Assignments,
    *,
    names: Words,
    clock: SeenClock,
    obstacles: tuple[str, ...],
    files: FilesSpec | None,
    overflow: Mapping[str, str],
) -> Proposal:
    joint, why = guessed_joint(columns, names)
    side, side_why = guessed_side(columns, names, joint)
    sound = {name: column for name, column in assigned.items() if name not in overflow}
    pulses = find_pulses(sound, clock)
    kind = _kind(columns, assigned, names)
    levels = condition_levels(assigned["condition"][0]) if "condition" in assigned else {}
    return Proposal(
        file=file,
        assigned=assigned,
        joint=Guess(joint or _USUAL_JOINT, why or "the file does not state it"),
        kind=kind,
        acts_on=_acts_on(sound, clock, pulses, walking=kind.value == "walking"),
        side=Guess(side, side_why),
        condition=_condition(file, assigned, pulses),
        pulses=pulses,
        files=files,
        rate_hz=clock.rate_hz if clock.source == "rate" else None,
        rate_guess=_rate_guess(assigned, clock),
        obstacles=obstacles,
        free=tuple(c for c in columns if id(c) not in assignments_by_column(assigned)),
        levels=levels,
    )


def _rate_guess(assigned: Assignments, clock: SeenClock) -> Guess:
    """Return a rate to ask about: the likely one if there are strides."""
    likely = {} if clock.rate_hz is not None else likely_rates(assigned, clock)
    if not likely:
        return Guess("1000.0", "the file does not state the rate; give your own")
    return Guess(repr(next(iter(likely))), f"by its strides: {told_rates(likely)}; give your own")


def _kind(columns: Sequence[InspectedColumn], assigned: Assignments, names: Words) -> Guess:
    if "contact" in assigned or "ground_reaction_force" in assigned:
        return Guess("walking", "there is contact of a foot with the ground")
    options = sorted((names.found | {w for c in columns for w in c.words.found}) & GAIT_WORDS)
    if options:
        return Guess("walking", f"names contain {options[0]}")
    return Guess("bench", "no sign of walking")


def _acts_on(assigned: Assignments, clock: SeenClock, pulses: Pulses, *, walking: bool) -> Guess:
    if not {"angle", "torque"} <= set(assigned):
        return Guess("joint", "the usual one")
    if "moment" in assigned["torque"][0].words.found:
        return Guess("device", "a joint moment of inverse dynamics is exerted by the joint")
    followed = command_correlation(assigned) if pulses.source == "command" else None
    if followed is not None:
        acts_on, how = ("joint", "follows") if followed > 0 else ("device", "opposes")
        return Guess(acts_on, f"the torque {how} the command (correlation {followed:.2f})")
    resistance = None if walking else torque_resistance(assigned, clock)
    if resistance is None:
        return Guess("joint", "not stated; 'device' inverts the torque's sign")
    share = f"{100 * abs(resistance):.0f} % of its quick changes"
    if resistance < 0:
        return Guess("device", f"the torque opposes the angle in {share}")
    return Guess("joint", f"the torque goes with the angle in {share}")


def _condition(file: str, assigned: Assignments, pulses: Pulses) -> Guess:
    if pulses.source:
        return Guess("perturbed", pulses.why)
    named = guessed_condition(_stem(Path(file)))
    if named and not (named == "perturbed" and "command" not in assigned):
        return Guess(named, "the file's name")
    if named:  # perturbed by name, and nothing says when: the study would not open
        return Guess(
            "unperturbed", "its name says perturbed, but no channel or table has the pulses"
        )
    return Guess("unperturbed", pulses.why or "no pulses found")


def _layout(files: FilesSpec | None) -> dict[str, Any]:
    return {} if files is None else files.model_dump()


def _seen(
    columns: Sequence[InspectedColumn], assigned: Assignments, overflow: Mapping[str, str]
) -> tuple[SeenChannel, ...]:
    assignment = assignments_by_column(assigned)
    return tuple(_seen_one(c, assignment, overflow) for c in columns)


def _seen_one(
    inspected: InspectedColumn, assignment: Mapping[int, Any], overflow: Mapping[str, str]
) -> SeenChannel:
    column, course, own = inspected.column, inspected.course, assignment.get(id(inspected))
    unit = own.unit if own else (column.unit or inspected.words.unit)
    guessed = own.unit_why if own else column.unit_why
    unit_is = ("guessed" if guessed else "stated") if unit else ""
    notes = (
        *course.notes,
        *([overflow[own.channel]] if own and own.channel in overflow else []),
        *(
            [f"its unit '{odd}' cannot be read"]
            if (odd := unreadable_unit(inspected.title, column.unit))
            else []
        ),
    )
    return SeenChannel(
        group=column.group,
        column=str(column.key),
        title=column.title,
        channel=own.channel if own else "",
        guess=own.why if own else "",
        unit=unit,
        unit_is=unit_is,
        n=course.n,
        n_missing=course.n_missing,
        low=course.low,
        high=course.high,
        levels=course.levels,
        notes=notes,
        outline=course.outline,
    )


def _group_notes(content: Content, group: str, assigned: Assignments) -> list[str]:
    """Return notes about other groups and about missing numbers."""
    notes = []
    others = [c for c in content.clocks if c.group != group]
    if others:
        text = ", ".join(f"'{c.group}' ({c.n} samples)" for c in others)
        notes.append(
            f"the study takes the signals of '{group}'; those of {text} were sampled apart and "
            "are excluded: nothing is interpolated."
        )
    for channel in ("angle", "torque"):
        if channel in assigned:
            values = assigned[channel][0].column.values
            starts = np.flatnonzero(np.diff(np.isnan(values).astype(np.int8), prepend=0) == 1)
            if starts.size:
                notes.append(
                    f"{channel}: numbers are missing in {starts.size} place(s), first from sample "
                    f"{int(starts[0]) + 1} on; an analysis leaves out what they touch."
                )
    return notes
