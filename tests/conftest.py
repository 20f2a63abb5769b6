"""Fixtures: where real recordings are, a small simulated study, and the command line."""

import http.client
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch
from urllib.parse import urlsplit

import hypothesis
import pandas as pd
import pytest

from jointz.analysis.analyze import analyze as analyze_study
from jointz.analysis.results_folder import write_results
from jointz.cli.main import run
from jointz.core.stop_signals import STOP_SIGNALS
from jointz.results.study_analysis import StudyAnalysis

# A pause of the machine within an example is no failure of it.
hypothesis.settings.register_profile("jointz", deadline=None)
hypothesis.settings.load_profile("jointz")

REPOSITORY = Path(__file__).parent.parent


@pytest.fixture(scope="session")
def real_data() -> Path:
    """The folder of real recordings; skips where it is absent."""
    folder = Path(os.environ.get("JOINTZ_DATA", REPOSITORY.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"real recordings are absent: no folder {folder.name}; set JOINTZ_DATA")
    return folder


@pytest.fixture(scope="session")
def small_study_source(
    tmp_path_factory: pytest.TempPathFactory, csv_study: Callable[..., None]
) -> Path:
    folder = tmp_path_factory.mktemp("source") / "study"
    csv_study(folder, people=2, strides=20, pulses=4, seed=7)
    return folder


@pytest.fixture(scope="session")
def small_analysis(small_study_source: Path) -> StudyAnalysis:
    """The analysis of the small study in order; to read only."""
    return analyze_study(small_study_source, resamples=20)


@pytest.fixture(scope="session")
def small_results(small_analysis: StudyAnalysis, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results of the small study in order, without figures; to read only."""
    folder = tmp_path_factory.mktemp("small") / "results"
    write_results(small_analysis, folder, figures=False, tables=True)
    return folder


@dataclass
class StudyFolder:
    """A study folder that a test may spoil."""

    root: Path

    @property
    def toml(self) -> str:
        return (self.root / "study.toml").read_text()

    def edit_toml(self, old: str, new: str, count: int = -1) -> None:
        assert old in self.toml
        (self.root / "study.toml").write_text(self.toml.replace(old, new, count))

    def edit_table(self, file: str, change: Callable[[pd.DataFrame], pd.DataFrame]) -> None:
        path = self.root / file
        change(pd.read_csv(path)).to_csv(path, index=False)


@pytest.fixture
def small_study(small_study_source: Path, tmp_path: Path) -> StudyFolder:
    """Two simulated walkers at 500 Hz with four pulses a timing point, as csv."""
    root = tmp_path / "study"
    shutil.copytree(small_study_source, root)
    return StudyFolder(root)


@contextmanager
def _dask_cluster(folder: Path, *preloads: str) -> Iterator[str]:
    file = folder / "scheduler.json"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": folder}
    common = ["--no-dashboard", "--host", "127.0.0.1", "--scheduler-file", str(file)]
    scheduler = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--port", "0", *common]
    worker = [sys.executable, "-m", "distributed.cli.dask_worker", "--nthreads", "1", *common]
    running = [subprocess.Popen(scheduler, **quiet)]
    while not file.exists():
        time.sleep(0.1)
    for preload in preloads or ("", ""):
        words = [*worker, "--preload", preload] if preload else worker
        running.append(subprocess.Popen(words, **quiet))
    yield json.loads(file.read_text())["address"]
    for process in reversed(running):  # workers that lose their scheduler wait for it
        process.terminate()
        process.wait()


@pytest.fixture(scope="session")
def dask_cluster() -> Callable[..., AbstractContextManager[str]]:
    """Return what starts a scheduler and workers by hand, as a lab would, and gives its address.

    Two workers, or one for each file or text of Python that a worker is to run first, "" for none.
    """
    return _dask_cluster


class PageClient:
    """A browser's requests to a page, without the browser."""

    def __init__(self, address: str) -> None:
        where = urlsplit(address)
        self.place, self.path = where.netloc, f"{where.path}?{where.query}"
        self.cookie = ""

    def open(self) -> "PageClient":
        """Show the token, and keep the cookie."""
        _, _, headers = self.request("GET", self.path)
        self.cookie = headers["set-cookie"].split(";")[0]
        return self

    def request(
        self, method: str, path: str, body: str | None = None
    ) -> tuple[int, str, http.client.HTTPMessage]:
        """Return status, text and headers of an answer."""
        headers = {"Origin": f"http://{self.place}", "Cookie": self.cookie}
        connection = http.client.HTTPConnection(self.place, timeout=10)
        connection.request(method, path, body, headers)
        answer = connection.getresponse()
        text = answer.read().decode(errors="replace")
        connection.close()
        return answer.status, text, answer.headers

    def socket(self, path: str) -> Any:
        """Open a WebSocket."""
        from websockets.sync.client import connect

        return connect(
            f"ws://{self.place}{path}",
            origin=f"http://{self.place}",
            additional_headers={"Cookie": self.cookie},
        )

    def refused_everywhere(self) -> bool:
        """Tell whether page, files, commands and sockets answer 403 to who shows a wrong token."""
        from websockets.exceptions import InvalidStatus

        asked = [("GET", "/"), ("GET", "/?token=x"), ("GET", "/console-files/console.js")]
        asked += [("POST", "/stop"), ("POST", "/command"), ("GET", "/_nicegui/x.js")]
        statuses = {self.request(method, path)[0] for method, path in asked}
        for path in ("/live", "/_nicegui_ws/socket.io/?EIO=4&transport=websocket"):
            try:
                self.socket(path).close()
                statuses.add(101)
            except InvalidStatus as refusal:
                statuses.add(refusal.response.status_code)
        return statuses == {403}


@pytest.fixture(scope="session")
def page_client() -> Callable[[str], PageClient]:
    """Return what makes a client of a page that has not shown the token yet."""
    return PageClient


@pytest.fixture(scope="session")
def script_errors() -> Callable[[Any], list[str]]:
    """Return what gathers the errors of a page's scripts as they come."""

    def gather(page: Any) -> list[str]:
        errors: list[str] = []
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.on("console", lambda told: told.type == "error" and errors.append(told.text))
        return errors

    return gather


@dataclass
class Outcome:
    """What a command printed and how it ended."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> dict:
        return json.loads(self.out)


@pytest.fixture
def jointz(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> Callable[..., Outcome]:
    """Run the command line inside the test's process."""

    def call(*arguments: object) -> Outcome:
        monkeypatch.setattr(sys, "argv", ["jointz", *map(str, arguments)])
        capsys.readouterr()
        with as_in_a_terminal(), pytest.raises(SystemExit) as end:
            run()
        captured = capsys.readouterr()
        return Outcome(int(end.value.code or 0), captured.out, captured.err)

    return call


@pytest.fixture
def analyze(jointz: Callable[..., Outcome], tmp_path: Path) -> Callable[..., Outcome]:
    """Analyse a study into ``tmp_path / "results"``: few resamples, no figures, as JSON."""
    small = ("--resamples", 50, "--no-figures", "--tables", "--workers", 1)

    def call(study: StudyFolder, *more: object) -> Outcome:
        return jointz("analyze", study.root, "--out", tmp_path / "results", "--json", *small, *more)

    return call


@contextmanager
def as_in_a_terminal() -> Iterator[None]:
    """Handle signals by default, and restore what a command changes in this process.

    A background job ignores some, and so do the processes that it starts.
    """
    handlers = {number: signal.signal(number, signal.SIG_DFL) for number in STOP_SIGNALS}
    hooks = sys.unraisablehook, sys.excepthook
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with patch.dict(os.environ):  # a command sets variables for its workers
            yield
    finally:
        sys.unraisablehook, sys.excepthook = hooks
        for number, handler in handlers.items():
            signal.signal(number, handler)


@pytest.fixture
def terminal_signals() -> Iterator[None]:
    """Handle signals as in a terminal, and have processes that are started do so."""
    with as_in_a_terminal():
        yield


@pytest.fixture(scope="module")
def terminal_signals_of_module() -> Iterator[None]:
    """Do so for fixtures of a module, too."""
    with as_in_a_terminal():
        yield


@pytest.fixture(autouse=True)
def _no_figure_left_open():
    """Close what a test plotted, or another test of the process would find it."""
    yield
    if pyplot := sys.modules.get("matplotlib.pyplot"):
        pyplot.close("all")
