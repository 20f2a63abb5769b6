"""The tree of errors: what is caught by what, and what an error knows."""

import pickle

import pytest

from jointz.core import errors
from jointz.core.errors import (
    DataError,
    DeviceError,
    EstimationError,
    OutputError,
    ProtocolError,
    SafetyStop,
    StudyError,
    WriteError,
)


def test_bad_input_alone_can_be_caught_as_a_value_error():
    for cls in (DataError, StudyError, errors.UnitError, ProtocolError):
        assert issubclass(cls, DataError)
        assert issubclass(cls, ValueError)
    for cls in (EstimationError, OutputError, DeviceError):
        assert not issubclass(cls, ValueError)


@pytest.mark.parametrize(
    ("error", "fields"),
    [
        (DataError("told", path="a.csv", row=3), {"path": "a.csv", "row": 3, "channel": None}),
        (StudyError("study.toml", ["one"]), {"path": "study.toml", "problems": ("one",)}),
        (EstimationError("ill_conditioned", "Add."), {"code": "ill_conditioned"}),
        (DeviceError("motor", "is gone"), {"device": "motor"}),
        (SafetyStop("posture", "angle 2.1 rad."), {"device": "safety", "code": "posture"}),
        (WriteError("a.nc", OSError(28, "No space left on device")), {}),
    ],
    ids=lambda value: type(value).__name__,
)
def test_an_error_has_fields_and_comes_whole_out_of_another_process(error, fields):
    assert {name: getattr(error, name) for name in fields} == fields
    error.add_note("and how to go on")
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert vars(again) == vars(error)
