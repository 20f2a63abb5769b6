"""``jointz collect`` as people call it."""

import csv
import io
import json

import pytest
from benchmarks.collection_entries import write_entry
from typer.testing import CliRunner

from jointz.cli.command_line import command_line


@pytest.fixture(scope="module")
def collection(tmp_path_factory):
    root = tmp_path_factory.mktemp("collection")
    for k in range(2):
        write_entry(root / f"lab-{k}", seed=k, people=3)
    return root


@pytest.fixture(scope="module")
def catalog(collection):
    pytest.importorskip("duckdb")
    assert call("build", collection, "--quiet").exit_code == 0
    return collection


def call(*arguments):
    return CliRunner().invoke(command_line(), ["collect", *map(str, arguments)])


def test_check_tells_a_sound_collection_from_a_spoilt_one(collection, tmp_path):
    assert call("check", collection).output == "2 entries: no problems.\n"

    def spoil(spec, tables):
        del spec["licence"]

    write_entry(tmp_path / "lab", seed=1, people=3, change=spoil)
    done = call("check", tmp_path, "--json")

    assert done.exit_code == 2
    found = json.loads(done.stdout)
    assert found["status"] == "problems"
    assert [f["code"] for f in found["findings"]] == ["key_missing"]


def test_the_tables_of_the_dissertation_become_an_entry(tmp_path):
    done = call("entry", "dissertation", "--out", tmp_path / "dissertation", "--json")

    assert done.exit_code == 0
    assert json.loads(done.stdout)["open"] == []
    assert call("check", tmp_path).exit_code == 0


def test_a_query_gives_text_csv_and_json(catalog):
    asked = ("query", catalog, "--parameter", "stiffness", "--phase", "60", "90")

    shown = call(*asked)
    rows = list(csv.DictReader(io.StringIO(call(*asked, "--csv").stdout)))
    found = json.loads(call(*asked, "--json").stdout)

    assert shown.exit_code == 0
    assert len(rows) == len(found["rows"]) == 12
    assert found["rows"][0]["unit"] == "N*m/rad"
    assert len(found["cites"]) == 2


def test_a_query_that_finds_nothing_ends_with_1(catalog):
    done = call("query", catalog, "--joint", "wrist", "--json")

    assert done.exit_code == 1
    assert json.loads(done.stdout)["status"] == "nothing_found"


def test_pool_writes_tables_and_the_page_of_what_is_known(catalog, tmp_path):
    done = call("pool", catalog, "--by", "joint", "--by", "timing_point", "--out",
                tmp_path / "known", "--json")  # fmt: skip

    assert done.exit_code == 0
    files = {p.name for p in (tmp_path / "known").iterdir()}
    assert files == {"pooled.csv", "studies.csv", "printed.csv", "coverage.html", "provenance.json"}
