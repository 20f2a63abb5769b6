"""Run the tests that a change reaches, the nearest first, for at most a minute: ``make quick``.

A test is near if it imports what changed, further if it imports what imports that.
"""

import re
import subprocess
import sys
import time
from collections import defaultdict, deque
from collections.abc import Iterable
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
_SECONDS = 50.0  # collection comes before, and the last test ends after
_MOST_FILES = 60
_FOLDERS = ("src/jointz", "tests", "benchmarks", "reproduction")
_NAMES = re.compile(r"\b(?:jointz|reproduction)(?:\.\w+)+")
_FROM = re.compile(r"^\s*from ((?:jointz|reproduction)[\w.]*) import \(?([\w, \n]+)", re.MULTILINE)


def changed_files() -> list[str]:
    """Return what differs from the last commit; if nothing does, what that commit changed."""
    differs = _git("diff", "--name-only", "HEAD") + _git("ls-files", "-o", "--exclude-standard")
    return differs or _git("diff", "--name-only", "HEAD~1", "HEAD")


def _git(*arguments: str) -> list[str]:
    asked = ["git", *arguments]
    return subprocess.run(
        asked, cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout.split()


def module_name(file: str) -> str:
    """Return the module of a source file, as others import it."""
    path = file.removeprefix("src/").removesuffix(".py").removesuffix("/__init__")
    return path.replace("/", ".")


def importers() -> dict[str, set[str]]:
    """Return which files name each module of the package, lazily or as a string, too."""
    found = defaultdict(set)
    for folder in _FOLDERS:
        for path in (ROOT / folder).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            names = set(_NAMES.findall(text))
            for package, members in _FROM.findall(text):
                names |= {f"{package}.{m.strip().split(' ')[0]}" for m in members.split(",")}
            for name in names:
                found[name].add(path.relative_to(ROOT).as_posix())
    return found


def nearest_tests(changed: Iterable[str]) -> list[str]:
    """Return test files in order of their distance from the changed files."""
    importing = importers()
    distance = dict.fromkeys(changed, 0)
    waiting = deque(distance)
    while waiting:
        file = waiting.popleft()
        for importer in importing.get(module_name(file), ()):
            if importer not in distance:
                distance[importer] = distance[file] + 1
                waiting.append(importer)
    if any(file.startswith("docs/") or file.endswith(".md") for file in distance):
        documented = (ROOT / "tests/unit/docs").glob("test_*.py")
        distance |= {path.relative_to(ROOT).as_posix(): 1 for path in documented}
    tests = [f for f in distance if Path(f).name.startswith("test_") and (ROOT / f).exists()]
    return sorted(tests, key=lambda file: (distance[file], "integration" in file, file))


class Deadline:
    """Pytest plugin that begins no test after some seconds."""

    def __init__(self) -> None:
        self._end = time.monotonic() + _SECONDS
        self.session: pytest.Session | None = None

    def pytest_sessionstart(self, session: pytest.Session) -> None:
        """Keep the session to stop it."""
        self.session = session

    def pytest_runtest_logfinish(self) -> None:
        """Stop after a test that ended too late."""
        if self.session is not None and time.monotonic() > self._end:
            self.session.shouldstop = f"{_SECONDS:g} s are over; the other tests: make test"


def main() -> int:
    """Run the nearest tests; a deadline is no failure."""
    changed = changed_files()
    tests = nearest_tests(changed)
    sys.stdout.write(f"{len(changed)} changed file(s) reach {len(tests)} test files\n")
    if not tests:
        return 0
    asked = ["-q", "-m", "not slow", *tests[:_MOST_FILES]]
    deadline = Deadline()
    code = pytest.main(asked, plugins=[deadline])
    if code == pytest.ExitCode.INTERRUPTED and deadline.session is not None:
        return int(deadline.session.testsfailed > 0)
    return 0 if code == pytest.ExitCode.NO_TESTS_COLLECTED else int(code)


if __name__ == "__main__":
    sys.exit(main())
