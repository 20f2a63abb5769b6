"""Channels and markers of a session on Lab Streaming Layer, on a fake pylsl and for real."""

import importlib
import importlib.util
import json
import os
import sys
from types import ModuleType
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest

from jointz.core.clock import RealClock, VirtualClock
from jointz.core.errors import DeviceError
from jointz.core.session_log import BENCH, WALKING, Layout
from jointz.rig.devices.lsl_outlets import SessionOutlets

from .fakes import needs


class FakeInfo:
    def __init__(self, *about: Any) -> None:
        self.about, self.node = about, MagicMock()

    def desc(self) -> MagicMock:
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


def records(layout: Layout, **values: list[float]) -> np.ndarray:
    made = np.zeros(len(next(iter(values.values()))), dtype=layout.dtype)
    for name, column in values.items():
        made[name] = column
    return made


def sent(name: str) -> list[tuple[list[Any], float]]:
    return next(outlet.sent for outlet in made if outlet.info.about[0] == name)


def test_every_channel_of_every_record_goes_out_with_its_time(pylsl) -> None:
    outlets = SessionOutlets(clock=VirtualClock(100_000_000_000))
    rows = records(WALKING, angle=[0.0, 0.1, 0.2, float("nan")])
    outlets.send(WALKING, rows, 100_000_000_000 + np.arange(4) * 2_000_000)
    names = [field.name for field in WALKING.fields]
    column = [values[names.index("angle")] for values, _ in sent("jointz")]
    assert column[:3] == [0.0, 0.1, 0.2]
    assert np.isnan(column[3])
    assert [stamp for _, stamp in sent("jointz")] == pytest.approx(
        [700.0, 700.002, 700.004, 700.006]
    )


def test_channels_are_described_by_label_and_unit(pylsl) -> None:
    SessionOutlets(clock=VirtualClock()).offer(BENCH)
    info = next(outlet.info for outlet in made if outlet.info.about[0] == "jointz")
    assert info.about[1:5] == ("jointz", len(BENCH.fields), 0.0, "double64")
    told = [call.args for call in info.node.mock_calls if call.args[:1] in (("label",), ("unit",))]
    assert [value for key, value in told if key == "label"] == [f.name for f in BENCH.fields]
    assert next(value for key, value in told if key == "unit") == "ns"


def test_the_next_stretch_goes_on_in_the_same_stream(pylsl) -> None:
    outlets = SessionOutlets(clock=VirtualClock(), name="knee")
    for _ in range(2):
        outlets.send(WALKING, records(WALKING, slot=[1]), np.array([5]))
    assert outlets.names == ("knee", "knee markers")
    assert len(made) == 2
    assert len(sent("knee")) == 2


def test_a_marker_carries_the_time_of_the_session(pylsl) -> None:
    outlets = SessionOutlets(clock=VirtualClock(1_000_000_000))
    outlets.mark('{"event": "sync"}', 3_000_000_000)
    assert sent("jointz markers") == [(['{"event": "sync"}'], pytest.approx(702.0))]


def test_a_missing_pylsl_is_named_with_its_command(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "pylsl", None)
    with pytest.raises(DeviceError, match=r'pip install "jointz\[lsl\]"'):
        SessionOutlets(clock=VirtualClock())


@needs("pylsl")
@pytest.mark.alone
def test_channels_and_markers_arrive_at_real_inlets() -> None:
    pylsl = importlib.import_module("pylsl")
    clock = RealClock()
    name = f"jointz-test-{os.getpid()}"
    outlets = SessionOutlets(clock=clock, name=name)
    outlets.offer(WALKING)
    inlets = [
        pylsl.StreamInlet(pylsl.resolve_byprop("name", wanted, 1, 5.0)[0], recover=False)
        for wanted in outlets.names
    ]
    for inlet in inlets:
        inlet.open_stream(5.0)
    began_ns = clock.now_ns()
    outlets.send(WALKING, records(WALKING, angle=list(range(50))), began_ns + np.arange(50))
    outlets.mark('{"event": "pulse_on"}', began_ns)
    samples, stamps = inlets[0].pull_chunk(timeout=5.0, max_samples=50)
    marker, marked_s = inlets[1].pull_sample(timeout=5.0)
    described = inlets[0].info(5.0).desc().child("channels").child("channel")
    place = [field.name for field in WALKING.fields].index("angle")
    assert [row[place] for row in samples] == [float(i) for i in range(50)]
    assert stamps[0] == pytest.approx(began_ns * 1e-9, abs=1e-3)
    assert json.loads(marker[0]) == {"event": "pulse_on"}
    assert marked_s == pytest.approx(began_ns * 1e-9, abs=1e-3)
    assert described.child_value("label") == "host_time_ns"
