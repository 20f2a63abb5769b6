"""``jointz analyze`` on a Dask cluster whose processes were started by hand."""

import time

import pytest

pytest.importorskip("distributed", reason="dask is not installed")
pytestmark = [pytest.mark.filterwarnings("default"), pytest.mark.slow]

OLDER = (
    "import jointz.tasks.dask_cluster as it; found = it._calculating(); "
    "it._calculating = lambda: {**found, 'jointz': '0.0.9'}"
)


def joined(jointz, words, *, seconds=60):
    """Run the command until the cluster's workers have come."""
    until = time.monotonic() + seconds
    while True:
        outcome = jointz(*words)
        if "no workers" not in outcome.err or time.monotonic() > until:
            return outcome


def test_the_numbers_are_those_of_one_machine(small_study, jointz, dask_cluster, tmp_path):
    here, there = tmp_path / "here", tmp_path / "there"
    assert jointz("analyze", small_study.root, "--out", here, "--workers", "1").code == 0

    with dask_cluster(tmp_path) as address:
        words = ("analyze", small_study.root, "--out", there, "--scheduler", address)
        outcome = joined(jointz, words)

    assert outcome.code == 0, outcome.err
    tables = sorted(file.name for file in here.glob("*.csv"))
    assert "estimates.csv" in tables
    for name in tables:
        assert (there / name).read_bytes() == (here / name).read_bytes(), name


def test_a_worker_of_another_version_is_refused(small_study, jointz, dask_cluster, tmp_path):
    out = tmp_path / "results"
    with dask_cluster(tmp_path, OLDER) as address:
        words = ("analyze", small_study.root, "--out", out, "--scheduler", address)
        outcome = joined(jointz, words)

    assert outcome.code == 2
    assert "tcp://127" in outcome.err
    assert "0.0.9" in outcome.err
    assert not out.exists()
