"""Tests marked ``real_time`` are tried again after an overrun of the machine, and only then."""

import shutil
import subprocess
import sys
from pathlib import Path

TESTS = """
import pytest
from jointz.core.errors import SafetyStop

calls = []

@pytest.mark.real_time
@pytest.mark.parametrize(("fails", "code"), [(1, "overrun"), (2, "overrun"), (1, "posture")])
def test_it(tmp_path, fails, code):
    (tmp_path / "study").mkdir()
    calls.append((fails, code))
    if calls.count((fails, code)) <= fails:
        raise SafetyStop(code, "5 slots missed")
"""


def test_a_test_is_tried_once_more_after_an_overrun_and_the_summary_says_so(tmp_path):
    shutil.copy(Path(__file__).parents[2] / "conftest.py", tmp_path)
    (tmp_path / "test_it.py").write_text(TESTS)
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers =\n    real_time: again\n")
    told = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(tmp_path)],
        cwd=tmp_path, stdout=subprocess.PIPE, text=True, check=False,
    ).stdout  # fmt: skip
    assert "2 failed, 1 passed" in told
    again = [line for line in told.splitlines() if line.startswith("test_it.py::")]
    assert len(again) == 2
    assert all("overrun: 5 slots missed" in line for line in again)
    assert "tried again: the machine was too slow for real time" in told
