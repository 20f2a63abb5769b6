"""The box of commands: what is sent arrives once and in order, what is broken is left out."""

import struct

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from jointz.core.errors import DataError
from jointz.rig.experiment.control_box import (
    LONGEST_TEXT_BYTES,
    Command,
    ControlBox,
    ControlSender,
    Order,
    read_setting,
    setting_text,
)


@pytest.fixture
def box(tmp_path):
    with ControlBox(tmp_path / "control") as box:
        yield box


@pytest.fixture
def sender(box, tmp_path):
    sender = ControlSender(tmp_path / "control")
    yield sender
    sender.close()


def drained(box, most=100):
    taken = [box.take() for _ in range(most)]
    return [command for command in taken if command is not None]


def test_commands_arrive_once_and_in_order(box, sender):
    sent = [Command(Order.START), Command(Order.NOTE, "strap slid µ"), Command(Order.PAUSE)]
    for command in sent:
        sender.send(*command)
    assert drained(box) == sent
    assert box.take() is None
    assert box.refused == 0


@given(st.text(max_size=40), st.floats(allow_nan=False))
def test_a_setting_is_read_as_it_was_sent(name, value):
    assert read_setting(setting_text(name, value)) == (name, value)


@pytest.mark.parametrize("text", ["", "stiffness", "stiffness=", "stiffness=high"])
def test_a_setting_without_a_number_is_refused(text):
    with pytest.raises(ValueError, match="float"):
        read_setting(text)


def test_a_stop_is_seen_at_once_and_stays(box, sender):
    assert not box.stop_asked
    sender.stop()
    assert box.stop_asked
    sender.send(Order.GO_ON)
    assert box.stop_asked


def test_more_commands_than_fit_are_refused_and_counted(box, sender):
    for _ in range(33):
        sender.send(Order.NOTE, "again")
    assert box.take() is None
    assert box.refused == 1
    sender.send(Order.PAUSE)
    assert drained(box) == [Command(Order.PAUSE)]


def test_a_note_that_does_not_fit_is_refused_where_it_is_written(sender):
    sender.send(Order.NOTE, "x" * LONGEST_TEXT_BYTES)
    with pytest.raises(DataError, match="Write two notes"):
        sender.send(Order.NOTE, "x" * (LONGEST_TEXT_BYTES + 1))


def test_a_file_of_something_else_is_no_box(tmp_path):
    with pytest.raises(DataError, match="Start the session first"):
        ControlSender(tmp_path / "none")
    (tmp_path / "other").write_bytes(b"no box")
    with pytest.raises(DataError, match="not the control file"):
        ControlSender(tmp_path / "other")


def test_a_new_stretch_begins_with_an_empty_box(box, sender, tmp_path):
    sender.stop()
    sender.send(Order.START)
    with ControlBox(tmp_path / "control") as again:
        assert not again.stop_asked
        assert again.take() is None


@settings(
    max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(st.binary(min_size=1, max_size=600), st.integers(0, 8000), st.integers(0, 40))
def test_garbage_never_makes_a_command(tmp_path_factory, garbage, at, count):
    path = tmp_path_factory.mktemp("box") / "control"
    with ControlBox(path) as box:
        content = bytearray(path.read_bytes())
        content[64 + at : 64 + at + len(garbage)] = garbage
        content[16:24] = struct.pack("<Q", count)
        with path.open("r+b") as file:
            file.write(content[: 64 + 256 * 32])
        assert drained(box) == []
        assert (box.refused > 0) == (count > 0)
