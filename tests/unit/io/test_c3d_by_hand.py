"""C3D files made by hand: every kind of computer, what is told twice, and damage."""

import struct
from pathlib import Path

import numpy as np
import pytest
from tests.unit.io.same_content import is_same_content

from jointz.core.acquisition import Acquisition, Event
from jointz.core.errors import DataError
from jointz.io.formats.registry import read_acquisition


def f4(value: float, machine: int) -> bytes:
    """A float of the three computers; that of a VAX is an IEEE float times four, words turned."""
    if machine == 85:
        raw = struct.pack("<f", value * 4)
        return raw[2:] + raw[:2]
    return struct.pack("<f" if machine == 84 else ">f", value)


def i2(value: int, machine: int) -> bytes:
    return struct.pack("<H" if machine != 86 else ">H", value & 0xFFFF)


def parameter(number: int, name: str, values: object, machine: int = 84) -> bytes:
    if isinstance(values, str):
        body = struct.pack("bBB", -1, 1, len(values)) + values.encode()
    elif isinstance(values, list) and values and isinstance(values[0], str):
        width = max(map(len, values))
        body = struct.pack("bBBB", -1, 2, width, len(values))
        body += "".join(v.ljust(width) for v in values).encode()
    elif isinstance(values, np.ndarray):
        body = struct.pack("bB", 4, values.ndim) + bytes(values.shape)
        body += b"".join(f4(v, machine) for v in values.ravel(order="F"))
    elif isinstance(values, float):
        body = struct.pack("bB", 4, 0) + f4(values, machine)
    else:
        words = values if isinstance(values, list) else [values]
        shape = bytes((1, len(words))) if isinstance(values, list) else b"\0"
        body = b"\2" + shape + b"".join(i2(v, machine) for v in words)
    body += b"\0"
    head = struct.pack("bb", len(name), number) + name.encode()
    return head + i2(len(body) + 2, machine) + body


def section(machine: int, groups: dict[str, dict[str, object]]) -> bytes:
    raw = b""
    for number, (group, entries) in enumerate(groups.items(), start=1):
        raw += struct.pack("bb", len(group), -number) + group.encode() + i2(3, machine) + b"\0"
        raw += b"".join(parameter(number, n, v, machine) for n, v in entries.items())
    size = -(-(len(raw) + 6) // 512)
    return (bytes((1, 0x50, size, machine)) + raw).ljust(512 * size, b"\0")


def made(
    *,
    machine: int = 84,
    floats: bool = True,
    unsigned: bool = False,
    more: dict[str, dict[str, object]] | None = None,
    frames: tuple[int, int] = (11, 12),
) -> bytes:
    """Two frames of one point and one channel at four times its rate; scales and offsets set."""
    scale = -0.25 if floats else 0.25
    offset = 40_000 if unsigned else -8
    point = {"USED": 1, "FRAMES": 2, "RATE": 50.0, "SCALE": scale}
    point |= {"LABELS": ["LKNE"], "UNITS": "mm"}
    analog = {"USED": 1, "RATE": 200.0, "GEN_SCALE": 0.5, "SCALE": np.array([0.125])}
    analog |= {"OFFSET": [offset], "LABELS": ["Fz"], "UNITS": ["N"]}
    analog["FORMAT"] = "UNSIGNED" if unsigned else "SIGNED"
    groups: dict[str, dict[str, object]] = {"POINT": point, "ANALOG": analog}
    for group, entries in (more or {}).items():
        groups[group] = groups.get(group, {}) | entries
    parameters = section(machine, groups)
    head = bytes((2, 0x50)) + b"".join(i2(v, machine) for v in (1, 4, *frames, 0))
    head += f4(scale, machine) + i2(2 + len(parameters) // 512, machine) + i2(4, machine)
    head = (head + f4(50.0, machine)).ljust(512, b"\0")
    raw = b""
    for quad, residual in (((40, -80, 120), 0), ((1, 2, 3), -1)):
        step = 1.0 if not floats else 0.25
        cells = [*(v * step for v in quad), residual, *(offset + v for v in (0, 16, -32, 64))]
        put = (lambda v: f4(v, machine)) if floats else (lambda v: i2(int(v), machine))
        raw += b"".join(put(v) for v in cells)
    return head + parameters + raw.ljust(-(-len(raw) // 512) * 512, b"\0")


def read(raw: bytes, tmp_path: Path) -> Acquisition:
    path = tmp_path / "made.c3d"
    path.write_bytes(raw)
    return read_acquisition(path)


@pytest.mark.parametrize("machine", [84, 85, 86])
@pytest.mark.parametrize("floats", [True, False])
@pytest.mark.parametrize("unsigned", [True, False])
def test_every_computer_and_kind_of_number_gives_the_same(
    machine: int, floats: bool, unsigned: bool, tmp_path: Path
) -> None:
    found = read(made(machine=machine, floats=floats, unsigned=unsigned), tmp_path)
    seen, forces = found.groups
    first = [s.values[0] for s in seen.signals]
    assert first == [10.0, -20.0, 30.0]
    assert all(np.isnan(s.values[1]) for s in seen.signals)  # its residual is negative
    assert forces.signals[0].values.tolist() == [0.0, 1.0, -2.0, 4.0] * 2
    assert [(s.name, s.unit) for s in (*seen.signals, *forces.signals)] == [
        *((f"LKNE.{axis}", "mm") for axis in "xyz"),
        ("Fz", "N"),
    ]
    assert (seen.rate_hz, seen.start_s, forces.rate_hz, forces.start_s) == (50, 0.2, 200, 0.2)


def patched(raw: bytes, at: int, new: bytes) -> bytes:
    return raw[:at] + new + raw[at + len(new) :]


def behind_the_name(raw: bytes, name: bytes) -> int:
    """Where the first value of a parameter stands: after name, step, kind and dimensions."""
    return raw.index(name) + len(name) + 4


WORD = struct.Struct("<H")
ROTATION = {"USED": 9, "DATA_START": 9, "RATIO": 1}
NO_ROTATIONS = {"USED": 1e20, "DATA_START": 3, "RATIO": 1}


@pytest.mark.parametrize(
    ("raw", "words"),
    [
        (made(more={"POINT": {"SCALE": 0.25}}), "POINT:SCALE is 0.25 and the scale of the header"),
        (made(more={"POINT": {"SCALE": 1e-41}}), "POINT:SCALE is 9.99967e-42; expected a num"),
        (made(more={"POINT": {"USED": 2}}), "the header counts 1 points, not 2 a frame"),
        (made(more={"ANALOG": {"USED": 2}}), "the header counts 4 analog values, not 8 a frame"),
        (patched(made(), 2, WORD.pack(3)), "the header counts 3 points, not 1 a frame"),
        (made(more={"POINT": {"DATA_START": 9}}), "at block 3 by the header, and at 9 by POINT:DA"),
        (patched(made(), 16, WORD.pack(2)), "byte 512, among the parameters at 512 to"),
        (made(more={"POINT": {"USED": 1e30}}), "POINT:USED is 1e+30; expected at most 65535"),
        (
            made(frames=(1, 0), more={"POINT": {"FRAMES": 0}, "ROTATION": NO_ROTATIONS}),
            "ROTATION:USED is 1e+20",
        ),
        (made(more={"ANALOG": {"RATE": 200.5}}), "ANALOG:RATE is 200.5 Hz, 4 samples a frame"),
        (made(more={"ANALOG": {"SCALE": np.zeros(0)}}), "SCALE holds 0 scales for 1 channels; exp"),
        (made(more={"ANALOG": {"OFFSET": []}}), "ANALOG:OFFSET holds 0 offsets for 1 channels"),
    ],
)
def test_two_statements_that_differ_are_refused(raw: bytes, words: str, tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"made\.c3d") as caught:
        read(raw, tmp_path)
    assert words in str(caught.value)


def test_what_header_and_length_can_tell_is_read_with_a_note(tmp_path: Path) -> None:
    scaled = read(patched(made(floats=False), 12, struct.pack("<f", 0.5)), tmp_path)
    assert "by 0.5; POINT:SCALE 0.25 holds" in scaled.metadata["reading.scale"]
    assert scaled.groups[0].signals[0].values[0] == 10.0
    behind = read(made() + bytes(512), tmp_path)
    assert behind.metadata["reading.behind"] == "960 bytes behind the frames are not read."
    without = read(made().replace(b"OFFSET", b"OFFSEX"), tmp_path)
    assert without.metadata["reading.analog.offset"] == "ANALOG:OFFSET is missing; taken as 0."
    general = read(made().replace(b"GEN_SCALE", b"GEN_SCALX"), tmp_path)
    assert "GEN_SCALE is missing" in general.metadata["reading.analog.gen_scale"]


def test_a_trial_says_where_the_frames_start_if_it_has_their_number(tmp_path: Path) -> None:
    fields = {"ACTUAL_START_FIELD": [101, 0], "ACTUAL_END_FIELD": [190, 0]}
    found = read(made(more={"TRIAL": fields}), tmp_path)
    assert [g.start_s for g in found.groups] == [0.2, 0.2]
    found = read(made(more={"TRIAL": fields | {"ACTUAL_END_FIELD": [102, 0]}}), tmp_path)
    assert found.groups[0].start_s == 2.0
    assert "from 11; TRIAL, from 101, holds" in found.metadata["reading.start"]
    fields = {"ACTUAL_START_FIELD": [70_001 & 0xFFFF, 1], "ACTUAL_END_FIELD": [70_002 & 0xFFFF, 1]}
    found = read(made(frames=(65535, 65535), more={"TRIAL": fields}), tmp_path)
    assert found.groups[0].start_s == 1400.0


def unsigned_in_disguise() -> bytes:
    """Two channels of floats: one of unsigned words, and one that is truly negative."""
    analog = {"USED": 2, "RATE": 100.0, "LABELS": ["a", "b"], "UNITS": ["V", "V"]}
    analog |= {"SCALE": np.array([1.0, 1.0]), "OFFSET": [-32768, -100]}
    raw = bytearray(made(more={"ANALOG": analog}))
    raw[4:6], raw[18:20] = WORD.pack(4), WORD.pack(2)
    start = 512 * (WORD.unpack(raw[16:18])[0] - 1)
    cells = [0, 0, 0, 0, 32768, -100, 32778, -90]
    raw[start : start + 64] = struct.pack("<16f", *cells, *cells)
    return bytes(raw)


def test_only_offsets_that_cannot_be_meant_are_taken_as_unsigned(tmp_path: Path) -> None:
    found = read(unsigned_in_disguise(), tmp_path)
    one, two = found.groups[1].signals
    assert one.values.tolist() == [0.0, 5.0] * 2
    assert two.values.tolist() == [0.0, 5.0] * 2
    assert "-32768 are taken as 32768 in 1 of 2 channels" in found.metadata["reading.analog.format"]


def test_rotations_at_a_rate_that_is_rounded_are_whole_times_as_fast(tmp_path: Path) -> None:
    rotation = {"USED": 1, "DATA_START": 4, "RATE": 119.88}
    raw = made(more={"POINT": {"RATE": 59.94}, "ANALOG": {"RATE": 239.76}, "ROTATION": rotation})
    assert WORD.unpack(raw[16:18]) == (3,)
    found = read(raw + bytes(512), tmp_path)
    assert [(g.n_samples, g.rate_hz) for g in found.groups][::2] == [(2, 59.94), (4, 119.88)]


def test_a_rate_too_small_for_a_float_is_no_clock(tmp_path: Path) -> None:
    raw = made(machine=85)
    at = behind_the_name(raw, b"\x04\x01RATE")
    for place in (at, 20):
        raw = patched(raw, place, bytes((0, 0, 1, 0)))
    raw = raw.replace(b"RATE", b"RATX", 2).replace(b"RATX", b"RATE", 1)  # none of the channels
    assert [g.rate_hz for g in read(raw, tmp_path).groups] == [None, None]


def test_events_are_minutes_and_seconds_and_what_is_said_of_them_in_their_order(
    tmp_path: Path,
) -> None:
    times = {"USED": 2, "TIMES": np.array([[1.0, 0.0], [2.5, 30.25]])}
    events = {"LABELS": ["Foot Off", "Foot Strike"], "CONTEXTS": ["Left", ""]}
    events |= {"SUBJECTS": ["late", "early"], "ICON_IDS": [2, 1], "GENERIC_FLAGS": [1]}
    found = read(made(more={"EVENT": times | events}), tmp_path)
    assert found.events == (Event(30.25, "Foot Strike"), Event(62.5, "Left Foot Off"))
    assert found.metadata["event.subjects"] == '["early", "late"]'
    assert found.metadata["event.icon_ids"] == "[1, 2]"
    note = "In the order of the file, not of time: EVENT:GENERIC_FLAGS."
    assert found.metadata["reading.events"] == note


def test_points_and_channels_without_a_label_are_counted(tmp_path: Path) -> None:
    found = read(made(more={"ANALOG": {"LABELS": [" "]}, "POINT": {"LABELS": [" "]}}), tmp_path)
    assert [g.signals[0].name for g in found.groups] == ["point 1.x", "analog 1"]


def test_more_frames_than_a_word_can_count_are_counted_in_a_float(tmp_path: Path) -> None:
    long = {"FRAMES": 65535, "LONG_FRAMES": 2.0}
    found = read(made(frames=(1, 65535), more={"POINT": long}), tmp_path)
    assert [g.n_samples for g in found.groups] == [2, 8]
    assert not any(key.startswith("reading.frames") for key in found.metadata)


def test_a_file_that_counts_its_frames_twice_is_measured(tmp_path: Path) -> None:
    found = read(made(frames=(1, 90)), tmp_path)
    assert found.groups[0].n_samples == 2
    assert found.metadata["reading.frames"].startswith("It states 2 and 90 frames; the length")
    with pytest.raises(DataError, match="it states 3 and 2 frames; expected one number"):
        read(made(frames=(1, 2), more={"POINT": {"FRAMES": 3}}), tmp_path)


@pytest.mark.parametrize(
    ("raw", "words"),
    [
        (made()[:1] + b"\x51" + made()[2:], "found byte 1 = 0x51"),
        (b"\1" + made()[1:], "the block of the parameters, from 2 on, found 1"),
        (b"\x80" + made()[1:], "the block of the parameters, from 2 on, found 128"),
        (made()[:515] + b"\x57" + made()[516:], "84, 85 or 86 (a kind of computer), found 87"),
        (made()[:700], "6 more bytes of parameters, found the end of the file at 700"),
        (made()[:1000], "its frames start at byte 1024 of 1000; it is cut off"),
        (made()[:-490], "it states 2 frames, and holds 0; it is cut off or damaged"),
        (made(more={"POINT": {"SCALE": float("inf")}}), "POINT:SCALE is inf"),
        (made(more={"ANALOG": {"RATE": 900.0}}), "ANALOG:RATE is 900 Hz, 4 samples a frame"),
        (made(more={"EVENT": {"TIMES": np.array([[0.0], [np.nan]])}}), "an event has a time that "),
        (made(more={"ROTATION": ROTATION | {"RATIO": 1.5}}), "ROTATION:RATIO is 1.5"),
        (made(more={"ROTATION": ROTATION}), "2 samples of 9 rotations end after the file's own e"),
    ],
)
def test_damage_is_named_with_its_place(raw: bytes, words: str, tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"made\.c3d") as caught:
        read(raw, tmp_path)
    assert words in str(caught.value)


def test_parameters_that_are_wiped_out_are_missed(tmp_path: Path) -> None:
    raw = bytearray(made())
    at = raw.index(b"LABELS") - 2
    raw[at : at + 20] = bytes(20)
    with pytest.raises(DataError, match=r"POINT:LABELS, POINT:UNITS.* belong to no parameter"):
        read(bytes(raw), tmp_path)


def test_what_looks_odd_is_told(tmp_path: Path) -> None:
    raw = bytearray(made())
    raw[20:24] = struct.pack("<f", 60.0)
    metadata = read(bytes(raw), tmp_path).metadata
    assert metadata["reading.rate"] == "The header says 60 Hz; POINT:RATE holds."


def spoiled(raw: bytes, rng: np.random.Generator, kind: int) -> bytes:
    """Cut a file off; turn bits or blank a part before the samples; or swap its first bytes."""
    spoilt = bytearray(raw)
    if kind == 0:
        return raw[: rng.integers(0, len(raw))]
    if kind == 1:
        for place in rng.integers(0, SAMPLES_FROM, 4):
            spoilt[place] ^= 1 << rng.integers(0, 8)
    elif kind == 2:
        start = rng.integers(0, SAMPLES_FROM - 16)
        spoilt[start : start + 16] = bytes(16)
    else:
        spoilt[:4] = rng.bytes(4)
    return bytes(spoilt)


#: Parameters that are stated once: what they are changed to is what they are.
TOLD_ONCE = (b"GEN_SCALE", b"SCALE", b"OFFSET", b"FORMAT")
SAMPLES_FROM = 512 * 2


def told_once(raw: bytes) -> np.ndarray:
    """Whether each byte of a file belongs to a scale, an offset or a format of channels."""
    found = np.zeros(len(raw), dtype=bool)
    analog = raw.index(b"ANALOG")
    for name in TOLD_ONCE:
        at = raw.index(bytes((len(name), 2)) + name, analog)
        (step,) = WORD.unpack(raw[at + 2 + len(name) : at + 4 + len(name)])
        found[at : at + 2 + len(name) + step] = True
    return found


def changed(raw: bytes, spoilt: bytes) -> np.ndarray:
    return np.frombuffer(raw, np.uint8) != np.frombuffer(spoilt, np.uint8)


def samples(found: Acquisition) -> list[list[float]]:
    return [s.values.tolist() for g in found.groups for s in g.signals]


def test_the_reading_of_200_damaged_files_is_that_of_the_whole_one(outcome, tmp_path: Path) -> None:
    """Cut off anywhere, or changed before the samples: refused, noted, or nothing is lost."""
    rng = np.random.default_rng(9)
    path, outcomes = tmp_path / "bad.c3d", {"refused": 0, "noted": 0, "same": 0}
    files = [(raw, read(raw, tmp_path), told_once(raw)) for raw in (made(floats=False), made())]
    for i in range(200):
        raw, whole, once = files[i % 8 < 4]
        spoilt = spoiled(raw, rng, i % 4)
        path.write_bytes(spoilt)
        found = outcome(path)
        if isinstance(found, str):
            assert path.name in found
            assert len(found) > 40
            outcomes["refused"] += 1
        elif any(key.startswith("reading.") for key in found.metadata):
            outcomes["noted"] += 1
        elif len(spoilt) < len(raw) or not changed(raw, spoilt)[once].any():
            assert repr(samples(found)) == repr(samples(whole))
            outcomes["same"] += 1
    assert min(outcomes.values()) >= 2, outcomes
    assert outcomes["refused"] >= 75


def test_a_cut_anywhere_is_refused_but_in_the_padding(outcome, tmp_path: Path) -> None:
    raw = made()
    whole, end = read(raw, tmp_path), raw.rindex(struct.pack("<f", 64 - 8)) + 4
    for at in range(0, len(raw), 7):
        (tmp_path / "bad.c3d").write_bytes(raw[:at])
        found = outcome(tmp_path / "bad.c3d")
        assert is_same_content(found, whole) if isinstance(found, Acquisition) else at < end, at


def test_frames_beyond_the_most_that_a_word_counts_are_told_by_the_length(tmp_path):
    content = made(frames=(1, 65535), more={"POINT": {"FRAMES": 65535}})
    (tmp_path / "long.c3d").write_bytes(content + bytes(range(1, 33)) * 65535)
    points = read_acquisition(tmp_path / "long.c3d").groups[0]
    assert points.n_samples > 65535
