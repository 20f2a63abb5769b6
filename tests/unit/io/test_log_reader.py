"""Reading a log back: every field, every place a crash may have cut it, every flipped bit."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jointz.core.errors import DataError
from jointz.core.session_log import VERSION, WALKING, checked_line, checked_text
from jointz.io.log_reader import read_log
from jointz.rig.experiment.files.recorder import Recorder

HEADER = {"participant": "S01", "condition": "perturbed", "segment": 3}
#: Records that a crash may leave bad at the end.
LONGEST_TORN_END = 100


def records(count, seed=1):
    """Return records whose every field is another number."""
    rng = np.random.default_rng(seed)
    kinds = {
        "q": lambda: int(rng.integers(-(2**62), 2**62)),
        "d": lambda: float(rng.normal()),
        "f": lambda: float(np.float32(rng.normal())),
        "I": lambda: int(rng.integers(0, 2**32)),
        "H": lambda: int(rng.integers(0, 2**16)),
    }
    return [tuple(kinds[field.code]() for field in WALKING.fields) for _ in range(count)]


def log_bytes(rows, **header):
    return WALKING.encode_header({**HEADER, **header}) + b"".join(WALKING.pack(row) for row in rows)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "walk-0.jzlog"


def test_every_field_of_every_record_comes_back(path):
    rows = records(20)
    with Recorder(path, HEADER, WALKING) as recorder:
        for row in rows:
            recorder.write(row)
    log = read_log(path)
    assert log.header.items() >= HEADER.items()
    assert log.torn_bytes == 0
    assert [tuple(found)[:-1] for found in log.records.tolist()] == rows


def test_a_log_without_records_is_empty(path):
    path.write_bytes(log_bytes([]))
    assert read_log(path).records.size == 0


def test_a_record_cut_off_at_any_byte_is_left_out_and_told_of(path):
    rows = records(3)
    whole = log_bytes(rows)
    for missing in range(1, WALKING.record_bytes + 1):
        path.write_bytes(whole[:-missing])
        log = read_log(path)
        assert log.records.size == 2
        assert [tuple(found)[:-1] for found in log.records.tolist()] == rows[:2]
        assert log.torn_bytes == (WALKING.record_bytes - missing)


def test_a_flipped_bit_in_any_byte_of_a_record_is_noticed(path):
    whole = log_bytes(records(3))
    start = len(whole) - 2 * WALKING.record_bytes
    for at in range(WALKING.record_bytes):
        spoilt = bytearray(whole)
        spoilt[start + at] ^= 1 << at % 8
        path.write_bytes(spoilt)
        with pytest.raises(DataError, match="record 2 of 3 is damaged"):
            read_log(path)


def test_damage_is_counted_and_its_first_place_named(path):
    spoilt = bytearray(log_bytes(records(10)))
    for record in (4, 7):
        spoilt[len(spoilt) - (10 - record) * WALKING.record_bytes - 1] ^= 1
    path.write_bytes(spoilt)
    with pytest.raises(DataError, match=r"record 4 of 10 is damaged \(2 in all\)") as caught:
        read_log(path)
    assert (caught.value.path, caught.value.row) == (str(path), 4)


@given(st.integers(0, 4), st.binary(min_size=1, max_size=WALKING.record_bytes))
def test_bytes_put_in_anywhere_are_noticed(tmp_path_factory, place, junk):
    rows = [WALKING.pack(row) for row in records(5 + LONGEST_TORN_END)]
    rows.insert(place, junk)
    path = tmp_path_factory.mktemp("log") / "log"
    path.write_bytes(WALKING.encode_header(HEADER) + b"".join(rows))
    with pytest.raises(DataError, match="is damaged"):
        read_log(path)


@pytest.mark.parametrize("junk", [bytes(4096), bytes(10**6), b"\xff" * 4096])
def test_what_the_power_left_after_the_last_record_is_torn(path, junk):
    path.write_bytes(log_bytes(records(10)) + junk)
    log = read_log(path)
    assert log.records["slot"].tolist() == [row[6] for row in records(10)]
    assert (log.whole_bytes, log.torn_bytes) == (len(log_bytes(records(10))), len(junk))


def test_a_bad_last_record_is_torn(path):
    whole = log_bytes(records(10))
    path.write_bytes(whole[:-3] + b"\0\0\0")
    log = read_log(path)
    assert (log.records.size, log.torn_bytes) == (9, WALKING.record_bytes)


def test_a_long_bad_end_is_damage(path):
    junk = b"\xff" * (WALKING.record_bytes * (LONGEST_TORN_END + 1))
    path.write_bytes(log_bytes(records(10)) + junk)
    with pytest.raises(DataError, match="record 11 of 111 is damaged"):
        read_log(path)


@pytest.mark.parametrize(
    "content",
    [b"", b"\n", b"time,angle\n0,1\n", b"{}\n", b"[1]\n", b"3\n", b"\xff\xfe\x00\n", b'{"jointz_l'],
)
def test_another_file_is_no_log(path, content):
    path.write_bytes(content)
    with pytest.raises(DataError):
        read_log(path)


@pytest.mark.parametrize(
    "change", [{"jointz_log": VERSION + 1}, {"record_bytes": WALKING.record_bytes + 8}]
)
def test_a_log_of_another_version_names_both_versions(path, change):
    header = json.loads(checked_text(WALKING.encode_header(HEADER).splitlines()[0])) | change
    path.write_bytes(2 * checked_line(json.dumps(header).encode()))
    with pytest.raises(DataError, match=f"version {VERSION} with {WALKING.record_bytes}"):
        read_log(path)


def test_a_log_of_the_first_version_is_read(path):
    rows = records(3)
    header = json.loads(checked_text(WALKING.encode_header(HEADER).splitlines()[0]))
    first = json.dumps(header | {"jointz_log": 1}).encode() + b"\n"
    path.write_bytes(first + b"".join(WALKING.pack(row) for row in rows))
    log = read_log(path)
    assert [tuple(found)[:-1] for found in log.records.tolist()] == rows
    assert (log.header["jointz_log"], log.whole_bytes) == (1, path.stat().st_size)


@pytest.mark.parametrize("place", ["first", "second"])
def test_a_header_with_a_flipped_bit_is_read_from_its_other_copy(path, place):
    whole = log_bytes(records(2))
    length = whole.index(b"\n") + 1
    header = read_header(path, whole)
    begin = length * (place == "second")
    for at in (*range(begin, begin + length, 29), begin + length - 1):
        spoilt = bytearray(whole)
        spoilt[at] ^= 1 << at % 8
        path.write_bytes(spoilt)
        log = read_log(path)
        assert (log.header, log.damaged_copy, log.records.size) == (header, place, 2)


def read_header(path, whole):
    path.write_bytes(whole)
    return read_log(path).header


def flipped(content, rng):
    spoilt = bytearray(content)
    spoilt[int(rng.integers(len(content)))] ^= 1 << int(rng.integers(8))
    return bytes(spoilt)


def put_in(content, rng):
    at = int(rng.integers(len(content)))
    return content[:at] + rng.bytes(int(rng.integers(1, 300))) + content[at:]


def taken_out(content, rng):
    at = int(rng.integers(len(content)))
    return content[:at] + content[at + int(rng.integers(1, 300)) :]


def cut_off(content, rng):
    return content[: int(rng.integers(len(content)))]


@pytest.mark.parametrize("harm", [flipped, put_in, taken_out, cut_off])
def test_every_intact_record_of_a_damaged_log_is_salvaged(path, harm):
    packed = [WALKING.pack(row) for row in records(300)]
    start = len(log_bytes([]))
    rng = np.random.default_rng(12)
    for _ in range(100):
        body = harm(b"".join(packed), rng)
        path.write_bytes(log_bytes([]) + body)
        log = read_log(path, salvage=True)
        assert [r.tobytes() for r in log.records] == [p for p in packed if p in body]
        left_out = sum(damage.n_bytes for damage in log.damage)
        assert log.records.nbytes + left_out + log.torn_bytes == len(body)
        assert log.whole_bytes + log.torn_bytes == start + len(body)


def test_damage_is_left_out_where_it_is(path):
    spoilt = bytearray(log_bytes(records(10)))
    for record in (1, 4, 5):
        spoilt[len(spoilt) - (11 - record) * WALKING.record_bytes] ^= 1
    path.write_bytes(spoilt)
    size = WALKING.record_bytes
    assert read_log(path, salvage=True).damage == ((0, size), (2, 2 * size))
