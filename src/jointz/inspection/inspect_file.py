"""Look at a file: what it holds, what it seems to be, and a study to start from."""

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
    Looked,
    assigned,
    guessed_condition,
    guessed_joint,
    guessed_side,
    in_seconds,
    looked_at,
    si_of,
)
from jointz.inspection.inspection_result import Inspection, SeenChannel, SeenClock
from jointz.inspection.names import GAIT_WORDS, Words, unreadable_unit, words_of
from jointz.inspection.problems import (
    Given,
    Pulses,
    bad_channels,
    clock_obstacles,
    command_advice,
    find_pulses,
    follows_command,
    likely_rates,
    missing_channels,
    not_a_recording,
    opposes,
    stride_notes,
)
from jointz.inspection.signals import clock_of, overflow_note
from jointz.inspection.study_draft import (
    Guess,
    Proposal,
    condition_levels,
    study_text,
    taken_for,
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
    """Look at a file and propose a ``study.toml`` for it; the file is never changed.

    Parameters
    ----------
    path : path
        The file.
    layout : mapping, optional
        What is known of a text file's layout, as under ``[files]``; the rest is found out.
    study_folder : path, optional
        Where ``study.toml`` will stand; beside the file by default.

    Returns
    -------
    Inspection
        Channels, clocks, notes, obstacles and the text of ``study.toml``.

    Raises
    ------
    DataError
        When the file is missing, unknown or damaged.
    """
    file = Path(path)
    content = read_content(file, layout)
    columns = tuple(looked_at(column) for column in content.columns)
    names = words_of(f"{file.parent.resolve().name} {_stem(file)}")
    own = words_of(_stem(file))
    names = Words(names.found, names.joint, own.side)
    every, group = _groups(columns, content.clocks, names)
    given = every.get(group, {})
    timed = content.files is not None and "time" in given  # stamps say more than a line above them
    clocks = tuple(
        _clock(
            replace(c, rate_hz=None) if timed else c,
            every[c.group] if c.group == group or c.time_s is not None else {},
        )
        for c in content.clocks
    )
    clock = next((c for c in clocks if c.group == group), SeenClock(group, "", 0))
    overflow = _overflows(given)
    in_group = [c for c in columns if c.column.group == group]
    obstacles, todo = _verdict(in_group, given, clock, overflow)
    obstacles = (*_bad_name(file), *obstacles)
    proposal = _proposal(
        _name_in(file, study_folder), in_group, given, names=names, clock=clock,
        obstacles=obstacles, files=content.files, overflow=overflow,
    )  # fmt: skip
    walking = proposal.kind.value == "walking"
    return Inspection(
        file=plainly(file.name),
        layout=_layout(content.files),
        channels=_seen(columns, given, overflow),
        clocks=clocks,
        n_events=content.n_events,
        notes=(
            *content.notes,
            *_group_notes(content, group, given),
            *_rate_notes(content, clock),
            *stride_notes(given, clock, walking=walking),
        ),
        obstacles=obstacles,
        advice=todo or _advice(plainly(file.name), proposal),
        toml=study_text(proposal),
    )


def _stem(file: Path) -> str:
    return file.name.split(".")[0]


def _name_in(file: Path, folder: str | os.PathLike[str] | None) -> str:
    """Return what a study calls the file; bytes that are no letters are written by their codes."""
    if folder is None:
        return plainly(file.name)
    return plainly(seen_from(file, Path(folder)))


def _bad_name(file: Path) -> list[str]:
    if is_plain(str(file.resolve())):
        return []
    return [
        "a study cannot name it: the name of the file, or of a folder above it, is not UTF-8. "
        "Rename it."
    ]


def _groups(
    columns: Sequence[Looked], clocks: Sequence[GroupClock], names: Words
) -> tuple[dict[str, Given], str]:
    """Return the channels of every group of signals, and the one that makes the best study."""
    found: dict[str, Given] = {}
    for clock in clocks:
        own = [c for c in columns if c.column.group == clock.group]
        joint, _ = guessed_joint(own, names)
        side, _ = guessed_side(own, names, joint)
        found[clock.group] = assigned(own, names, joint=joint, side=side)
    return found, max(found, key=lambda group: _weight(found[group]), default="")


def _weight(given: Given) -> int:
    return len(given) + 10 * len({"angle", "torque"} & set(given))


def _clock(stated: GroupClock, given: Given) -> SeenClock:
    if stated.time_s is not None and stated.unit_stated:
        return clock_of(stated.group, stated.n, "the file's own stamps", stated.time_s)
    if stated.rate_hz is not None:
        start, n = stated.start_s, stated.n
        end = start + (n - 1) / stated.rate_hz if n else start
        return SeenClock(stated.group, "rate", n, stated.rate_hz, start, end, uniform=True)
    if "time" in given:
        looked, taken = given["time"]
        return clock_of(stated.group, stated.n, str(looked.key), in_seconds(looked, taken))
    return SeenClock(stated.group, "", stated.n)


def _rate_notes(content: Content, clock: SeenClock) -> list[str]:
    """Return a note where a line above the table and its stamps state different rates."""
    stated = next((c.rate_hz for c in content.clocks if content.files is not None), None)
    found = clock.rate_hz
    if stated is None or found is None or abs(found / stated - 1) < _SAME_RATE:
        return []
    return [
        f"a line above the table states {stated:g} Hz, the column of time runs at {found:.6g} Hz: "
        "which is right?"
    ]


def _overflows(given: Given) -> dict[str, str]:
    found = {}
    for channel, (looked, taken) in given.items():
        si_unit, factor = si_of(taken)
        note = overflow_note(looked.course, si_unit, factor)
        if note:
            found[channel] = note
    return found


def _verdict(
    columns: Sequence[Looked], given: Given, clock: SeenClock, overflow: Mapping[str, str]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return what stands in the way of an analysis, and what to do where it is no recording."""
    why, todo = not_a_recording(columns, given)
    if why:
        return (why,), (todo,)
    bad = [*bad_channels(given, overflow), *clock_obstacles(given, clock)]
    wrong = ("Repair what is wrong with the file; nothing of it can be trusted before.",)
    return (*missing_channels(columns, given, clock), *bad), wrong if bad else ()


def _advice(file: str, proposal: Proposal) -> tuple[str, ...]:
    """Return what takes the file as it is, where an analysis of pulses in walking does not."""
    if proposal.kind.value == "walking" and not proposal.obstacles:
        return ()
    acts_on = proposal.acts_on.value
    return tuple(command_advice(file, proposal.given, proposal.files, acts_on=acts_on))


def _proposal(
    file: str,
    columns: Sequence[Looked],
    given: Given,
    *,
    names: Words,
    clock: SeenClock,
    obstacles: tuple[str, ...],
    files: FilesSpec | None,
    overflow: Mapping[str, str],
) -> Proposal:
    joint, why = guessed_joint(columns, names)
    side, side_why = guessed_side(columns, names, joint)
    sound = {name: column for name, column in given.items() if name not in overflow}
    pulses = find_pulses(sound, clock)
    kind = _kind(columns, given, names)
    levels = condition_levels(given["condition"][0]) if "condition" in given else {}
    return Proposal(
        file=file,
        given=given,
        joint=Guess(joint or _USUAL_JOINT, why or "nothing says which one"),
        kind=kind,
        acts_on=_acts_on(sound, clock, pulses, walking=kind.value == "walking"),
        side=Guess(side, side_why),
        condition=_condition(file, given, pulses),
        pulses=pulses,
        files=files,
        rate_hz=clock.rate_hz if clock.source == "rate" else None,
        rate_guess=_rate_guess(given, clock),
        obstacles=obstacles,
        free=tuple(c for c in columns if id(c) not in taken_for(given)),
        levels=levels,
    )


def _rate_guess(given: Given, clock: SeenClock) -> Guess:
    """Return a rate to ask about: that of usual strides where there are strides."""
    likely = {} if clock.rate_hz is not None else likely_rates(given, clock)
    if not likely:
        return Guess("1000.0", "nothing says the rate; give your own")
    return Guess(repr(next(iter(likely))), f"by its strides: {told_rates(likely)}; give your own")


def _kind(columns: Sequence[Looked], given: Given, names: Words) -> Guess:
    if "contact" in given or "ground_reaction_force" in given:
        return Guess("walking", "there is a foot's contact with the ground")
    said = sorted((names.found | {w for c in columns for w in c.words.found}) & GAIT_WORDS)
    if said:
        return Guess("walking", f"names speak of {said[0]}")
    return Guess("bench", "nothing speaks of walking")


def _acts_on(given: Given, clock: SeenClock, pulses: Pulses, *, walking: bool) -> Guess:
    if not {"angle", "torque"} <= set(given):
        return Guess("joint", "the usual one")
    if "moment" in given["torque"][0].words.found:
        return Guess("device", "a joint moment of inverse dynamics is the joint's own")
    followed = follows_command(given) if pulses.source == "command" else None
    if followed is not None:
        acts_on, how = ("joint", "follows") if followed > 0 else ("device", "opposes")
        return Guess(acts_on, f"the torque {how} the command (correlation {followed:.2f})")
    told = None if walking else opposes(given, clock)
    if told is None:
        return Guess("joint", "nothing says it; 'device' turns the torque's sign")
    share = f"{100 * abs(told):.0f} % of its quick changes"
    if told < 0:
        return Guess("device", f"the torque opposes the angle in {share}")
    return Guess("joint", f"the torque goes with the angle in {share}")


def _condition(file: str, given: Given, pulses: Pulses) -> Guess:
    if pulses.source:
        return Guess("perturbed", pulses.why)
    named = guessed_condition(_stem(Path(file)))
    if named and not (named == "perturbed" and "command" not in given):
        return Guess(named, "the file's name")
    if named:  # perturbed by name, and nothing says when: the study would not open
        return Guess("unperturbed", "its name says perturbed, but no channel or table says when")
    return Guess("unperturbed", pulses.why or "no pulses were found")


def _layout(files: FilesSpec | None) -> dict[str, Any]:
    return {} if files is None else files.model_dump()


def _seen(
    columns: Sequence[Looked], given: Given, overflow: Mapping[str, str]
) -> tuple[SeenChannel, ...]:
    taken = taken_for(given)
    return tuple(_seen_one(c, taken, overflow) for c in columns)


def _seen_one(looked: Looked, taken: Mapping[int, Any], overflow: Mapping[str, str]) -> SeenChannel:
    column, course, own = looked.column, looked.course, taken.get(id(looked))
    unit = own.unit if own else (column.unit or looked.words.unit)
    guessed = own.unit_why if own else column.unit_why
    unit_is = ("guessed" if guessed else "stated") if unit else ""
    notes = (
        *course.notes,
        *([overflow[own.channel]] if own and own.channel in overflow else []),
        *(
            [f"its unit '{odd}' cannot be read"]
            if (odd := unreadable_unit(looked.title, column.unit))
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


def _group_notes(content: Content, group: str, given: Given) -> list[str]:
    """Return notes about other rates and about where numbers are missing."""
    notes = []
    others = [c for c in content.clocks if c.group != group]
    if others:
        told = ", ".join(f"'{c.group}' ({c.n} samples)" for c in others)
        notes.append(
            f"the study takes the signals of '{group}'; those of {told} were sampled apart and "
            "are left out: nothing is interpolated."
        )
    for channel in ("angle", "torque"):
        if channel in given:
            values = given[channel][0].column.values
            begins = np.flatnonzero(np.diff(np.isnan(values).astype(np.int8), prepend=0) == 1)
            if begins.size:
                notes.append(
                    f"{channel}: numbers are missing in {begins.size} place(s), first from sample "
                    f"{int(begins[0]) + 1} on; an analysis leaves out what they touch."
                )
    return notes
