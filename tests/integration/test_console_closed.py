"""The console's command without a browser: ended by Ctrl-C, and a stop of a session that hangs."""

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import pytest

pytest.importorskip("nicegui", reason="nicegui is not installed")

from jointz.rig.console.operator_commands import CONFIRMED_WITHIN_S, OperatorCommands
from jointz.rig.experiment.files.journal import read_journal
from jointz.rig.session.live.live_session import holder_of, is_held

pytestmark = [
    pytest.mark.usefixtures("terminal_signals"),
    pytest.mark.skipif(sys.platform != "linux", reason="the console is for Linux"),
]

#: Loading a session takes seconds on a machine that has other things to do.
PATIENCE_S = 60


def wait_for(end):
    deadline = time.monotonic() + PATIENCE_S
    while not (found := end()):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    return found


@contextmanager
def console(study, *arguments):
    """Open a page; in the end neither it nor its session is left."""
    command = [sys.executable, "-m", "jointz", "console", "--out", str(study), "--port", "0"]
    process = subprocess.Popen(
        [*command, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        process.address = process.stdout.readline().split()[1]
        yield process
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate()
        deadline = time.monotonic() + PATIENCE_S
        while arguments and is_held(study) and time.monotonic() < deadline:  # else another's
            OperatorCommands(study, None, dict).stop()
            time.sleep(0.05)


def ended(process, *, presses=1):
    """Press Ctrl-C and return the last words."""
    for _ in range(presses):
        process.send_signal(signal.SIGINT)
        time.sleep(0.02)
    _, words = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130
    return words


@pytest.mark.parametrize("presses", [1, 2])
def test_a_session_that_nobody_started_ends_with_its_page(tmp_path, presses):
    study = tmp_path / "study"
    with console(study, "walking", "--participants", "1", "--seed", "1") as page:
        # At once, and when it waits: a second Ctrl-C must not leave a traceback, nor the session.
        if presses == 1:
            wait_for(lambda: read_journal(study / "sessions" / "S01" / "journal.jsonl"))
        words = ended(page, presses=presses)
        assert not is_held(study)
    assert words.count("\n") == 1
    events = read_journal(study / "sessions" / "S01" / "journal.jsonl")
    assert [event["event"] for event in events] == ["prompted", "stop_asked"]


@pytest.mark.alone
def test_a_session_outlives_its_page_and_a_stop_that_it_does_not_confirm_is_no_success(
    tmp_path, page_client
):
    study = tmp_path / "study"
    journal = study / "sessions" / "S01" / "journal.jsonl"

    def has(name):
        return any(event["event"] == name for event in read_journal(journal))

    with console(study, "walking", "--participants", "1", "--seed", "1") as page:
        client = page_client(page.address).open()
        start = json.dumps({"order": "start", "condition": "no_device"})
        wait_for(lambda: client.request("POST", "/command", start)[0] == 200)
        wait_for(lambda: has("loop_started"))
        with console(study) as second:
            words = ended(page)
            assert words.count("\n") == 1
            assert f"goes on (process {holder_of(study)})" in words
            assert f"jointz console --out {study}" in words
            client = page_client(second.address).open()
            session = holder_of(study)
            os.kill(session, signal.SIGSTOP)
            try:
                began = time.monotonic()
                status, text, _ = client.request("POST", "/stop")
                took_s = time.monotonic() - began
                assert f"goes on (process {session})" in ended(second)
            finally:
                os.kill(session, signal.SIGCONT)
        assert status == 504
        assert "emergency stop" in json.loads(text)["refused"]
        assert CONFIRMED_WITHIN_S <= took_s < CONFIRMED_WITHIN_S + 2
        wait_for(lambda: has("stop_asked"))  # it is obeyed as soon as the session goes on
