"""A page needs its extra and an address; both are named when they are missing."""

import os
import signal
import socket
import sys

import pytest

from jointz.core.errors import DataError
from jointz.core.stop_signals import STOP_SIGNALS, listen_for_stops
from jointz.rig.console.console_app import _left
from jointz.web.server import _address, _listen


def test_console_without_the_extra_says_how_to_get_it(monkeypatch, jointz, tmp_path):
    monkeypatch.setitem(sys.modules, "nicegui", None)
    outcome = jointz("console", "walking", "--out", tmp_path / "study")
    assert outcome.code == 2
    assert 'pip install "jointz[app]"' in outcome.err
    assert not (tmp_path / "study").exists()


def test_an_address_that_is_taken_is_told():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(DataError, match=f"127.0.0.1 port {port}.*--port"):
            _listen("127.0.0.1", port)


@pytest.mark.parametrize("host", ["no.such.name.invalid", "300.1.1.1"])
def test_an_address_that_is_none_is_told(host):
    with pytest.raises(DataError, match="cannot be listened on"):
        _listen(host, 0)


def test_the_address_that_is_told_can_be_opened():
    assert _address("127.0.0.1", 80, "t") == "http://127.0.0.1:80/?token=t"
    assert _address("::1", 80, "t") == "http://[::1]:80/?token=t"
    assert _address("0.0.0.0", 80, "t") == f"http://{socket.gethostname()}:80/?token=t"


@pytest.mark.skipif(sys.platform == "win32", reason="signals are POSIX's")
@pytest.mark.parametrize("number", STOP_SIGNALS)
def test_no_signal_breaks_into_the_last_words_of_a_console(number):
    class Desk:
        def leave(self):
            os.kill(os.getpid(), number)
            return "closed"

    before = {one: signal.getsignal(one) for one in STOP_SIGNALS}
    hooks = sys.unraisablehook, sys.excepthook
    try:
        listen_for_stops()
        assert _left(Desk()) == "closed"
    finally:
        sys.unraisablehook, sys.excepthook = hooks
        for one, handler in before.items():
            signal.signal(one, handler)
