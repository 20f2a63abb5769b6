"""The study that is proposed for the recordings of a file or a folder."""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import takewhile
from typing import Any

import numpy as np

from jointz.core.channels import OPPOSITE_DIRECTION
from jointz.inspection.file_labels import agree, labels_of
from jointz.inspection.guess import (
    Assignments,
    InspectedColumn,
    condition_levels,
    guessed_joint,
)
from jointz.inspection.names import GAIT_WORDS, channel_scores
from jointz.inspection.people import Person, find_person
from jointz.inspection.problems import (
    Pulses,
    motion_of,
    pulse_response,
    pulses_of_table,
    torque_over_command,
)
from jointz.inspection.pulse_columns import OwnPulses, PulseColumns, stated_unit
from jointz.inspection.signs import angle_direction, is_clear
from jointz.inspection.source import Source
from jointz.inspection.study_draft import Guess, Proposal, RecordingDraft, Signs, usual_direction
from jointz.io.column_units import SAMPLE
from jointz.io.toml_problems import OPEN

_USUAL_JOINT = "knee"
_UNLIKE = 50.0  # ratio of torques in different units


def proposal_of(
    sources: Sequence[Source],
    tables: Sequence[PulseColumns],
    people: Mapping[str, Person],
    obstacles: Sequence[str],
) -> Proposal:
    """Return the proposed study; the first source shows the meaning of the columns."""
    main = sources[0]
    assigned, clock = main.assigned, main.clock
    others = [c for one in main.joined for c in one.source.columns]
    joint, why = guessed_joint([*main.columns, *others], main.names)
    joint, why = joint or _USUAL_JOINT, why or "the file does not state it"
    kind = _kind(main)
    tables_of = _tables_of(sources, tables)
    table = tables_of[0]
    positive = usual_direction(joint)
    # Where the first recording has none, another's shows at least the names.
    shown_table = next(filter(None, tables_of), None)
    onset_unit = "" if shown_table is None else stated_unit(shown_table, "onset")
    own = None
    if table is not None:
        rows = table.rows_of(main.labels.participant, main.shown)
        own = pulses_of_table(assigned, clock, table, rows)
    is_onset_open = shown_table is not None and not onset_unit
    is_onset_open = is_onset_open and (own is None or not own.is_unit_clear)
    rates = {s.clock.rate_hz if s.clock.source == "rate" else None for s in sources}
    signs = _signs(main, own, positive.value, walking=kind.value != "bench", knee=joint == "knee")
    participants = [source.labels.participant for source in sources]
    pairs = zip(sources, tables_of, strict=True)
    drafts = (_draft(s, t, main, signs, people, participants) for s, t in pairs)
    recordings = [_as_in_tables(draft, tables) for draft in drafts]
    return Proposal(
        main=main,
        recordings=tuple(_distinct(recordings)),
        assigned=assigned,
        joint=Guess(joint, why),
        kind=kind,
        positive=positive,
        table_columns={}
        if shown_table is None
        else _table_columns(shown_table, own, is_onset_open=is_onset_open),
        in_samples=SAMPLE in (onset_unit, own.unit if own else ""),
        is_onset_unit_open=is_onset_open,
        is_leg_open=_is_leg_open(main, own),
        signs=signs,
        torque_over_command=torque_over_command(assigned, clock),
        first_sample=None if own is None else own.first_sample,
        pulses=Pulses() if table is not None else main.pulses,
        rate_hz=next(iter(rates)) if len(rates) == 1 else None,
        rates_hz=tuple(sorted(hz for hz in rates if hz)),
        obstacles=tuple(obstacles),
        levels=condition_levels(assigned),
        heel_strikes=next((one for s in sources if (one := s.heel_strikes) and not one.file), None),
    )


def _tables_of(
    sources: Sequence[Source], tables: Sequence[PulseColumns]
) -> list[PulseColumns | None]:
    """Return the pulse table of each recording: of its part, its file, or a similar name."""
    tables_of = [source.table for source in sources]
    free = [k for k, s in enumerate(sources) if not s.part and may_have_pulses(s)]
    for table in tables:
        own = [k for k in free if _may_be_of(table, sources[k])]
        if not table.names_recordings:
            likeness = {k: _likeness(table.file, sources[k].shown) for k in own}
            most = max(likeness.values(), default=0)
            own = [k for k in own if likeness[k] == most]
            named = [k for k in own if sources[k].labels.condition == "perturbed"]
            own = named or own
            if len(own) > 1:  # it may belong to any of them
                continue
        for k in own:
            current, shown = tables_of[k], sources[k].shown
            if current is None or _likeness(table.file, shown) > _likeness(current.file, shown):
                tables_of[k] = table
    return tables_of


def may_have_pulses(source: Source) -> bool:
    """Return whether the name of the file allows for pulses."""
    return source.labels.condition not in ("unperturbed", "no_device")


def _may_be_of(table: PulseColumns, source: Source) -> bool:
    """Return whether a pulse table agrees with a recording in person, session and side."""
    if table.file == source.shown:
        return True
    if table.names_recordings:
        return bool(table.rows_of(source.labels.participant, source.shown).any())
    labels = labels_of(table.file, folders=table.file.split("/")[-2::-1])
    pairs = (
        (labels.participant, source.labels.participant),
        (labels.session, source.labels.session),
        (labels.side, source.side[0]),
    )
    return agree(pairs)


def _likeness(a: str, b: str) -> int:
    """Return how many first letters two files share, 0 where they lie in other folders."""
    if a == b:
        return len(a) + 1
    (place, _, name), (other_place, _, other) = a.rpartition("/"), b.rpartition("/")
    letters = zip(name.casefold(), other.casefold(), strict=False)
    return (place == other_place) * (1 + len(list(takewhile(lambda ab: ab[0] == ab[1], letters))))


def _table_columns(
    table: PulseColumns, own: OwnPulses | None, *, is_onset_open: bool
) -> dict[str, dict[str, Any]]:
    if table.are_usual():
        return {}
    usual = {"onset": OPEN if is_onset_open or own is None else own.unit, "amplitude": "N*m"}
    usual["duration"] = usual["onset"]  # as the onsets are written
    columns: dict[str, dict[str, Any]] = {}
    for meaning, inspected in table.columns.items():
        columns[meaning] = {"column": str(inspected.key)}
        if meaning in usual:
            columns[meaning]["unit"] = stated_unit(table, meaning) or usual[meaning]
    return columns


def _draft(
    source: Source,
    table: PulseColumns | None,
    main: Source,
    signs: Signs,
    people: Mapping[str, Person],
    participants: Collection[str],
) -> RecordingDraft:
    labels = source.labels
    of_table, of_file = find_person(people, labels.participant, participants), source.person
    person = Guess(labels.participant, "its name, or that of the folder or part")
    if not person.value:
        person = Guess(OPEN if len(participants) > 1 else "S01", "the file does not state it")
    return RecordingDraft(
        file=source.shown,
        participant=person,
        condition=_condition(source, table, main),
        side=_side(source, of_table.side or of_file.side),
        part=source.part,
        session=labels.session,
        perturbations="" if table is None else table.file,
        lacks=tuple(n for n in main.assigned if n not in source.assigned),
        mass_kg=source.content.mass_kg or of_file.mass_kg or of_table.mass_kg,
        height_m=of_file.height_m or of_table.height_m,
        changes=_changes(source, main, signs),
        files=source.content.files if source.content.files != main.content.files else None,
        joined=source.joined,
        heel_strikes=own if (own := source.heel_strikes) and own.file else None,
    )


def _side(source: Source, stated: str) -> Guess:
    """Return the leg by names, else the one that a table of people or a value states."""
    side, why = source.side
    if not stated or stated == side:
        return Guess(side, why)
    return Guess(OPEN if side else stated)


def _is_unlike(own: InspectedColumn, first: InspectedColumn) -> bool:
    """Return whether a torque is far larger or smaller than the first recording's."""
    spans = [(c.course.high or 0.0) - (c.course.low or 0.0) for c in (own, first)]
    return max(spans) > _UNLIKE * min(spans)


def _is_leg_open(main: Source, own: OwnPulses | None) -> bool:
    """Return whether angles are of both legs, and no name says which has the device.

    Pulses decide it where they move the proposed leg, and not the other.
    """
    assigned = main.assigned
    angles = {c.words.side: c for c in main.in_group if "angle" in channel_scores(c.words)}
    torque = assigned.get("torque", assigned.get("current"))
    named = main.names.side or (torque and torque[0].words.side)
    if named or not {"left", "right"} <= set(angles):
        return False
    if not {"angle", "torque"} <= set(assigned):
        return True
    other = angles["left" if assigned["angle"][0].words.side == "right" else "right"]
    legs = (assigned, {**assigned, "angle": (other, assigned["angle"][1])})
    moved, moved_other = (is_clear(pulse_response(leg, main.clock, own)[0]) for leg in legs)
    return moved_other or not moved


def _as_in_tables(recording: RecordingDraft, tables: Sequence[PulseColumns]) -> RecordingDraft:
    """Return a recording whose participant is called as in the tables of pulses."""
    person = recording.participant
    for table in tables:
        if (name := table.name_of(person.value)) != person.value:
            person = Guess(name, f"as in {table.file}")
    return replace(recording, participant=person)


def _changes(source: Source, main: Source, signs: Signs) -> dict[str, dict[str, Any]]:
    """Return the keys of a recording's channels that differ from those of the study."""
    changes: dict[str, dict[str, Any]] = {}
    for name, (inspected, assignment) in source.assigned.items():
        if source is main or name not in main.assigned or name in source.joined_channels:
            continue
        first, of_first = main.assigned[name]
        change: dict[str, Any] = {}
        if inspected.key != first.key:
            change["column"] = inspected.key
        # The same column without a stated unit has that of the first recording, unless it is the
        # angle of a walking knee, whose range tells degrees from radians.
        is_alike = inspected.key == first.key and assignment.unit_why
        guessed = is_alike and not (name == "angle" and signs.angle_by_range)
        if assignment.unit and assignment.unit != of_first.unit and not guessed:
            change["unit"] = assignment.unit
        if name == "torque" and assignment.unit_why and _is_unlike(inspected, first):
            change["unit"] = OPEN
        known = bool(source.angle_direction and signs.angle_by_range)
        if name == "angle" and known and source.angle_direction != signs.angle.value:
            change["positive"] = source.angle_direction
        named = inspected.words.direction
        if name in ("torque", "command") and named and named != first.words.direction:
            change["positive"] = named
        if (name in source.inverted) != (name in main.inverted):
            change["invert"] = name in source.inverted
        if change:
            changes[name] = change
    return changes


def _distinct(recordings: Sequence[RecordingDraft]) -> list[RecordingDraft]:
    """Give numbers as sessions to recordings that are otherwise the same."""
    cells = Counter(_cell(r) for r in recordings)
    numbers: Counter[tuple[str, ...]] = Counter()
    distinct = []
    for recording in recordings:
        cell = _cell(recording)
        if cells[cell] > 1:
            numbers[cell] += 1
            name = recording.part or f"{numbers[cell]}"
            why = "several recordings are otherwise the same"
            recording = replace(recording, session=name, session_why=why)
        distinct.append(recording)
    return distinct


def _cell(recording: RecordingDraft) -> tuple[str, ...]:
    guesses = (recording.participant, recording.condition, recording.side)
    return (*(guess.value for guess in guesses), recording.session)


def _kind(main: Source) -> Guess:
    """Return whether people walk, open where neither names nor the angle decide it."""
    if main.heel_strikes:
        return Guess("walking", "there are heel strikes")
    motion = "" if "angle" in main.overflow else motion_of(main.assigned, main.clock)
    words = main.names.found.union(*(c.words.found for c in main.in_group)) & GAIT_WORDS
    if motion == "gait":
        return Guess("walking", "the angle repeats as in strides")
    if motion != "sine" and {"contact", "ground_reaction_force"} & set(main.assigned):
        return Guess("walking", "there is contact of a foot with the ground")
    if motion == "aperiodic":
        return Guess(OPEN) if words else Guess("bench", "the angle does not repeat as in strides")
    return Guess("walking", f"names contain {min(words)}") if words and not motion else Guess(OPEN)


def _signs(
    main: Source, own: OwnPulses | None, positive: str, *, walking: bool, knee: bool
) -> Signs:
    """Decide directions by names, ranges and the response to pulses, and say what is open."""
    assigned = {n: c for n, c in main.assigned.items() if n not in main.overflow}
    angle, straight, by_range = Guess(""), 0, False
    if "angle" in assigned:
        if walking and knee and positive == "flexion":
            direction, straight, why = angle_direction(assigned)
            angle, by_range = Guess(direction, why), bool(direction)
        angle = angle if by_range else _named_direction(assigned, "angle")
    angle_open = "angle" in assigned and not angle.value
    torque, command = (_named_direction(assigned, name) for name in ("torque", "command"))
    # What is positive in the other direction is turned when it is read.
    turns = [g.value not in ("", positive) for g in (angle, torque)]
    acts_on, acts_on_open, inertia = Guess("joint"), False, np.nan
    if {"angle", "torque"} <= set(assigned):
        moved, inertia = pulse_response(assigned, main.clock, own)
        acts_on_open = not is_clear(moved) and not torque.value
        if is_clear(moved):
            along = (moved > 0) == (turns[0] == turns[1])
            why = f"pulses of torque move the joint {'along it' if along else 'against it'}"
            acts_on = Guess("joint" if along else "device", why)
        inertia = inertia if is_clear(moved) else np.nan
    ratio = torque_over_command(assigned, main.clock)
    if ratio is not None and not (command.value or acts_on_open or angle_open):
        follows = (ratio > 0) != turns[1]
        if follows != (acts_on.value == "joint"):
            command = Guess(OPPOSITE_DIRECTION[positive], "it opposes the torque on the joint")
    current, current_open = _current(assigned, main, own, angle.value or positive)
    return Signs(
        acts_on, acts_on_open, angle, angle_open, by_range, straight, torque, command, current,
        current_open, inertia,
    )  # fmt: skip


def _current(
    assigned: Assignments, main: Source, own: OwnPulses | None, angle: str
) -> tuple[Guess, bool]:
    """Return the direction in which a motor's current pushes the joint, and whether it is open."""
    if "current" not in assigned or "torque" in assigned or "angle" not in assigned:
        return Guess(""), False
    score, _ = pulse_response(assigned, main.clock, own)
    if not is_clear(score):
        return Guess(""), True
    how = "as" if score > 0 else "against"
    side = angle if score > 0 else OPPOSITE_DIRECTION[angle]
    return Guess(side, f"pulses of current accelerate the joint {how} the angle grows"), False


def _named_direction(assigned: Assignments, name: str) -> Guess:
    named = assigned[name][0].words.direction if name in assigned else ""
    return Guess(named, "its name says it" if named else "")


def _condition(source: Source, table: PulseColumns | None, main: Source) -> Guess:
    named = source.labels.condition or source.labels.folder_condition
    if source.pulses.source == "trigger" and named not in ("", "perturbed"):
        return Guess(OPEN)  # a trigger may start a recorder
    if source.pulses.source:
        return Guess("perturbed", source.pulses.why)
    if table is not None:
        return Guess("perturbed", f"{table.file} has its pulses")
    if named and (named != "perturbed" or source.pulses.n):
        return Guess(named, "its name, or that of the folder or part")
    shown = {"command", "trigger"} & set(source.assigned)
    if shown and not source.pulses.n and main.pulses.source:
        return Guess("unperturbed", source.pulses.why)
    return Guess(OPEN)
