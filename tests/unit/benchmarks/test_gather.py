"""What benchmarks measured becomes one page: figures, ratios, what was asked, growth."""

import copy
import json
import subprocess
import sys
from pathlib import Path

import pytest
from benchmarks import gather, machine
from benchmarks.figures import Figures, Peer, at_least, at_most
from benchmarks.page import broken, missed, page_of

ROOT = Path(__file__).parents[3]
VERSIONS = {"jointz": "0.1.0", "python": "3.11.7", "packages": {"numpy": "2.4.6"}}


def measured(count: int, engine: str = "processes", **others: object) -> dict[str, object]:
    """A measurement of ``benchmarks.scale`` where each participant takes two seconds."""
    workers = 1 if engine == "serial" else 2
    found = {"what": "people", "count": count, "engine": engine, "workers": workers,
             "wall_s": 2.0 * count / workers, "busy_s": 2.0 * count, "idle_share": 0.05,
             "client_mb": 240.0, "worker_mb": 540.0, "digest": f"abc{count}"}  # fmt: skip
    return found | others


def part(name: str, found: dict[str, object] | None, **others: object) -> dict[str, object]:
    """A part as it is kept."""
    of = {"cpu": "Some CPU", "cores": 2, "memory_gb": 16.0, "system": "Linux, x86_64"}
    made = {"schema": "jointz.benchmarks/1", "part": name, "machine": of, "commit": "0123456789ab",
            "date": "2026-11-22T10:00:00+00:00", "load": 0.1, "threads": "1", "seconds": 90.0,
            "found": found}  # fmt: skip
    return made | others


@pytest.fixture
def taken() -> Figures:
    figures = Figures()
    lsq = Peer("lsq_linear", "scipy 1.17.1")
    figures.beside("bounded fit", lsq, (2.0, 125.0), "us", asked=at_least(50.0))
    figures.beside("whole analysis", Peer("read_csv", "pandas 3.1.1"), (9.0, 2.5), "s",
                   asked=at_most(3.0))  # fmt: skip
    figures.beside("memory", Peer("one participant"), (330.0, 300.0), "MB", asked=at_most(1.2))
    figures.beside("missed slots", Peer("without the page"), (0.0, 0.5), "", note="p = 0.42")
    figures.alone("query", 12.34, "ms", asked=at_most(50.0))
    figures.left_out("physics, beside MuJoCo's", "mujoco is not installed")
    figures.timed("benchmarks/test_x.py::test_y[a]",
                  {"min": 0.001, "median": 0.0025, "iqr": 0.0002, "rounds": 1234})  # fmt: skip
    figures.failed("benchmarks/test_analysis.py::test_whole_analysis")
    return figures


@pytest.fixture
def parts(taken: Figures) -> list[dict[str, object]]:
    growth = [measured(n, client_mb=mb) for n, mb in ((1, 240.0), (10, 240.0))]
    growth[0]["wall_s"] = 2.0
    engines = [measured(100, "serial", worker_mb=None), measured(100, wall_s=104.0)]
    engines.append(measured(1000, client_mb=252.0))
    found = json.loads(json.dumps(taken.to_dict() | {"versions": VERSIONS}))
    return [
        part("tests", found),
        part("growth", {"versions": VERSIONS, "measured": growth}),
        part("engines", {"versions": VERSIONS, "measured": engines}),
        part("fits", None, why="its process ended with status 1"),
    ]


def rows(page: str) -> dict[str, list[str]]:
    """The cells of every table's rows, by the first of them."""
    lines = [line.strip("| ").split(" | ") for line in page.splitlines() if line.startswith("| ")]
    return {line[0]: line[1:] for line in lines}


def test_ratios_stand_beside_what_was_asked(parts):
    found = rows(page_of(parts, image="", quick=False))

    assert found["bounded fit"] == ["2 us", "lsq_linear (scipy 1.17.1)", "125 us", "62.5",
                                    "peer / ours", "at least 50", "yes"]  # fmt: skip
    assert found["whole analysis"] == ["9 s", "read_csv (pandas 3.1.1)", "2.5 s", "3.6",
                                       "ours / peer", "at most 3", "**no**"]  # fmt: skip
    assert found["memory"] == ["330 MB", "one participant", "300 MB", "1.1",
                               "ours / peer", "at most 1.2", "yes"]  # fmt: skip
    assert found["query"] == ["12.3 ms", "at most 50 ms", "yes"]
    assert found["`test_x.py::test_y[a]`"] == ["2.5", "1", "0.2", "1,234"]


def test_engines_are_held_to_what_is_asked(parts):
    engines = [measured(100, "serial"), measured(100, wall_s=104.0), measured(1000, "serial"),
               measured(1000, wall_s=1100.0, client_mb=310.0)]  # fmt: skip
    parts[2]["found"]["measured"] = engines
    parts[3] = part("fits", {"versions": VERSIONS, "measured": [measured(500, idle_share=0.06)]})

    told = rows(page_of(parts, image="", quick=False))

    assert told["100 people, processes: efficiency"] == ["0.962", "at least 0.93", "yes"]
    assert told["100 people, processes: client's memory"] == ["240 MB", "at most 300 MB", "yes"]
    assert missed(parts)[1:] == [
        "1,000 people, processes: efficiency: 0.909, at least 0.93 asked",
        "1,000 people, processes: client's memory: 310 MB, at most 300 MB asked",
        "1,000 people, processes: client's memory: ours / peer 1.29 beside 100 people, "
        "at most 1.05 asked",
        "500 fits, processes: scheduler's share: 6 %, at most 5 % asked",
    ]


def test_what_is_not_met_and_what_broke_is_listed(parts):
    spoilt = copy.deepcopy(parts)
    spoilt[2]["found"]["measured"][1]["digest"] = "other"

    assert missed(parts) == [
        "whole analysis: ours / peer 3.6 beside read_csv (pandas 3.1.1), at most 3 asked"
    ]
    assert broken(parts) == [
        "fits: its process ended with status 1",
        "test_analysis.py::test_whole_analysis: did not pass",
    ]
    assert "engines: engines differ" in broken(spoilt)


def test_what_a_part_writes_is_kept_and_taken_again_on_the_same_machine_only(tmp_path, monkeypatch):
    code = "import json, sys; json.dump({'measured': [1]}, open(sys.argv[1], 'w'))"
    one = gather.Part("growth", (sys.executable, "-c", code))

    made = gather.run_part(one, tmp_path, load=0.1)

    assert made["found"] == {"measured": [1]}
    assert made["machine"] == machine.machine()
    assert gather.kept_part(one, tmp_path) == made
    assert [file.name for file in tmp_path.iterdir()] == ["growth.json"]
    monkeypatch.setattr(gather, "machine", lambda: {"cpu": "another"})
    assert gather.kept_part(one, tmp_path) is None


def test_a_part_that_breaks_leaves_no_older_figures(tmp_path):
    one = gather.Part("growth", (sys.executable, "-c", "raise SystemExit(3)"))
    (tmp_path / "growth.json").write_text("{}")

    made = gather.run_part(one, tmp_path, load=0.1)

    assert (made["found"], made["why"]) == (None, "its process ended with status 3")
    assert list(tmp_path.iterdir()) == []


BENCHMARK = """
from benchmarks.figures import at_most
def test_one(figures, quick):
    figures.alone("one", 2.0, "s", asked=at_most(1.0))
    assert quick
"""


@pytest.mark.parametrize(("option", "written"), [("--small", True), ("--benchmark-disable", False)])
def test_figures_are_written_only_when_measuring(tmp_path, option, written):
    (tmp_path / "conftest.py").write_text("from benchmarks.conftest import *\n")
    (tmp_path / "test_one.py").write_text(BENCHMARK)
    words = [sys.executable, "-m", "pytest", tmp_path, f"--rootdir={tmp_path}", option, "-q",
             "-p", "no:cacheprovider", "--figures", tmp_path / "figures.json"]  # fmt: skip

    subprocess.run(list(map(str, words)), cwd=ROOT, check=True, capture_output=True)

    assert (tmp_path / "figures.json").is_file() is written
    if written:
        (row,) = json.loads((tmp_path / "figures.json").read_text())["figures"]
        assert (row["what"], row["ours"], row["met"]) == ("one", 2.0, False)
