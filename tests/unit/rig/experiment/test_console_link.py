"""A page and a session: commands are obeyed, refused and written down; a lost page is noticed."""

import threading
import time

import pytest

from jointz.rig.experiment import console_link
from jointz.rig.experiment.console_link import ConsoleLink
from jointz.rig.experiment.control_box import ControlBox, ControlSender, Order
from jointz.rig.experiment.files.journal import Journal, read_journal


class Trial:
    """Counts ticks, and says whether it can be paused."""

    def __init__(self, *, can_pause=True, refuses=""):
        self.can_pause, self.ticks, self.paused = can_pause, 0, []
        self.refuses, self.changes = refuses, []

    def tick(self, *_):
        self.ticks += 1
        return True

    def request_stop(self):
        raise AssertionError("the session asks the trial")

    def pause(self, *, on):
        if self.can_pause:
            self.paused.append(on)
        return self.can_pause

    def set_parameter(self, name, value):
        self.changes.append((name, value))
        return self.refuses

    def undo_parameter(self):
        self.changes.append("undo")
        return self.refuses


class Desk:
    """A link with everything around it."""

    def __init__(self, folder, without_console="go_on"):
        self.file = folder / "journal.jsonl"
        self.journal = Journal(self.file)
        self.box = ControlBox(folder / "control")
        self.sender = ControlSender(folder / "control")
        self.stops = 0
        self.link = ConsoleLink(
            self.box,
            self.journal,
            request_stop=self.stop,
            without_console=without_console,
        )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.sender.close()
        self.box.__exit__(None, None, None)
        self.journal.__exit__(None, None, None)

    def stop(self):
        self.stops += 1

    def events(self):
        return [e["event"] for e in read_journal(self.file)]


@pytest.fixture
def desk(tmp_path):
    with Desk(tmp_path) as desk:
        yield desk


def test_a_condition_waits_for_the_page(desk):
    def press():
        time.sleep(0.05)
        desk.sender.send(Order.NOTE, "left leg")
        desk.sender.send(Order.PAUSE)
        desk.sender.send(Order.START)

    thread = threading.Thread(target=press)
    thread.start()
    desk.link.await_start("perturbed", "Walk.")
    thread.join()
    assert desk.events() == ["prompted", "note", "control_refused", "started"]
    events = read_journal(desk.file)
    assert events[0]["text"] == "Walk."
    assert events[1]["text"] == "left leg"
    assert {e["condition"] for e in events} == {"perturbed"}


def test_a_stop_before_a_condition_ends_the_session(desk):
    desk.sender.stop()
    with pytest.raises(KeyboardInterrupt):
        desk.link.await_start("perturbed", "Walk.")
    assert desk.events() == ["prompted", "stop_asked"]


def test_a_stop_is_asked_for_once_and_before_the_tick(desk):
    trial = Trial()
    tick = desk.link.attended(trial, "perturbed")
    tick(700, 10, 0)
    desk.sender.stop()
    tick(701, 20, 0)
    tick(702, 30, 0)
    assert (desk.stops, trial.ticks) == (1, 3)
    (event,) = read_journal(desk.file)
    # The slot is that of the log, which counts from the trial's first tick.
    assert (event["event"], event["slot"], event["host_ns"]) == ("stop_asked", 1, 20)


def test_a_pause_and_its_end_are_obeyed_and_written_down(desk):
    trial = Trial()
    tick = desk.link.attended(trial, "perturbed")
    desk.sender.send(Order.PAUSE)
    desk.sender.send(Order.GO_ON)
    desk.sender.send(Order.START)
    for slot in range(4):
        tick(slot, slot, 0)
    assert trial.paused == [True, False]
    assert desk.events() == ["paused", "went_on", "control_refused"]


def test_what_cannot_be_paused_says_so(desk):
    tick = desk.link.attended(Trial(can_pause=False), "unperturbed")
    desk.sender.send(Order.PAUSE)
    tick(0, 0, 0)
    (event,) = read_journal(desk.file)
    assert (event["event"], event["order"]) == ("control_refused", "pause")


def test_a_parameter_is_changed_in_the_trial_which_writes_it_down(desk):
    trial = Trial()
    tick = desk.link.attended(trial, "controlled")
    desk.sender.send(Order.SET, "stiffness=-2.5")
    desk.sender.send(Order.UNDO)
    for slot in range(3):
        tick(slot, slot, 0)
    assert trial.changes == [("stiffness", -2.5), "undo"]
    assert desk.events() == []


@pytest.mark.parametrize(
    ("order", "text", "reason"),
    [
        (Order.SET, "stiffness=1", "no controller"),
        (Order.UNDO, "", "no controller"),
        (Order.SET, "stiffness=much", "'stiffness=much' is no parameter with a number"),
        (Order.SET, "", "'' is no parameter with a number"),
    ],
)
def test_a_parameter_that_is_not_changed_is_journalled_with_the_reason(desk, order, text, reason):
    trial = Trial(refuses="no controller")
    tick = desk.link.attended(trial, "controlled")
    desk.sender.send(order, text)
    tick(0, 0, 0)
    (event,) = read_journal(desk.file)
    assert (event["event"], event["order"]) == ("control_refused", order.name.lower())
    assert (event["reason"], event["slot"], trial.ticks) == (reason, 0, 1)


@pytest.mark.parametrize(("wish", "stops"), [("go_on", 0), ("stop", 1)])
def test_a_lost_page_is_noticed_and_the_protocol_decides(tmp_path, monkeypatch, wish, stops):
    trial = Trial()
    with Desk(tmp_path, wish) as desk:
        tick = desk.link.attended(trial, "perturbed")
        tick(0, 0, 0)  # nobody has looked yet: nobody is missed
        desk.sender.beat()
        tick(1, 0, 0)
        monkeypatch.setattr(console_link, "LOST_AFTER_NS", 0)
        tick(2, 0, 0)
        tick(3, 0, 0)
        assert desk.stops == stops
        expected = ["console_lost"] + ["stopped_without_console"] * stops
        assert desk.events() == expected
        monkeypatch.setattr(console_link, "LOST_AFTER_NS", 10**12)
        tick(4, 0, 0)
        assert desk.events()[-1] == "console_back"


def test_refused_commands_are_told_of_once_a_second(desk):
    tick = desk.link.attended(Trial(), "perturbed")
    for k in range(5):
        for _ in range(33):
            desk.sender.send(Order.NOTE, "flood")
        tick(k, 2_000_000_000 + k, 0)
    events = read_journal(desk.file)
    assert [e["event"] for e in events] == ["control_refused"]
