"""Processes that end with the one they work for."""

import os
import subprocess
import sys
import time

import pytest

from jointz.core.errors import DataError
from jointz.tasks import process_pool as process_pool_module
from jointz.tasks.process_pool import process_pool, workers_for

_HOLD = """
import time
from jointz.tasks.process_pool import process_pool
if __name__ == "__main__":
    with process_pool(2, needs="json") as pool:
        print(pool.submit(__import__("os").getpid).result(), flush=True)
        time.sleep(60)
"""
_UNGUARDED = """
from jointz.tasks.process_pool import process_pool
with process_pool(2, needs="json") as pool:
    print(pool.submit(abs, -1).result())
"""


def ran(script, text):
    script.write_text(text)
    return subprocess.run(
        [sys.executable, script], capture_output=True, text=True, timeout=60, check=False
    )


def test_a_script_that_every_worker_would_run_again_is_refused(tmp_path):
    done = ran(tmp_path / "mine.py", _UNGUARDED)

    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.count("Traceback") == 1
    assert "mine.py" in done.stderr

    head, rest = _UNGUARDED.split("with", 1)
    guarded = f"{head}if __name__ == '__main__':\n  with{rest}"
    assert ran(tmp_path / "guarded.py", guarded).stdout == "1\n"


def test_few_things_to_do_start_no_process():
    assert workers_for(3) == 1
    assert workers_for(1000) == len(os.sched_getaffinity(0))
    with process_pool(1, needs="json") as pool:
        assert pool is None


def test_without_posix_signals_there_are_no_processes(monkeypatch):
    monkeypatch.setattr(process_pool_module, "CAN_WAIT", False)

    assert workers_for(1000) == 1
    with pytest.raises(DataError, match="workers"), process_pool(2, needs="json"):
        pass


def test_workers_end_with_a_parent_that_is_killed(tmp_path):
    script = tmp_path / "hold.py"
    script.write_text(_HOLD)
    parent = subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    worker = int(parent.stdout.readline())
    parent.kill()
    parent.wait()
    parent.stdout.close()

    deadline = time.monotonic() + 10.0
    while _runs(worker) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not _runs(worker)


def _runs(pid: int) -> bool:
    try:
        with open(f"/proc/{pid}/stat") as stat:
            return stat.read().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False
