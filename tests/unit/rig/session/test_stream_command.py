"""``jointz stream``: on a stand-in for pylsl."""

import json
import sys
from types import ModuleType, SimpleNamespace
from unittest.mock import MagicMock

import pytest

from jointz.core.clock import VirtualClock
from jointz.core.session_log import WALKING
from jointz.rig.experiment.files.journal import Journal
from jointz.rig.experiment.files.recorder import Recorder


class Streams:
    """Keeps what is pushed, and is interrupted after so many."""

    def __init__(self):
        self.sent, self.interrupted_after = [], -1

    def outlet(self, name, **_):
        def push_sample(_, stamp):
            if len(self.sent) == self.interrupted_after:
                raise KeyboardInterrupt
            self.sent.append((name, stamp))

        return SimpleNamespace(push_sample=push_sample)


class Info(str):
    """The name of a stream, and a description that nobody reads."""

    def __new__(cls, name, *_):
        return super().__new__(cls, name)

    def desc(self):
        return MagicMock()


@pytest.fixture
def pylsl(monkeypatch):
    streams, module = Streams(), ModuleType("pylsl")
    module.StreamInfo, module.StreamOutlet, module.IRREGULAR_RATE = Info, streams.outlet, 0.0
    module.local_clock = lambda: 700.0
    monkeypatch.setitem(sys.modules, "pylsl", module)
    monkeypatch.setattr("jointz.rig.session.live.lab_stream.RealClock", lambda **_: VirtualClock())
    return streams


@pytest.fixture
def session(tmp_path):
    folder = tmp_path / "S01"
    (folder / "logs").mkdir(parents=True)
    with Journal(folder / "journal.jsonl") as journal:
        journal.write("segment_started", condition="EWP", segment=0)
    with Recorder(folder / "logs" / "EWP-0.jzlog", {"condition": "EWP"}, WALKING) as recorder:
        for tick in range(50):
            given = {"host_time_ns": tick * 2_000_000, "slot": tick, "pulse": tick >= 25}
            recorder.write(tuple(given.get(field.name, 0) for field in WALKING.fields))
    return folder


def test_a_session_that_is_over_is_played(jointz, pylsl, session):
    done = jointz("stream", session, "--name", "knee")
    assert done.code == 0
    stamps = [stamp for name, stamp in pylsl.sent if name == "knee"]
    assert (len(stamps), len(pylsl.sent)) == (50, 52)
    assert (stamps[0], stamps[-1]) == (pytest.approx(700.0), pytest.approx(700.098))


def test_ctrl_c_is_the_usual_end(jointz, pylsl, session):
    pylsl.interrupted_after = 20
    done = jointz("stream", session, "--json")
    assert done.code == 0
    assert json.loads(done.out)["status"] == "ok"
