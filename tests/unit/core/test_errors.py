"""The tree of errors: what is caught by what, and what an error knows."""

import inspect
import pickle
import re

import pytest

from jointz.core import errors
from jointz.core.errors import (
    DataError,
    EstimationError,
    JointzError,
    OutputError,
    StudyError,
    UnitError,
)

CLASSES = {
    name: cls
    for name, cls in inspect.getmembers(errors, inspect.isclass)
    if cls.__module__ == errors.__name__ and not name.startswith("_")
}


def test_every_error_is_a_jointz_error():
    assert all(issubclass(cls, JointzError) for cls in CLASSES.values())


def test_the_tree_of_the_documentation_is_the_tree_of_the_classes():
    """Depth in the drawing is the number of public ancestors below JointzError."""
    drawn = re.findall(r"^    ([│ ├└─]*)([A-Z]\w+)", errors.__doc__, flags=re.MULTILINE)

    def ancestors(cls):
        public = [c for c in cls.__mro__[1:] if c in CLASSES.values()]
        return [c.__name__ for c in public][::-1]

    path: list[str] = []
    for branch, name in drawn:
        path = path[: len(branch) // 4]
        assert ancestors(CLASSES[name]) == path, name
        path.append(name)
    assert {name for _, name in drawn} == set(CLASSES)


@pytest.mark.parametrize(
    "error",
    [
        JointzError("told"),
        DataError("told", path="a.csv", channel="angle", row=3),
        StudyError("study.toml", ["one", "two"]),
        errors.EntryError("entry.toml", ["one", "two"]),
        EstimationError("no_pulses", "told"),
        errors.DeviceError("motor", "is gone"),
        errors.SafetyStop("posture", "told"),
        errors.WriteError("a.nc", OSError(28, "No space left on device")),
    ],
    ids=lambda error: type(error).__name__,
)
def test_an_error_comes_whole_out_of_another_process(error):
    error.add_note("and how to go on")
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert vars(again) == vars(error)


@pytest.mark.parametrize(
    "cls", [DataError, StudyError, UnitError, errors.ProtocolError, errors.EntryError]
)
def test_bad_input_can_be_caught_as_a_value_error(cls):
    assert issubclass(cls, DataError)
    assert issubclass(cls, ValueError)


@pytest.mark.parametrize("cls", [EstimationError, OutputError, errors.DeviceError])
def test_what_is_no_bad_input_is_no_value_error(cls):
    assert not issubclass(cls, ValueError)


@pytest.mark.parametrize("cls", [StudyError, errors.ProtocolError, errors.EntryError])
@pytest.mark.parametrize(
    ("problems", "text"),
    [
        (["one"], "study.toml: 1 problem\n  - one"),
        (["one", "two"], "study.toml: 2 problems\n  - one\n  - two"),
    ],
)
def test_all_problems_stand_in_one_message(cls, problems, text):
    error = cls("study.toml", problems)

    assert str(error) == text
    assert error.problems == tuple(problems)
    assert error.path == "study.toml"


@pytest.mark.parametrize(
    ("error", "text", "fields"),
    [
        (
            DataError("a.csv, row 3: no number.", path="a.csv", channel="angle", row=3),
            "a.csv, row 3: no number.",
            {"path": "a.csv", "channel": "angle", "row": 3},
        ),
        (UnitError("no unit"), "no unit", {"path": None, "channel": None, "row": None}),
        (EstimationError("ill_conditioned", "Add."), "Add.", {"code": "ill_conditioned"}),
        (
            errors.NotConnectedError("goniometer", "no answer in 1 s. Plug it in."),
            "goniometer: no answer in 1 s. Plug it in.",
            {"device": "goniometer"},
        ),
        (
            errors.SafetyStop("posture", "angle 2.1 rad, limit 1.9 rad."),
            "safety: posture: angle 2.1 rad, limit 1.9 rad.",
            {"device": "safety", "code": "posture"},
        ),
    ],
    ids=lambda value: type(value).__name__,
)
def test_an_error_says_what_happened_and_holds_it_in_fields(error, text, fields):
    assert str(error) == text
    assert {name: getattr(error, name) for name in fields} == fields
