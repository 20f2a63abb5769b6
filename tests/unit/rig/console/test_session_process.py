"""The session's process: started once, told apart, its last words kept."""

import sys
import time

import pytest

from jointz.core.errors import DataError
from jointz.rig.console import session_process
from jointz.rig.console.session_process import SessionProcess


class Fake:
    """A python that stands for ``python -m jointz run``."""

    def __init__(self, folder, text):
        self.executable = str(folder / "python")
        with open(self.executable, "w") as stream:
            stream.write(f"#!{sys.executable}\n{text}\n")
        (folder / "python").chmod(0o755)


@pytest.fixture
def made(tmp_path):
    """Make processes of a study; they let go of their files in the end."""
    all_made = []

    def make(*arguments):
        all_made.append(SessionProcess(tmp_path / "study", arguments))
        return all_made[-1]

    yield make
    for one in all_made:
        one.close()


def wait_for(end):
    deadline = time.monotonic() + 10
    while not end() and time.monotonic() < deadline:
        time.sleep(0.01)
    assert end()


def test_a_session_that_ends_leaves_its_last_words(tmp_path, monkeypatch, made):
    fake = Fake(tmp_path, "import sys; sys.exit(' '.join(sys.argv[1:]))")
    monkeypatch.setattr(session_process, "sys", fake)
    process = made("walking")
    process.start(resume=True)
    wait_for(lambda: not process.alive())
    assert process.last_words() == "-m jointz run walking --resume"


def test_a_new_session_is_not_taken_for_one_that_was_killed(tmp_path, monkeypatch, made):
    monkeypatch.setattr(session_process, "sys", Fake(tmp_path, ""))
    left = tmp_path / "study" / "sessions" / "S01" / "control"
    left.parent.mkdir(parents=True)
    left.touch()
    process = made("walking")
    process.start(resume=True)
    assert not left.exists()
    wait_for(lambda: not process.alive())


def test_a_session_that_lives_is_not_started_again(tmp_path, monkeypatch, made):
    fake = Fake(tmp_path, "import sys; sys.stdin.read(); import time; time.sleep(60)")
    monkeypatch.setattr(session_process, "sys", fake)
    process = made("walking")
    monkeypatch.setattr(session_process, "_PATIENCE_S", 0.1)
    process.start(resume=False)
    try:
        assert process.alive()
        with pytest.raises(DataError, match="lives"):
            process.start(resume=True)
    finally:
        process._child.kill()
        process._child.wait()


def test_who_only_looks_on_starts_nothing(made):
    process = made()
    with pytest.raises(DataError, match="can only watch"):
        process.start(resume=True)
