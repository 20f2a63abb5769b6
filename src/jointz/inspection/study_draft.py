"""Draft of a ``study.toml``, in which each guess is marked with its reason."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from jointz.core.study import FilesSpec
from jointz.inspection.guess import Assignments
from jointz.inspection.inspection_result import Question
from jointz.inspection.own_clocks import HeelStrikes
from jointz.inspection.problems import Pulses
from jointz.inspection.source import JoinedSource, Source
from jointz.io.toml_problems import OPEN
from jointz.io.toml_text import written_comment, written_key, written_text

_POSITIVE = {"ankle": "dorsiflexion"}
_LONGEST_LIST = 12
_DIRECTED = ("angle", "torque", "command", "current")
_WHY_INVERTED = {
    "contact": "the knee is bent where it rises: it is low on the ground",
    "ground_reaction_force": "it is negative where the foot is loaded",
}


@dataclass(frozen=True, slots=True)
class Guess:
    """A value and the reason for it."""

    value: str
    why: str = ""  # "" if the value is known


@dataclass(frozen=True, slots=True)
class RecordingDraft:
    """A recording of a proposed study."""

    file: str  # as the study names it
    participant: Guess
    condition: Guess  # "" if a column holds conditions
    side: Guess  # "" if unknown
    part: str = ""
    session: str = ""
    session_why: str = ""  # "" if the name says it
    perturbations: str = ""  # pulse table
    lacks: tuple[str, ...] = ()  # channels of the study that the file does not have
    mass_kg: float | None = None  # of the participant, where a file states it
    height_m: float | None = None  # likewise
    changes: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)  # of channels
    files: FilesSpec | None = None  # layout, where it is another than the study's
    joined: tuple[JoinedSource, ...] = ()
    heel_strikes: HeelStrikes | None = None  # in another file


@dataclass(frozen=True, slots=True)
class Signs:
    """Directions of angle, torque and command, "" where unknown, and which of them are open."""

    acts_on: Guess  # key ``torque_acts_on``
    acts_on_open: bool
    angle: Guess
    angle_open: bool
    angle_by_range: bool
    straight_deg: int  # angle of a straight knee, 0 or 180
    torque: Guess
    command: Guess
    current: Guess
    current_open: bool
    inertia: float  # kg m2, the torque over the acceleration at pulses; NaN without


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """Content of a ``study.toml``."""

    main: Source  # the recording that shows what the columns mean
    recordings: tuple[RecordingDraft, ...]
    assigned: Assignments  # channel -> column
    joint: Guess  # key ``joint``
    kind: Guess  # key ``kind``
    positive: Guess  # key ``positive``
    signs: Signs
    # meaning -> column and unit of the pulse tables; empty if their names say it
    table_columns: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    in_samples: bool = False  # whether pulse tables count samples
    is_onset_unit_open: bool = False
    is_leg_open: bool = False
    torque_over_command: float | None = None  # median ratio of their changes in pulses
    first_sample: int | None = None
    pulses: Pulses = field(default_factory=Pulses)
    rate_hz: float | None = None  # rate stated by the files; None if not stated, or of several
    rates_hz: tuple[float, ...] = ()  # stated by the files of the recordings
    obstacles: tuple[str, ...] = ()  # reasons why the file cannot be analysed
    # level of the column of conditions -> condition
    levels: Mapping[str, str] = field(default_factory=dict)
    questions: tuple[Question, ...] = ()
    heel_strikes: HeelStrikes | None = None

    def question(self, about: str) -> Question | None:
        """Return what is asked about a key and has no answer yet."""
        return next((q for q in self.questions if q.about == about and not q.drafted), None)

    def direction_of(self, channel: str) -> Guess:
        """Return the direction in which a channel is positive, "" where it has or needs none."""
        return getattr(self.signs, channel) if channel in _DIRECTED else Guess("")


def study_text(proposal: Proposal) -> str:
    """Return the text of a ``study.toml``."""
    lines = [
        f"# Proposed by jointz inspect for {written_comment(_first_file(proposal))}.",
        f'# A value "{OPEN}" is open: no file says it. Answer each before an analysis.',
        "# Lines marked 'guess' are guesses: check each, correct it, and remove the mark.",
        "# Lines behind '#' are off: if one applies, fill in what you know and remove its '#'.",
        *(
            f"# Cannot be analysed as it is: {written_comment(reason)}"
            for reason in proposal.obstacles
        ),
        "jointz = 1",
        _line("joint", proposal.joint),
        _key(proposal, "kind", proposal.kind),
        _line("positive", proposal.positive),
        _key(proposal, "torque_acts_on", proposal.signs.acts_on),
        *_coupling(proposal),
        *_rate(proposal),
    ]
    for name in proposal.assigned:
        lines += _channel(proposal, name) if name not in proposal.main.joined_channels else []
    lines += _heel_strikes(proposal) + _missing(proposal) + _unassigned(proposal.main)
    lines += _people(proposal) + _recordings(proposal) + _perturbations(proposal)
    return "\n".join([*lines, *_calibration(proposal), *_files(proposal.main.content.files)]) + "\n"


def _first_file(proposal: Proposal) -> str:
    first, n_more = proposal.recordings[0].file, len(proposal.recordings) - 1
    return f"{first} and {n_more} more" if n_more else first


def _calibration(proposal: Proposal) -> list[str]:
    """Return the zero of an angle that is 180 deg where the knee is straight."""
    if not proposal.signs.straight_deg:
        return []
    turned = -1 if proposal.signs.angle.value == "extension" else 1
    zero = _inline({"value": turned * round(math.pi, 6), "sd": 0.05})
    return ["", "[calibration]", f"angle_zero_rad = {zero}  # guess: straight is 180 deg"]


def _inline(content: Mapping[str, Any]) -> str:
    """Return a table of TOML on one line."""
    cells = (f"{written_key(key)} = {_value(value)}" for key, value in content.items())
    return f"{{ {', '.join(cells)} }}"


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        return _inline(value)
    if isinstance(value, tuple):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    return written_text(value) if isinstance(value, str) else repr(value)


def _line(key: str, guess: Guess, *, raw: bool = False) -> str:
    value = guess.value if raw else written_text(guess.value)
    mark = f"  # guess: {written_comment(guess.why)}" if guess.why else ""
    return f"{key} = {value}{mark}"


def _key(proposal: Proposal, about: str, guess: Guess) -> str:
    """Return a key with its value, or open with the question and its answers."""
    key = about.rpartition(".")[2]
    if (question := proposal.question(about)) is None:
        return _line(key, guess)
    return f"{key} = {written_text(OPEN)}  # {written_comment(question.in_a_line())}"


def usual_direction(joint: str) -> Guess:
    """Return the direction in which results of a joint are usually positive."""
    return Guess(_POSITIVE.get(joint, "flexion"), "the usual one")


def _coupling(proposal: Proposal) -> list[str]:
    if proposal.kind.value != "walking":
        return []
    return [_line("coupling", Guess("strap", '"rigid" where the device moves with the bone'))]


def _rate(proposal: Proposal) -> list[str]:
    if "time" in proposal.assigned:
        return []
    return [_key(proposal, "sample_rate_hz", Guess("")) if proposal.rate_hz is None
            else f"sample_rate_hz = {proposal.rate_hz!r}"]  # fmt: skip


def _channel(proposal: Proposal, name: str) -> list[str]:
    inspected, assignment = proposal.assigned[name]
    column = str(inspected.key) if isinstance(inspected.key, int) else written_text(inspected.key)
    title = f" ('{inspected.column.title}')" if inspected.column.title else ""
    lines = ["", f"[channels.{name}]"]
    lines.append(_line("column", Guess(column, f"{assignment.why}{title}"), raw=True))
    if name in proposal.main.own_times:
        stamps, unit = proposal.main.own_times[name]
        lines.append(f"time = {_inline({'column': stamps, 'unit': unit})}")
    if name == "contact":
        volts = bool(assignment.unit)
        why = "more than two levels" if volts else "two levels"
        lines.append(_line("kind", Guess("voltage" if volts else "contact", why)))
    if assignment.unit:
        own_unit = Guess(assignment.unit, assignment.unit_why)
        lines.append(_key(proposal, f"channels.{name}.unit", own_unit))
    lines += [
        _key(proposal, about, Guess(""))
        for key in ("scale", "positive")
        if proposal.question(about := f"channels.{name}.{key}")
    ]
    if name in proposal.main.inverted:
        lines.append(f"invert = true  # guess: {_WHY_INVERTED[name]}")
    turned = proposal.direction_of(name)
    if turned.value not in ("", proposal.positive.value):
        lines.append(_line("positive", turned))
    if name == "condition" and (question := proposal.question("channels.condition.values")):
        lines.append(f"# {written_comment(question.in_a_line())}")
    if name == "condition" and proposal.levels:
        meant = Guess(_inline(proposal.levels), "meaning of the levels, by words or pulses")
        lines.append(_line("values", meant, raw=True))
    return lines


def _heel_strikes(proposal: Proposal) -> list[str]:
    if proposal.question(about := "channels.heel_strikes.column"):
        return ["", "[channels.heel_strikes]", _key(proposal, about, Guess(""))]
    if proposal.heel_strikes is None:
        return []
    strikes = proposal.heel_strikes
    name = _line("column", Guess(strikes.column, "its name"))
    unit = [_line("unit", Guess(strikes.unit))] if strikes.unit else []
    return ["", "[channels.heel_strikes]", name, *unit]


def _missing(proposal: Proposal) -> list[str]:
    lines = []
    for name, unit in (("angle", "deg"), ("torque", "N*m")):
        if proposal.question(about := f"channels.{name}.column"):
            lines += ["", f"[channels.{name}]", _key(proposal, about, Guess(""))]
            lines += [f"# unit = {written_text(unit)}"]
    if proposal.question("torque_model"):
        lines += ["", "[torque_model]  # in the data sheet, or by: jointz identify actuator"]
        lines += [f"gear_ratio = {written_text(OPEN)}  # turns of the motor a turn of the joint"]
        lines += [f"torque_constant = {written_text(OPEN)}  # N*m/A at the motor's shaft"]
    return lines


def _unassigned(main: Source) -> list[str]:
    """Return a comment about the columns without a channel."""
    if not (columns := main.unassigned):
        return []
    names = [written_comment(c.title) for c in columns[:_LONGEST_LIST]]
    more = f" and {len(columns) - _LONGEST_LIST} more" if len(columns) > _LONGEST_LIST else ""
    keep = "[channels.NAME] with its column keeps one"
    return ["", f"# Columns without a channel: {', '.join(names)}{more}. {keep}."]


def _people(proposal: Proposal) -> list[str]:
    # Of several recordings of a person, one that states the mass stands last, and counts.
    recordings = sorted(proposal.recordings, key=lambda r: r.mass_kg is not None)
    people = {r.participant.value: r for r in recordings}
    lines = []
    for _, own in sorted(people.items()):
        mass = "# mass_kg = 70.0  # only for values per kg"
        if proposal.question("participants.mass_kg"):
            mass = _key(proposal, "participants.mass_kg", Guess(""))
        if own.mass_kg is not None:
            mass = _line("mass_kg", Guess(repr(own.mass_kg), "the file states it"), raw=True)
        height = [] if own.height_m is None else [f"height_m = {own.height_m!r}"]
        lines += ["", "[[participants]]", _line("id", own.participant), mass, *height]
    return lines


def _recordings(proposal: Proposal) -> list[str]:
    ordered = sorted(proposal.recordings, key=lambda r: (r.participant.value, r.file, r.part))
    lines = [line for recording in ordered for line in _recording(proposal, recording)]
    if len(proposal.recordings) == 1:
        lines.append("# [[participants]]  # another one for each other person")
        lines.append(
            "# [[recordings]]  # another one for each other file, such as one without pulses"
        )
    return lines


def _recording(proposal: Proposal, recording: RecordingDraft) -> list[str]:
    person = recording.participant.value
    lines = ["", "[[recordings]]", f"participant = {written_text(person)}"]
    if "condition" not in proposal.assigned:
        is_open = recording.condition.value == OPEN
        condition = _key(proposal, "recordings.condition", recording.condition)
        lines.append(condition if is_open else _line("condition", recording.condition))
    lines.append(f"file = {written_text(recording.file)}")
    if recording.part:
        lines.append(f"part = {written_text(recording.part)}")
    if recording.session:
        lines.append(_line("session", Guess(recording.session, recording.session_why)))
    if proposal.question("recordings.side"):
        lines.append(_key(proposal, "recordings.side", recording.side))
    elif recording.side.value:
        lines.append(_line("side", recording.side))
    else:
        lines.append('# side = "right"  # which one?')
    lines += [f"channels.{k} = {_inline(v)}" for k, v in recording.changes.items()]
    if recording.files is not None:
        own = recording.files.model_dump(exclude_none=True)
        lines.append(f"files = {_inline({'encoding': 'utf-8', **own})}")
    lines += _strikes_of(proposal, recording)
    needs = recording.condition.value in ("perturbed", OPEN) or "condition" in proposal.assigned
    if recording.perturbations:
        lines.append(f"perturbations = {written_text(recording.perturbations)}")
    elif needs and not proposal.pulses.source and "command" not in proposal.assigned:
        lines.append(
            '# perturbations = "PULSES.csv"  # a table with onset_s: the times of the pulses'
        )
    return lines + [line for one in recording.joined for line in _joined(proposal, one)]


def _strikes_of(proposal: Proposal, recording: RecordingDraft) -> list[str]:
    own = recording.heel_strikes
    if own is None:
        return []
    lines = [f"heel_strikes = {written_text(own.file)}"]
    if proposal.heel_strikes is not None:
        lines.append(f"channels.heel_strikes.column = {written_text(own.column)}")
    return lines


def _joined(proposal: Proposal, joined: JoinedSource) -> list[str]:
    source = joined.source
    lines = ["[[recordings.joined]]", f"file = {written_text(source.shown)}"]
    if joined.offset_s is None:
        lines.append(_key(proposal, "recordings.joined.offset_s", Guess(OPEN)))
    else:
        offset = Guess(f"{joined.offset_s:g}", "both clocks begin and end together")
        lines.append(_line("offset_s", offset, raw=True))
    if source.content.files is not None and (layout := _own_layout(source.content.files)):
        lines.append(f"files = {_inline(layout)}")
    for name in [n for n in ("time", *joined.channels) if n in source.assigned]:
        inspected, assignment = source.assigned[name]
        keys = {"column": inspected.key} | ({"unit": assignment.unit} if assignment.unit else {})
        turned = proposal.direction_of(name)
        if name == "angle" and source.angle_direction:
            turned = Guess(source.angle_direction, "its range")
        if turned.value not in ("", proposal.positive.value):
            keys["positive"] = turned.value
        open_keys = ("unit", "scale", "positive")
        keys |= {k: OPEN for k in open_keys if proposal.question(f"channels.{name}.{k}")}
        why = "; ".join(filter(None, (assignment.why, assignment.unit_why, turned.why)))
        lines.append(f"channels.{name} = {_inline(keys)}  # guess: {written_comment(why)}")
    return lines


def _perturbations(proposal: Proposal) -> list[str]:
    lines = []
    if proposal.pulses.source and proposal.pulses.source != "command":
        lines.append(_line("source", Guess(proposal.pulses.source, proposal.pulses.why)))
    conditions = {r.condition.value for r in proposal.recordings}
    alone = conditions == {"perturbed"} and "condition" not in proposal.assigned
    # In walking, the recommended methods predict from unperturbed strides of the same recording.
    if alone and proposal.kind.value == "bench":
        why = "the study has no unperturbed recording; remove this line when you add one"
        lines.append(_line("baseline", Guess("pre_pulse", why)))
    if proposal.table_columns:
        lines.append(f"columns = {_inline(proposal.table_columns)}  # guess: by their names")
    if proposal.question("perturbations.first_sample"):
        lines.append(_key(proposal, "perturbations.first_sample", Guess("")))
    elif proposal.in_samples:
        first = Guess(str(proposal.first_sample), "pulses of the command begin there")
        lines.append(_line("first_sample", first, raw=True))
    head = ["", "[perturbations]" if lines else "# [perturbations]"]
    if (proposal.pulses.source or "perturbed" in conditions) and proposal.kind.value == "walking":
        lines += ["# timing_points = { name = % }  # of the cycle: the planned times of the pulses"]
    return head + lines if lines else []


def _own_layout(files: FilesSpec) -> dict[str, Any]:
    """Return the keys of a layout that differ from their defaults."""
    keys = files.model_dump(exclude_defaults=True)
    return {k: v for k, v in keys.items() if (k, v) != ("delimiter", ",")}


def _files(files: FilesSpec | None) -> list[str]:
    if files is None or not (layout := _own_layout(files)):
        return []
    keys = (f"{name} = {_value(value)}" for name, value in layout.items())
    return ["", "[files]  # guess: by the first lines of the file", *keys]
