"""Groups of a walking participant's recordings: every session and side by itself."""

from collections.abc import Sequence

from jointz.identify.preparation.sources import RecordingInput
from jointz.identify.study_kinds import StudyKind

#: Session and side, "" where they are not stated.
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
    other side never belong to it; of the others those of the same session do, else those where
    one of the two states no session, else all. A recording may belong to several groups. One that
    belongs to none is in a last group, of None.
    """
    ordered = sorted(recordings, key=lambda r: r.condition != "perturbed")
    units = dict.fromkeys(unit_of(r) for r in ordered if r.condition == "perturbed")
    if not kind.by_side or not units:
        return [(("", ""), ordered)]
    groups: list[tuple[Unit | None, list[RecordingInput]]] = []
    for unit in units:
        own = _unperturbed(unit, ordered)
        own += [r for r in ordered if r.condition == "no_device" and not groups]
        own += [r for r in ordered if r.condition == "perturbed" and unit_of(r) == unit]
        groups.append((unit, [r for r in ordered if any(r is one for one in own)]))
    rest = [r for r in ordered if not any(r is one for _, group in groups for one in group)]
    return [*groups, (None, rest)] if rest else groups


def _unperturbed(unit: Unit, recordings: Sequence[RecordingInput]) -> list[RecordingInput]:
    """Return the unperturbed recordings that serve a session and side."""
    session, side = unit

    def alike(recording: RecordingInput) -> int:
        other = unit_of(recording)[0]
        return 2 if other == session else int("" in (other, session))

    there = [r for r in recordings if r.condition == "unperturbed"]
    there = [r for r in there if "" in (side, unit_of(r)[1]) or side == unit_of(r)[1]]
    best = max(map(alike, there), default=0)
    return [r for r in there if alike(r) == best]
