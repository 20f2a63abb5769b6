"""Inspection of a file or a folder: its content, its likely meaning, and a study to start from."""

import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from jointz.core.errors import DataError
from jointz.identify.preparation.pulses import runs_of
from jointz.inspection.content import Content
from jointz.inspection.guess import Assignment, InspectedColumn
from jointz.inspection.inspection_result import Inspection, SeenChannel, SeenClock, SeenRecording
from jointz.inspection.names import unreadable_unit
from jointz.inspection.people import Person, people_in
from jointz.inspection.problems import (
    FEWEST_SAMPLES,
    bad_channels,
    clock_obstacles,
    command_advice,
    missing_channels,
    not_a_recording,
    stride_notes,
)
from jointz.inspection.proposal import proposal_of
from jointz.inspection.pulse_columns import PulseColumns
from jointz.inspection.questions import questions_of
from jointz.inspection.source import (
    Source,
    files_in,
    most_telling,
    read_sources,
    with_most_telling_first,
    without_samples,
)
from jointz.inspection.study_draft import Proposal, RecordingDraft, study_text
from jointz.inspection.trials import is_whole, joined, trials_of, with_strikes
from jointz.io.formats.losses import is_plain, plainly
from jointz.io.formats.registry import format_of
from jointz.io.text.clock_times import CLOCK_TEXT

_SAME_RATE = 0.05
_LONGEST_LIST = 3


def inspect_file(
    path: str | os.PathLike[str],
    *,
    layout: Mapping[str, Any] | None = None,
    study_folder: str | os.PathLike[str] | None = None,
) -> Inspection:
    """Inspect a file or a folder and propose a ``study.toml``; no file is ever changed.

    Parameters
    ----------
    path : path
        The file, or a folder with recordings and pulse tables.
    layout : mapping, optional
        Known parts of a text file's layout, as under ``[files]``; the rest is detected.
    study_folder : path, optional
        Folder of ``study.toml``; by default that of the file, or the folder itself.

    Returns
    -------
    Inspection
        Channels, clocks, notes, obstacles, questions and the text of ``study.toml``.

    Raises
    ------
    DataError
        If a file is missing, unknown or damaged, or a folder has no recording.
    """
    target = Path(path)
    if not target.is_dir():
        sources, tables = read_sources(target, layout, study_folder)
        return _inspection(sources, tables, sources[0].people, notes=[])
    sources, tables, people, notes = _sources_in(target, layout, study_folder or target)
    if not sources:
        unread = [f for f in sorted(target.rglob("[!.]*")) if f.is_file()]
        if unread and not notes:
            format_of(unread[0])  # says what is read
        todo = "Name a file with the joint's angle and torque in time."
        message = " ".join([f"{target}: no recording found.", *notes[:_LONGEST_LIST], todo])
        raise DataError(message, path=str(target))
    return _inspection(sources, tables, people, notes=notes)


def _sources_in(
    folder: Path, layout: Mapping[str, Any] | None, study_folder: str | os.PathLike[str]
) -> tuple[list[Source], list[PulseColumns], dict[str, Person], list[str]]:
    """Return the recordings of a folder, the most telling first with samples; tables, notes."""
    sources: list[Source] = []
    pieces: list[Source] = []
    tables: list[PulseColumns] = []
    people: dict[str, Person] = {}
    notes: list[str] = []
    for file in files_in(folder):
        if listed := people_in(file):  # a table of text, or with few numbers
            people |= listed
            continue
        try:
            found, own_tables = read_sources(file, layout, study_folder, folder)
        except DataError as exc:
            is_note = "no table of numbers" in str(exc)
            notes.append(f"no table: {file.name}. Read it." if is_note else f"left out: {exc}")
            continue
        whole = [source for source in found if is_whole(source)]
        tables += own_tables
        people |= found[0].people
        used = own_tables or found[0].people
        others = (s for s in found if not is_whole(s) and (s.is_recording or not used))
        pieces += map(without_samples, others)
        # Of all files but the most telling one only what a line of the study needs is kept.
        sources = with_most_telling_first([*sources, *whole]) if whole else sources
    trials, pieces = trials_of(pieces)
    sources = [*sources, *trials, *(p for p in pieces if p.is_recording)]
    sources, pieces = with_strikes(sources, [p for p in pieces if not p.is_recording])
    if not sources:  # which columns hold what is asked
        sources = [p for p in pieces if p.is_series]
        pieces = [p for p in pieces if not p.is_series]
    notes += [f"left out: {p.shown} holds no angle and no torque in time." for p in pieces]
    if sources:
        best = most_telling(sources)
        whole = [_with_samples(best, layout, study_folder, folder)]
        sources = whole + [source for source in sources if source is not best]
    return sources, tables, people, notes


def _with_samples(
    recording: Source,
    layout: Mapping[str, Any] | None,
    study_folder: str | os.PathLike[str],
    root: Path,
) -> Source:
    """Return a recording with its samples; they are read again where they were forgotten."""

    def read(source: Source) -> Source:
        found, _ = read_sources(source.file, layout, study_folder, root)
        return next(one for one in found if one.part == source.part)

    whole = recording if recording.columns else read(recording)
    if recording.joined:
        whole = joined(whole, [read(one.source) for one in recording.joined])
    return replace(whole, heel_strikes=recording.heel_strikes)


def _inspection(
    sources: Sequence[Source],
    tables: Sequence[PulseColumns],
    people: Mapping[str, Person],
    *,
    notes: Sequence[str],
) -> Inspection:
    main = sources[0]
    obstacles, todo = _verdict(main)
    obstacles = (*_bad_name(main.file), *obstacles)
    proposal = proposal_of(sources, tables, people, obstacles)
    proposal = replace(proposal, questions=questions_of(proposal, main.clock))
    walking = proposal.kind.value == "walking"
    recordings = map(_seen_recording, sources, proposal.recordings)
    return Inspection(
        file=plainly(main.file.name),
        layout={} if main.content.files is None else main.content.files.model_dump(),
        channels=_seen_channels(main),
        clocks=main.clocks,
        n_events=len(main.content.events),
        notes=(
            *main.content.notes,
            *_group_notes(main, {t.columns["onset"].column.group for t in tables}),
            *_rate_notes(main.content, main.clock),
            *stride_notes(main.assigned, main.clock, walking=walking),
            *_left_over(tables, proposal),
            *notes,
        ),
        obstacles=obstacles,
        advice=todo or _advice(main, proposal),
        questions=proposal.questions,
        recordings=tuple(sorted(recordings, key=lambda r: (r.participant, r.file, r.part))),
        toml=study_text(proposal),
    )


def _left_over(tables: Sequence[PulseColumns], proposal: Proposal) -> list[str]:
    """Return a note for each pulse table that belongs to no recording, and of lacking channels."""
    used = {recording.perturbations for recording in proposal.recordings}
    notes = [
        f"{table.file} is a pulse table, and no name says whose: it is left out."
        for table in tables
        if table.file not in used
    ]
    return notes + [
        f"{recording.file} has no column for {', '.join(recording.lacks)}; the study needs it."
        for recording in proposal.recordings
        if recording.lacks
    ]


def _bad_name(file: Path) -> list[str]:
    if is_plain(str(file.resolve())):
        return []
    return [
        "a study cannot name it: the name of the file or of a folder above it is not UTF-8. "
        "Rename it."
    ]


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


def _verdict(main: Source) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the obstacles to an analysis, and advice if the file is not a recording."""
    columns, assigned = main.in_group, main.assigned
    why, todo = not_a_recording(columns, assigned)
    if why:
        return (why,), (todo,)
    bad = [*bad_channels(assigned, main.overflow), *clock_obstacles(assigned, main.clock)]
    wrong = ("Repair the file first; its content cannot be trusted.",)
    return (*missing_channels(columns, assigned, main.clock), *bad), wrong if bad else ()


def _advice(main: Source, proposal: Proposal) -> tuple[str, ...]:
    """Return commands that take the file, if an analysis of pulses in walking cannot."""
    if proposal.kind.value == "walking" and not proposal.obstacles:
        is_random = main.pulses.n and not main.pulses.source
        return ("Is its torque random? See jointz identify time-varying --help.",) * bool(is_random)
    open_units = map(proposal.question, ("channels.angle.unit", "channels.torque.unit"))
    if any(open_units) or main.joined or main.part or main.clock_groups:
        return ()
    is_of_day = "time" in main.assigned and main.assigned["time"][1].unit == CLOCK_TEXT
    if main.clock.gaps or main.clock.n < FEWEST_SAMPLES or is_of_day:
        return ()
    commands = command_advice(
        plainly(str(main.file)), main.assigned, main.clock, main.content.files,
        acts_on=proposal.signs.acts_on.value,
    )  # fmt: skip
    if commands and proposal.question("torque_acts_on"):
        commands.append("If the torque acts on the device, write --torque-acts-on device.")
    return tuple(commands)


def _seen_channels(main: Source) -> tuple[SeenChannel, ...]:
    assignments = {(c.column.group, c.key): own for c, own in main.assigned.values()}
    return tuple(
        _seen_channel(c, assignments.get((c.column.group, c.key)), main.overflow)
        for c in main.columns
    )


def _seen_channel(
    inspected: InspectedColumn, own: Assignment | None, overflow: Mapping[str, str]
) -> SeenChannel:
    column, course = inspected.column, inspected.course
    unit = own.unit if own else (column.unit or inspected.words.unit)
    guessed = own.unit_why if own else column.unit_why
    unit_is = ("guessed" if guessed else "stated") if unit else ""
    notes = [*course.notes]
    if own and own.channel in overflow:
        notes.append(overflow[own.channel])
    if odd := unreadable_unit(inspected.title, column.unit):
        notes.append(f"its unit '{odd}' cannot be read")
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
        notes=tuple(notes),
        outline=course.outline,
    )


def _seen_recording(source: Source, draft: RecordingDraft) -> SeenRecording:
    return SeenRecording(
        file=draft.file,
        participant=draft.participant.value,
        condition=draft.condition.value,
        part=draft.part,
        session=draft.session,
        side=draft.side.value,
        perturbations=draft.perturbations,
        n=source.clock.n,
        rate_hz=source.clock.rate_hz,
    )


def _group_notes(source: Source, of_tables: Collection[str]) -> list[str]:
    """Return notes about groups that are no part of the study, and about missing numbers."""
    notes = []
    assigned = source.assigned
    taken = {source.group, *of_tables, *source.clock_groups.values()}
    others = [c for c in source.content.clocks if c.group not in taken and c.n > 1]
    if others:
        text = ", ".join(f"'{c.group}' ({c.n} samples)" for c in others)
        notes.append(f"the study takes nothing of {text}.")
    apart = {*source.clock_groups, *source.joined_channels}
    for channel in ("angle", "torque"):
        if channel in assigned and channel not in apart:
            values = assigned[channel][0].column.values
            runs = runs_of(np.isnan(values))
            if runs.size:
                notes.append(
                    f"{channel}: numbers are missing in {len(runs)} place(s), first from sample "
                    f"{int(runs[0, 0]) + 1} on; an analysis leaves out what they touch."
                )
    return notes
