"""A session is put on streams out of its files: followed while it runs, played when it is over."""

import fcntl
import json

import pytest

from jointz.core.clock import VirtualClock
from jointz.core.errors import DataError
from jointz.core.session_log import WALKING, Flag
from jointz.rig.experiment.files.journal import Journal
from jointz.rig.experiment.files.recorder import Recorder
from jointz.rig.session.live import lab_stream as session_stream
from jointz.rig.session.live.lab_stream import Following, Sending, found_session, replay

START_NS = 100_000_000_000
HEADER = {"participant": "S01", "condition": "EWP"}


class Outlets:
    """Stands for the streams: keeps what is sent."""

    def __init__(self):
        self.offered, self.stamps, self.marked = set(), [], []

    names = ("jointz", "jointz markers")

    def offer(self, layout):
        self.offered.add(layout.name)

    def send(self, layout, records, times_ns):
        assert records.dtype == layout.dtype
        self.stamps += times_ns.tolist()

    def mark(self, marker, time_ns):
        self.marked.append((json.loads(marker), time_ns))

    @property
    def events(self):
        return [(told["event"], time_ns) for told, time_ns in self.marked]


def record(tick, **values):
    given = {"host_time_ns": START_NS + tick * 2_000_000, "slot": tick, **values}
    return tuple(given.get(field.name, 0) for field in WALKING.fields)


def log(folder, name="EWP-0"):
    return Recorder(folder / "logs" / f"{name}.jzlog", HEADER, WALKING)


@pytest.fixture
def session(tmp_path):
    folder = tmp_path / "study" / "sessions" / "S01"
    (folder / "logs").mkdir(parents=True)
    (folder / "journal.jsonl").touch()
    return folder


@pytest.fixture
def study(session):
    return session.parent.parent


@pytest.fixture
def outlets():
    return Outlets()


def following(study, outlets, clock=None):
    sending = Sending(outlets)
    return Following(study, sending, clock=clock or VirtualClock())


def test_records_go_out_with_the_time_of_their_tick(session, study, outlets):
    stream = following(study, outlets)
    with log(session) as recorder:
        assert stream.update() == 0
        assert outlets.offered == {"walking"}
        for tick in range(5):
            recorder.write(record(tick))
            assert stream.update() == 1
    assert outlets.stamps == [START_NS + tick * 2_000_000 for tick in range(5)]


def test_pulses_and_trips_are_markers_at_their_tick(session, study, outlets):
    stream = following(study, outlets)
    with log(session) as recorder:
        for tick, pulse in enumerate([0, 0, 7, 7, 0, 8, 9, 0, 0]):
            flags = int(Flag.TRIPPED) if tick >= 7 else 0
            recorder.write(record(tick, pulse=pulse, flags=flags))
        stream.update()
    told = [(m["event"], m.get("pulse"), (at - START_NS) // 2_000_000) for m, at in outlets.marked]
    *pulses, tripped = told
    assert pulses[::2] == [("pulse_on", 7, 2), ("pulse_on", 8, 5), ("pulse_on", 9, 6)]
    assert pulses[1::2] == [("pulse_off", 7, 4), ("pulse_off", 8, 6), ("pulse_off", 9, 7)]
    assert tripped == ("tripped", None, 7)
    assert outlets.marked[0][0] == {"event": "pulse_on", "pulse": 7, **HEADER}


def test_who_comes_late_sees_what_happens_from_then_on(session, study, outlets):
    with log(session) as recorder, Journal(session / "journal.jsonl") as journal:
        recorder.write(record(1))
        journal.write("before", condition="EWP")
        stream = following(study, outlets, VirtualClock(77))
        recorder.write(record(2))
        journal.write("segment_started", condition="EWP", segment=0)
        with (session / "journal.jsonl").open("ab") as file:
            file.write(b'{"event": "torn')
        assert stream.update() == 2
    assert outlets.stamps == [START_NS + 4_000_000]
    assert outlets.events == [("segment_started", 77)]


def test_the_next_participant_is_followed_from_the_beginning(session, study, outlets):
    stream = following(study, outlets)
    later = session.parent / "S02"
    (later / "logs").mkdir(parents=True)
    with Journal(later / "journal.jsonl") as journal, log(later) as recorder:
        journal.write("segment_started", condition="EWP", segment=0)
        recorder.write(record(1))
        assert stream.update() == 2
    assert outlets.marked[0][0]["participant"] == "S02"


def test_a_session_that_is_over_is_played_at_its_pace(session, outlets):
    with Journal(session / "journal.jsonl") as journal:
        for segment in range(2):
            journal.write("segment_started", condition="EWP", segment=segment)
            journal.write("pulse_completed", condition="EWP", segment=segment, slot=600, pulse=1)
            journal.write("condition_completed", condition="EWP", segment=segment)
    for segment, count in enumerate([1000, 500]):
        with log(session, f"EWP-{segment}") as recorder:
            recorder.write(*[record(tick) for tick in range(count)])
    clock = VirtualClock(5)
    replay(session, Sending(outlets), clock=clock)
    assert len(outlets.stamps) == 1500
    assert outlets.stamps[:2] == [5, 2_000_005]
    assert outlets.stamps == sorted(outlets.stamps)
    assert clock.now_ns() * 1e-9 == pytest.approx(3.0, abs=0.05)
    second = outlets.stamps[1000]
    assert outlets.events == [
        ("segment_started", 5),
        ("pulse_completed", 5 + 600 * 2_000_000),
        ("condition_completed", 5 + 999 * 2_000_000),
        ("segment_started", second),
        ("pulse_completed", second + 499 * 2_000_000),  # the log ends before it
        ("condition_completed", second + 499 * 2_000_000),
    ]


def test_a_study_of_one_session_or_the_session_itself_is_played(session, study):
    assert found_session(study) == found_session(session) == (session, None)


def test_of_several_sessions_one_has_to_be_named_and_there_has_to_be_one(session, study, tmp_path):
    other = session.parent / "S02"
    other.mkdir()
    (other / "journal.jsonl").touch()
    with pytest.raises(DataError, match="S01"):
        found_session(study)
    with pytest.raises(DataError, match="no session"):
        found_session(tmp_path)


@pytest.mark.parametrize("clock", ["real", "fast"])
def test_a_study_that_runs_is_followed_unless_its_time_is_virtual(session, study, clock):
    run = study / "run.json"
    run.write_text(json.dumps({"clock": clock}))
    with run.open() as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        if clock == "real":
            assert found_session(study) == found_session(session) == (None, study)
        else:
            with pytest.raises(DataError, match="runs in virtual time"):
                found_session(study)


def test_following_ends_with_the_session_and_leaves_nothing_behind(
    session, study, outlets, monkeypatch
):
    """What is written between the last look and the end is sent too."""

    def held(_):
        if not list(session.glob("logs/*")):
            with log(session) as recorder:
                recorder.write(record(1))
        return False

    stream = following(study, outlets)
    monkeypatch.setattr(session_stream, "is_held", held)
    monkeypatch.setattr(session_stream, "_LOOK_S", -1.0)
    session_stream._follow(stream, study, VirtualClock())
    assert len(outlets.stamps) == 1
