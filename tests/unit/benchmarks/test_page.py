"""The page of benchmarks: its targets, its tables and the links between them."""

import importlib
import re
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pandas as pd
import pytest

ROOT = Path(__file__).parents[3]


def module(name: str) -> ModuleType:
    """Return a module of the benchmarks, which are no part of the package."""
    if str(ROOT) not in sys.path:
        sys.path.append(str(ROOT))
    return importlib.import_module(f"benchmarks.{name}")


figures, gather = module("figures"), module("gather")
VERSIONS = {"python": "3.11", "jointz": "0.1.0", "packages": {"numpy": "2.0"}}


def part(name: str, **found: Any) -> dict[str, Any]:
    made = {"cpu": "CPU", "cores": 2, "memory_gb": 8.0, "system": "Linux"}
    about = {"machine": made, "load": 0.1, "threads": "1", "seconds": 60.0, "commit": "abc"}
    return {
        "part": name,
        "date": "2026-01-01T00:00",
        **about,
        "found": {"versions": VERSIONS} | found,
    }


def scaled(count: int, engine: str, wall_s: float) -> dict[str, Any]:
    workers = 1 if engine == "serial" else 2
    memory = {"client_mb": 200.0, "worker_mb": None if workers == 1 else 500.0}
    shares = {"busy_s": 0.9 * workers * wall_s, "idle_share": 0.1, "digest": "d"}
    about = {"count": count, "engine": engine, "workers": workers, "wall_s": wall_s}
    return about | memory | shares


def parts() -> list[dict[str, Any]]:
    fast = figures.Figure("sum", 1.0, "ms", figures.Peer("add", "x 1"), 10.0, figures.at_least(2.0))
    slow = figures.Figure("product", 5.0, "s", asked=figures.at_most(1.0))
    plain = figures.Figure("no target", 3.0, "s")
    timing = {"test": "t", "min_s": 1.0, "median_s": 1.0, "iqr_s": 0.1, "rounds": 3}
    tests = {"figures": [f.to_dict() for f in (fast, slow, plain)], "timings": [timing]}
    people = [scaled(10, "serial", 20.0), scaled(10, "processes", 10.0)]
    return [part("tests", **tests, left_out=[], failed=["t"]), part("engines", measured=people)]


@pytest.fixture
def written(tmp_path: Path) -> str:
    gather.write_page(parts(), tmp_path / "page.md", quick=False)
    return (tmp_path / "page.md").read_text()


def test_the_page_has_missed_and_met_targets_apart(written):
    missed, others = written.split("## Compared with other programs")

    assert "3 of 4 targets are met" in missed
    assert "| product | 5 s | - | - | - | at most 1 s |" in missed
    assert "| sum | 1 ms | add (x 1) | 10 ms | 10 | at least 2 |" in others
    assert "no target" not in written


def test_the_tables_have_what_the_page_leaves_out(written, tmp_path):
    linked = re.findall(r"<(tables/\S+)>", written)
    tables = {name: pd.read_csv(tmp_path / name) for name in linked}

    assert len(tables) == 4
    quantities = tables["tables/benchmarks-figures.csv"].set_index("quantity")
    assert quantities.loc["no target", "jointz"] == 3.0
    assert quantities.loc["10 people, processes: efficiency", "met"]
    assert tables["tables/benchmarks-scale.csv"]["efficiency"].tolist()[1] == 1.0


def test_quick_figures_are_not_judged(tmp_path):
    gather.write_page(parts(), tmp_path / "page.md", quick=True)

    assert "targets are met" not in (tmp_path / "page.md").read_text()
    table = pd.read_csv(tmp_path / "tables" / "benchmarks-figures.csv")
    assert table["target"].isna().all()
