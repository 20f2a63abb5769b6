"""Layouts of text files as laboratories have them, found from their first lines."""

import gzip
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from jointz.core.errors import DataError
from jointz.io.formats.registry import read_table
from jointz.io.text.text_layout import find_layout

ROWS = [[0.0, 12.5, -3.25], [0.01, 12.75, -3.0], [0.02, 13.0, -2.75], [0.03, 13.5, -2.5]]
NAMES = ["time", "angle", "torque"]


def table(*, delimiter=",", decimal=".", head=(), names=NAMES, rows=ROWS) -> str:
    cells = [[str(v).replace(".", decimal) for v in row] for row in rows]
    lines = [delimiter.join(line) for line in [*([names] if names else []), *cells]]
    return "\n".join([*head, *lines]) + "\n"


def layout_of(folder: Path, text: str, name="a.csv", **known):
    (folder / name).write_text(text, encoding="utf-8")
    return find_layout(folder / name, known)


@pytest.mark.parametrize("delimiter", [",", ";", "\t", " ", "|"])
@pytest.mark.parametrize("decimal", [".", ","])
@pytest.mark.parametrize("n_head", [0, 1, 6])
def test_signs_and_lines_above_the_names_are_found(delimiter, decimal, n_head, tmp_path):
    if delimiter == decimal:
        pytest.skip("one sign for two things")
    head = ["Motion lab, trial 3", "", "operator; N.N.", "# rate 100", "x,y", "end of header"]
    text = table(delimiter=delimiter, decimal=decimal, head=head[:n_head])

    found = layout_of(tmp_path, text)

    files = found.files
    assert (files.delimiter, files.decimal, files.skip_rows) == (delimiter, decimal, n_head)
    assert found.columns == tuple(NAMES)
    read = read_table(tmp_path / "a.csv", numeric=NAMES, files=files)
    assert read.columns["torque"].tolist() == [row[2] for row in ROWS]


def test_without_names_columns_are_given_by_number(tmp_path):
    found = layout_of(tmp_path, table(names=None))

    assert not found.files.header
    assert found.columns == ("1", "2", "3")


@pytest.mark.parametrize("units", [["s", "deg", "Nm"], ["[s]", "[deg]", "[N*m]"], ["(s)", "", "V"]])
def test_a_row_of_units_is_told_from_names_and_numbers(units, tmp_path):
    text = table(head=[",".join(NAMES)], names=units)

    found = layout_of(tmp_path, text)

    assert found.names == tuple(NAMES)
    assert found.units == tuple(u.strip("[]()") for u in units)
    assert (found.files.skip_rows, found.files.header) == (2, False)


def test_a_column_without_a_name_does_not_make_the_file_unreadable(tmp_path):
    found = layout_of(tmp_path, table(names=NAMES[:2]))

    assert found.columns == ("1", "2", "3")
    assert found.names == ("time", "angle", "")


def test_one_name_for_two_columns_gives_numbers(tmp_path):
    found = layout_of(tmp_path, table(names=["time", "angle", "angle"]))

    assert found.columns == ("1", "2", "3")


def test_a_column_of_text_does_not_hide_the_table(tmp_path):
    text = "phase,angle,torque\n" + "".join(f"ENP,{k}.5,1.5\n" for k in range(5))

    assert layout_of(tmp_path, text).columns == ("phase", "angle", "torque")


def test_gzip_is_looked_into(tmp_path):
    (tmp_path / "a.csv.gz").write_bytes(gzip.compress(table(delimiter=";").encode()))

    assert find_layout(tmp_path / "a.csv.gz").files.delimiter == ";"


@pytest.mark.parametrize("width", [2, 3])
def test_lines_of_facts_above_are_not_the_table(width, tmp_path):
    facts = ["Mass;70", "Height;1.8", "Age;31"]
    rows = [row[:width] for row in ROWS]
    text = table(delimiter=";", head=facts, names=NAMES[:width], rows=rows)

    found = layout_of(tmp_path, text)

    assert (found.files.skip_rows, found.columns) == (3, tuple(NAMES[:width]))


def test_a_stray_text_in_the_first_row_does_not_make_it_the_names(tmp_path):
    rows = [[0.0, "#DIV/0!", -3.25], *ROWS[1:]]

    assert layout_of(tmp_path, table(rows=rows)).columns == tuple(NAMES)


@pytest.mark.parametrize(
    "known",
    [{"delimiter": ",", "decimal": ","}, {"delimiter": ";;"}, {"delimiter": "\\t"}],
)
def test_signs_that_are_none_are_refused(known, tmp_path):
    with pytest.raises(DataError, match=r"delimiter|ASCII"):
        layout_of(tmp_path, table(), **known)


def test_a_table_far_below_is_found_where_its_place_is_said(tmp_path):
    text = "prose of a long log\n" * 450 + table(delimiter=";")

    with pytest.raises(DataError, match="--skip-rows"):
        layout_of(tmp_path, text)

    found = layout_of(tmp_path, text, skip_rows=450)
    assert (found.columns, found.files.delimiter) == (tuple(NAMES), ";")


def test_what_is_known_is_kept(tmp_path):
    text = table(delimiter=";", decimal=",")

    found = layout_of(tmp_path, text, skip_rows=1, header=False)

    assert found.columns == ("1", "2", "3")
    assert found.files.decimal == ","


@pytest.mark.parametrize("header", [True, False])
def test_where_the_table_begins_is_found_where_it_is_not_said(header, tmp_path):
    head = ["# made by hand", "# 100 Hz, 3 columns"]
    text = table(head=head, names=NAMES if header else None)

    found = layout_of(tmp_path, text, header=header)

    assert (found.files.skip_rows, found.files.header) == (2, header)
    assert found.columns == (tuple(NAMES) if header else ("1", "2", "3"))


@pytest.mark.parametrize("text", ["only words\nand more\n", "\n\n\n"])
def test_no_table_is_an_error_that_says_what_to_give(text, tmp_path):
    with pytest.raises(DataError, match=r"a\.csv: .*--delimiter"):
        layout_of(tmp_path, text)


def test_an_empty_and_a_damaged_file_are_errors(tmp_path):
    with pytest.raises(DataError, match="is empty"):
        layout_of(tmp_path, "")
    (tmp_path / "b.csv.gz").write_bytes(gzip.compress(table().encode())[:20])
    with pytest.raises(DataError, match="cut off or damaged"):
        find_layout(tmp_path / "b.csv.gz")


KNOWN = st.fixed_dictionaries(
    {},
    optional={
        "delimiter": st.sampled_from([",", ";", "\t", " ", "|", ";;", "\\t", "", '"', "ä", "."]),
        "decimal": st.sampled_from([".", ","]),
        "skip_rows": st.integers(0, 12),
        "header": st.booleans(),
    },
)
LINES = st.lists(st.sampled_from(["t;a", "0;1,5", "0.5,2", "Mass;70", "", "x y", "1|2", "#"]))


@given(lines=LINES, known=KNOWN)
def test_whatever_is_said_ends_in_a_layout_or_an_error(tmp_path_factory, lines, known):
    file = tmp_path_factory.getbasetemp() / "known.csv"
    file.write_text("".join(f"{line}\n" for line in lines))

    try:
        found = find_layout(file, known)
    except DataError as exc:
        said, found = str(exc), None
    else:
        said = ""

    assert found is None or len(found.columns) == len(found.names)
    assert found is None or found.files.skip_rows >= known.get("skip_rows", 0)
    assert found is None or known.get("delimiter") in (None, "", found.files.delimiter)
    assert found is not None or "known.csv" in said or "delimiter" in said


@given(st.binary(max_size=300))
def test_any_bytes_end_in_a_layout_or_an_error(tmp_path_factory, content):
    file = tmp_path_factory.getbasetemp() / "any.csv"
    file.write_bytes(content)

    try:
        found = find_layout(file)
    except DataError as exc:
        said = str(exc)
    else:
        said = "any.csv" if len(found.columns) == len(found.names) > 0 else "no column"

    assert "any.csv" in said
