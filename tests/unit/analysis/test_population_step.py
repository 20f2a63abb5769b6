"""Notes of an analysis, in plain words."""

from dataclasses import replace
from pathlib import Path

import pytest

from jointz.analysis.population_step import _doubt_notes, _model_notes, _session_notes
from jointz.core.codes import Doubt
from jointz.core.events import PulseRecord, StrideRecord
from jointz.core.study import Study, StudySpec
from jointz.identify.participant import ParticipantResult
from jointz.results.participant_model import ParticipantModel


def model(name, *, lag_s=0.006, resonance=0.02, inertia=0.95, curve=0.0, strides=900):
    return ParticipantModel(name, lag_s, 0.001, 1.0, 0.2, resonance, inertia, curve, strides)


def test_models_are_summarised_with_spans_and_counts():
    models = [
        model("S01", inertia=0.99),
        model("S02", lag_s=0.0094, inertia=0.5, strides=60),
        model("S03", inertia=0.05),
    ]
    lag, resonance, inertia, _, strides = _model_notes(models)
    assert lag == (
        "estimated lag of the angle behind the torque: 6.0 to 9.4 ms (sd 1.0 ms); models.csv has "
        "each."
    )
    assert resonance.endswith("unlikely in 3 of 3.")
    assert inertia == (
        "one inertia for all timing points: likely in 1, open in 1, unlikely in 1 of 3."
    )
    assert "trained on 60 to 900 strides" in strides
    assert "trained on 900 strides" in _model_notes(models[:1])[-1]
    assert _model_notes([]) == []


def test_who_is_doubted_is_named_with_what_may_be_why():
    doubted = replace(model("S02"), doubts=(Doubt.RESPONSES_DIFFER_WITH_DIRECTION.value,))
    (note,) = _doubt_notes([model("S01"), doubted])
    assert note.startswith("responses_differ_with_direction in 1 of 2 participants (S02): pulses")
    assert "reflex" in note
    assert _doubt_notes([model("S01")]) == []


def note_of_sessions(*recordings, method="dissertation", baseline=None):
    """Return the notes about one pulse or stride a (condition, session, side)."""
    spec = StudySpec.model_validate(
        {
            **{"jointz": 1, "joint": "knee", "kind": "walking", "channels": {}},
            "participants": [{"id": "S01"}],
            "recordings": [{"participant": "S01", "file": "p.csv"}],
            "perturbations": {"baseline": baseline} if baseline else {},
        }
    )
    pulses = tuple(
        PulseRecord("S01", "p.csv", 1.0, 0.1, 10.0, "LRE", session=session, side=side)
        for condition, session, side in recordings
        if condition == "perturbed"
    )
    strides = tuple(
        StrideRecord("S01", "r.csv", condition, 0.0, 1.0, session=session, side=side)
        for condition, session, side in recordings
    )
    result = ParticipantResult({}, (), pulses, strides, ())
    return _session_notes(Study(Path(), spec, "", {}), method, [result])


def test_unperturbed_motion_of_another_session_is_told_with_both_sessions():
    days = [("perturbed", "b", "left"), ("unperturbed", "a", "left")]

    (note,) = note_of_sessions(*days)

    assert note.startswith(
        "S01, b, left: no unperturbed recording of session 'b'; the unperturbed motion of "
        "session 'a' is used."
    )
    assert "own unperturbed strides" in note_of_sessions(*days, method="recommended")[0]


@pytest.mark.parametrize("unperturbed", [("b", "left"), ("", ""), ("b", "")])
def test_unperturbed_motion_of_the_session_itself_or_of_none_has_no_note(unperturbed):
    assert not note_of_sessions(
        ("perturbed", "b", "left"), ("unperturbed", "a", "left"), ("unperturbed", *unperturbed)
    )


def test_a_level_before_the_pulse_has_no_note_of_sessions():
    days = [("perturbed", "b", ""), ("unperturbed", "a", "")]

    assert note_of_sessions(*days)
    assert not note_of_sessions(*days, method="pre_pulse")
    assert not note_of_sessions(*days, baseline="pre_pulse")
