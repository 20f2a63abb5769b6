"""The registry of controllers: which there are, and what is said of those that do not fit."""

import sys
import tomllib
from importlib.metadata import EntryPoint
from pathlib import Path
from types import SimpleNamespace

import pytest

from jointz.core.errors import DataError, ProtocolError
from jointz.core.protocols.protocol_models import ControllerSpec
from jointz.io.protocols import load_protocol
from jointz.rig.devices.interface import Wearer
from jointz.rig.experiment.controllers import (
    BUILT_IN,
    GROUP,
    ControlParameter,
    make_controller,
    refuse_bad_controllers,
)

KNEE = load_protocol("knee_controller")
SOMEBODY = Wearer("S01", 70.0, 1.75)
SHARE = ControlParameter(0.1, 0.0, 1.0, 0.5, "1")


class Constant:
    """A controller whose parameters and description a test chooses."""

    def __init__(self, parameters=None, description=None):
        self.parameters = {"share": SHARE} if parameters is None else parameters
        self.description = {"torque_nm": 1.0} if description is None else description

    def torque(self, _state, values):
        return values["share"]

    def describe(self):
        return self.description


def constant(spec, *, protocol, wearer):
    return Constant()


def picky(spec, *, protocol, wearer):
    if spec.settings.get("share") != 0.5:
        raise DataError(f"settings.share: expected 0.5 for {wearer.id}.")
    return Constant()


def broken(spec, *, protocol, wearer):
    raise ZeroDivisionError("a bug")


def empty(spec, *, protocol, wearer):
    return object()


def too_high(spec, *, protocol, wearer):
    return Constant({"share": ControlParameter(2.0, 0.0, 1.0, 0.5, "1")})


def still(spec, *, protocol, wearer):
    return Constant({"share": ControlParameter(0.5, 0.0, 1.0, 0.0, "1")})


def secretive(spec, *, protocol, wearer):
    return Constant(description={"table": float("nan")})


NO_FUNCTION = 3
NAMES = ["constant", "picky", "broken", "empty", "too_high", "still", "secretive"]
NAMES += ["NO_FUNCTION", "nothing"]


@pytest.fixture(autouse=True)
def installed(monkeypatch):
    """Install a package that registers controllers, one under the name of one of jointz."""
    points = [EntryPoint(name.lower(), f"{__name__}:{name}", GROUP) for name in NAMES]
    points.append(EntryPoint("four_state", f"{__name__}:broken", GROUP))
    monkeypatch.setitem(sys.modules, __name__, SimpleNamespace(**globals()))
    monkeypatch.setattr("jointz.core.entry_points.entry_points", lambda **_group: points)


def make(name, **more):
    return make_controller(ControllerSpec(name=name, **more), protocol=KNEE, wearer=SOMEBODY)


def test_the_controllers_of_jointz_are_entry_points_that_make_controllers():
    project = tomllib.loads((Path(__file__).parents[4] / "pyproject.toml").read_text("utf-8"))

    assert project["project"]["entry-points"][GROUP] == dict(BUILT_IN)
    for condition in KNEE.conditions:
        made = make_controller(condition.controller, protocol=KNEE, wearer=SOMEBODY)
        assert all(one.low <= one.value <= one.high for one in made.parameters.values())


def test_a_controller_of_another_package_is_made_for_the_wearer():
    assert isinstance(make("constant"), Constant)
    with pytest.raises(DataError, match=r"settings.share: expected 0.5 for S01"):
        make("picky")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("four_states", "expected one of .*four_state.*got 'four_states'. Did you mean 'four_sta"),
        ("nothing", r"controller 'nothing' \(.*:nothing\): cannot be imported"),
        ("no_function", "expected a function that makes a controller, got 3"),
        ("broken", r"controller 'broken' .*could not be made \(ZeroDivisionError: a bug\)"),
        ("empty", "expected a controller .parameters, torque, describe., got <object"),
        ("too_high", "parameter share: expected finite low <= value <= high"),
        ("still", "parameter share: expected rate_per_s > 0, got 0"),
        ("secretive", "describe: expected plain JSON"),
    ],
)
def test_a_controller_that_does_not_fit_is_named(name, message):
    with pytest.raises(DataError, match=message):
        make(name)


def test_all_problems_of_a_protocol_are_told_at_once_for_every_wearer():
    conditions = [
        condition.model_copy(update={"controller": ControllerSpec(name=name)})
        for condition, name in zip(
            KNEE.conditions, ("picky", "constant", "no_such", "picky"), strict=True
        )
    ]
    protocol = KNEE.model_copy(update={"conditions": tuple(conditions)})

    with pytest.raises(ProtocolError) as raised:
        refuse_bad_controllers(protocol, [SOMEBODY, Wearer("S02")])

    places = [problem.split(":")[0] for problem in raised.value.problems]
    assert places.count("conditions[1].controller") == 2  # another text for each wearer
    assert places.count("conditions[3].controller") == 1  # the same for both
    assert places.count("conditions[4].controller") == 2
