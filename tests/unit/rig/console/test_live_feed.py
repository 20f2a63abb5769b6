"""Browsers are told the newest, one message at a time, and only while they behave."""

import asyncio
import json

import numpy as np
import pytest

from jointz.core.errors import DataError
from jointz.rig.console import live_feed
from jointz.rig.console.live_feed import LiveFeed


class Live:
    """A session that grows by a row at every look."""

    def __init__(self):
        self.count = self.generation = 0
        self.problem = None

    def poll(self):
        if self.problem:
            raise self.problem
        self.count += 1

    def rows_after(self, number):
        new = min(self.count - number, 50)
        return np.full((new, 7), float("nan")), self.count

    def strikes_s(self):
        return [0.5]

    def status(self):
        return {"state": "running", "told": [{"text": "</script>"}], "x": float("nan")}


class Process:
    """Would run a session."""

    can_start = False

    def last_words(self):
        return ""


class Socket:
    """A browser that says what it is told to say."""

    def __init__(self, *says):
        self.says, self.heard, self.closed = list(says), [], None

    async def accept(self):
        pass

    async def send_text(self, text):
        self.heard.append(json.loads(text))

    async def receive(self):
        if not self.says:
            return {"type": "websocket.disconnect"}
        said = self.says.pop(0)
        return {"type": "websocket.receive", **said}

    async def close(self, code):
        self.closed = code


NEXT = {"text": "next"}


@pytest.fixture
def live():
    return Live()


@pytest.fixture
def feed(live, monkeypatch):
    monkeypatch.setattr(live_feed, "_PERIOD_S", 0.0)
    monkeypatch.setattr(live_feed, "_STATUS_S", 0.0)
    made = LiveFeed(live, Process())
    made.poll()
    return made


def test_the_first_message_holds_everything_and_the_next_what_is_new(feed):
    socket = Socket(NEXT, NEXT)
    asyncio.run(feed.answer(socket))
    first, second, _ = socket.heard
    assert first["anew"]
    assert first["status"]["state"] == "running"
    assert first["status"]["x"] is None
    assert [len(column) for column in first["rows"]] == [1] * 7
    assert first["rows"][0] == [None]
    assert "status" not in second
    assert second["rows"] == [[]] * 7


@pytest.mark.parametrize(
    "said", [{"text": "NEXT"}, {"text": ""}, {"bytes": b"next"}, {"text": '{"order": "start"}'}]
)
def test_a_browser_that_says_anything_else_is_sent_away(feed, said):
    socket = Socket(said, NEXT)
    asyncio.run(feed.answer(socket))
    assert socket.closed == 1008
    assert len(socket.heard) == 1
    assert not feed.somebody()


def test_somebody_is_there_while_a_browser_answers(feed, monkeypatch):
    seen = []

    class Watching(Socket):
        async def receive(self):
            monkeypatch.setattr(live_feed, "ALIVE_S", 60.0)
            seen.append(feed.somebody())
            monkeypatch.setattr(live_feed, "ALIVE_S", 0.0)
            seen.append(feed.somebody())
            return await super().receive()

    asyncio.run(feed.answer(Watching(NEXT)))
    assert seen == [False, False, True, False]  # only who asks for more is there
    assert not feed.somebody()


@pytest.mark.parametrize(("says", "refused"), [([NEXT], [1013]), ([], [])])
def test_more_than_eight_browsers_are_refused_but_idle_ones_do_not_count(feed, says, refused):
    closed = []

    async def nobody_more():
        last = Socket(NEXT)
        await feed.answer(last)
        closed.extend([last.closed] if last.closed else [])

    class Crowd(Socket):
        left = 8

        async def receive(self):
            if self.says:
                return await super().receive()
            Crowd.left -= 1
            await (feed.answer(Crowd(*says)) if Crowd.left else nobody_more())
            return {"type": "websocket.disconnect"}

    asyncio.run(feed.answer(Crowd(*says)))
    assert closed == refused


def test_a_damaged_file_is_told_and_the_page_goes_on(feed, live):
    live.problem = DataError("journal: line 3 was altered")
    feed.poll()
    assert json.loads(feed.frame((-1, 0, -1))[0])["status"]["problem"] == str(live.problem)
    live.problem = None
    feed.poll()
    assert json.loads(feed.frame((-1, 0, -1))[0])["status"]["problem"] == ""


def test_a_page_that_fails_says_so(feed, live):
    live.problem = KeyError("number")
    feed.poll()
    assert "has failed" in json.loads(feed.frame((-1, 0, -1))[0])["status"]["problem"]
