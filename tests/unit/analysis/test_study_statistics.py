"""Notes of an analysis, in plain words."""

from pathlib import Path

import pytest

from jointz.analysis.study_statistics import _session_notes
from jointz.core.events import PulseRecord, StrideRecord
from jointz.core.study import Study, StudySpec
from jointz.identify.participant import ParticipantResult


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


@pytest.mark.parametrize("method", ["dissertation", "rigid"])
def test_unperturbed_motion_of_another_session_is_told_with_the_participant(method):
    days = [("perturbed", "b", "left"), ("unperturbed", "a", "left")]

    (note,) = note_of_sessions(*days, method=method)

    assert note.startswith("S01, b, left:")


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
