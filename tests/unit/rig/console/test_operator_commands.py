"""What is asked for is checked before it reaches a session."""

import json

import pytest

from jointz.core.errors import DataError
from jointz.rig.console import operator_commands
from jointz.rig.console.operator_commands import Heartbeat, OperatorCommands
from jointz.rig.experiment.control_box import Command, ControlBox, Order
from jointz.rig.experiment.files.journal import Journal


class Process:
    """Would run a session."""

    def __init__(self):
        self.lives, self.started = True, []
        self.is_own = False

    @property
    def number(self):
        return 4711 if self.lives else None

    def alive(self):
        return self.lives

    def start(self, *, resume):
        self.started.append(resume)


class Room:
    """Commands of an operator, with the box that a session reads."""

    def __init__(self, study):
        self.folder = study / "sessions" / "S01"
        self.folder.mkdir(parents=True)
        self.box = ControlBox(self.folder / "control")
        self.process = Process()
        self.status = {"condition": "perturbed", "participant": "S01", "reason": ""}
        self.status["state"] = "waiting"
        self.desk = OperatorCommands(study, self.process, lambda: dict(self.status))

    def ask(self, **message):
        self.desk.ask(json.dumps(message).encode())


@pytest.fixture
def room(tmp_path):
    made = Room(tmp_path)
    yield made
    made.box.__exit__(None, None, None)


@pytest.mark.parametrize(
    ("state", "message", "order"),
    [
        ("waiting", {"order": "start", "condition": "perturbed"}, Order.START),
        ("running", {"order": "pause"}, Order.PAUSE),
        ("paused", {"order": "go_on"}, Order.GO_ON),
        ("running", {"order": "note", "text": "left strap"}, Order.NOTE),
        ("waiting", {"order": "note", "text": "left strap"}, Order.NOTE),
    ],
)
def test_what_fits_is_passed_on(room, state, message, order):
    room.status["state"] = state
    room.ask(**message)
    command = room.box.take()
    assert command.order is order
    assert command.text == message.get("text", "")


@pytest.mark.parametrize(
    ("state", "message"),
    [
        ("running", {"order": "start", "condition": "perturbed"}),
        ("waiting", {"order": "start", "condition": "another"}),
        ("waiting", {"order": "pause"}),
        ("running", {"order": "go_on"}),
        ("running", {"order": "rearm", "reason": ""}),
    ],
)
def test_what_was_meant_for_another_moment_is_refused(room, state, message):
    room.status["state"] = state
    with pytest.raises(DataError, match="session is"):
        room.ask(**message)
    assert room.box.take() is None
    assert room.process.started == []


STIFFNESS = {"value": 40.0, "low": 0.0, "high": 60.0, "rate_per_s": 10.0, "unit": "N*m/rad"}
CONTROLLER = {"name": "impedance_constant", "parameters": {"stiffness": STIFFNESS}}


@pytest.mark.parametrize("state", ["running", "paused"])
@pytest.mark.parametrize(
    ("message", "command"),
    [
        (
            {"order": "set", "name": "stiffness", "value": 45.5},
            Command(Order.SET, "stiffness=45.5"),
        ),
        ({"order": "set", "name": "stiffness", "value": 60}, Command(Order.SET, "stiffness=60.0")),
        ({"order": "undo"}, Command(Order.UNDO)),
    ],
)
def test_a_parameter_of_a_controller_is_passed_on(room, state, message, command):
    room.status |= {"state": state, "controller": CONTROLLER}
    room.ask(**message)
    assert room.box.take() == command


@pytest.mark.parametrize(
    ("state", "controller", "message", "why"),
    [
        ("running", None, {"order": "undo"}, "no controller runs"),
        ("running", None, {"order": "set", "name": "stiffness", "value": 1}, "no controller runs"),
        ("waiting", CONTROLLER, {"order": "undo"}, "session is waiting"),
        ("stopping", CONTROLLER, {"order": "set", "name": "stiffness", "value": 1}, "is stopping"),
        ("running", CONTROLLER, {"order": "set", "name": "x", "value": 1}, "it has stiffness"),
        (
            "running",
            CONTROLLER,
            {"order": "set", "name": "stiffness", "value": 60.1},
            "stiffness: 60.1; expected 0 to 60",
        ),
    ],
)
def test_a_parameter_that_a_session_would_refuse_is_refused_at_once(
    room, state, controller, message, why
):
    room.status |= {"state": state, "controller": controller}
    with pytest.raises(DataError, match=why):
        room.ask(**message)
    assert room.box.take() is None


@pytest.mark.parametrize(
    "message",
    [
        b"",
        b"{}",
        b'{"order": "start"}',
        b'{"order": "torque", "value": 17}',
        b'{"order": "start", "condition": "perturbed", "torque": 17}',
        b'{"order": "note", "text": "  "}',
        b'{"order": "note", "text": 3}',
        b'{"order": "note", "text": "a\\nb"}',
        b'{"order": "note", "text": "\\ud800"}',
        b'{"order": "note", "text": "' + b"x" * 300 + b'"}',
        b'{"order": "set", "name": "stiffness"}',
        b'{"order": "set", "name": "stiffness", "value": "45"}',
        b'{"order": "set", "name": "stiffness", "value": NaN}',
        b'{"order": "set", "name": "stiffness", "value": 1e999}',
        b'{"order": "set", "name": "stiffness", "value": true}',
        b'{"order": "set", "name": " ", "value": 1}',
        b'{"order": "set", "name": "a\\nb", "value": 1}',
        b'{"order": "set", "name": "' + b"x" * 300 + b'", "value": 1}',
        b'{"order": "undo", "name": "stiffness"}',
        b"\xff\xfe",
    ],
)
def test_what_is_malformed_is_refused(room, message):
    with pytest.raises(DataError, match=r"^command: "):
        room.desk.ask(message)
    assert room.box.take() is None


def test_a_stop_reaches_every_box_whatever_the_state(room, tmp_path):
    (tmp_path / "sessions" / "S00").mkdir()
    (tmp_path / "sessions" / "S00" / "control").write_bytes(b"something else")
    with ControlBox(tmp_path / "sessions" / "S00x.control"):
        assert room.desk.stop() == 1
    assert room.box.stop_asked


@pytest.mark.parametrize(
    ("lives", "asked", "is_heard"), [(True, 1, True), (True, 0, False), (False, 1, False)]
)
def test_a_stop_that_nobody_receives_is_told(room, lives, asked, is_heard):
    room.process.lives = lives
    assert (room.desk.unheard(asked) == "") is is_heard
    assert "emergency stop" in room.desk.unconfirmed(asked)


def test_a_session_that_is_over_receives_no_stop_while_the_next_is_loaded(room):
    room.box.__exit__(None, None, None)
    assert room.desk.stop() == 0
    assert room.desk.unheard(0)


@pytest.mark.parametrize(
    ("state", "unconfirmed", "is_confirmed"),
    [
        ("stopping", "", True),
        ("stopped", "", True),
        ("tripped", "", True),
        ("tripped", "perturbed", False),  # a device has not confirmed its stop
        ("waiting", "", False),
        ("starting", "", False),
        ("running", "", False),
        ("paused", "", False),
        ("silent", "", False),
        ("failed", "", False),
    ],
)
def test_the_session_itself_confirms_a_stop(room, state, unconfirmed, is_confirmed):
    room.status |= {"state": state, "unconfirmed": unconfirmed}
    assert room.desk.is_confirmed() is is_confirmed


def test_a_new_box_of_the_same_name_is_the_one_that_is_stopped(room):
    """A session that goes on makes its box anew: the old one is not what is meant."""
    with ControlBox(room.folder / "control") as newer:
        room.desk.stop()
        assert newer.stop_asked
        assert not room.box.stop_asked


def test_rearming_names_what_happened(room):
    room.status |= {"state": "tripped", "reason": "safety: overrun"}
    with pytest.raises(DataError, match="something else has happened"):
        room.ask(order="rearm", reason="safety: posture")
    assert room.process.started == []
    room.ask(order="rearm", reason="safety: overrun")
    assert room.process.started == [True]


def test_nothing_is_left_for_a_session_that_is_gone(room):
    room.process.lives = False
    with pytest.raises(DataError, match="no session runs"):
        room.ask(order="start", condition="perturbed")


def test_a_session_that_does_not_end_is_told(room, monkeypatch):
    monkeypatch.setattr(operator_commands, "_PATIENCE_S", 0.1)
    room.process.is_own = True
    assert "4711" in room.desk.leave()


class Followed:
    """A session that is followed."""

    def __init__(self, folder):
        self.folder = folder


def test_signs_of_life_follow_a_session_that_goes_on(room):
    beat = Heartbeat(Followed(room.folder), lambda: True)
    beat.beat()
    assert room.box.beat_ns > 0
    with ControlBox(room.folder / "control") as newer:
        beat.beat()
        assert newer.beat_ns > 0
    beat.close()


def test_a_page_that_looks_on_ends_nobody_elses_session(room):
    with Journal(room.folder / "journal.jsonl") as journal:
        journal.write("prompted", condition="perturbed", time_ns=1)
    assert "4711" in room.desk.leave()
    assert not room.box.stop_asked
