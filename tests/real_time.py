"""Another attempt for tests that keep real time, where this machine itself was late."""

import json
import subprocess
import sys
from collections.abc import Iterator

import pytest
from _pytest.runner import runtestprotocol

#: A process that only sleeps (0.1 ms late on an idle machine) missed two slots of a loop at 1 kHz.
_LATE_S = 0.002
_ATTEMPTS = 5
_WATCH = """
import json, sys, threading, time
late_s = 0.0
def watch():
    global late_s
    while True:
        began = time.perf_counter()
        time.sleep(0.001)
        late_s = max(late_s, time.perf_counter() - began - 0.001)
threading.Thread(target=watch, daemon=True).start()
for _ in sys.stdin:
    print(late_s, flush=True)
    late_s = 0.0
"""
_RETRIED = "tried again: this machine was late"
_watch_key = pytest.StashKey["LatenessWatch"]()


class LatenessWatch:
    """Another process that measures how late this machine wakes it."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-c", _WATCH],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            bufsize=1,
            start_new_session=True,  # a Ctrl-C of a test is not meant for it
        )

    def take(self) -> float:
        """Return the largest lateness in s since the last call."""
        self._process.stdin.write("\n")
        return json.loads(self._process.stdout.readline())

    def close(self) -> None:
        self._process.kill()
        self._process.communicate()


def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool | None:
    """Run a test marked ``alone`` again, with its fixtures, if it failed on a late machine.

    If the machine was on time the failure is final.
    """
    if item.get_closest_marker("alone") is None:
        return None
    if _watch_key not in item.config.stash:
        item.config.stash[_watch_key] = LatenessWatch()
    watch = item.config.stash[_watch_key]
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    for left in reversed(range(_ATTEMPTS)):
        watch.take()
        reports = runtestprotocol(item, log=False, nextitem=nextitem)
        failure = next((report for report in reports if report.failed), None)
        late_s = watch.take()
        if failure is None or not left or late_s < _LATE_S:
            break
        crash = getattr(failure.longrepr, "reprcrash", None)
        why = str(getattr(crash, "message", failure.longrepr)).splitlines()[0]
        item.user_properties.append((_RETRIED, f"{1e3 * late_s:.1f} ms late: {why}"))
        item._initrequest()  # new fixtures, as pytest itself does
    for report in reports:
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


def pytest_unconfigure(config: pytest.Config) -> None:
    if watch := config.stash.get(_watch_key, None):
        watch.close()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """List the tests that were tried again."""
    lines = list(_retried(terminalreporter))
    if lines:
        terminalreporter.section(_RETRIED)
    for line in lines:
        terminalreporter.write_line(line)


def _retried(terminalreporter: pytest.TerminalReporter) -> Iterator[str]:
    for kind in ("passed", "failed", "error"):
        for report in terminalreporter.getreports(kind):
            if getattr(report, "when", "") == "call" or report.failed:
                for name, why in getattr(report, "user_properties", ()):  # a module may not load
                    if name == _RETRIED:
                        yield f"{report.nodeid}: {why}"
