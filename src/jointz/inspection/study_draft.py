"""Draft of a ``study.toml``, in which each guess is marked with its reason."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from jointz.core.channels import CHANNEL_UNITS, LABEL_CHANNELS, OPPOSITE_DIRECTION
from jointz.core.study import FilesSpec
from jointz.inspection.guess import Assignment, InspectedColumn, guessed_condition
from jointz.inspection.problems import Assignments, Pulses
from jointz.io.toml_text import written_comment, written_key, written_text

_PERSON = re.compile(
    r"(?<![A-Za-z])((?:sub-?|s|p|pt|subj|subject|vp|tn)_?\d+)(?!\d)", re.IGNORECASE
)
_POSITIVE = {"ankle": "dorsiflexion"}
_LONGEST_LIST = 12
_CHANNELS = (*CHANNEL_UNITS, *LABEL_CHANNELS, "contact")


@dataclass(frozen=True, slots=True)
class Guess:
    """A value and the reason for it."""

    value: str
    why: str = ""  # "" if the value is known


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """Content of a ``study.toml``."""

    file: str  # name of the file in the study
    assigned: Assignments  # channel -> column
    joint: Guess  # key ``joint``
    kind: Guess  # key ``kind``
    acts_on: Guess  # key ``torque_acts_on``
    side: Guess  # key ``side`` of the recording; "" if unknown
    condition: Guess  # key ``condition`` of the recording; "" if a column holds conditions
    pulses: Pulses = field(default_factory=Pulses)
    files: FilesSpec | None = None  # layout of a text file; None for other formats
    rate_hz: float | None = None  # rate stated by the file; None if not stated
    # Hz, as text: proposed rate if the file states none; not used by an analysis
    rate_guess: Guess = Guess("1000.0")
    obstacles: tuple[str, ...] = ()  # reasons why the file cannot be analysed
    free: tuple[InspectedColumn, ...] = ()  # columns without a channel
    # level of the column of conditions -> condition
    levels: Mapping[str, str] = field(default_factory=dict)


def study_text(proposal: Proposal) -> str:
    """Return the text."""
    lines = [
        f"# Proposed by jointz inspect for {written_comment(proposal.file)}.",
        "# Lines marked 'guess' are guesses: check each, correct it, and remove the mark.",
        "# Lines behind '#' are off: if one applies, fill in what you know and remove its '#'.",
        *(
            f"# Cannot be analysed as it is: {written_comment(reason)}"
            for reason in proposal.obstacles
        ),
        "jointz = 1",
        _line("joint", proposal.joint),
        _line("kind", proposal.kind),
        _line("positive", _positive(proposal)),
        _line("torque_acts_on", proposal.acts_on),
        *_coupling(proposal),
        *_rate(proposal),
    ]
    for name in proposal.assigned:
        lines += _channel(proposal, name)
    lines += _missing(proposal) + _others(proposal.free)
    lines += _people(proposal) + _recording(proposal) + _perturbations(proposal)
    return "\n".join([*lines, *_files(proposal.files)]) + "\n"


def _line(key: str, guess: Guess, *, raw: bool = False) -> str:
    value = guess.value if raw else written_text(guess.value)
    mark = f"  # guess: {written_comment(guess.why)}" if guess.why else ""
    return f"{key} = {value}{mark}"


def _positive(proposal: Proposal) -> Guess:
    angle = proposal.assigned.get("angle")
    options = angle[0].words.direction if angle else ""
    if options:
        return Guess(options, "by the angle's name")
    return Guess(_POSITIVE.get(proposal.joint.value, "flexion"), "the usual one")


def _coupling(proposal: Proposal) -> list[str]:
    if proposal.kind.value != "walking":
        return []
    return [_line("coupling", Guess("strap", '"rigid" where the device moves with the bone'))]


def _rate(proposal: Proposal) -> list[str]:
    if "time" in proposal.assigned:
        return []
    if proposal.rate_hz is not None:
        return [f"sample_rate_hz = {proposal.rate_hz!r}"]
    return [f"# {_line('sample_rate_hz', proposal.rate_guess, raw=True)}"]


def _channel(proposal: Proposal, name: str) -> list[str]:
    inspected, assignment = proposal.assigned[name]
    column = str(inspected.key) if isinstance(inspected.key, int) else written_text(inspected.key)
    title = f" ('{inspected.column.title}')" if inspected.column.title else ""
    lines = ["", f"[channels.{name}]"]
    lines.append(_line("column", Guess(column, f"{assignment.why}{title}"), raw=True))
    if name == "contact":
        volts = bool(assignment.unit)
        why = "more than two levels" if volts else "two levels"
        lines.append(_line("kind", Guess("voltage" if volts else "contact", why)))
    if assignment.unit:
        lines.append(_line("unit", Guess(assignment.unit, assignment.unit_why)))
    direction = inspected.words.direction
    if name in ("angle", "torque") and direction and direction != _positive(proposal).value:
        lines.append(_line("positive", Guess(direction, "its name says it")))
    if name == "angle" and not direction and _sign_is_open(proposal):
        lines.append(f"# {_line('positive', _turned(proposal))}")
    if name == "condition" and proposal.levels:
        levels = ", ".join(
            f"{written_text(level)} = {written_text(condition)}"
            for level, condition in proposal.levels.items()
        )
        meant = Guess(f"{{ {levels} }}", "likely meaning of the levels")
        lines.append(_line("values", meant, raw=True))
    return lines


def _sign_is_open(proposal: Proposal) -> bool:
    # On a bench without a command, torque_acts_on was guessed by the angle, whose sign is settled.
    return proposal.kind.value == "walking" or proposal.pulses.source == "command"


def _turned(proposal: Proposal) -> Guess:
    inspected, assignment = proposal.assigned["angle"]
    low, high = inspected.course.low, inspected.course.high
    reach = "" if low is None or high is None else f", {low:.4g} to {high:.4g} {assignment.unit},"
    why = f"usually off; is the angle{reach} positive in this direction?"
    return Guess(OPPOSITE_DIRECTION[_positive(proposal).value], why)


def _missing(proposal: Proposal) -> list[str]:
    lines = []
    for name, unit in (("angle", "rad"), ("torque", "N*m")):
        if name not in proposal.assigned:
            lines += ["", f"# [channels.{name}]  # not found in the file; name its column"]
            lines += ['# column = "?"', f'# unit = "{unit}"']
    return lines


def _others(free: Sequence[InspectedColumn]) -> list[str]:
    if not free:
        return []
    names = [written_comment(c.title) for c in free[:_LONGEST_LIST]]
    more = f" and {len(free) - _LONGEST_LIST} more" if len(free) > _LONGEST_LIST else ""
    word = re.sub(r"\W+", "_", names[0].casefold(), flags=re.ASCII).strip("_")
    one = word if word and not word.isdecimal() else "own"
    one = f"own_{one}" if one in _CHANNELS else one
    return [
        "",
        f"# Columns without a channel: {', '.join(names)}{more}. To keep one of them:",
        f"# [channels.{written_key(one)}]",
        f"# column = {free[0].key if isinstance(free[0].key, int) else written_text(free[0].key)}",
    ]


def _people(proposal: Proposal) -> list[str]:
    person = _person(proposal.file)
    return [
        "",
        "[[participants]]",
        _line("id", person),
        "# mass_kg = 70.0  # only for values per kg",
    ]


def _person(file: str) -> Guess:
    found = _PERSON.search(Path(file).name.replace("_", " "))
    if found:
        return Guess(found[1].replace(" ", ""), "the file's name")
    return Guess("S01", "the file does not state it")


def _recording(proposal: Proposal) -> list[str]:
    person = _person(proposal.file).value
    lines = ["", "[[recordings]]", f"participant = {written_text(person)}"]
    if "condition" not in proposal.assigned:
        lines.append(_line("condition", proposal.condition))
    lines.append(f"file = {written_text(proposal.file)}")
    if proposal.side.value:
        lines.append(_line("side", proposal.side))
    else:
        lines.append('# side = "right"  # which one?')
    needs = proposal.condition.value == "perturbed" or "condition" in proposal.assigned
    if needs and not proposal.pulses.source and "command" not in proposal.assigned:
        lines.append(
            '# perturbations = "PULSES.csv"  # a table with onset_s: the times of the pulses'
        )
    lines.append("# [[participants]]  # another one for each other person")
    lines.append("# [[recordings]]  # another one for each other file, such as one without pulses")
    return lines


def _perturbations(proposal: Proposal) -> list[str]:
    lines = []
    if proposal.pulses.source and proposal.pulses.source != "command":
        lines.append(_line("source", Guess(proposal.pulses.source, proposal.pulses.why)))
    alone = proposal.condition.value == "perturbed" and "condition" not in proposal.assigned
    # In walking, the recommended methods predict from unperturbed strides of the same recording.
    if alone and proposal.kind.value == "bench":
        why = "the study has no unperturbed recording; remove this line when you add one"
        lines.append(_line("baseline", Guess("pre_pulse", why)))
    asked = []
    if proposal.pulses.source and proposal.kind.value == "walking":
        asked = ["# timing_points = { name = % }  # of the cycle: the planned times of the pulses"]
    if not lines and not asked:
        return []
    return ["", "[perturbations]" if lines else "# [perturbations]", *lines, *asked]


def _files(files: FilesSpec | None) -> list[str]:
    if files is None:
        return []
    found = {k: v for k, v in files.model_dump().items() if v != FilesSpec.model_fields[k].default}
    if found.get("delimiter") == ",":
        del found["delimiter"]
    if not found:
        return []
    lines = ["", "[files]  # guess: by the first lines of the file"]
    for name, value in found.items():
        written = str(value).lower() if isinstance(value, bool | int) else written_text(value)
        lines.append(f"{name} = {written}")
    return lines


def condition_levels(inspected: InspectedColumn) -> dict[str, str]:
    """Return the likely meaning of the levels of a column of conditions."""
    levels = [level for level in inspected.course.levels if level]
    return {level: guessed_condition(level) or "unperturbed" for level in levels}


def assignments_by_column(assigned: Assignments) -> dict[int, Assignment]:
    """Return the assignment of each column, by the column's identity."""
    return {id(inspected): assignment for inspected, assignment in assigned.values()}
