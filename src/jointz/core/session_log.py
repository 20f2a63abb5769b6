"""Format of the crash-safe log of a session: header and records.

A log is a header and then records of one size, each with a CRC-32 of itself,
written one tick at a time. What was written before a crash can be read; a record
that was cut off is recognised by its length or checksum. The header is a line of
JSON with its CRC-32, and stands there twice (once and without one in version 1).

A tick writes one record for each sample that an actuator or sensor had queued,
at least one. The fields of the tick itself stand in all of them; ``part``
counts them. Where a device had no sample left its time is :data:`NO_SAMPLE`.
"""

import json
import re
import struct
import zlib
from collections.abc import Mapping
from enum import IntFlag
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from jointz.core.channels import CHANNEL_UNITS

VERSION = 2
#: The header of this one stands there once and has no checksum.
_FIRST_VERSION = 1
NO_SAMPLE = -1


def checked_line(text: bytes) -> bytes:
    """Return a text with its CRC-32, as a line."""
    return text + b" %08x\n" % zlib.crc32(text)


def checked_text(line: bytes) -> bytes | None:
    """Return the text of a line, None where its checksum does not fit."""
    text, _, check = line.rpartition(b" ")
    return text if check == b"%08x" % zlib.crc32(text) else None


class Field(NamedTuple):
    """A field of a record: its name, code of :mod:`struct`, unit and meaning."""

    name: str
    code: str  # format character of :mod:`struct`
    unit: str
    meaning: str


_CHECK = struct.Struct("<I")


class Layout:
    """The records of one kind of session: their fields, in the order of their bytes.

    What stands first is aligned without padding; the checksum comes last.
    """

    __slots__ = ("_body", "dtype", "fields", "name", "record_bytes")

    def __init__(self, name: str, fields: tuple[Field, ...]) -> None:
        self.name = name
        self.fields = fields
        self._body = struct.Struct("<" + "".join(field.code for field in fields))
        self.record_bytes = self._body.size + _CHECK.size
        self.dtype = np.dtype(
            [(f.name, "<" + np.dtype(f.code).str[1:]) for f in fields] + [("crc", "<u4")]
        )

    def pack(self, values: tuple[float, ...]) -> bytes:
        """Return a record with its checksum."""
        body = self._body.pack(*values)
        return body + _CHECK.pack(zlib.crc32(body))

    def encode_header(self, header: Mapping[str, Any]) -> bytes:
        """Return both copies of a log's header."""
        full = {
            "jointz_log": VERSION,
            "layout": self.name,
            **header,
            "record_bytes": self.record_bytes,
            "fields": [field._asdict() for field in self.fields],
        }
        return 2 * checked_line(json.dumps(full, ensure_ascii=True).encode("ascii"))


_MOTOR = (
    Field("motor_velocity", "f", "rad/s", "output velocity of the actuator"),
    Field("current", "f", "A", "motor current"),
    Field("voltage", "f", "V", "supply"),
    Field("temperature_c", "f", "degC", "winding"),
)
_TORQUES = (
    Field("requested_torque", "f", "N*m", "what the controller asked for"),
    Field("sent_torque", "f", "N*m", "what the safety gate let through to the device"),
    Field("command", "f", "N*m", "torque of pulses or a controller, 0 outside of them"),
)

WALKING = Layout(
    "walking",
    (
        Field("host_time_ns", "q", "ns", "when the tick began, by the host's clock"),
        Field("actuator_time_ns", "q", "ns", "when the actuator measured, by its clock"),
        Field("angle_sensor_time_ns", "q", "ns", "when the goniometer measured, by its clock"),
        Field("contact_time_ns", "q", "ns", "when the footswitch measured, by its clock"),
        Field("motor_angle", "d", "rad", "output angle of the actuator"),
        Field("angle", "d", "rad", "joint angle of the goniometer"),
        Field("slot", "I", "1", "number of the tick on the loop's grid"),
        Field("busy_us", "f", "us", "how long the tick before was at work"),
        *_MOTOR,
        Field("contact", "f", "1", "footswitch"),
        *_TORQUES,
        Field("applied_torque", "f", "N*m", "torque on the joint by equation 4.1, online"),
        Field("phase_pct", "f", "%", "phase of the gait cycle, NaN where there is none"),
        Field("shadow_phase_pct", "f", "%", "the same from the knee angle, for comparison"),
        Field("faults", "I", "1", "fault bits of the actuator"),
        Field("stride", "I", "1", "heel strikes accepted so far"),
        Field("pulse", "I", "1", "number of the planned pulse that is on, 0 for none"),
        Field("flags", "H", "1", "state of the tick, bits of Flag"),
        Field("part", "H", "1", "number of the sample within its tick"),
    ),
)

BENCH = Layout(
    "bench",
    (
        Field("host_time_ns", "q", "ns", "when the tick began, by the host's clock"),
        Field("actuator_time_ns", "q", "ns", "when the actuator measured, by its clock"),
        Field("angle_sensor_time_ns", "q", "ns", "when the encoder at the output measured"),
        Field("torque_sensor_time_ns", "q", "ns", "when the torque sensor measured"),
        Field("positioner_time_ns", "q", "ns", "when the positioner measured, by its clock"),
        Field("motor_angle", "d", "rad", "output angle of the actuator"),
        Field("angle", "d", "rad", "angle of the output"),
        Field("position", "d", "rad", "angle of the far side"),
        Field("measured_torque", "d", "N*m", "torque sensor"),
        Field("slot", "I", "1", "number of the tick on the loop's grid"),
        Field("busy_us", "f", "us", "how long the tick before was at work"),
        *_MOTOR,
        *_TORQUES,
        Field("reference_torque", "f", "N*m", "torque asked for besides the pulses"),
        Field("reference_position", "d", "rad", "angle asked for of the far side"),
        Field("faults", "I", "1", "fault bits of the actuator"),
        Field("pulse", "I", "1", "number of the planned pulse that is on, 0 for none"),
        Field("flags", "H", "1", "state of the tick, bits of Flag"),
        Field("part", "H", "1", "number of the sample within its tick"),
    ),
)

#: Of a bench with a footswitch: a calibration of that.
BENCH_CONTACT = Layout(
    "bench-contact",
    (
        *BENCH.fields,
        Field("contact_time_ns", "q", "ns", "when the footswitch measured, by its clock"),
        Field("contact", "f", "V", "footswitch"),
    ),
)

#: What walking may be measured with besides: time and value, in this order behind all else.
WALKING_EXTRAS: Mapping[str, tuple[Field, Field]] = {
    "moment": (
        Field("moment_time_ns", "q", "ns", "when the joint moment was measured, by its clock"),
        Field("joint_moment", "d", "N*m", "internal moment of the joint"),
    ),
    **{
        name: (
            Field(f"{name}_time_ns", "q", "ns", "when it was measured, by its clock"),
            Field(name, "d", CHANNEL_UNITS[name][0], meaning),
        )
        for name, meaning in (
            ("joint_encoder", "joint angle of the device's encoder"),
            ("shank_velocity", "gyroscope on the shank, about the joint's axis"),
            ("thigh_velocity", "gyroscope on the thigh, about the joint's axis"),
        )
    },
}


def _walking_with(extras: tuple[str, ...]) -> Layout:
    fields = [field for name in extras for field in WALKING_EXTRAS[name]]
    return Layout("-".join(("walking", *extras)), (*WALKING.fields, *fields))


#: Layouts of walking, by what is measured besides.
WALKING_LAYOUTS: Mapping[tuple[str, ...], Layout] = {
    extras: _walking_with(extras) if extras else WALKING
    for count in range(len(WALKING_EXTRAS) + 1)
    for extras in combinations(WALKING_EXTRAS, count)
}

#: Name -> layout.
LAYOUTS = {layout.name: layout for layout in (*WALKING_LAYOUTS.values(), BENCH, BENCH_CONTACT)}


class LogHeader(NamedTuple):
    """The header of a log."""

    values: dict[str, Any]  # content of the JSON line
    layout: Layout  # of the records
    size_bytes: int  # size of all copies; offset of the first record
    damaged_copy: str  # ``first`` or ``second``; "" if none is damaged


_HEADER_BEGINS = re.compile(rb'\{"jointz_log"')
_LONGEST_HEADER_BYTES = 1_000_000


def decode_header(content: bytes) -> LogHeader:
    """Return the header of a log, from the copy whose checksum fits."""
    text, size_bytes, damaged = _intact_copy(content)
    try:
        values = json.loads(text)
        version, record_bytes = values["jointz_log"], values["record_bytes"]
        layout = LAYOUTS[values.get("layout", "walking")]  # early logs name none
    except (ValueError, KeyError, TypeError) as exc:
        raise ValueError(
            "expected a log of jointz, whose first line is JSON with 'jointz_log'. Give a .jzlog "
            "file of a session, or a copy of it: its header cannot be read."
        ) from exc
    if version not in (_FIRST_VERSION, VERSION) or record_bytes != layout.record_bytes:
        raise ValueError(
            f"a log of version {version} with records of {record_bytes} bytes; this jointz reads "
            f"version {VERSION} with {layout.record_bytes}. Read it with the jointz that wrote it."
        )
    return LogHeader(dict(values), layout, size_bytes, damaged)


def _intact_copy(content: bytes) -> tuple[bytes, int, str]:
    """Return the header's text, the offset of the records, and the damaged copy's name."""
    for match in _HEADER_BEGINS.finditer(content, 0, _LONGEST_HEADER_BYTES):
        line, end, _ = content[match.start() : _LONGEST_HEADER_BYTES].partition(b"\n")
        text = checked_text(line)
        if text is None:
            continue
        size = len(line + end)
        if match.start() > 0:
            return text, match.start() + size, "first"
        second = content[size : 2 * size]
        return text, min(2 * size, len(content)), "second" if second != line + end else ""
    line, end, _ = content[:_LONGEST_HEADER_BYTES].partition(b"\n")
    return line, len(line + end), ""


class Flag(IntFlag):
    """State of a tick.

    ``LEAD``: a bench is led to its reference, or back from it; ``CUT``: a pulse displaced the
    joint too far, and has no torque until its end.
    """

    STEADY = 1
    SHAM = 2
    CLAMPED = 4
    FADING = 8
    TRIPPED = 16
    OVERRUN = 32
    LEAD = 64
    CUT = 128
