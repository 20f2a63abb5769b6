"""XDF: streams, clocks and events, damaged files, and a recording over loopback."""

import struct
import sys
import time
import uuid
from pathlib import Path

import numpy as np
import pytest

from jointz.core.acquisition import Acquisition, Event
from jointz.core.errors import DataError
from jointz.io.formats.registry import read_acquisition

pyxdf = pytest.importorskip("pyxdf", reason="XDF files need jointz[formats]")

# Files are made here by hand: jointz reads XDF, and writes none.


def chunk(tag: int, body: bytes) -> bytes:
    return struct.pack("<BIH", 4, len(body) + 2, tag) + body


def header(
    number: int, fmt: str, *, rate: str = "0", more: str = "", channels: object = 1
) -> bytes:
    xml = (
        f'<?xml version="1.0"?><info><name>s{number % 10}</name><channel_count>{channels}'
        f"</channel_count><nominal_srate>{rate}</nominal_srate><channel_format>{fmt}"
        f"</channel_format>{more}</info>"
    )
    return chunk(2, struct.pack("<I", number) + xml.encode())


def samples(number: int, rows: list[tuple[float | None, bytes]]) -> bytes:
    body = struct.pack("<IBI", number, 4, len(rows))
    for stamp, raw in rows:
        body += b"\0" if stamp is None else struct.pack("<Bd", 8, stamp)
        body += raw
    return chunk(3, body)


def doubles(*stamps: float | None) -> bytes:
    """Samples of stream 1, each the number 1."""
    return samples(1, [(stamp, struct.pack("<d", 1)) for stamp in stamps])


def offset(time_s: float, value_s: float) -> bytes:
    return chunk(4, struct.pack("<Idd", 1, time_s, value_s))


def xdf(*chunks: bytes) -> bytes:
    return b"XDF:" + chunk(1, b"<info><version>1.0</version></info>") + b"".join(chunks)


def texts(*rows: tuple[float, str]) -> bytes:
    """Samples of stream 2, each a text."""
    return samples(2, [(stamp, bytes((1, len(text))) + text.encode()) for stamp, text in rows])


def footer(number: int, count: int) -> bytes:
    xml = f"<info><sample_count>{count}</sample_count></info>"
    return chunk(6, struct.pack("<I", number) + xml.encode())


CHANNEL = (
    "<desc><channels><channel><label>speed</label><unit>rad/s</unit></channel></channels></desc>"
)
#: Numbers at a rate of which only the first has a stamp, and markers.
TWO_STREAMS = xdf(
    header(1, "double64", rate="100", more=f"<type>Motor</type>{CHANNEL}"),
    header(2, "string", more="<type>Markers</type>"),
    doubles(2.5, *[None] * 4),
    footer(1, 5),
    texts((2.5, "go"), (2.51, ""), (2.52, "stop")),
    footer(2, 3),
)


def read(raw: bytes, tmp_path: Path) -> Acquisition:
    path = tmp_path / "made.xdf"
    path.write_bytes(raw)
    return read_acquisition(path)


def test_streams_are_groups_and_markers_are_events_too(tmp_path: Path) -> None:
    found = read(TWO_STREAMS, tmp_path)
    wheel, marks = found.groups
    assert [(s.name, s.unit, len(s.values)) for s in wheel.signals] == [("speed", "rad/s", 5)]
    assert (wheel.name, wheel.rate_hz, wheel.start_s) == ("s1", 100.0, 2.5)
    assert marks.signals[0].values.tolist() == ["go", "", "stop"]
    assert marks.times_s().tolist() == [2.5, 2.51, 2.52]  # type: ignore[union-attr]
    assert found.events == (Event(2.5, "go"), Event(2.52, "stop"))
    assert found.metadata["s1.type"] == "Motor"


@pytest.mark.parametrize(
    ("length", "events"),
    [("0.5", [Event(1.0, "go", 0.5)]), ("n/a", [Event(1.0, "go"), Event(1.0, "n/a")])],
)
def test_markers_with_durations_are_events_that_last(
    length: str, events: list[Event], tmp_path: Path
) -> None:
    labels = "".join(f"<channel><label>{w}</label></channel>" for w in ("label", "duration_s"))
    more = f"<desc><channels>{labels}</channels></desc>"
    row = b"\1\2go" + bytes((1, len(length))) + length.encode()
    found = read(
        xdf(header(2, "string", more=more, channels=2), samples(2, [(1.0, row)])), tmp_path
    )
    assert list(found.events) == events


@pytest.mark.parametrize(
    ("fmt", "kind"),
    [("int8", "b"), ("int16", "h"), ("int32", "i"), ("int64", "q"), ("float32", "f")],
)
def test_every_format_of_numbers_is_read(fmt: str, kind: str, tmp_path: Path) -> None:
    rows = [(1.0, struct.pack(f"<2{kind}", 7, -3)), (1.5, struct.pack(f"<2{kind}", 100, 0))]
    (group,) = read(xdf(header(1, fmt, channels=2), samples(1, rows)), tmp_path).groups  # type: ignore[arg-type]
    assert [s.values.tolist() for s in group.signals] == [[7, 100], [-3, 0]]
    assert group.times_s().tolist() == [1.0, 1.5]  # type: ignore[union-attr]


def test_whole_numbers_too_large_for_a_float_stay_as_texts(tmp_path: Path) -> None:
    rows = [(1.0, struct.pack("<q", 2**60 + 1))]
    (group,) = read(xdf(header(1, "int64"), samples(1, rows)), tmp_path).groups  # type: ignore[arg-type]
    assert group.signals[0].values.tolist() == [str(2**60 + 1)]


def test_only_the_first_stamp_and_a_rate_are_a_uniform_clock(tmp_path: Path) -> None:
    stream = header(1, "double64", rate="50")
    uniform = read(xdf(stream, doubles(4.0, None, None)), tmp_path).groups[0]
    assert (uniform.rate_hz, uniform.start_s) == (50.0, 4.0)
    stamped = read(xdf(stream, doubles(4.0, None, 5.0, None)), tmp_path)
    assert stamped.groups[0].times_s().tolist() == [4.0, 4.02, 5.0, 5.02]  # type: ignore[union-attr]
    assert stamped.metadata["s1.nominal_srate"] == "50"
    assert "2 of 4 time stamps follow from the nominal rate" in stamped.metadata["reading.s1"]
    # Neither stamps nor rate: no clock, and none made up.
    clockless = read(xdf(header(1, "double64"), doubles(None, None)), tmp_path)
    assert clockless.groups[0].times_s() is None


@pytest.mark.parametrize(
    ("rate", "stamps", "words"),
    [
        ("100", [None, None], "its first sample has none to count from"),
        ("100", [None, 5.0], "its first sample has none to count from"),
        ("0", [None, 5.0], "its first sample has none to count from"),
        ("0", [5.0, None, None], "2 of 3 have none, nor a rate"),
    ],
)
def test_time_stamps_are_not_made_up(
    rate: str, stamps: list[float | None], words: str, tmp_path: Path
) -> None:
    with pytest.raises(DataError, match="stream 's1': expected a time stamp a") as caught:
        read(xdf(header(1, "double64", rate=rate), doubles(*stamps)), tmp_path)
    assert words in str(caught.value)


def test_offsets_of_a_clock_are_put_to_account(tmp_path: Path) -> None:
    offsets = [offset(t, 100.0 + 1e-3 * t) for t in (10.0, 20.0, 30.0)]
    raw = xdf(header(1, "double64", rate="0.1"), doubles(10.0, 20.0, 30.0), *offsets)
    content = read(raw, tmp_path)
    times = content.groups[0].times_s()
    np.testing.assert_allclose(times, [110.01, 120.02, 130.03], rtol=0, atol=1e-6)
    assert "corrected by 3 offsets" in content.metadata["reading.s1"]


def test_offsets_that_correct_nothing_are_told(tmp_path: Path) -> None:
    raw = xdf(header(1, "double64"), doubles(10.0, 20.0), *[offset(10.0, 99.0)] * 2)
    content = read(raw, tmp_path)
    assert content.groups[0].times_s().tolist() == [10.0, 20.0]  # type: ignore[union-attr]
    assert "None of the 2 offsets" in content.metadata["reading.s1"]
    assert "corrected by" not in content.metadata["reading.s1"]


def test_a_stream_of_which_only_parts_are_corrected_is_refused(tmp_path: Path) -> None:
    stream = header(1, "double64"), doubles(10.0, 20.0, 300.0, 310.0)
    late = [offset(300.0 + i, 900.0) for i in range(20)]
    with pytest.raises(DataError, match="stream 's1': expected offsets of its clock that pyxdf"):
        read(xdf(*stream, *[offset(10.0, 1.0)] * 40, *late), tmp_path)
    early = [offset(10.0 + i / 2, 1.0) for i in range(40)]
    content = read(xdf(*stream, *early, *late), tmp_path)
    assert "Its clock was reset 1 time(s)" in content.metadata["reading.s1"]
    times = content.groups[0].times_s()
    np.testing.assert_allclose(times, [11.0, 21.0, 1200.0, 1210.0], rtol=0, atol=1e-6)


def test_streams_of_one_name_are_told_apart(tmp_path: Path) -> None:
    one, two = header(1, "int8"), header(11, "int8")
    assert [g.name for g in read(xdf(one, two), tmp_path).groups] == ["s1 (1)", "s1 (11)"]
    one = header(1, "int8", more="<source_id>left</source_id>")
    two = header(11, "int8", more="<source_id>right</source_id>")
    assert [g.name for g in read(xdf(one, two), tmp_path).groups] == ["s1 (left)", "s1 (right)"]


def test_a_recording_that_was_not_closed_and_texts_that_are_no_utf8_are_told(
    tmp_path: Path,
) -> None:
    content = read(xdf(header(1, "string"), samples(1, [(1.0, b"\1\2a\xb5")])), tmp_path)
    assert content.events[0].label == "a\ufffd"
    assert "1 texts are no UTF-8" in content.metadata["reading.s1"]
    assert "has no footer" in content.metadata["reading.s1"]


def test_without_pyxdf_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyxdf", None)
    with pytest.raises(DataError, match=r'pip install "jointz\[formats\]"'):
        read(TWO_STREAMS, tmp_path)


def test_a_pyxdf_that_is_too_old_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    load = pyxdf.load_xdf

    def load_as_before(*args: object, **options: object) -> object:
        streams, header = load(*args, **options)
        for stream in streams:
            del stream["info"]["clock_segments"]  # came with 1.17.2
        return streams, header

    monkeypatch.setattr(pyxdf, "load_xdf", load_as_before)
    with pytest.raises(DataError, match=r"made\.xdf: XDF files need pyxdf 1\.17\.2 or newer"):
        read(TWO_STREAMS, tmp_path)


GOOD = xdf(header(1, "double64"), doubles(1.0, 2.0))
BYTES = header(1, "int8")
BOUNDARY = chunk(5, bytes.fromhex("43a546dccbf5410fb30ed5467383cbe4"))


@pytest.mark.parametrize(
    ("raw", "words"),
    [
        (b"XDF;" + GOOD[4:], "byte 0: expected 'XDF:'"),
        (b"XDF:", "expected a file header"),
        (GOOD[:-1] + BOUNDARY, "expected a number of 1, 4 or 8 bytes, found one of 18"),
        (xdf(b"\3"), "expected a number of 1, 4 or 8 bytes"),
        (xdf(chunk(9, b"")), "expected a chunk of kind 1 to 6, found kind 9"),
        (xdf(chunk(5, bytes(16))), "the signature of a boundary"),
        (xdf(samples(1, [])), "a header of stream 1 before its chunks"),
        (xdf(BYTES, BYTES), "one header of stream 1"),
        (xdf(header(1, "double32")), "a channel_format among"),
        (xdf(header(1, "int8", channels=0)), "a channel_count from 1 to 65536"),
        (xdf(header(1, "int8", channels="9" * 5000)), "a channel_count from 1 to 65536, found '99"),
        (xdf(header(1, "int8", channels=65_537)), "a channel_count from 1 to 65536, found '65537'"),
        (xdf(chunk(1, b'<?xml version="1.0" encoding="UTF-16"?><info/>')), "cannot be read as a "),
        (xdf(BYTES, chunk(6, b"\1\0\0\0<info><sample_count>-</sample_count></info>")), "cannot be"),
        (xdf(header(1, "int8", rate="fast")), "a nominal_srate from 0 on"),
        (xdf(chunk(2, b"\1\0\0\0<info>")), "a description in XML"),
        (xdf(chunk(2, b"\1\0\0\0<other/>")), "expected <info>, found <other>"),
        (xdf(BYTES, samples(1, [(1.0, b"")])), "1 more bytes, found 0"),
        (xdf(BYTES, samples(1, [(1.0, b"123")])), "the end of the samples"),
        (xdf(BYTES, chunk(4, bytes((1, 0, 0, 0, 9)))), "a clock offset of 16 bytes"),
        (xdf(BYTES, samples(1, [(np.nan, b"1")])), "sample 1: expected a time stamp"),
        (xdf(BYTES, chunk(3, struct.pack("<IBQ", 1, 8, 2**62))), f"expected {2**62} samples, foun"),
    ],
)
def test_damage_is_named_with_its_place(raw: bytes, words: str, tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"made\.xdf") as caught:
        read(raw, tmp_path)
    assert words in str(caught.value)


def test_chunks_before_the_one_in_which_a_recorder_stopped_are_read(tmp_path: Path) -> None:
    started = doubles(3.0, 4.0)
    for size in (1, 3, len(started) - 1):
        found = read(GOOD + started[:size], tmp_path)
        assert found.groups[0].times_s().tolist() == [1.0, 2.0]  # type: ignore[union-attr]
        assert f"last {size} bytes are not read" in found.metadata["reading.end"]
    with pytest.raises(DataError, match="expected a chunk of"):
        read(GOOD + chunk(3, b"")[:1] + b"\xff" * 4 + BOUNDARY, tmp_path)


def test_a_file_header_of_plain_text_is_no_metadata(tmp_path: Path) -> None:
    raw = b"XDF:" + chunk(1, b"<info>abc</info>") + GOOD[len(xdf()) :]
    assert [g.n_samples for g in read(raw, tmp_path).groups] == [2]


def begins_like(found: Acquisition, whole: Acquisition) -> bool:
    """Whether every sample that was read is that of the whole file."""
    pairs = zip(found.groups, whole.groups, strict=False)
    return all(
        np.array_equal(s.values, twin.values[: len(s.values)])
        for group, other in pairs
        for s, twin in zip(group.signals, other.signals, strict=True)
    )


def frames_of_chunks(raw: bytes) -> list[int]:
    """Where lengths, kinds and stream numbers stand: what parts a file into chunks."""
    found, at = [], 4
    while at < len(raw):
        size = 1 + raw[at]
        length = int.from_bytes(raw[at + 1 : at + size], "little")
        found += range(at, at + size + 2 + 4 * (raw[at + size] != 1))
        at += size + length
    return found


def test_a_file_that_is_cut_off_is_refused_or_its_beginning_with_a_note(
    outcome, tmp_path: Path
) -> None:
    path, raw, n_read = tmp_path / "cut.xdf", TWO_STREAMS, 0
    whole = read(raw, tmp_path)
    ends = {at for at in frames_of_chunks(raw) if at - 1 not in frames_of_chunks(raw)}
    for at in sorted(ends | set(range(0, len(raw), 17))):
        path.write_bytes(raw[:at])
        found = outcome(path)
        if isinstance(found, Acquisition):
            n_read += 1
            assert begins_like(found, whole)
            noted = {key.removeprefix("reading.") for key in found.metadata if "reading." in key}
            assert noted or not found.groups
            for group, twin in zip(found.groups, whole.groups, strict=False):
                assert group.name in noted or group.n_samples == twin.n_samples
    assert n_read >= 5  # between chunks


def test_bits_that_turn_between_samples_do_not_change_samples(outcome, tmp_path: Path) -> None:
    path, raw = tmp_path / "bad.xdf", TWO_STREAMS
    whole = read(raw, tmp_path)
    rng = np.random.default_rng(5)
    for place in frames_of_chunks(raw):
        spoilt = bytearray(raw)
        spoilt[place] ^= 1 << rng.integers(0, 8)
        path.write_bytes(spoilt)
        found = outcome(path)
        if isinstance(found, Acquisition) and not any("reading." in k for k in found.metadata):
            assert begins_like(found, whole), place
            assert [g.n_samples for g in found.groups] == [5, 3], place


def test_a_recording_over_loopback_opens_with_the_numbers_that_were_sent(tmp_path: Path) -> None:
    try:
        import pylsl
    except (ImportError, RuntimeError) as exc:
        pytest.skip(f"Lab Streaming Layer does not load: {exc}")
    source = uuid.uuid4().hex
    info = pylsl.StreamInfo("knee", "Motor", 2, 200.0, "double64", source)
    channels = info.desc().append_child("channels")
    for label, unit in (("angle", "deg"), ("torque", "Nm")):
        entry = channels.append_child("channel")
        entry.append_child_value("label", label)
        entry.append_child_value("unit", unit)
    outlet = pylsl.StreamOutlet(info)
    found = pylsl.resolve_byprop("source_id", source, timeout=5.0)
    if not found:
        pytest.skip("this machine lets no stream be found over loopback")
    inlet = pylsl.StreamInlet(found[0])
    inlet.open_stream(timeout=5.0)
    sent = [[i / 7, -i / 3] for i in range(50)]
    base = pylsl.local_clock()
    for i, row in enumerate(sent):
        outlet.push_sample(row, base + i / 200)
    rows: list[tuple[float | None, bytes]] = []
    for _ in sent:
        values, stamp = inlet.pull_sample(timeout=5.0)
        rows.append((stamp, struct.pack("<2d", *values)))
    offset = inlet.time_correction(timeout=5.0)
    now = time.monotonic()
    xml = struct.pack("<I", 7) + inlet.info(timeout=5.0).as_xml().encode()
    raw = xdf(chunk(2, xml), samples(7, rows), chunk(4, struct.pack("<Idd", 7, now, offset)))
    content = read(raw, tmp_path)
    (group,) = content.groups
    assert [(s.name, s.unit) for s in group.signals] == [("angle", "deg"), ("torque", "Nm")]
    assert np.array_equal(np.stack([s.values for s in group.signals], axis=1), np.array(sent))
    stamps = base + np.arange(50) / 200
    np.testing.assert_allclose(group.times_s(), stamps, rtol=0, atol=5e-3)
    assert content.metadata["knee.source_id"] == source
