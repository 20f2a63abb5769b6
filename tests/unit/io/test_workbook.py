"""Workbooks as laboratories record into them, and the addresses of what is wrong in them."""

import datetime as dt
import re
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from jointz.core.acquisition import Acquisition
from jointz.core.errors import DataError
from jointz.io.formats.registry import read_acquisition

openpyxl = pytest.importorskip("openpyxl")
Rows = list[list[Any]]
LAB: Rows = [
    ["Subject", "S01"],
    ["Body mass (kg)", 72.4],
    [],
    ["Time", "Knee angle", "Torque", "Phase"],
    ["s", "deg", "Nm", None],
    [0.00, 5.0, 1.5, "stance"],
    [0.01, 5.5, None, "stance"],
    [0.02, 6.0, 2.5, "swing"],
]


@pytest.fixture
def book(tmp_path: Path) -> Callable[..., Acquisition]:
    """Write sheets of rows, change the workbook, and read it."""

    def make(rows: Rows, change: Callable[[Any], object] = str) -> Acquisition:
        made = openpyxl.Workbook()
        made.active.title = "Trial 1"
        for row in rows:
            made.active.append(row)
        change(made)
        made.save(tmp_path / "lab.xlsx")
        return read_acquisition(tmp_path / "lab.xlsx")

    return make


def test_prose_names_units_and_samples_are_told_apart(book):
    content = book(LAB)

    (group,) = content.groups
    assert group.name == "Trial 1"
    np.testing.assert_array_equal(group.time_s, [0.0, 0.01, 0.02])
    names = [(s.name, s.unit) for s in group.signals]
    assert names == [("Knee angle", "deg"), ("Torque", "Nm"), ("Phase", "")]
    np.testing.assert_array_equal(group.signals[1].values, [1.5, np.nan, 2.5])
    assert group.signals[2].values.tolist() == ["stance", "stance", "swing"]
    assert content.metadata["Trial 1.row 1"] == "Subject | S01"
    assert content.metadata["Trial 1.row 2"] == "Body mass (kg) | 72.4"
    assert content.metadata["time.column.Trial 1"] == "Time"


def test_pairs_of_time_and_value_make_groups_of_their_own(book):
    rows = [
        ["Time [s]", "Angle", None, "Time [s]", "Torque"],
        [0.0, 1.0, None, 0.00, 10.0],
        [0.1, 2.0, None, 0.05, 11.0],
        [None, None, None, 0.10, 12.0],
    ]
    content = book(rows)

    assert [g.name for g in content.groups] == ["Trial 1!A", "Trial 1!D"]
    assert [g.n_samples for g in content.groups] == [2, 3]
    np.testing.assert_array_equal(content.groups[1].time_s, [0.0, 0.05, 0.1])
    assert [s.name for g in content.groups for s in g.signals] == ["Angle", "Torque"]


def test_a_column_that_ends_early_is_aligned_by_time(book):
    (group,) = book([["Time [s]", "a", "b"], [0, 1, 2], [1, 3, 4], [2, 5, None]]).groups

    np.testing.assert_array_equal(group.signals[1].values, [2, 4, np.nan])


def test_names_under_merged_heads(book):
    def merge(made):
        made.active.merge_cells("B1:C1")
        made.active.merge_cells("D1:E1")

    rows = [
        [None, "Left", None, "Right", None],
        ["Time [s]", "Knee", "Hip", "Knee", "Hip"],
        [0, 1, 2, 3, 4],
        [1, 5, 6, 7, 8],
    ]
    (group,) = book(rows, merge).groups

    assert [s.name for s in group.signals] == ["Left Knee", "Left Hip", "Right Knee", "Right Hip"]


def test_dates_become_text_and_say_so(book):
    day = dt.datetime(2024, 5, 1, 12, 30)  # noqa: DTZ001 - a workbook has no time zones
    (group,) = book([["When", "x"], [day, 1.0], [day, 2.0]]).groups

    assert group.signals[0].values[0] == "2024-05-01T12:30:00"
    assert "ISO 8601" in group.signals[0].description


def test_hidden_sheets_are_not_read_and_named(book):
    def hide(made):
        made.create_sheet("Old").append(["a"])
        made["Old"].sheet_state = "hidden"

    assert book(LAB, hide).metadata["reading.hidden_sheets"] == "not read: Old"


WRONG: list[tuple[str, Any, str, str]] = [
    ("C7", "2,5", "Trial 1!C7", "decimal comma"),
    ("C7", "bad", "Trial 1!C7", "found the text 'bad'"),
    ("C7", "12.5", "Trial 1!C7", "found the text '12.5'"),
    ("C7", dt.datetime(2024, 5, 1), "Trial 1!C7", "found the date"),  # noqa: DTZ001
    ("C7", "#DIV/0!", "Trial 1!C7", "of a formula"),
    ("C7", "=A7*2", "Trial 1!C7", "a formula without a value"),
    ("A7", None, "Trial 1!A7", "expected a time stamp"),
    ("B9", 3.0, "Trial 1!B9", "no time for it"),
    ("F7", 3.0, "Trial 1!F4", "Name the column"),
    ("C4", "Knee angle", "Trial 1!C4", "stands over column B too"),
]


@pytest.mark.parametrize(("cell", "value", "address", "words"), WRONG)
def test_what_cannot_be_told_is_named_by_its_address(book, cell, value, address, words):
    def spoil(made):
        made.active[cell] = value

    with pytest.raises(DataError) as caught:
        book(LAB, spoil)

    assert str(caught.value).startswith(f"lab.xlsx, {address}:")
    assert words in str(caught.value)


def test_a_torque_called_t_aligns_nothing(book):
    (group,) = book([["Frame", "T [Nm]", "Angle"], [1, 5.0, 1.0], [2, 4.0, 2.0]]).groups

    assert group.time_s is None
    assert [(s.name, s.unit) for s in group.signals][1] == ("T [Nm]", "Nm")
    with pytest.raises(DataError, match=r"Trial 1!C3: 'Angle' ends here"):
        book([["Frame", "T [Nm]", "Angle"], [1, 5.0, 1.0], [2, 4.0, None]])


TWO_CLOCKS: Rows = [
    ["Subject", "Time [s]", "Angle", "Time [ms]", "Torque"],
    ["S01", 0.0, 1.0, 0, 7.0],
    ["S01", 0.1, 2.0, 50, 8.0],
    ["S01", 0.2, 3.0, 100, 9.0],
]


def test_two_clocks_after_another_column_are_refused_unless_they_are_one(book):
    with pytest.raises(DataError, match=r"Trial 1!D1: 'Time \[ms\]' holds other times than 'Ti"):
        book(TWO_CLOCKS)

    (group,) = book([TWO_CLOCKS[0], *[[*r[:3], 1000 * r[1], r[4]] for r in TWO_CLOCKS[1:]]]).groups
    np.testing.assert_array_equal(group.time_s, [0.0, 0.1, 0.2])


def test_a_column_of_dates_is_no_clock(book):
    days = [dt.datetime(2024, 5, 1, 12, 0, k) for k in range(3)]  # noqa: DTZ001
    rows = [["Timestamp", "Time (s)", "Angle"], *[[d, k / 10, 1.0] for k, d in enumerate(days)]]

    for table in (rows, [["Trial", *rows[0]], *[[1, *row] for row in rows[1:]]]):
        (group,) = book(table).groups

        np.testing.assert_array_equal(group.time_s, [0.0, 0.1, 0.2])
        assert [s.name for s in group.signals][-2:] == ["Timestamp", "Angle"]


def test_units_half_of_which_are_known_are_units(book):
    (group,) = book([["Time", "Load cell"], ["s", "counts"], [0, 1], [1, 2]]).groups

    assert [(s.name, s.unit) for s in group.signals] == [("Load cell", "counts")]
    np.testing.assert_array_equal(group.time_s, [0.0, 1.0])


def test_names_that_look_like_units_of_names_above_are_refused(book):
    rows = [["Time", "Load", "Force"], ["s", "counts", "ticks"], [0, 1, 2], [1, 2, 3]]
    with pytest.raises(DataError, match=r"Trial 1!A1: two full rows of texts.*'Time' and 's'"):
        book(rows)

    assert book([["Subject", "S01"], ["Time [s]", "Load"], [0, 1], [1, 2]]).groups[0].n_samples == 2


def test_a_stray_cell_far_away_is_named_and_no_rectangle_is_made(book):
    def stray(made):
        made.active["XFD1048576"] = "?"

    with pytest.raises(DataError, match=r"lab\.xlsx, Trial 1!XFD1048576: cells are filled in as"):
        book(LAB, stray)


def test_cells_that_are_only_formatted_belong_to_no_table(book):
    def paint(made):
        made.active["XFD1048576"].number_format = "0.00"

    assert book(LAB, paint).groups[0].n_samples == 3


def test_a_number_beyond_all_is_refused_by_its_address(tmp_path):
    def huge(text):
        return text.replace(b"<v>2.5</v>", b"<v>" + b"9" * 400 + b"</v>")

    with pytest.raises(DataError, match=r"b\.xlsx, Trial 1!C8: the number is larger than any"):
        repacked(tmp_path, LAB, "Trial 1", huge)


def test_a_compression_that_is_none_is_damage(tmp_path):
    openpyxl.Workbook().save(tmp_path / "a.xlsx")
    raw = (tmp_path / "a.xlsx").read_bytes()
    for mark in (rb"(PK\x03\x04.{4})..", rb"(PK\x01\x02.{6}).."):
        raw = re.sub(mark, lambda found: found[1] + b"\x0e\x00", raw, flags=re.DOTALL)
    (tmp_path / "a.xlsx").write_bytes(raw)

    with pytest.raises(DataError, match=r"a\.xlsx: cannot be read as a \.xlsx file"):
        read_acquisition(tmp_path / "a.xlsx")


def repacked(tmp_path, rows, title, change):
    """Write a workbook, change the XML of its first sheet, and read it."""
    made = openpyxl.Workbook()
    made.active.title = title
    for row in rows:
        made.active.append(row)
    made.save(tmp_path / "a.xlsx")
    with (
        zipfile.ZipFile(tmp_path / "a.xlsx") as old,
        zipfile.ZipFile(tmp_path / "b.xlsx", "w") as new,
    ):
        for name in old.namelist():
            text = old.read(name)
            new.writestr(name, change(text) if name.endswith("sheet1.xml") else text)
    return read_acquisition(tmp_path / "b.xlsx")


def test_all_decimal_commas_are_refused_too(book):
    with pytest.raises(DataError, match=r"Trial 1!A2.*decimal comma"):
        book([["Time", "x"], ["0,00", "1,5"], ["0,01", "1,6"]])


def test_unequal_columns_without_time_are_refused(book):
    with pytest.raises(DataError, match=r"Trial 1!B3: 'b' ends here.*go on to row 4"):
        book([["a", "b"], [1, 2], [3, None], [4, None]])


def test_merged_samples_are_refused(book):
    with pytest.raises(DataError, match=r"Trial 1!B6: .*merged"):
        book(LAB, lambda made: made.active.merge_cells("B6:B7"))


def test_a_book_of_prose_is_refused(book):
    with pytest.raises(DataError, match=r"expected a row of names with numbers.*Trial 1"):
        book([["Hello"], ["World"]])


def test_formulas_that_a_spreadsheet_program_calculated_are_read_by_their_values(tmp_path):
    """A stored value stands beside the formula, as spreadsheet programs write it."""

    def calculate(text):
        return re.sub(rb"(<f>A(\d)\*2</f>)<v(?: /|></v)>", rb"\1<v>\2</v>", text)

    rows = [["x", "twice"], [1.0, "=A2*2"], [1.5, "=A3*2"]]
    (group,) = repacked(tmp_path, rows, "Trial 1", calculate).groups

    np.testing.assert_array_equal(group.signals[1].values, [2.0, 3.0])


def test_without_openpyxl_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    (tmp_path / "a.xlsx").write_bytes(b"")

    with pytest.raises(DataError, match=r'pip install "jointz\[formats\]"'):
        read_acquisition(tmp_path / "a.xlsx")
