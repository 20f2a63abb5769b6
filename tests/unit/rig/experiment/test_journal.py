"""The journal: what stands in it after a crash, and what it counts as done."""

import json
import os
import zlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from jointz.core.errors import DataError, OutputError, WriteError
from jointz.rig.experiment.files.journal import (
    Journal,
    pulses_done,
    read_journal,
)


@pytest.fixture
def file(tmp_path):
    return tmp_path / "journal.jsonl"


def write(file, *events):
    with Journal(file) as journal:
        for event, details in events:
            journal.write(event, **details)


THREE = (
    ("segment_started", {"condition": "walk", "segment": 0}),
    ("pulse_completed", {"condition": "walk", "segment": 0, "pulse": 7, "onset_slot": 12345}),
    ("stopped", {"condition": "walk", "segment": 0, "reason": "Jörg said\n“stop”"}),
)
READ = [{"event": event, **details} for event, details in THREE]


def test_a_line_is_json_and_its_checksum(file):
    write(file, THREE[0])
    text, _, check = file.read_bytes().rstrip(b"\n").rpartition(b" ")
    assert json.loads(text) == READ[0]
    assert int(check, 16) == zlib.crc32(text)


def test_a_line_cut_off_anywhere_is_left_out_and_the_next_one_stands_alone(tmp_path):
    whole = tmp_path / "whole"
    write(whole, *THREE)
    content = whole.read_bytes()
    second_end = content.index(b"\n", content.index(b"\n") + 1) + 1
    for size in range(second_end, len(content)):
        torn = tmp_path / "torn"
        torn.write_bytes(content[:size])
        assert read_journal(torn) == READ[:2]
        write(torn, ("stopped", {}))
        kept = READ if size == len(content) - 1 else READ[:2]  # one that lacks its end alone
        assert read_journal(torn) == [*kept, {"event": "stopped"}]


@pytest.mark.parametrize("size", [0, 1, 5])
def test_a_journal_cut_off_in_its_first_line_is_empty(file, size):
    file.write_bytes(b'{"eve'[:size])
    assert read_journal(file) == []
    write(file, *THREE)
    assert read_journal(file) == READ


@pytest.mark.parametrize("line", [0, 1, 2])
def test_a_line_that_was_altered_is_an_error_that_names_it(file, line):
    write(file, *THREE)
    lines = file.read_bytes().split(b"\n")
    lines[line] = lines[line].replace(b"segment", b"sediment", 1)
    file.write_bytes(b"\n".join(lines))
    with pytest.raises(DataError, match=rf"line {line + 1}") as caught:
        read_journal(file)
    assert (caught.value.path, caught.value.row) == (str(file), line + 1)


@pytest.mark.parametrize("junk", [b"", b"{}", b"\xff\xfe", b"{} zzzzzzzz"])
def test_a_line_without_a_checksum_is_an_error(file, junk):
    file.write_bytes(junk + b"\n")
    with pytest.raises(DataError, match="line 1"):
        read_journal(file)


def test_an_event_the_disk_takes_only_in_part_is_an_error(file, monkeypatch):
    real = os.write
    with Journal(file) as journal:
        journal.write("segment_started")
        with monkeypatch.context() as patch:
            patch.setattr(os, "write", lambda fd, data: real(fd, data[: len(data) // 2]))
            with pytest.raises(WriteError, match=r"journal.jsonl.*No space"):
                journal.write("stopped")
    assert read_journal(file) == [{"event": "segment_started"}]
    write(file, ("stopped", {}))
    assert len(read_journal(file)) == 2


def test_two_cannot_write_one_journal(file):
    with Journal(file) as journal:
        with pytest.raises(OutputError, match="another process is running this"):
            Journal(file)
        journal.write("stopped")
    with Journal(file):
        assert read_journal(file) == [{"event": "stopped"}]


def completed(pulse, condition="walk", **more):
    return {"event": "pulse_completed", "condition": condition, "pulse": pulse, **more}


def test_a_pulse_is_done_when_its_end_stands_in_the_journal():
    events = [
        {"event": "pulse_started", "condition": "walk", "pulse": 1},
        {"event": "pulse_started", "condition": "walk", "pulse": 2},
        completed(2, onset_slot=9),
        {"event": "pulse_aborted", "condition": "walk", "pulse": 3},
        {"event": "pulse_missed", "condition": "walk", "pulse": 4},
        completed(5, condition="other"),
    ]
    assert pulses_done(events, "walk") == {2: completed(2, onset_slot=9)}
    assert set(pulses_done(events, "other")) == {5}


values = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(allow_nan=False), st.text(max_size=20)
)


@given(st.lists(st.dictionaries(st.sampled_from("abcde"), values), max_size=5))
def test_any_details_survive(tmp_path_factory, details):
    file = tmp_path_factory.mktemp("journal") / "j"
    write(file, *[("happened", each) for each in details])
    assert read_journal(file) == [{"event": "happened", **each} for each in details]
