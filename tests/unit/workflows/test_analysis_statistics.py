"""Notes of an analysis, in plain words."""

from dataclasses import replace
from pathlib import Path

from jointz.core.codes import Doubt
from jointz.core.events import PulseRecord
from jointz.core.participant_model import ParticipantModel
from jointz.core.study import ParticipantSpec, RecordingSpec, Study, StudySpec
from jointz.workflows.analysis_statistics import _doubt_notes, _model_notes, _side_notes


def model(name, *, lag_s=0.006, resonance=0.02, inertia=0.95, curve=0.0, strides=900):
    return ParticipantModel(name, lag_s, 0.001, 1.0, 0.2, resonance, inertia, curve, strides)


def test_the_lag_found_is_told_in_milliseconds_with_its_spread():
    notes = _model_notes([model("S01"), model("S02", lag_s=0.0094)])
    assert notes[0] == (
        "lag: the angle was found to be 6.0 to 9.4 ms behind the torque (sd 1.0 ms); models.csv "
        "has each."
    )


def test_hypotheses_are_counted_as_likely_open_or_unlikely():
    notes = _model_notes(
        [model("S01", inertia=0.99), model("S02", inertia=0.5), model("S03", inertia=0.05)]
    )
    assert notes[2] == (
        "one inertia for all timing points: likely in 1, open in 1, unlikely in 1 of 3."
    )
    assert notes[1].endswith("unlikely in 3 of 3.")


def test_strides_learned_from_are_told_and_one_number_is_no_range():
    assert "learned from 900 strides" in _model_notes([model("S01")])[-1]
    spanned = _model_notes([model("S01"), model("S02", strides=60)])[-1]
    assert "learned from 60 to 900 strides" in spanned


def test_other_methods_have_no_such_notes():
    assert _model_notes([]) == []


def test_who_is_doubted_is_named_with_what_may_be_why():
    doubted = replace(model("S02"), doubts=(Doubt.RESPONSES_DIFFER_WITH_DIRECTION.value,))
    (note,) = _doubt_notes([model("S01"), doubted])
    assert note.startswith("responses_differ_with_direction in 1 of 2 (S02): pulses of the two")
    assert "reflex" in note
    assert _doubt_notes([model("S01")]) == []


def study(recordings):
    people = dict.fromkeys(person for person, _, _ in recordings)
    spec = StudySpec(
        jointz=1,
        joint="knee",
        kind="walking",
        channels={},
        participants=tuple(ParticipantSpec(id=person) for person in people),
        recordings=tuple(
            RecordingSpec(participant=person, file=file, condition="perturbed", side=side)
            for person, file, side in recordings
        ),
    )
    return Study(Path(), spec, "", {})


def pulse(person, file, code=""):
    return PulseRecord(person, file, 1.0, 0.1, 10.0, "LRE", code=code)


def test_whose_sides_are_averaged_is_told_with_how_to_keep_them_apart():
    both = study(
        [
            ("S01", "l.csv", "left"), ("S01", "r.csv", "right"),
            ("S02", "l2.csv", "left"), ("S02", "l3.csv", "left"),
            ("S03", "u.csv", None), ("S03", "r3.csv", "right"),
        ]
    )  # fmt: skip
    pulses = [pulse(r.participant, r.file) for r in both.spec.recordings]

    (note,) = _side_notes(both, pulses)

    assert note.startswith("S01: perturbed recordings are of both sides, and one row a timing")
    assert note.endswith("name them as two participants in study.toml.")


def test_a_side_whose_pulses_are_all_left_out_is_averaged_with_nothing():
    both = study([("S01", "l.csv", "left"), ("S01", "r.csv", "right")])

    assert _side_notes(both, [pulse("S01", "l.csv"), pulse("S01", "r.csv", "gap")]) == []
    assert _side_notes(study([("S01", "l.csv", "left")]), [pulse("S01", "l.csv")]) == []
