"""Questions about a proposed study that only a person can answer."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from jointz.core.channels import OPPOSITE_DIRECTION
from jointz.inspection.guess import InspectedColumn, si_of
from jointz.inspection.inspection_result import Answer, Question, SeenClock
from jointz.inspection.problems import likely_rates
from jointz.inspection.study_draft import Proposal
from jointz.io.text.column_names import EITHER
from jointz.io.toml_problems import OPEN

_MOST_ANSWERS = 3
_LEAST_DEG, _MOST_DEG = 5.0, 250.0  # between them a range without a unit is in degrees
_ALIKE = 1.25  # times the command: beyond it a unit is not decided
#: Inertia of limbs about a joint, kg m2, with a device; beyond so many times a unit is doubted.
_INERTIA = {
    "knee": (0.05, 0.8), "ankle": (0.005, 0.3), "hip": (0.3, 6.0), "elbow": (0.02, 0.4),
    "wrist": (0.0008, 0.05), "shoulder": (0.05, 1.5),
}  # fmt: skip
_FAR = 6.0
_MOST_FOLLOWED = 2.0  # times the command: beyond it a stated unit is doubted
_MOST_NM, _GAIT_RAD = 2000.0, (0.35, 2.0)
#: Size of 1 N*m in units of torque.
_TORQUE_UNITS = {
    "N*m": 1.0, "mN*m": 1000.0, "lbf*in": 8.851, "lbf*ft": 0.7376, "kgf*cm": 10.197, "N*cm": 100.0
}  # fmt: skip
_USUAL_TORQUES = [("N*m", "the usual one"), ("N*m/kg", "inverse dynamics"), ("mN*m", "or counts")]


def questions_of(proposal: Proposal, clock: SeenClock) -> tuple[Question, ...]:
    """Return the questions about a proposed study, the ones that stop an analysis first."""
    questions = [
        *_kind(proposal),
        *_missing(proposal),
        *_heel_strikes(proposal),
        *_clock(proposal, clock),
        *_offsets(proposal),
        *_pulses(proposal),
        *_masses(proposal),
        *_two_units(proposal),
        *_units(proposal),
        *_signs(proposal),
        *_people(proposal),
        *_sessions(proposal),
        *_gait(proposal),
    ]
    return (*questions, *_coupling(proposal))


def _coupling(proposal: Proposal) -> Iterator[Question]:
    driven = "angle" in proposal.assigned and {"torque", "current"} & set(proposal.assigned)
    if proposal.kind.value == "walking" and driven:
        yield Question(
            "coupling",
            "How does the device hold the leg?",
            (Answer("strap", "cuffs on skin and muscle, as on most devices; the default"),
             Answer("rigid", "the device moves with the bone: simulators, bone pins")),
        )  # fmt: skip


def _open(about: str, text: str, *answers: tuple[Any, str]) -> Question:
    """Return a question that stops an analysis, with its answers and what they mean."""
    return Question(about, text, tuple(Answer(*answer) for answer in answers), drafted=False)


def _kind(proposal: Proposal) -> Iterator[Question]:
    if proposal.kind.value == OPEN:
        text = "Does the person walk, or is the limb held on a bench? The angle does not decide it."
        answers = (("walking", "strides"), ("bench", "sitting, lying or standing"))
        yield _open("kind", text, *answers)


def _missing(proposal: Proposal) -> Iterator[Question]:
    """Ask for the column of the angle, and of the torque, among those without a channel."""
    assigned = proposal.assigned
    lacking = ["angle"] if "angle" not in assigned else []
    lacking += [] if {"torque", "current"} & set(assigned) else ["torque"]
    for name in lacking:
        free = [c for c in proposal.main.unassigned if not c.column.is_text and _moves(c)][
            :_MOST_ANSWERS
        ]
        answers = [(c.key, f"'{c.title}', {c.course.low:.4g} to {c.course.high:.4g}") for c in free]
        text = f"Which column is the {name}?"
        if name == "torque":
            text += " Counts or volts of a sensor need scale: torque per count or volt."
        yield _open(f"channels.{name}.column", text, *answers)
    if "current" in assigned and "torque" not in assigned:
        yield _open(
            "torque_model",
            "Which motor and gear? The torque is computed from the current; every value stands in "
            "the data sheet, or jointz identify actuator measures it.",
            ("gear_ratio", "turns of the motor a turn of the joint"),
            ("torque_constant", "N*m/A at the motor's shaft"),
        )


def _heel_strikes(proposal: Proposal) -> Iterator[Question]:
    channels = {"contact", "ground_reaction_force", "cycle"}
    files = all(r.heel_strikes for r in proposal.recordings)
    if proposal.kind.value == "bench" or channels & set(proposal.assigned):
        return
    if proposal.heel_strikes is None and not files and proposal.kind.value != OPEN:
        yield _open(
            "channels.heel_strikes.column",
            "Where are the heel strikes? A study of walking needs a footswitch, a ground reaction "
            "force, or times of heel strikes, in a file of their own, too.",
        )


def _moves(inspected: InspectedColumn) -> bool:
    course = inspected.course
    return course.low is not None and course.low != course.high and not course.rises


def _clock(proposal: Proposal, clock: SeenClock) -> Iterator[Question]:
    if "time" not in proposal.assigned and proposal.rate_hz is None:
        likely = list(likely_rates(proposal.assigned, clock).items())[:_MOST_ANSWERS]
        answers = [(hz, f"strides then last {s:.3g} s") for hz, s in likely]
        usual = [(hz, "a usual rate") for hz in (1000.0, 500.0, 100.0)]
        text = "At what rate, in Hz, was it sampled? It scales K, B and J."
        if len(proposal.rates_hz) > 1:
            text = "The recordings have several rates, and a study without time has one. Add a "
            text += "column of time, or make a study of each rate."
            answers = [(hz, "of some") for hz in proposal.rates_hz]
        yield _open("sample_rate_hz", text, *(answers or usual))
        return
    if "time" in proposal.assigned:
        inspected, assignment = proposal.assigned["time"]
        values = inspected.column.values
        steps = np.unique(np.diff(values[np.isfinite(values)][:1000]))
        if assignment.unit_why and steps.size == 1 and steps[0] == 1.0:
            yield _open(
                "channels.time.scale",
                f"'{inspected.title}' counts by 1 and states no unit. Milliseconds, or samples?",
                (1.0, "milliseconds, 1 kHz"),
                (2.0, "samples at 500 Hz"),
                (10.0, "samples at 100 Hz"),
            )


def _offsets(proposal: Proposal) -> Iterator[Question]:
    joined = (one for recording in proposal.recordings for one in recording.joined)
    unknown = [one.source.shown for one in joined if one.offset_s is None]
    if unknown:
        yield _open(
            "recordings.joined.offset_s",
            f"The clock of {', '.join(unknown[:_MOST_ANSWERS])} does not begin and end with that "
            "of its recording. Time in the recording minus time in this file, s?",
            (0.0, "one clock"),
            ("events_s", "of events in both files, see the docs"),
        )


def _pulses(proposal: Proposal) -> Iterator[Question]:
    if proposal.is_onset_unit_open:
        text = "In what unit are the onsets of the pulse table?"
        yield _open("perturbations.columns.onset.unit", text, ("s", ""), ("ms", ""), ("sample", ""))
    if proposal.in_samples and proposal.first_sample is None:
        yield _open(
            "perturbations.first_sample",
            "The pulse table counts samples. Which number has the first sample of a recording?",
            (1, "MATLAB, LabVIEW, spreadsheets"),
            (0, "Python, C"),
        )
    if levels := [level for level, meant in proposal.levels.items() if meant == OPEN]:
        text = f"Which condition is each level of the column: {', '.join(levels)}?"
        answers = [(name, "") for name in ("unperturbed", "perturbed", "no_device")]
        yield _open("channels.condition.values", text, *answers)
    unknown = [r.file for r in proposal.recordings if r.condition.value == OPEN]
    if unknown and "condition" not in proposal.assigned:
        yield _open(
            "recordings.condition",
            f"No pulses were found in {', '.join(unknown[:_MOST_ANSWERS])}. Were there any? A "
            "random torque or position has none: see jointz identify --help.",
            ("unperturbed", "there are none"),
            ("perturbed", "name the command, or a table: perturbations"),
            ("no_device", "walking without the device"),
        )


def _masses(proposal: Proposal) -> Iterator[Question]:
    per_mass = [n for n, (_, a) in proposal.assigned.items() if a.unit.endswith("/kg")]
    lacking = sorted({r.participant.value for r in proposal.recordings if not r.mass_kg})
    if per_mass and lacking:
        text = f"The {per_mass[0]} is per body mass. What is the mass of {', '.join(lacking)}, kg?"
        yield _open("participants.mass_kg", text, (70.0, "an average: give the person's own"))


def _two_units(proposal: Proposal) -> Iterator[Question]:
    for name, (inspected, assignment) in proposal.assigned.items():
        if EITHER in inspected.column.unit:
            units = {assignment.unit: "", **dict.fromkeys(inspected.column.unit.split(EITHER), "")}
            text = f"The file states two units of '{inspected.title}'. Which is right?"
            yield _open(f"channels.{name}.unit", text, *units.items())


def _units(proposal: Proposal) -> Iterator[Question]:
    if "angle" in proposal.assigned:
        yield from _angle_unit(proposal)
    if "torque" not in proposal.assigned:
        return
    unlike = [
        r.file for r in proposal.recordings if r.changes.get("torque", {}).get("unit") == OPEN
    ]
    if unlike:
        text = f"In what unit is the torque of {', '.join(unlike[:_MOST_ANSWERS])}? It is of "
        text += "another size than the first's."
        yield _open("recordings.channels.torque.unit", text, ("N*m", ""), ("mN*m", ""))
    yield from _torque_unit(proposal)


def _angle_unit(proposal: Proposal) -> Iterator[Question]:
    """Ask for a unit that is not stated, unless a walking joint bends so far in radians."""
    inspected, assignment = proposal.assigned["angle"]
    low, high = inspected.course.low or 0.0, inspected.course.high or 0.0
    as_gait = proposal.kind.value == "walking" and _GAIT_RAD[0] < high - low < _GAIT_RAD[1]
    decided = as_gait if assignment.unit == "rad" else _is_in_degrees(proposal, inspected)
    if assignment.unit_why and not inspected.column.unit_why and not decided:
        text = f"In what unit is the angle '{inspected.title}', {low:.3g} to {high:.3g}? "
        text += "Counts and volts need scale, too: the angle of one in that unit."
        yield _open("channels.angle.unit", text, ("deg", ""), ("rad", ""), ("turn", ""))


def _is_in_degrees(proposal: Proposal, inspected: InspectedColumn) -> bool:
    """Return whether the range of a joint's angle can only be one of degrees."""
    low, high = inspected.course.low or 0.0, inspected.course.high or 0.0
    far = _LEAST_DEG < high - low < _MOST_DEG and max(abs(low), abs(high)) < _MOST_DEG
    return proposal.signs.angle_by_range or (far and not inspected.course.whole)


def _torque_unit(proposal: Proposal) -> Iterator[Question]:
    inspected, assignment = proposal.assigned["torque"]
    if si_of(assignment)[0] == "V":
        text = f"How many N*m is 1 V of '{inspected.title}'? Give the sensor's calibration."
        yield _open("channels.torque.scale", text)
    ratio, command = proposal.torque_over_command, proposal.assigned.get("command")
    stated = not assignment.unit_why or bool(inspected.column.unit_why)
    if command and command[1].unit_why and not (stated and _is_like(ratio, _ALIKE)):
        text = f"In what unit is the command '{command[0].title}'?"
        yield _open("channels.command.unit", text, ("N*m", ""), ("mN*m", ""))
        ratio = None
    factor = si_of(assignment)[1]
    largest = max(abs(inspected.course.low or 0.0), abs(inspected.course.high or 0.0))
    least, most = _INERTIA[proposal.joint.value]
    inertia = math.nan if assignment.unit.endswith("/kg") else proposal.signs.inertia / factor
    is_odd = inertia * factor < least / _FAR or inertia * factor > most * _FAR
    is_followed = _is_like(ratio, _MOST_FOLLOWED if stated else _ALIKE)
    decided = is_followed or (ratio is None and stated)
    if decided and not is_odd and largest * factor < _MOST_NM:
        return
    text = f"In what unit is the torque '{inspected.title}', up to {largest:.3g}?"
    sizes = (math.nan, math.nan)
    if is_odd:
        text += f" In {assignment.unit} the limb's inertia would be {inertia * factor:.2g} kg m2."
        sizes = (inertia / most, inertia / least)
    if ratio is not None and not is_followed:
        text += f" In pulses it changes by {ratio:.3g} times the command."
        sizes = (abs(ratio) / factor / _ALIKE, abs(ratio) / factor * _ALIKE)
    likely = [unit for unit, size in _TORQUE_UNITS.items() if sizes[0] <= size <= sizes[1]]
    answers = [(unit, "as the pulses then") for unit in likely] or _USUAL_TORQUES
    yield _open("channels.torque.unit", text, *answers)


def _is_like(ratio: float | None, factor: float) -> bool:
    return ratio is not None and bool(1 / factor <= abs(ratio) <= factor)


def _signs(proposal: Proposal) -> Iterator[Question]:
    """Ask for directions; where the angle's is open or opposite, for those of the others, too."""
    positive, assigned = proposal.positive.value, proposal.assigned
    directions = ((positive, "the usual one"), (OPPOSITE_DIRECTION[positive], "the other"))
    if proposal.signs.current_open:
        text = "In which direction does a positive current of the motor push the joint?"
        yield _open("channels.current.positive", text, *directions)
    if proposal.signs.angle_open:
        inspected, assignment = assigned["angle"]
        low, high = inspected.course.low, inspected.course.high
        text = "In which direction does the angle grow?"
        text += "" if low is None else f" It goes from {low:.4g} to {high:.4g} {assignment.unit}."
        yield _open("channels.angle.positive", text, *directions)
    if "torque" in assigned and proposal.signs.acts_on_open:
        yield _open(
            "torque_acts_on",
            "Is the torque that of the device on the joint, or of the leg on the device?",
            ("joint", "a positive torque pushes towards the positive angle; the default"),
            ("device", "a sensor that measures what the leg does, or inverse dynamics"),
        )
    is_turned = proposal.signs.acts_on_open and proposal.signs.angle.value not in ("", positive)
    known = {"torque": proposal.signs.torque.value, "command": proposal.signs.command.value}
    for name in [n for n in known if n in assigned and not known[n]]:
        if proposal.signs.angle_open or is_turned:
            text = f"In which direction does the {name} count?"
            text += "" if proposal.signs.acts_on_open else " As the angle, by the pulses."
            yield _open(f"channels.{name}.positive", text, *directions)


def _people(proposal: Proposal) -> Iterator[Question]:
    unknown = [r.file for r in proposal.recordings if r.participant.value == OPEN]
    if unknown:
        files = ", ".join(unknown[:_MOST_ANSWERS])
        text = f"Who is in {files}? No name of a file or folder says it."
        yield _open("recordings.participant", text, ("S01", ""))


def _sessions(proposal: Proposal) -> Iterator[Question]:
    numbered = [r for r in proposal.recordings if r.session_why]
    if numbered:
        yield Question(
            "recordings.session",
            f"{len(numbered)} recordings have the same participant and condition. Days or "
            "donnings of their own, or trials of one?",
            (Answer(numbered[0].session, "each is estimated by itself"),
             Answer("", "join them into one file with a column that counts trials")),
        )  # fmt: skip


def _gait(proposal: Proposal) -> Iterator[Question]:
    """Ask for the planned times of pulses and the leg, which an analysis can do without."""
    if proposal.kind.value != "walking":
        return
    if any(r.condition.value == "perturbed" for r in proposal.recordings):
        yield Question(
            "perturbations.timing_points",
            "At which % of the gait cycle were the pulses planned?",
            (Answer(None, "the six of the dissertation: 7, 21.5, 40.5, 56, 68.5, 81"),
             Answer("{ name = % }", "your own")),
        )  # fmt: skip
    if unknown := [r for r in proposal.recordings if not r.side.value]:
        yield Question(
            "recordings.side",
            f"Which leg was measured ({len(unknown)} recording(s))? It matters where both were.",
            (Answer(None, "unknown, or the same in all"), Answer("right", ""), Answer("left", "")),
        )
    if proposal.is_leg_open:
        text = "Which leg wears the device? The file has columns of both."
        answers = (("right", "as drafted"), ("left", "name its columns in [channels]"))
        yield _open("recordings.side", text, *answers)
