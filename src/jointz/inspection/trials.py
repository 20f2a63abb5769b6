"""Trials in several files: angle apart from torque, heel strikes as times."""

import re
from collections.abc import Sequence
from dataclasses import replace
from difflib import SequenceMatcher

from jointz.inspection.file_labels import agree
from jointz.inspection.inspection_result import SeenClock
from jointz.inspection.names import word_set
from jointz.inspection.own_clocks import HeelStrikes, channels_at_times, times_of
from jointz.inspection.source import JoinedSource, Source

_SAME_LENGTH = 0.2  # of files of one trial, whose devices start and stop by themselves
_BEYOND_STRIKES_S = 5.0  # of a recording before the first heel strike and after the last
_SAME_END = 2.0  # periods of the slower clock, within which clocks begin and end together
#: Words by which files of one trial differ.
_DEVICES = word_set(
    "ik id exo mocap daq gonio goniometer goniometers emg imu force forces grf plate fp angle "
    "angles torque torques knee ankle hip kinematics kinetics cam camera motor log data analog "
    "analogs a markers motion joint joints state states encoder device robot sensor sensors "
    "strikes events heel heelstrikes steps trc qtm vicon nexus labview"
)
_TORQUES = {"torque", "current"}


def is_whole(source: Source) -> bool:
    """Return whether a file has all that a recording needs in time."""
    return source.is_recording and bool(_TORQUES & set(source.assigned))


def trials_of(pieces: Sequence[Source]) -> tuple[list[Source], list[Source]]:
    """Return the recordings that files make together, and the files that are left."""
    mains = [p for p in pieces if _TORQUES & set(p.assigned)]
    angles = [p for p in pieces if "angle" in p.assigned and p not in mains]
    angle_of = _pairs(mains, angles)
    pairs = [(main, angle_of[id(main)]) for main in mains if id(main) in angle_of]
    trials = [joined(main, [angle]) for main, angle in pairs]
    used = {id(p) for pair in pairs for p in pair}
    return trials, [p for p in pieces if id(p) not in used]


def with_strikes(
    recordings: Sequence[Source], pieces: Sequence[Source]
) -> tuple[list[Source], list[Source]]:
    """Give recordings the files that list their heel strikes; return the other files, too."""
    files = [p for p in pieces if p.heel_strikes and not p.is_recording]
    lacking = [r for r in recordings if r.heel_strikes is None]
    file_of = _pairs(lacking, files)
    found = [
        replace(r, heel_strikes=_strikes_in(file_of[id(r)])) if id(r) in file_of else r
        for r in recordings
    ]
    used = {id(p) for p in file_of.values()}
    return found, [p for p in pieces if id(p) not in used]


def _strikes_in(piece: Source) -> HeelStrikes | None:
    return piece.heel_strikes and replace(piece.heel_strikes, file=piece.shown)


def joined(main: Source, others: Sequence[Source]) -> Source:
    """Return a recording with the channels that other files bring."""
    assigned, found = dict(main.assigned), []
    clocks = {c.group: c for c in main.content.clocks}
    time_s = times_of(clocks[main.group], main.assigned) if main.group in clocks else None
    for other in others:
        own_clocks = {c.group: c for c in other.content.clocks}
        lacking = {n: c for n, c in other.assigned.items() if n not in assigned and n != "time"}
        if time_s is not None and other.group in own_clocks:
            own_time_s = times_of(own_clocks[other.group], other.assigned)
            if own_time_s is not None:
                lacking, _ = channels_at_times(assigned, time_s, {"": (other.assigned, own_time_s)})
        assigned |= lacking
        offset_s = 0.0 if _together(main.clock, other.clock) else None
        found.append(JoinedSource(other, tuple(lacking), offset_s))
    directions = [main.angle_direction, *(other.angle_direction for other in others)]
    return replace(
        main,
        assigned=assigned,
        joined=tuple(found),
        angle_direction=next(filter(None, directions), ""),
        side=next((s.side for s in (main, *others) if s.side[0]), main.side),
        inverted=main.inverted.union(*(other.inverted for other in others)),
    )


def _together(a: SeenClock, b: SeenClock) -> bool:
    """Return whether two clocks begin and end together."""
    if not (a.rate_hz and b.rate_hz) or None in (a.start_s, a.end_s, b.start_s, b.end_s):
        return False
    most = _SAME_END / min(a.rate_hz, b.rate_hz)
    starts, ends = (a.start_s or 0.0) - (b.start_s or 0.0), (a.end_s or 0.0) - (b.end_s or 0.0)
    return max(abs(starts), abs(ends)) <= most


def _pairs(recordings: Sequence[Source], files: Sequence[Source]) -> dict[int, Source]:
    """Return the file that belongs to each recording: each is the only best one of the other."""
    likeness = {
        (id(r), id(f)): _likeness(r, f) for r in recordings for f in files if _may_be_of(r, f)
    }
    found = {}
    for recording in recordings:
        own = [f for f in files if _is_only_best(likeness, id(recording), id(f))]
        if own:
            found[id(recording)] = own[0]
    return found


def _is_only_best(likeness: dict[tuple[int, int], int], recording: int, file: int) -> bool:
    mine = likeness.get((recording, file))
    others = [v for k, v in likeness.items() if (k[0] == recording) != (k[1] == file)]
    return mine is not None and all(mine > other for other in others)


def _may_be_of(recording: Source, file: Source) -> bool:
    """Return whether a file contradicts a recording neither by its labels nor by its length."""
    a, b = recording.labels, file.labels
    labels = ((a.participant, b.participant), (a.session, b.session), (a.side, b.side))
    if not agree(labels) or _words(recording) != _words(file):
        return False
    length, own = _length_s(recording.clock), _length_s(file.clock)
    most = _SAME_LENGTH * length + (_BEYOND_STRIKES_S if file.heel_strikes else 0.0)
    return not own or not length or abs(own - length) <= most


def _words(source: Source) -> list[str]:
    """Return the words of a file and its folders, without those of devices."""
    place = source.shown.rpartition(".")[0] or source.shown
    words = _words_and_numbers(place)
    return sorted(w.lstrip("0") or "0" if w.isdecimal() else w for w in words if w not in _DEVICES)


def _words_and_numbers(name: str) -> list[str]:
    return re.findall(r"[a-z]+|\d+", name.casefold())


def _length_s(clock: SeenClock) -> float:
    return (clock.end_s or 0.0) - (clock.start_s or 0.0)


def _likeness(recording: Source, file: Source) -> int:
    """Return how many words of their names and folders two files share in the same order."""
    a, b = (_words_and_numbers(source.shown) for source in (recording, file))
    return sum(block.size for block in SequenceMatcher(None, a, b).get_matching_blocks())
