"""Figures that the benchmarks measure are collected, and written when the session has ended.

``pytest benchmarks`` writes ``build/benchmarks.json``, or what ``--figures FILE`` names; nothing
with ``--benchmark-disable``, and nothing when the session was broken off.
"""

from collections.abc import Generator
from pathlib import Path
from typing import Any

import pytest
from benchmarks.figures import Figures, write_json

_FIGURES = pytest.StashKey[Figures]()
_FILE = Path("build", "benchmarks.json")


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("figures", "what benchmarks measure")
    group.addoption("--figures", type=Path, metavar="FILE", help=f"written there, not to {_FILE}")
    group.addoption("--small", action="store_true", help="little work: figures that assert nothing")


def pytest_configure(config: pytest.Config) -> None:
    config.stash[_FIGURES] = Figures()


@pytest.fixture(scope="session")
def quick(request: pytest.FixtureRequest) -> bool:
    """Whether little work is done, and no figure asserted."""
    return _is_disabled(request.config) or bool(request.config.getoption("small", default=False))


@pytest.fixture(scope="session")
def figures(request: pytest.FixtureRequest) -> Figures:
    """Take what is measured: every benchmark hands its figures over before it asserts them."""
    return request.config.stash[_FIGURES]


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Function,
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    taken = item.config.stash[_FIGURES]
    if report.failed:
        taken.failed(item.nodeid)
    elif report.skipped and report.when == "setup":  # later ones say themselves what is missing
        taken.left_out(item.nodeid, _reason(report))
    benchmark: Any = item.funcargs.get("benchmark")
    if report.when == "call" and benchmark is not None and benchmark.stats is not None:
        taken.timed(item.nodeid, benchmark.stats)
    return report


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    report = yield
    if report.skipped:
        collector.config.stash[_FIGURES].left_out(collector.nodeid, _reason(report))
    return report


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    ended = exitstatus in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED)
    taken = session.config.stash[_FIGURES]
    if taken and ended and not session.shouldfail and not _is_disabled(session.config):
        file = session.config.getoption("figures", default=None)
        write_json(taken.to_dict(), file or session.config.rootpath / _FILE)


def _is_disabled(config: pytest.Config) -> bool:
    return bool(config.getoption("benchmark_disable", default=False))


def _reason(report: pytest.TestReport | pytest.CollectReport) -> str:
    found = report.longrepr
    return str(found[2] if isinstance(found, tuple) else found).removeprefix("Skipped: ")
