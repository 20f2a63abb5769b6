"""The recorder: one write a tick, whole or an error, and never over another log."""

import errno
import os

import pytest

from jointz.core.errors import OutputError, WriteError
from jointz.core.session_log import WALKING
from jointz.io.log_reader import read_log
from jointz.rig.experiment.files.recorder import Recorder

HEADER = {"participant": "S01", "segment": 0}


def record(slot, part=0):
    values = dict.fromkeys((field.name for field in WALKING.fields), 0) | {
        "slot": slot,
        "part": part,
    }
    return tuple(values.values())


@pytest.fixture
def path(tmp_path):
    return tmp_path / "walk-0.jzlog"


def slots(path):
    return read_log(path).records["slot"].tolist()


def test_what_is_written_is_on_disk_at_once(path):
    with Recorder(path, HEADER, WALKING) as recorder:
        assert slots(path) == []
        for slot in range(5):
            recorder.write(record(slot))
            assert slots(path) == list(range(slot + 1))
    assert read_log(path).header["participant"] == "S01"


def test_the_records_of_a_tick_are_one_write(path, monkeypatch):
    real, sizes = os.write, []

    def write(fd, data):
        sizes.append(len(data))
        return real(fd, data)

    with Recorder(path, HEADER, WALKING) as recorder:
        monkeypatch.setattr(os, "write", write)
        recorder.write(record(0))
        recorder.write(record(1), record(1, 1), record(1, 2))
    assert sizes == [WALKING.record_bytes, 3 * WALKING.record_bytes]
    assert read_log(path).records["part"].tolist() == [0, 0, 1, 2]


def test_a_log_is_never_written_over(path):
    with Recorder(path, HEADER, WALKING) as recorder:
        recorder.write(record(1))
    with pytest.raises(OutputError, match=r"walk-0\.jzlog"):
        Recorder(path, HEADER, WALKING)
    assert slots(path) == [1]


def test_a_disk_that_takes_a_part_of_a_record_is_an_error_and_the_rest_can_be_read(
    path, monkeypatch
):
    real = os.write
    with Recorder(path, HEADER, WALKING) as recorder:
        recorder.write(record(1))
        monkeypatch.setattr(os, "write", lambda fd, data: real(fd, data[:40]))
        with pytest.raises(WriteError, match=r"walk-0.jzlog.*No space"):
            recorder.write(record(2))
    assert slots(path) == [1]
    assert read_log(path).torn_bytes == 40


def full(fd, data):
    raise OSError(errno.ENOSPC, "No space left on device")


def half(real):
    return lambda fd, data: real(fd, data[: len(data) // 2])


@pytest.mark.parametrize("disk", [full, half(os.write)])
def test_a_log_whose_header_found_no_room_does_not_exist(path, monkeypatch, disk):
    with monkeypatch.context() as patch:
        patch.setattr(os, "write", disk)
        with pytest.raises(WriteError, match="No space"):
            Recorder(path, HEADER, WALKING)
    assert list(path.parent.iterdir()) == []
    with Recorder(path, HEADER, WALKING) as recorder:
        recorder.write(record(3))
    assert slots(path) == [3]


def test_a_crash_before_the_header_was_whole_leaves_no_log_and_does_not_bar_the_next(path):
    path.with_name("walk-0.jzlog.partial").write_bytes(b'{"jointz_log"')
    assert not path.exists()
    with Recorder(path, HEADER, WALKING) as recorder:
        recorder.write(record(3))
    assert slots(path) == [3]
