"""A catalog of results folders."""

import json
import os
import shutil
from pathlib import Path

import pandas as pd
import pytest

import jointz
from jointz.analysis.results_folder import write_results
from jointz.collections.catalog import query_catalog
from jointz.collections.catalog_query import CatalogFilter
from jointz.collections.coverage import PoolRules, pool_collection
from jointz.collections.results_catalog import build_results_catalog
from jointz.core.errors import DataError

pytest.importorskip("duckdb")


@pytest.fixture(scope="module")
def results(small_study_source, tmp_path_factory):
    """The results of one study in two folders."""
    deep = tmp_path_factory.mktemp("results") / "deep"
    write_results(jointz.analyze(small_study_source, resamples=2), deep / "ours")
    shutil.copytree(deep / "ours", deep / "theirs")
    return deep.parent


def test_every_estimate_of_every_folder_stands_in_it(results, tmp_path):
    made = build_results_catalog([results], out=results)

    assert made.entries == ("deep/ours", "deep/theirs")
    assert (made.people, made.skipped) == (2, ())  # one study, analysed twice
    table = query_catalog(results).to_frame()
    assert len(table) == made.rows
    assert table["study"].unique().size == 1
    for name in made.entries:
        written = pd.read_csv(results / name / "estimates.csv")
        found = query_catalog(results, CatalogFilter(entry=(name,))).to_frame()
        keys = ["participant", "parameter", "timing_point"]
        both = found.merge(written, on=keys, suffixes=("", "_csv"), validate="one_to_one")
        assert len(both) == len(written)
        pd.testing.assert_series_equal(both["value"], both["value_csv"], check_names=False)
        assert set(found["method"]) == set(written["method"])
    covariance = pd.read_csv(results / "deep" / "ours" / "covariance.csv")
    covariance = covariance.dropna(subset="with_stiffness")
    cell = covariance.iloc[0]
    row = table[
        (table["entry"] == "deep/ours")
        & (table["participant"] == cell["participant"])
        & (table["timing_point"] == cell["timing_point"])
        & (table["parameter"] == cell["parameter"])
    ]
    assert row["with_stiffness"].item() == cell["with_stiffness"]


def test_broken_folders_are_named_and_skipped(results, tmp_path):
    for name in ("fine", "cut", "infinite", "strange", "twice", "without"):
        shutil.copytree(results / "deep" / "ours", tmp_path / name)
    (tmp_path / "cut" / "estimates.csv").write_text("participant,timing_point\nS01,LRE\n")
    (tmp_path / "strange" / "provenance.json").write_text(
        json.dumps({"study": {"kind": "walking", "participants": [{"name": "S01"}]}})
    )
    (tmp_path / "without" / "provenance.json").write_text("{")
    lines = (tmp_path / "twice" / "covariance.csv").read_text().splitlines()
    (tmp_path / "twice" / "covariance.csv").write_text("\n".join([*lines, lines[-1]]) + "\n")
    estimates = pd.read_csv(tmp_path / "infinite" / "estimates.csv")
    estimates.loc[0, "ci_high"] = float("inf")
    estimates.to_csv(tmp_path / "infinite" / "estimates.csv", index=False)

    made = build_results_catalog([tmp_path], out=tmp_path)

    assert made.entries == ("fine",)
    assert made.skipped_entries == ("cut", "infinite", "strange", "twice", "without")


def test_a_folder_that_lost_its_estimates_and_one_that_cannot_be_read_are_named(
    results, tmp_path, monkeypatch
):
    for name in ("fine", "locked", "lost", "pooled"):
        shutil.copytree(results / "deep" / "ours", tmp_path / name)
    (tmp_path / "lost" / "estimates.csv").unlink()
    (tmp_path / "pooled" / "estimates.csv").unlink()
    other = json.dumps({"made_by": "pool", "files": ["pooled.csv"]})
    (tmp_path / "pooled" / "provenance.json").write_text(other)
    scandir = os.scandir

    def refusing(place):
        if Path(place).name == "locked":
            raise PermissionError(13, "Permission denied", str(place))
        return scandir(place)

    monkeypatch.setattr(os, "scandir", refusing)

    made = build_results_catalog([tmp_path, tmp_path / "nowhere"], out=tmp_path)

    assert made.entries == ("fine",)
    assert set(made.skipped_entries) == {"locked", "lost", "nowhere"}


def test_nothing_that_is_no_result_makes_a_catalog(results, tmp_path):
    with pytest.raises(DataError, match="results folders"):
        build_results_catalog([tmp_path, tmp_path / "nowhere"], out=tmp_path)
    assert not list(tmp_path.iterdir())


def test_it_is_not_pooled(results, tmp_path):
    file = tmp_path / "own.parquet"
    build_results_catalog([results / "deep" / "ours"], out=file)

    with pytest.raises(DataError, match="Make an entry of each"):
        pool_collection(file, where=CatalogFilter(), rules=PoolRules())
