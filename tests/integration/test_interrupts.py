"""Ctrl-C at any moment of a command: exit status 130, no traceback, nothing half-written."""

import os
import random
import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc"),
    pytest.mark.usefixtures("terminal_signals"),
]

STOPPED = 130
PATIENCE_S = 120.0
#: Interrupts of each command in the slow test, and the seed of their moments.
MANY = int(os.environ.get("JOINTZ_INTERRUPTS", "50"))
SEED = 22
TICKS_HZ = os.sysconf("SC_CLK_TCK")
#: Processor time that a command takes by and large, with all its processes, s.
COMMANDS = {"run": 8.0, "analyze": 15.0, "demo": 30.0}


@pytest.fixture
def arguments(walking_file, small_study_source, tmp_path):
    """Return the arguments of a command that writes ``out``."""
    made = {
        "run": ["run", walking_file(strides=8, pulses=2), "--workers", "2"],
        "analyze": ["analyze", small_study_source, "--resamples", "200", "--workers", "2"],
        "demo": ["demo", "--quick"],
    }
    return lambda command: [*map(str, made[command]), "--out", str(tmp_path / "out" / "made")]


class Command:
    """A command in a session of its own, as a terminal has it."""

    def __init__(self, arguments, folder):
        self._process = subprocess.Popen(
            [sys.executable, "-m", "jointz", *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            env={**os.environ, "TMPDIR": str(folder)},
        )
        self._id = self._process.pid

    def processes(self):
        """Return the processor time of every process of the session by its id, s."""
        found = {}
        for file in Path("/proc").glob("[0-9]*/stat"):
            with suppress(OSError):
                fields = file.read_text().rpartition(")")[2].split()
                if int(fields[3]) == self._id and fields[0] != "Z":
                    found[file.parent.name] = sum(map(int, fields[11:15])) / TICKS_HZ
        return found

    def busy_s(self):
        """Return the processor time of all: it tells the same moment on a busy machine."""
        return sum(self.processes().values())

    def listens(self):
        """Tell whether it handles SIGTERM, as it does not before it listens for a stop."""
        with suppress(OSError):
            status = Path(f"/proc/{self._id}/status").read_text()
            caught = re.search(r"SigCgt:\s*(\w+)", status)
            return caught and bool(int(caught[1], 16) >> (signal.SIGTERM - 1) & 1)
        return False

    def wait_until(self, reached):
        """Wait for something; return whether it was there before the end."""
        until = time.monotonic() + PATIENCE_S
        while not reached():
            assert time.monotonic() < until
            if self._process.poll() is not None:
                return False
            time.sleep(0.01)
        return True

    def interrupt(self, *, group):
        with suppress(ProcessLookupError):
            (os.killpg if group else os.kill)(self._id, signal.SIGINT)

    def end(self):
        """Return status and last words; nothing of it is left then."""
        try:
            words = self._process.communicate(timeout=PATIENCE_S)[1]
            until = time.monotonic() + 10.0
            while self.processes() and time.monotonic() < until:
                time.sleep(0.02)
            assert not self.processes()
        finally:
            with suppress(ProcessLookupError):
                os.killpg(self._id, signal.SIGKILL)
        return self._process.returncode, words


def interrupt(arguments, folder, *, after_s, group):
    """Interrupt a command when it was busy for a while, and return whether it was in time."""
    temporary = folder / "tmp"
    temporary.mkdir(parents=True, exist_ok=True)
    command = Command(arguments, temporary)
    in_time = command.wait_until(command.listens)
    if after_s > 0.0:
        in_time = command.wait_until(lambda: command.busy_s() >= after_s)
    command.interrupt(group=group)
    status, words = command.end()
    assert "Traceback" not in words
    assert "Exception ignored" not in words
    if status == STOPPED:
        assert re.fullmatch(r"jointz: Stopped\. [^\n]*\n", words)
    else:  # it came when all was done
        assert (status, words) == (0, "")
    assert not [path.name for path in folder.rglob("*partial*")]
    assert not list(temporary.iterdir())
    return in_time and status == STOPPED


def assert_whole(command, made):
    """A folder of results has the file that is written last; a run can be gone on with."""
    last = {"analyze": "provenance.json", "demo": ".jointz-demo"}
    if made.exists() and command in last:
        assert (made / last[command]).exists()


@pytest.mark.parametrize(
    ("command", "share"),
    [("run", 0.0), ("run", 0.5), ("analyze", 0.5), ("demo", 0.5)],
)
def test_ctrl_c_ends_a_command(arguments, tmp_path, command, share):
    after_s = share * min(COMMANDS[command], 5.0)
    assert interrupt(arguments(command), tmp_path / "out", after_s=after_s, group=True)
    assert_whole(command, tmp_path / "out" / "made")


@pytest.mark.slow
@pytest.mark.timeout(0)
@pytest.mark.parametrize("command", COMMANDS)
def test_ctrl_c_at_random_moments(arguments, tmp_path, command):
    moments = random.Random(f"{SEED} {command}")
    stopped = 0
    for number in range(MANY):
        folder = tmp_path / "out" if command == "run" else tmp_path / f"out{number}"
        call = [one.replace(str(tmp_path / "out"), str(folder)) for one in arguments(command)]
        if command == "run" and (folder / "made").exists():
            if (folder / "made" / "study.toml").exists():
                folder.rename(tmp_path / f"whole{number}")
            else:
                call.append("--resume")
        after_s = COMMANDS[command] * moments.random() ** 2
        in_time = interrupt(call, folder, after_s=after_s, group=moments.random() < 0.5)
        assert_whole(command, folder / "made")
        stopped += in_time
    assert stopped > MANY // 2


SWALLOWING = {
    "callback": "ctypes.CFUNCTYPE(None)(press)()",
    "except": """
try:
    press()
except BaseException:
    pass
""",
    "other error": """
try:
    press()
except BaseException as exc:
    raise ImportError("numpy failed") from exc
""",
    "clean-up": """
try:
    press()
finally:
    press()
    print("cleaned up", flush=True)
""",
}
PROGRAM = """
import ctypes, os, signal, sys, time, types
from jointz.cli.main import run


def press():
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(0.01)


def run_demo(*_, **__):
    exec(code)
    time.sleep(60)


code = sys.argv.pop()
sys.modules["jointz.demo.demo_study"] = types.SimpleNamespace(run_demo=run_demo)
run()
"""


@pytest.fixture
def program(tmp_path):
    """Return how ``jointz demo`` is started with other code in it."""
    (tmp_path / "program.py").write_text(PROGRAM)

    def started(code):
        return subprocess.Popen(
            [sys.executable, "-m", "program", "demo", "--quiet", code],
            cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip

    return started


@pytest.mark.parametrize("way", SWALLOWING)
def test_a_ctrl_c_that_a_library_swallows_is_acted_on(program, way):
    with program(SWALLOWING[way]) as running:
        told, words = running.communicate(timeout=PATIENCE_S)
    assert re.fullmatch(r"jointz: Stopped\. [^\n]*\n", words)
    assert running.returncode == STOPPED
    assert told == ("cleaned up\n" if way == "clean-up" else "")


HANGING = {
    "clean-up": """
try:
    press()
finally:
    print("hangs", flush=True)
    time.sleep(60)
""",
    "exit": """
import atexit
atexit.register(lambda: [print("hangs", flush=True), time.sleep(60)])
press()
""",
}


@pytest.mark.alone
@pytest.mark.parametrize("way", HANGING)
def test_a_late_ctrl_c_ends_a_clean_up_that_hangs(program, way):
    code = f"from jointz.core import stop_signals\nstop_signals._AT_ONCE_S = 1.0\n{HANGING[way]}"
    running = program(code)
    try:
        assert running.stdout.readline() == "hangs\n"
        running.send_signal(signal.SIGINT)  # too early
        time.sleep(1.5)  # the first Ctrl-C comes again by itself in the meantime
        assert running.poll() is None
        running.send_signal(signal.SIGINT)
        assert running.wait(5.0) == STOPPED
        assert "clean-up was not done" in running.stderr.read()
    finally:
        running.kill()
        running.communicate()


def test_a_ctrl_c_that_is_ignored_from_the_start_stays_so(program):
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # as a job in the background has it
    with program("press()\nraise SystemExit(7)") as running:
        running.communicate(timeout=PATIENCE_S)
    assert running.returncode == 7
