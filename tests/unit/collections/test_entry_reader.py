"""Entries as they stand on disk, and the catalog as a file."""

import tomllib

import numpy as np
import pandas as pd
import pytest
from benchmarks.collection_entries import write_entry
from hypothesis import given
from hypothesis import strategies as st

from jointz.collections.catalog_columns import CATALOG_COLUMNS
from jointz.collections.catalog_file import (
    catalog_about,
    check_filter,
    count_rows,
    read_catalog,
    write_catalog,
)
from jointz.collections.catalog_query import CatalogFilter
from jointz.collections.entry_reader import read_condition, read_entry, written_entry
from jointz.core.errors import DataError, EntryError


def test_an_entry_is_read_with_its_tables_and_their_hashes(tmp_path):
    write_entry(tmp_path / "lab", seed=1, people=2)

    entry = read_entry(tmp_path / "lab")
    tables = read_condition(entry, entry.spec.conditions[0])

    assert entry.name == entry.spec.study == "lab"
    assert dict(tables.sha256) == entry.spec.hashes
    assert len(tables.rows) == 2 * 6 * 5
    assert tables.rows["value"].dtype == float
    assert len(tables.covariance) == 2 * 6 * 3


def test_every_problem_of_shape_is_in_one_message(tmp_path):
    write_entry(tmp_path / "lab", seed=1, people=2)
    file = tmp_path / "lab" / "entry.toml"
    text = file.read_text().replace("licence =", "license =").replace('age_band = "', 'sexe = "')
    file.write_text(text)

    with pytest.raises(EntryError) as raised:
        read_entry(tmp_path / "lab")

    assert {problem.partition(":")[0] for problem in raised.value.problems} >= {
        "licence", "license", "participants[1].age_band", "participants[2].sexe",
    }  # fmt: skip


@pytest.mark.parametrize("file", ["../other/estimates.csv", "/etc/passwd", "..\\x.csv"])
def test_no_entry_reaches_outside_its_folder(tmp_path, file):
    write_entry(tmp_path / "lab", seed=1, people=2)

    with pytest.raises(DataError, match="inside the folder"):
        read_entry(tmp_path / "lab").path(file)


def test_no_link_reaches_outside_either(tmp_path):
    write_entry(tmp_path / "lab", seed=1, people=2)
    (tmp_path / "lab" / "estimates.csv").rename(tmp_path / "elsewhere.csv")
    (tmp_path / "lab" / "estimates.csv").symlink_to(tmp_path / "elsewhere.csv")

    with pytest.raises(DataError, match="links to a file outside"):
        read_entry(tmp_path / "lab").path("estimates.csv")


TEXTS = st.text(st.characters(exclude_categories=("Cs", "Cc")), min_size=1, max_size=12)


@given(
    name=TEXTS,
    sd=st.floats(0, 1e6),
    n=st.integers(0, 10**6),
    settings=st.dictionaries(TEXTS, TEXTS),
)
def test_what_is_written_is_read_again(name, sd, n, settings):
    content = {
        "title": name,
        "empty": [],
        "calibration": {"torque_gain": {"value": 1.0, "sd": sd}},
        "method": {"name": name, "settings": settings},
        "exclusions": [{"kind": "pulse", "n": n}, {"kind": "stride", "n": 0}],
    }

    assert tomllib.loads(written_entry(content)) == content


# --- the catalog ---------------------------------------------------------------------------------


@pytest.fixture
def catalog(tmp_path):
    """Eight rows in a folder whose name holds a pattern."""
    pytest.importorskip("duckdb")
    pytest.importorskip("pyarrow")
    rows = [
        {"study": study, "entry": f"folder-{study}", "values": kind, "joint": "knee",
         "parameter": "stiffness", "onset_gait_pct": onset, "walking_speed_m_s": speed,
         "status": status, "value": onset, "condition": "level"}
        for study, kind, speed in (("a", "estimates", 1.2), ("b", "estimates", 0.6),
                                   ("c", "printed", 1.2))
        for onset, status in ((5.0, "ok"), (95.0, "undecided"), (60.0, "at_bound"))
    ]  # fmt: skip
    table = pd.DataFrame(rows, columns=list(CATALOG_COLUMNS))
    for column, kind in CATALOG_COLUMNS.items():
        table[column] = (
            table[column].astype(object).fillna("")
            if kind == "text"
            else table[column].astype(float)
        )
    folder = tmp_path / "labs [2] *"
    folder.mkdir()
    write_catalog(table, folder / "catalog.parquet", {"entries": {"folder-a": {}}})
    return folder / "catalog.parquet"


@pytest.mark.parametrize(
    ("where", "found"),
    [
        (CatalogFilter(), 6),
        (CatalogFilter(kind="printed"), 3),
        (CatalogFilter(standing=True), 4),
        (CatalogFilter(phase_pct=(0, 10)), 2),
        (CatalogFilter(phase_pct=(90, 10)), 4),
        (CatalogFilter(speed_m_s=(0.5, 0.7)), 3),
        (CatalogFilter(entry=("folder-b", "folder-a")), 6),
        (CatalogFilter(joint=("knee", "hip"), parameter=("stiffness",)), 6),
        (CatalogFilter(condition=("level' OR '1' = '1",)), 0),
    ],
)
def test_a_filter_finds_what_it_asks_for(catalog, where, found):
    table, _ = read_catalog(catalog, where)
    assert len(table) == found
    assert count_rows(catalog, where) == found


def test_a_catalog_comes_back_as_it_was_written(catalog):
    table, without_onset = read_catalog(catalog, CatalogFilter(entry=("folder-a",)))

    assert without_onset == 0
    assert list(table.columns) == list(CATALOG_COLUMNS)
    assert sorted(table["value"]) == [5.0, 60.0, 95.0]
    assert np.isnan(table["ci_low"]).all()
    assert set(table["surface"]) == {""}
    assert catalog_about(catalog)["entries"] == {"folder-a": {}}
    assert list(catalog.parent.iterdir()) == [catalog]


def test_a_file_that_is_no_catalog_is_refused(catalog):
    pa = pytest.importorskip("pyarrow")
    other = catalog.with_name("other.parquet")
    pa.parquet.write_table(pa.table({"joint": ["knee"]}), other)
    with pytest.raises(DataError, match="expected a catalog"):
        catalog_about(other)

    table = pa.parquet.read_table(catalog)
    pa.parquet.write_table(table.drop_columns(["cite", "n"]), other)
    with pytest.raises(DataError, match="n, cite"):
        catalog_about(other)

    pa.parquet.write_table(
        table.replace_schema_metadata({"jointz": '{"schema": "jointz.Catalog/0"}'}), other
    )
    with pytest.raises(DataError, match=r"schema 'jointz\.Catalog/0'"):
        catalog_about(other)

    other.write_bytes(catalog.read_bytes()[:200])
    with pytest.raises(DataError, match="expected a catalog"):
        catalog_about(other)
    with pytest.raises(DataError, match="Name a catalog"):
        catalog_about(catalog.with_name("none.parquet"))


@pytest.mark.parametrize(
    "where",
    [
        CatalogFilter(phase_pct=(0, 140)),
        CatalogFilter(speed_m_s=(2, 1)),
        CatalogFilter(speed_m_s=(float("nan"), 1)),
    ],
)
def test_a_range_that_is_none_is_refused(where):
    with pytest.raises(DataError, match="expected"):
        check_filter(where)


def test_without_the_extra_the_error_names_it(monkeypatch, tmp_path):
    monkeypatch.setitem(__import__("sys").modules, "duckdb", None)

    with pytest.raises(DataError, match=r'duckdb.*pip install "jointz\[scale\]"'):
        catalog_about(tmp_path / "catalog.parquet")
