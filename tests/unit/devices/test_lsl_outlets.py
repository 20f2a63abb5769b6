"""A session on Lab Streaming Layer: fed by its files, on a stand-in for pylsl and for real."""

import importlib
import importlib.util
import json
import os
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from jointz.core.clock import RealClock, VirtualClock
from jointz.core.errors import DataError, DeviceError
from jointz.core.session_log import BENCH, WALKING, Flag, Layout
from jointz.devices.lsl_outlets import LogFollower, SessionOutlets, publish
from jointz.experiment.journal import Journal
from jointz.experiment.recorder import Recorder

HAS_PYLSL = importlib.util.find_spec("pylsl") is not None


class FakeNode:
    def __init__(self, name: str = "") -> None:
        self.name, self.children, self.values = name, [], {}

    def append_child(self, name: str) -> "FakeNode":
        self.children.append(FakeNode(name))
        return self.children[-1]

    def append_child_value(self, name: str, value: str) -> "FakeNode":
        self.values[name] = value
        return self


class FakeInfo:
    def __init__(self, *about: Any) -> None:
        self.about, self.node = about, FakeNode()

    def desc(self) -> FakeNode:
        return self.node


class FakeOutlet:
    def __init__(self, info: FakeInfo, max_buffered: int) -> None:
        self.info, self.max_buffered = info, max_buffered
        self.sent: list[tuple[list[Any], float]] = []
        made.append(self)

    def push_sample(self, x: list[Any], timestamp: float) -> None:
        assert len(x) == self.info.about[2]
        self.sent.append((x, timestamp))


made: list[FakeOutlet] = []


@pytest.fixture
def pylsl(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    made.clear()
    module = ModuleType("pylsl")
    module.StreamInfo, module.StreamOutlet = FakeInfo, FakeOutlet
    module.IRREGULAR_RATE = 0.0
    module.local_clock = lambda: 700.0
    monkeypatch.setitem(sys.modules, "pylsl", module)
    return module


def record(layout: Layout, host_ns: int, **values: float) -> tuple[float, ...]:
    return tuple({"host_time_ns": host_ns, **values}.get(f.name, 0) for f in layout.fields)


@pytest.fixture
def session(tmp_path: Path) -> Path:
    (tmp_path / "logs").mkdir()
    return tmp_path


def outlets_of(session: Path, clock: VirtualClock) -> SessionOutlets:
    return SessionOutlets(session / "logs", session / "journal.jsonl", clock=clock)


def sent(name: str) -> list[tuple[list[Any], float]]:
    return next(outlet.sent for outlet in made if outlet.info.about[0] == name)


def markers() -> list[dict[str, Any]]:
    return [json.loads(values[0]) for values, _ in sent("jointz markers")]


def test_every_channel_of_every_record_goes_out_with_the_time_of_its_tick(session, pylsl) -> None:
    clock = VirtualClock(100_000_000_000)
    outlets = outlets_of(session, clock)
    with Recorder(session / "logs" / "a-0.jzlog", {"condition": "a"}, WALKING) as recorder:
        for i in range(5):
            recorder.write(record(WALKING, 100_000_000_000 + i * 2_000_000, angle=0.1 * i))
            assert outlets.update() == 1
    values, stamp = sent("jointz")[3]
    names = [field.name for field in WALKING.fields]
    assert values[names.index("angle")] == pytest.approx(0.3)
    assert stamp == pytest.approx(700.006)
    assert outlets.update() == 0


def test_channels_are_described_by_label_and_unit(session, pylsl) -> None:
    outlets = outlets_of(session, VirtualClock())
    with Recorder(session / "logs" / "a-0.jzlog", {}, BENCH):
        outlets.update()
    info = next(outlet.info for outlet in made if outlet.info.about[0] == "jointz")
    assert info.about[1:5] == ("jointz", len(BENCH.fields), 0.0, "double64")
    (channels,) = info.node.children
    assert [child.values["label"] for child in channels.children] == [f.name for f in BENCH.fields]
    assert channels.children[0].values["unit"] == "ns"


def test_pulses_and_trips_are_markers_at_their_tick(session, pylsl) -> None:
    clock = VirtualClock()
    outlets = outlets_of(session, clock)
    pulses = [0, 0, 7, 7, 0, 8, 9, 0, 0]
    with Recorder(session / "logs" / "a-0.jzlog", {"condition": "a"}, WALKING) as recorder:
        for i, pulse in enumerate(pulses):
            flags = int(Flag.TRIPPED) if i >= 7 else 0
            recorder.write(record(WALKING, i * 1_000_000_000, pulse=pulse, flags=flags))
        outlets.update()
    events = [(m["event"], m.get("pulse")) for m in markers()]
    stamps = [round(stamp - 700.0) for _, stamp in sent("jointz markers")]
    assert list(zip(events, stamps, strict=True)) == [
        (("pulse_on", 7), 2),
        (("pulse_off", 7), 4),
        (("pulse_on", 8), 5),
        (("pulse_off", 8), 6),
        (("pulse_on", 9), 6),
        (("pulse_off", 9), 7),
        (("tripped", None), 7),
    ]


def test_events_of_the_journal_are_markers(session, pylsl) -> None:
    with Journal(session / "journal.jsonl") as journal:
        journal.write("before", condition="a")
        outlets = outlets_of(session, VirtualClock())
        journal.write("segment_started", condition="a", segment=0)
        assert outlets.update() == 1
        with (session / "journal.jsonl").open("ab") as file:
            file.write(b'{"event": "torn')
        assert outlets.update() == 0
    assert markers() == [{"event": "segment_started", "condition": "a", "segment": 0}]


def test_a_record_that_is_not_whole_yet_is_waited_for(session, pylsl) -> None:
    path = session / "logs" / "a-0.jzlog"
    outlets = outlets_of(session, VirtualClock())
    data = WALKING.pack(record(WALKING, 5))
    with path.open("wb", buffering=0) as file:
        file.write(WALKING.encode_header({}) + data[:50])
        assert outlets.update() == 0
        file.write(data[50:] + data)
        assert outlets.update() == 2


def test_a_record_that_the_disk_has_not_got_right_holds_up_what_follows(session) -> None:
    path = session / "a-0.jzlog"
    good = WALKING.pack(record(WALKING, 5))
    path.write_bytes(WALKING.encode_header({}) + good + bytes(len(good)) + good)
    follower = LogFollower(path)
    assert len(follower.read()) == 1
    assert len(follower.read()) == 0


def test_who_comes_late_sees_what_happens_from_then_on(session, pylsl) -> None:
    with Recorder(session / "logs" / "a-0.jzlog", {}, WALKING) as recorder:
        recorder.write(record(WALKING, 1))
        outlets = outlets_of(session, VirtualClock())
        recorder.write(record(WALKING, 2))
        assert outlets.update() == 1


def test_the_next_stretch_goes_on_in_the_same_stream(session, pylsl) -> None:
    outlets = outlets_of(session, VirtualClock())
    for name in ("a-0", "b-0"):
        with Recorder(session / "logs" / f"{name}.jzlog", {}, WALKING) as recorder:
            recorder.write(record(WALKING, 1))
        outlets.update()
    assert len(made) == 2
    assert len(sent("jointz")) == 2


def test_a_file_that_is_no_log_is_named(session, pylsl) -> None:
    (session / "logs" / "x.jzlog").write_bytes(b"nothing\n")
    with pytest.raises(DataError, match=r"x\.jzlog: expected a log of jointz"):
        outlets_of(session, VirtualClock())


def test_it_publishes_until_it_is_told_to_end(session, pylsl) -> None:
    clock = VirtualClock()
    outlets = outlets_of(session, clock)
    asked = iter([False, False, True])
    with Recorder(session / "logs" / "a-0.jzlog", {}, WALKING) as recorder:
        recorder.write(record(WALKING, 1))
        assert publish(outlets, clock=clock, until=lambda: next(asked)) == 1
    assert clock.now_ns() == 20_000_000


def test_a_marker_of_ones_own_carries_the_time_of_the_session(session, pylsl) -> None:
    outlets = outlets_of(session, VirtualClock(1_000_000_000))
    outlets.mark('{"event": "sync"}', 3_000_000_000)
    assert sent("jointz markers") == [(['{"event": "sync"}'], pytest.approx(702.0))]


def test_a_missing_pylsl_is_named_with_its_command(session, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "pylsl", None)
    with pytest.raises(DeviceError, match=r'pip install "jointz\[lsl\]"'):
        outlets_of(session, VirtualClock())


@pytest.mark.skipif(not HAS_PYLSL, reason="pylsl is not installed")
def test_a_session_arrives_at_real_inlets(session: Path) -> None:
    pylsl = importlib.import_module("pylsl")
    clock = RealClock()
    name = f"jointz-test-{os.getpid()}"
    outlets = SessionOutlets(session / "logs", session / "journal.jsonl", clock=clock, name=name)
    with Recorder(session / "logs" / "a-0.jzlog", {"condition": "a"}, WALKING) as recorder:
        outlets.update()
        inlets = [
            pylsl.StreamInlet(pylsl.resolve_byprop("name", wanted, 1, 5.0)[0], recover=False)
            for wanted in (name, f"{name} markers")
        ]
        for inlet in inlets:
            inlet.open_stream(5.0)
        began_ns = clock.now_ns()
        for i in range(50):
            recorder.write(record(WALKING, began_ns + i, angle=float(i), pulse=i // 25))
        outlets.update()
        samples, stamps = inlets[0].pull_chunk(timeout=5.0, max_samples=50)
        marker, marked_s = inlets[1].pull_sample(timeout=5.0)
        described = inlets[0].info(5.0).desc().child("channels").child("channel")
    place = [field.name for field in WALKING.fields].index("angle")
    assert [row[place] for row in samples] == [float(i) for i in range(50)]
    assert stamps[0] == pytest.approx(began_ns * 1e-9, abs=1e-3)
    assert json.loads(marker[0]) == {"event": "pulse_on", "condition": "a", "pulse": 1}
    assert marked_s == pytest.approx(began_ns * 1e-9, abs=1e-3)
    assert described.child_value("label") == "host_time_ns"
