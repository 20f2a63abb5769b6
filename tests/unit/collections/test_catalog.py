"""From entries to a catalog, and what comes out of it again."""

import numpy as np
import pandas as pd
import pytest
from benchmarks.collection_entries import write_entry

from jointz.collections.catalog import build_catalog, query_catalog
from jointz.collections.catalog_columns import CATALOG_COLUMNS
from jointz.collections.catalog_file import catalog_about
from jointz.collections.catalog_query import CatalogFilter
from jointz.collections.dissertation_entry import printed_values, write_dissertation_entry
from jointz.core.errors import WriteError

pytest.importorskip("duckdb")
pytest.importorskip("pyarrow")


@pytest.fixture(scope="module")
def collection(tmp_path_factory):
    root = tmp_path_factory.mktemp("collection")
    for k, joint in enumerate(("knee", "ankle", "knee")):
        write_entry(root / f"lab-{k}", seed=k, people=3, joint=joint)
    write_dissertation_entry(root / "dissertation")
    (root / "broken").mkdir()
    (root / "broken" / "entry.toml").write_text('study = "broken"\n')
    return root


@pytest.fixture(scope="module")
def made(collection):
    return build_catalog(collection)


def test_a_broken_entry_is_named_and_the_rest_is_built(made):
    assert made.entries == ("dissertation", "lab-0", "lab-1", "lab-2")
    assert made.skipped_entries == ("broken",)
    assert "broken: licence: expected a value" in made.summary()
    assert (made.rows, made.people) == (3 * 3 * 6 * 5 + 198, 3 * 3 + 10)


def test_rows_hold_the_estimates_with_their_covariances(collection, made):
    found = query_catalog(collection, CatalogFilter(entry=("lab-0",), parameter=("damping",)))
    table = found.table.set_index(["participant", "timing_point"])
    keys = ["participant", "timing_point"]
    own = pd.read_csv(collection / "lab-0" / "estimates.csv")
    own = own[own["parameter"] == "damping"].set_index(keys)
    cov = pd.read_csv(collection / "lab-0" / "covariance.csv")
    cov = cov[cov["parameter"] == "damping"].set_index(keys)

    assert len(table) == len(own) == 18
    assert table["value"].sort_index().tolist() == own["value"].sort_index().tolist()
    both = table[["with_stiffness", "with_inertia"]].sort_index()
    assert np.allclose(both, cov[["with_stiffness", "with_inertia"]].sort_index(), rtol=0)
    assert set(table["torque_gain_sd"]) == {0.02}
    assert table["angle_gain_sd"].isna().all()
    assert table["mass_kg"].between(30, 120).all()


def test_printed_values_are_kept_apart(collection, made):
    estimates = query_catalog(collection, CatalogFilter(joint=("knee",)))
    printed = query_catalog(collection, CatalogFilter(joint=("knee",), kind="printed"))

    assert set(estimates.table["values"]) == {"estimates"}
    assert set(printed.table["study"]) == {"dissertation"}
    assert estimates.also == len(printed.table) == 198
    assert set(estimates.cites) == {"lab-0", "lab-2"}


def test_the_dissertation_gives_the_mean_printed_and_every_participant(collection, made):
    where = CatalogFilter(kind="printed", parameter=("stiffness_per_mass",), phase_pct=(5, 9))
    table = query_catalog(collection, where).table

    mean = table[table["statistic"] == "mean"].iloc[0]
    assert (mean["value"], mean["n"], mean["timing_point"]) == (2.13, 10, "LRE")
    assert len(table) == 11
    assert table.set_index("participant").loc["S5", "status"] == "at_bound"
    assert printed_values().query("statistic == 'mean'")["note"].str.contains("not printed").all()


def test_a_disk_that_is_full_leaves_the_catalog_as_it_was(tmp_path, monkeypatch):
    import pyarrow.parquet

    write_entry(tmp_path / "lab", seed=1, people=2)
    build_catalog(tmp_path)
    before = (tmp_path / "catalog.parquet").read_bytes()

    def full(table, where, **_):
        where.write_bytes(b"PAR1")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(pyarrow.parquet, "write_table", full)
    with pytest.raises(WriteError, match="No space left on device"):
        build_catalog(tmp_path)

    assert (tmp_path / "catalog.parquet").read_bytes() == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["catalog.parquet", "lab"]


def test_an_entry_is_found_by_its_folder_and_by_its_id(tmp_path):
    def named(spec, tables):
        spec["study"] = "our-knees"

    write_entry(tmp_path / "Our Knees", seed=1, people=2, change=named)
    write_entry(tmp_path / "lab-b", seed=2, people=2)
    build_catalog(tmp_path)

    for name in ("Our Knees", "our-knees"):
        found = query_catalog(tmp_path, CatalogFilter(entry=(name,)))
        assert set(found.table["study"]) == {"our-knees"}
        assert list(found.cites) == ["our-knees"]
    assert query_catalog(tmp_path, CatalogFilter(entry=("nobody",))).table.empty


def test_of_two_entries_with_the_same_people_the_first_stands(tmp_path):
    for name in ("lab-a", "lab-b"):
        write_entry(tmp_path / name, seed=5, people=3)

    made = build_catalog(tmp_path, out=tmp_path / "elsewhere.parquet")

    assert (made.entries, made.skipped_entries) == (("lab-a",), ("lab-b",))
    assert (tmp_path / "elsewhere.parquet").is_file()
    assert query_catalog(tmp_path / "elsewhere.parquet").table["study"].unique().tolist() == [
        "lab-a"
    ]


def test_an_inertia_of_all_timing_points_keeps_its_variance(tmp_path):
    def shared(spec, tables):
        table = tables["estimates.csv"]
        inertia = table["parameter"] == "inertia"
        one = table[inertia & (table["timing_point"] == "LRE")].assign(timing_point="all")
        tables["estimates.csv"] = pd.concat([table[~inertia], one], ignore_index=True)

    write_entry(tmp_path / "lab", seed=5, people=3, change=shared)
    assert build_catalog(tmp_path).skipped == ()

    table = query_catalog(tmp_path, CatalogFilter(parameter=("inertia",))).table

    half = (table["ci_high"] - table["ci_low"]) / 2
    assert np.allclose(1.96 * np.sqrt(table["with_inertia"]), half, rtol=1e-3)
    assert table["with_stiffness"].isna().all()


def test_covariances_go_to_the_rows_of_their_method_only(tmp_path):
    def two_methods(spec, tables):
        table = tables["estimates.csv"]
        other = table.assign(method="dissertation")
        ends = ["value", "ci_low", "ci_high"]
        other[ends] *= 1.3
        tables["estimates.csv"] = pd.concat([table, other], ignore_index=True)

    write_entry(tmp_path / "lab", seed=5, people=3, change=two_methods)
    assert build_catalog(tmp_path).skipped == ()

    table = query_catalog(tmp_path, CatalogFilter(parameter=("stiffness",))).table

    assert table.groupby("method", observed=True)["with_stiffness"].count().to_dict() == {
        "rigid": 18, "dissertation": 0,
    }  # fmt: skip


def test_a_catalog_says_where_its_collection_is(tmp_path):
    write_entry(tmp_path / "collection" / "lab", seed=5, people=2)
    (tmp_path / "elsewhere").mkdir()
    for out, told in (("collection", "."), ("elsewhere", "../collection")):
        file = tmp_path / out / "catalog.parquet"
        build_catalog(tmp_path / "collection", out=file)
        assert catalog_about(file)["collection"] == told
    build_catalog(tmp_path / "collection" / "lab")  # the folder of one entry
    assert catalog_about(tmp_path / "collection" / "lab" / "catalog.parquet")["collection"] == ".."


def test_the_raw_data_are_found_from_the_folder_of_the_collection(tmp_path):
    def near(spec, tables):
        spec["raw_data"]["study"] = "../../raw/study"

    write_entry(tmp_path / "lab", seed=5, people=2, change=near)
    build_catalog(tmp_path)

    table = query_catalog(tmp_path).table

    assert set(table["raw_study"]) == {"../raw/study"}
    assert list(table.columns) == list(CATALOG_COLUMNS)


def test_a_catalog_that_was_built_again_is_read_again(tmp_path):
    for k in range(2):
        write_entry(tmp_path / f"lab-{k}", seed=k, people=2)
        build_catalog(tmp_path)

        assert query_catalog(tmp_path).table["study"].nunique() == k + 1


def test_both_sides_of_a_person_are_rows_of_their_own_and_one_person(tmp_path):
    def on_both_sides(spec, tables):
        spec["joint"]["side"] = "both"
        for person in spec["participants"]:
            person["side"] = "both"
        for file, table in tables.items():
            sides = [table.assign(side=side) for side in ("left", "right")]
            values = ["value", "ci_low", "ci_high"] if file == "estimates.csv" else []
            sides[1][values] *= 1.1
            tables[file] = pd.concat(sides, ignore_index=True)

    write_entry(tmp_path / "lab", seed=5, people=2, change=on_both_sides)
    made = build_catalog(tmp_path)
    table = query_catalog(tmp_path).table

    assert made.skipped == ()
    assert made.people == 2
    assert table["side"].astype(str).value_counts().to_dict() == {"left": 60, "right": 60}
    stiffness = table[table["parameter"] == "stiffness"]
    assert stiffness["with_stiffness"].notna().all()
    keys = ["participant", "side", "timing_point"]
    assert not stiffness.duplicated(keys).any()
