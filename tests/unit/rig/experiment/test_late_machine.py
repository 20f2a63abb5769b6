"""A test that keeps real time is tried again if the machine was late, and only then."""

import os
import subprocess
import sys
from pathlib import Path

LATE = """
from tests import real_time

late = []

class Scripted:
    def take(self):
        return late.pop() if late else 0.0
    def close(self):
        pass

real_time.LatenessWatch = Scripted
"""
TESTS = """
from collections import Counter
import pytest
from conftest import late

begun = Counter()

@pytest.fixture
def session(request):
    begun[request.node.name] += 1
    return begun[request.node.name]

@pytest.mark.alone
@pytest.mark.parametrize(("fails", "late_s"), [(1, 0.004), (4, 0.004), (5, 0.004), (1, 0.0)])
def test_it(session, fails, late_s):
    late.append(late_s)
    if session <= fails:
        raise RuntimeError(f"5 slots missed by {fails}, {late_s}")
"""


def test_a_failure_counts_unless_the_machine_was_late_and_the_summary_lists_the_others(tmp_path):
    (tmp_path / "conftest.py").write_text(LATE)
    (tmp_path / "test_it.py").write_text(TESTS)
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers =\n    alone: keeps real time\n")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    printed = subprocess.run(
        [*command, "-p", "tests.real_time", "--import-mode=prepend", str(tmp_path)],
        cwd=tmp_path, stdout=subprocess.PIPE, text=True, check=False,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[4])},
    ).stdout  # fmt: skip
    assert "2 failed, 2 passed" in printed
    listed = [line for line in printed.splitlines() if "4.0 ms late" in line]
    assert len(listed) == 1 + 4 + 4
    assert all("5 slots missed" in line for line in listed)
    assert "FAILED test_it.py::test_it[5-0.004]" in printed
    assert "FAILED test_it.py::test_it[1-0.0]" in printed
