"""The bytes of a log: one record a sample, each with a checksum."""

import json
import math
import struct
import zlib

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from jointz.core.session_log import VERSION, WALKING, Flag

RANGES = {"q": (-(2**63), 2**63 - 1), "I": (0, 2**32 - 1), "H": (0, 2**16 - 1)}


def values_of(field):
    if field.code in "df":
        return st.floats(width=64 if field.code == "d" else 32)
    return st.integers(*RANGES[field.code])


records = st.tuples(*[values_of(field) for field in WALKING.fields])


@given(records)
def test_every_field_survives_packing_and_a_checksum_ends_the_record(values):
    packed = WALKING.pack(values)
    (found,) = np.frombuffer(packed, dtype=WALKING.dtype)
    for field, value in zip(WALKING.fields, values, strict=True):
        read = found[field.name].item()
        assert read == value or (math.isnan(read) and math.isnan(value)), field.name
    assert len(packed) == WALKING.record_bytes
    assert struct.unpack("<I", packed[-4:]) == (zlib.crc32(packed[:-4]),)


def test_every_field_lies_on_a_multiple_of_its_own_size():
    for field in WALKING.fields:
        dtype, offset = WALKING.dtype.fields[field.name][:2]
        assert offset % dtype.itemsize == 0, field.name
    assert WALKING.dtype.itemsize == WALKING.record_bytes


def test_flags_are_bits_that_fit_their_field():
    assert [flag.bit_count() for flag in Flag] == [1] * len(Flag)
    assert sum(Flag) < 2**16


def header_of(encoded):
    """One of the two copies without its checksum."""
    first, second = encoded.splitlines(keepends=True)
    assert first == second
    assert first.endswith(b"\n")
    assert first.isascii()
    text, checksum = first.rsplit(maxsplit=1)
    assert int(checksum, 16) == zlib.crc32(text)
    return json.loads(text)


def test_the_header_is_two_lines_of_ascii_that_say_how_to_read_the_rest():
    header = header_of(
        WALKING.encode_header({"participant": "Jörg\nS01", "segment": 2, "record_bytes": 1})
    )
    assert (header["participant"], header["segment"]) == ("Jörg\nS01", 2)
    assert (header["jointz_log"], header["record_bytes"]) == (VERSION, WALKING.record_bytes)
    format_ = "<" + "".join(field["code"] for field in header["fields"])
    assert struct.calcsize(format_) == header["record_bytes"] - 4
