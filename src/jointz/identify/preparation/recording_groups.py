"""Groups of a participant's recordings; in walking one for every session and side."""

from collections.abc import Sequence

from jointz.identify.preparation.sources import RecordingInput
from jointz.identify.study_kinds import StudyKind

#: Session and side, "" if they are not stated.
Unit = tuple[str, str]


def unit_of(recording: RecordingInput) -> Unit:
    """Return session and side of a recording."""
    attrs = recording.recording.attrs
    return str(attrs["session"]), str(attrs["side"])


def recording_groups(
    recordings: Sequence[RecordingInput], kind: StudyKind
) -> list[tuple[Unit | None, list[RecordingInput]]]:
    """Return the recordings that are estimated together, with their session and side.

    The perturbed recordings of one session and side are a group. Unperturbed recordings of the
    same or of an unstated side join it: those of the same session, else those for which one of
    the two sessions is not stated, else all. A recording may be in several groups. Recordings
    without a group form a last one, of None.
    """
    ordered = sorted(recordings, key=lambda r: r.condition != "perturbed")
    units = dict.fromkeys(unit_of(r) for r in ordered if r.condition == "perturbed")
    if not kind.by_side or not units:
        return [(("", ""), ordered)]
    groups: list[tuple[Unit | None, list[RecordingInput]]] = []
    for unit in units:
        members = set(map(id, _unperturbed(unit, ordered)))
        members |= {
            id(r)
            for r in ordered
            if (r.condition == "perturbed" and unit_of(r) == unit)
            or (r.condition == "no_device" and not groups)
        }
        groups.append((unit, [r for r in ordered if id(r) in members]))
    grouped = {id(r) for _, group in groups for r in group}
    rest = [r for r in ordered if id(r) not in grouped]
    return [*groups, (None, rest)] if rest else groups


def _unperturbed(unit: Unit, recordings: Sequence[RecordingInput]) -> list[RecordingInput]:
    """Return the unperturbed recordings that serve a session and side."""
    session, side = unit

    def agreement(recording: RecordingInput) -> int:
        other = unit_of(recording)[0]
        return 2 if other == session else int("" in (other, session))

    unperturbed = [
        r
        for r in recordings
        if r.condition == "unperturbed" and ("" in (side, unit_of(r)[1]) or side == unit_of(r)[1])
    ]
    best = max(map(agreement, unperturbed), default=0)
    return [r for r in unperturbed if agreement(r) == best]
