"""Work shared out to processes, and what becomes of it when one of them is gone."""

import os
import signal
import subprocess
import sys
import time
from functools import partial

import pytest

from jointz.workflows.process_pool import process_pool, shared_out, workers_for

_HOLD = """
import time
from jointz.workflows.process_pool import process_pool
if __name__ == "__main__":
    with process_pool(2, needs="json") as pool:
        print(pool.submit(__import__("os").getpid).result(), flush=True)
        time.sleep(60)
"""


def test_few_things_to_do_start_no_process():
    assert workers_for(3) == 1
    assert workers_for(1000) == len(os.sched_getaffinity(0))
    with process_pool(1, needs="json") as pool:
        assert pool is None


def test_results_come_in_the_order_of_the_calls_from_other_processes():
    with process_pool(2, needs="json") as pool:
        found = [wait() for wait in shared_out(pool, [partial(divmod, k, 3) for k in range(5)])]
        (elsewhere,) = shared_out(pool, [os.getpid])

        assert elsewhere() != os.getpid()
    assert found == [divmod(k, 3) for k in range(5)]


def test_an_error_of_a_call_is_raised_where_its_result_is_asked_for():
    with process_pool(2, needs="json") as pool:
        broken, fine = shared_out(pool, [partial(divmod, 1, 0), partial(divmod, 1, 1)])
        with pytest.raises(ZeroDivisionError):
            broken()
        assert fine() == (1, 0)


def test_what_a_killed_worker_owed_is_done_here():
    with process_pool(2, needs="json") as pool:
        (killed,) = shared_out(pool, [partial(_pid_or_death, os.getpid())])

        assert killed() == os.getpid()
        (after,) = shared_out(pool, [os.getpid])
        assert after() == os.getpid()


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


def _pid_or_death(parent: int) -> int:
    if os.getpid() != parent:
        os.kill(os.getpid(), signal.SIGKILL)
    return os.getpid()


def _runs(pid: int) -> bool:
    try:
        with open(f"/proc/{pid}/stat") as stat:
            return stat.read().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False
