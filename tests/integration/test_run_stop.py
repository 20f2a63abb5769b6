"""``jointz run`` from outside: signals, a parent that dies, two runs of one study."""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from jointz.rig.experiment.files.journal import read_journal

pytestmark = pytest.mark.usefixtures("terminal_signals")

STOPPED = 130
#: For a machine that has other things to do, too.
TIMEOUT_S = 120.0


@pytest.fixture(scope="module")
def protocol_file(walking_file):
    """Two participants who walk for a while: a minute of the loop unless they are stopped."""
    return walking_file(strides=4, pulses=300)


_STARTED: list[subprocess.Popen[str]] = []


@pytest.fixture(autouse=True)
def _nothing_runs_on():
    """End what a test that failed left running: it would slow down all that follow."""
    yield
    while _STARTED:
        with suppress(ProcessLookupError):
            os.killpg(_STARTED.pop().pid, signal.SIGKILL)


def start(protocol_file, out, *options):
    """Start the command in a process group of its own, as a shell does."""
    running = subprocess.Popen(
        [sys.executable, "-m", "jointz", "run", str(protocol_file), "--out", str(out), *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    _STARTED.append(running)
    return running


def events(out, participant):
    return read_journal(out / "sessions" / participant / "journal.jsonl")


def wait_until(reached, what):
    until = time.monotonic() + TIMEOUT_S
    while not reached():
        if time.monotonic() > until:
            pytest.fail(f"no {what} in {TIMEOUT_S:g} s")
        time.sleep(0.02)


def wait_for(what, out, *participants):
    """Wait until an event stands in every journal."""
    wait_until(
        lambda: all(any(e["event"] == what for e in events(out, one)) for one in participants), what
    )


def group_of(process):
    """Return the processes of the group besides the first: workers, and their cleaner."""
    listed = subprocess.run(
        ["ps", "-o", "pid=", "-s", str(process.pid)], capture_output=True, text=True, check=False
    )
    return {int(pid) for pid in listed.stdout.split()} - {process.pid}


def workers_of(process):
    found = set()
    for pid in group_of(process):
        with suppress(OSError):  # it has ended
            if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes():
                found.add(pid)
    return found


def assert_group_gone(process):
    wait_until(lambda: not group_of(process), "end of all processes")


def assert_refused(outcome):
    """A second run of a study was refused, and told so as JSON."""
    assert outcome.code == 2
    assert outcome.json["error"] == "OutputError"
    assert "another process is running this" in outcome.json["message"]


@pytest.mark.parametrize(
    ("send", "number"),
    [
        pytest.param(os.kill, signal.SIGINT, marks=pytest.mark.slow),
        pytest.param(os.kill, signal.SIGHUP, marks=pytest.mark.slow),
        (os.killpg, signal.SIGINT),
        pytest.param(os.killpg, signal.SIGTERM, marks=pytest.mark.slow),
    ],
)
def test_a_signal_stops_every_worker_and_a_second_run_none(
    protocol_file, tmp_path, jointz, send, number
):
    out = tmp_path / "study"
    running = start(protocol_file, out, "--workers", "2")
    wait_for("pulse_started", out, "S01", "S02")
    assert_refused(jointz("run", protocol_file, "--out", out, "--resume", "--json"))
    assert running.poll() is None
    send(running.pid, number)
    words = running.communicate(timeout=TIMEOUT_S)[1]
    assert running.returncode == STOPPED
    assert words.startswith("jointz: Stopped.")
    assert words.count("\n") == 1
    for participant in ("S01", "S02"):
        assert events(out, participant)[-1]["event"] == "stopped"
    assert_group_gone(running)


@pytest.mark.parametrize(
    "moment",
    [
        "study",
        pytest.param("one worker", marks=pytest.mark.slow),
        pytest.param("sessions", marks=pytest.mark.slow),
    ],
)
def test_ctrl_c_while_workers_start_shows_no_traceback(protocol_file, tmp_path, moment):
    out = tmp_path / "study"
    running = start(protocol_file, out, "--workers", "2")
    reached = {
        "study": out.exists,
        "one worker": lambda: workers_of(running),
        "sessions": (out / "sessions").exists,
    }
    wait_until(reached[moment], moment)
    os.killpg(running.pid, signal.SIGINT)
    said = running.communicate(timeout=TIMEOUT_S)[1]
    assert running.returncode == STOPPED
    assert said.startswith("jointz: Stopped.")
    assert said.count("\n") == 1
    assert_group_gone(running)


def test_workers_stop_when_their_parent_dies_and_are_not_run_twice(protocol_file, tmp_path, jointz):
    out = tmp_path / "study"
    first = start(protocol_file, out, "--workers", "2")
    wait_for("pulse_started", out, "S01", "S02")
    slow = workers_of(first)
    assert len(slow) == 2
    for worker in slow:
        os.kill(worker, signal.SIGSTOP)
    try:
        first.kill()
        first.wait(timeout=TIMEOUT_S)
        assert_refused(
            jointz("run", protocol_file, "--out", out, "--workers", "1", "--resume", "--json")
        )
    finally:
        for worker in slow:
            os.kill(worker, signal.SIGCONT)
        first.communicate(timeout=TIMEOUT_S)
    assert_group_gone(first)
    for participant in ("S01", "S02"):
        assert events(out, participant)[-1]["event"] == "stopped"
