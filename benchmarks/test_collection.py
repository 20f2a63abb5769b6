"""A collection of 50 labs with 200 people each: how long it takes to build, and to ask.

Labs and people are fictional, their entries made here. One entry is broken on purpose: it must be
named and skipped. Asked for are at most 2 min to build and at most 50 ms for a query in a process
that has asked before. With ``--benchmark-disable`` a small collection runs once and no time is
asserted.
"""

import statistics
from pathlib import Path
from time import perf_counter

import pytest
from benchmarks.collection_entries import JOINTS, write_entry
from benchmarks.figures import Figures, at_most

from jointz.collections.catalog_query import CatalogFilter

pytest.importorskip("duckdb")
pytest.importorskip("pyarrow")

MOST_BUILD_S = 120.0
MOST_QUERY_S = 0.05
N_QUERIES = 20
BROKEN = "lab-007"

QUERIES = {
    "one cell": CatalogFilter(
        joint=("knee",), parameter=("stiffness",), phase_pct=(60.0, 75.0), speed_m_s=(1.0, 1.3)
    ),
    "one study": CatalogFilter(entry=("lab-011",), standing=True),
    "a parameter of a joint": CatalogFilter(joint=("knee",), parameter=("stiffness",)),
}


@pytest.fixture(scope="module")
def collection(quick: bool, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int]:
    """The folder of a collection, and how many entries it has."""
    labs, people = (16, 3) if quick else (50, 200)
    root = tmp_path_factory.mktemp("collection")
    joints = list(JOINTS)[:3]
    for k in range(labs):
        folder = root / f"lab-{k:03d}"
        write_entry(folder, seed=k, people=people, joint=joints[k % len(joints)])
    with (root / BROKEN / "estimates.csv").open("a") as stream:
        stream.write("S001,LRE,7.0,stiffness\n")
    return root, labs


def test_building_and_asking_a_collection(
    collection: tuple[Path, int], quick: bool, figures: Figures
) -> None:
    from jointz.collections.catalog import build_catalog, query_catalog

    root, labs = collection
    start = perf_counter()
    made = build_catalog(root)
    build_s = perf_counter() - start
    size_mb = (root / "catalog.parquet").stat().st_size / 1e6
    print(f"\n{labs} labs, {made.people} people, {made.rows} rows, {size_mb:.1f} MB")
    print(f"build                     {build_s:8.2f} s   (at most {MOST_BUILD_S:g} s)")
    size = f"{labs} labs, {made.people:,} people"
    figures.alone(f"catalog of {size}: build", build_s, "s", asked=at_most(MOST_BUILD_S))
    assert made.skipped_entries == (BROKEN,)
    assert len(made.entries) == labs - 1

    for name, where in QUERIES.items():
        found = query_catalog(root, where)  # warm
        times = []
        for _ in range(1 if quick else N_QUERIES):
            start = perf_counter()
            query_catalog(root, where)
            times.append(perf_counter() - start)
        median_s = statistics.median(times)
        print(f"query {name:<23}{1e3 * median_s:5.1f} ms, {len(found.table)} rows")
        what, asked = f"catalog of {size}: query of {name}, median", at_most(1e3 * MOST_QUERY_S)
        figures.alone(what, 1e3 * median_s, "ms", asked=asked)
        assert len(found.table) > 0
        if not quick:
            assert median_s <= MOST_QUERY_S
    if not quick:
        assert build_s <= MOST_BUILD_S
