"""Reading delimited text: the fast path, and every way a file can be wrong."""

import gzip
import hashlib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pydantic import ValidationError

from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.io.formats.registry import list_columns, read_table
from jointz.io.text.text_layout import find_layout

PLAIN = FilesSpec()
HEAD = "time_s,angle_deg,torque_nm\n"
ROWS = "".join(f"{i * 0.001:.3f},{i * 0.5:.2f},{-i:.3f}\n" for i in range(12))


def write(tmp_path: Path, content: str | bytes, name: str = "S01.csv") -> Path:
    path = tmp_path / name
    raw = content.encode() if isinstance(content, str) else content
    path.write_bytes(gzip.compress(raw) if name.endswith(".gz") else raw)
    return path


def read(path: Path, *numeric: str | int, labels: tuple[str | int, ...] = (), **layout: object):
    return read_table(path, numeric=numeric, labels=labels, files=FilesSpec(**layout))


# --- what is read -----------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["a.csv", "a.csv.gz", "a.txt", "a.CSV"])
def test_columns_come_back_with_the_hash_of_the_file_on_disk(tmp_path, name):
    path = write(tmp_path, HEAD + ROWS, name)
    table = read(path, "torque_nm", "time_s")
    assert list(table.columns) == ["torque_nm", "time_s"]
    np.testing.assert_array_equal(table.columns["torque_nm"], -np.arange(12.0))
    assert table.columns["time_s"].dtype == np.float64
    assert table.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert (table.first_row, table.units) == (2, {})


def test_the_layout_of_a_continental_file_is_followed(tmp_path):
    path = write(tmp_path, 'Lab 5" pad\nsecond\nt;x\n0,5;-1,25e1\n1,0;\n')
    table = read(path, "t", "x", delimiter=";", decimal=",", skip_rows=2)
    np.testing.assert_array_equal(table.columns["x"], [-12.5, np.nan])
    np.testing.assert_array_equal(table.columns["t"], [0.5, 1.0])
    assert table.first_row == 4


@pytest.mark.parametrize("name", ["a.csv", "a.csv.gz"])
@pytest.mark.parametrize(
    ("written", "stated"),
    [
        ("cp1252", "cp1252"),
        ("mac_roman", "mac_roman"),
        ("utf-16", None),  # a byte order mark says it
        ("utf-16-le", "utf-16-le"),
        ("utf-8-sig", "cp1252"),  # the mark of the file counts
    ],
)
def test_a_text_is_read_in_its_encoding(tmp_path, written, stated, name):
    rows = "".join(f"{i};{i / 8};Süd\n" for i in range(3000))
    content = f"Zeit;Winkel [°];Ort\n{rows}".replace(".", ",").encode(written)
    path = write(tmp_path, content, name)
    layout = {"delimiter": ";", "decimal": ",", "encoding": stated}
    table = read(path, "Winkel [°]", labels=("Ort",), **layout)
    np.testing.assert_array_equal(table.columns["Winkel [°]"], np.arange(3000) / 8)
    assert set(table.columns["Ort"]) == {"Süd"}
    assert table.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert find_layout(path).files == FilesSpec(
        delimiter=";", decimal=",", encoding=None if written == "utf-8-sig" else stated or written
    )


@pytest.mark.parametrize("n_bytes", range(8186, 8200))
def test_recoding_keeps_its_place_whatever_the_length_of_the_head(tmp_path, n_bytes):
    head = "°" * (n_bytes - 4) + "\na;b\n"
    path = write(tmp_path, (head + "1;2\n3;4\n").encode("cp1252"))
    table = read(path, "a", delimiter=";", skip_rows=1, encoding="cp1252")
    np.testing.assert_array_equal(table.columns["a"], [1.0, 3.0])


def test_cells_that_a_study_calls_missing_are_missing(tmp_path):
    path = write(tmp_path, "a,b\n1,9999\n-,4\n n/a,5\n")
    table = read(path, "a", "b", missing=["9999", "-"])
    np.testing.assert_array_equal(table.columns["a"], [1.0, np.nan, np.nan])
    np.testing.assert_array_equal(table.columns["b"], [np.nan, 4.0, 5.0])


def test_an_encoding_that_nobody_knows_is_refused():
    for name in ("cp1253x", "rot13"):
        with pytest.raises(ValidationError, match="expected an encoding such as utf-8, cp1252"):
            FilesSpec(encoding=name)


@pytest.mark.parametrize("columns", [(1, 3), ("1", "3"), (0, 2)])
def test_without_a_header_columns_are_counted_from_one_unless_one_is_zero(tmp_path, columns):
    table = read(write(tmp_path, "1,2,3\n4,5,6\n"), *columns, header=False)
    np.testing.assert_array_equal(table.columns[str(columns[0])], [1, 4])
    np.testing.assert_array_equal(table.columns[str(columns[1])], [3, 6])
    assert table.first_row == 1


def test_a_number_takes_a_column_by_position_under_a_header_too(tmp_path):
    table = read(write(tmp_path, "x,x\n1,2\n"), 2)
    np.testing.assert_array_equal(table.columns["2"], [2])


def test_missing_cells_are_nan_and_infinity_stays(tmp_path):
    path = write(tmp_path, "t,x\n1,\n2,NaN\n3, nan\n4,NA\n5,inf\n6,-inf\n")
    expected = [np.nan, np.nan, np.nan, np.nan, np.inf, -np.inf]
    np.testing.assert_array_equal(read(path, "x").columns["x"], expected)


def test_labels_are_written_plainly(tmp_path):
    path = write(tmp_path, "t,a,b,c\n1,0,1.0,left\n2,,1.000000e+00, right \n3,2,1.5,True\n")
    table = read(path, "t", labels=("a", "b", "c"))
    assert table.columns["a"].tolist() == ["0", "", "2"]
    assert table.columns["b"].tolist() == ["1", "1", "1.5"]
    assert table.columns["c"].tolist() == ["left", "right", "True"]


def test_labels_of_a_file_that_stands_for_itself_are_as_written(tmp_path):
    path = write(tmp_path, "t,a,b\n1,1.0,NA\n2,1e3,nan\n3,,None\nNA,01, right \n5,1,")
    table = read_table(path, numeric=("t",), labels=("a", "b"), files=FilesSpec(), as_written=True)
    assert table.columns["a"].tolist() == ["1.0", "1e3", "", "01", "1"]
    assert table.columns["b"].tolist() == ["NA", "nan", "None", "right", ""]
    np.testing.assert_array_equal(table.columns["t"], [1.0, 2.0, 3.0, np.nan, 5.0])


@pytest.mark.parametrize(
    "content",
    [
        "\ufefft,x\n1,2\n3,4\n",
        "t,x\r\n1,2\r\n3,4\r\n",
        '"t","x"\n"1","2"\n3,4\n',
        "t, x\n1, 2\n3, 4\n",
        "t,x\n1,2\n3,4",
        "t,x\n1,2\n3,4\n\n\n",
        "t,x\n1,2\n3,4\n  \n",
        't,x,note\n1,2,"a, b"\n3,4,c\n',
    ],
    ids=["bom", "crlf", "quoted", "spaces", "no end", "empty end", "space end", "quoted comma"],
)
def test_harmless_spellings_are_read(tmp_path, content):
    table = read(write(tmp_path, content), "t", "x")
    np.testing.assert_array_equal(table.columns["t"], [1, 3])
    np.testing.assert_array_equal(table.columns["x"], [2, 4])


def test_a_byte_order_mark_before_numbers_is_no_part_of_them(tmp_path):
    table = read(write(tmp_path, "\ufeff1,2\n3,4\n"), 1, header=False)
    np.testing.assert_array_equal(table.columns["1"], [1, 3])


def test_an_empty_line_is_a_missing_sample_where_there_is_one_column(tmp_path):
    table = read(write(tmp_path, "x\n1\n\n3\n\n"), "x")
    np.testing.assert_array_equal(table.columns["x"], [1, np.nan, 3])


def test_a_file_longer_than_a_block_is_checked_across_blocks(tmp_path):
    n = 40_000
    rows = [f"{i},{i * 0.5:.3f},{i % 7}\n" for i in range(n)]
    good = read(write(tmp_path, "t,x,y\n" + "".join(rows)), "t", "x")
    np.testing.assert_array_equal(good.columns["t"], np.arange(n))
    rows[30_000] = "30000,1.000\n"
    rows[30_001] = "30001,1.000,2,3\n"  # as many delimiters as a good file
    with pytest.raises(DataError, match=r"row 30002: expected 3 values, found 2"):
        read(write(tmp_path, "t,x,y\n" + "".join(rows)), "t", "x")


# --- what is refused --------------------------------------------------------------------------

REFUSED = {
    "bad cell": ("t,x\n1,2\n2,abc\n", {}, "S01.csv, row 3, column 'x'"),
    "nothing": ("", {}, "empty"),
    "header only": ("t,x\n", {}, "only a header"),
    "short last row": ("t,x\n1,2\n3", {}, "row 3: .*cut off"),
    "short ended last row": ("t,x\n1,2\n3\n", {}, "row 3: .*cut off"),
    "empty last value": ("t,x\n1,2\n3,", {}, "row 3: .*cut off"),
    "short row": ("t,x\n1\n3,4\n", {}, "row 2: "),
    "empty row": ("t,x\n1,2\n\n3,4\n", {}, "row 3: "),
    "long row": ("t,x\n1,2\n3,4,5\n6,7\n", {}, "row 3: "),
    "long rows": ("t,x\n1,2,3\n4,5,6\n", {}, "row 2: "),
    "twice": ("t,x,x\n1,2,3\n", {}, "row 1: .*'x'"),
    "no header": ("0.1,2\n0.2,4\n", {}, r"row 1: .*\[files\] header = false"),
    "semicolons": ("t;x\n1;2\n", {}, r"\[files\] delimiter = \";\""),
    "tabs": ("t\tx\n1\t2\n", {}, r"\[files\] delimiter = \"\\t\""),
    "decimal comma": ("t;x\n1;2,5\n", {"delimiter": ";"}, r"row 2, column 'x'.* decimal = \",\""),
    "decimal point": ("t;x\n1;2.5\n", {"delimiter": ";", "decimal": ","}, r"decimal = \"\.\""),
    "two meanings": ("t;x\n1;2\n", {"decimal": ","}, "both delimiter and decimal"),
    "names without header": ("1,2\n", {"header": False}, "S01.csv"),
    "long delimiter": ("t::x\n1::2\n", {"delimiter": "::"}, "delimiter"),
    "old Mac": ("t,x\r1,2\r3,4\r", {}, "S01.csv"),
    "skipped all": ("t,x\n1,2\n", {"skip_rows": 5}, "skip_rows"),
    "quote left open": ('t,x\n1,"2\n3,4\n', {}, "row 3, column 'x'"),
}


@pytest.mark.parametrize(("content", "layout", "place"), REFUSED.values(), ids=REFUSED)
def test_a_wrong_file_is_refused_with_its_row_or_setting(tmp_path, content, layout, place):
    with pytest.raises(DataError, match=place):
        read(write(tmp_path, content), "t", "x", **layout)


@pytest.mark.parametrize("cut", [1, 2, 3, 4])
def test_a_last_number_shorter_than_all_before_is_a_cut(tmp_path, cut):
    content = (HEAD + ROWS)[: -1 - cut]  # ends with "-11.000" less one to four characters
    with pytest.raises(DataError, match=r"row 13: .*cut off"):
        read(write(tmp_path, content), "time_s")


def test_a_cut_exponent_is_a_cut(tmp_path):
    rows = "".join(f"{i},{i + 0.5:.6e}\n" for i in range(12))
    for end in (2, 3, 4):
        with pytest.raises(DataError, match="cut off"):
            read(write(tmp_path, "t,x\n" + rows[:-end]), "t", "x")


def test_numbers_of_free_length_may_end_an_unterminated_file(tmp_path):
    rows = "".join(f"{i},{i / 8}\n" for i in range(13))
    assert len(read(write(tmp_path, "t,x\n" + rows[:-1]), "x").columns["x"]) == 13


def test_a_gzip_stream_that_ends_early_is_a_cut(tmp_path):
    path = write(tmp_path, HEAD + ROWS * 200, "S01.csv.gz")
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(DataError, match=r"S01.csv.gz: .*cut off"):
        read(path, "time_s")
    path.write_bytes(b"t,x\n1,2\n")
    with pytest.raises(DataError, match="cut off or damaged"):
        list_columns(path, PLAIN)


def test_text_that_is_not_utf8_is_refused(tmp_path):
    for content in ("t,Winkel \xb0\n1,2\n", "t,x,n\n1,2,a\n3,4,\xe9\n"):
        path = write(tmp_path, content.encode("latin-1"))
        with pytest.raises(DataError, match="UTF-8"):
            read(path, "t", labels=("n",) if "n\n" in content else ())


def test_all_missing_columns_are_named_with_a_close_match(tmp_path):
    with pytest.raises(DataError, match=r"'torqe_nm', 'grf'.*'torque_nm' for 'torqe_nm'"):
        read(write(tmp_path, HEAD + ROWS), "torqe_nm", "grf", "time_s")


# --- real files -------------------------------------------------------------------------------


@pytest.mark.real_data
@pytest.mark.parametrize(
    ("name", "column", "n"),
    [
        ("reklab_ankle/z_df.csv.gz", None, 60_000),
        ("moore2015_walk/UnpertPre_data.csv", "time", 6001),
        ("winter_normal/winter_normal_tidy.csv", "gait_percent", 51),
        ("gaitanalysistoolkit/rawdata.txt", "% TimeStamp", 301),
    ],
)
def test_real_recordings_agree_with_pandas(real_data, name, column, n):
    tab = FilesSpec(delimiter="\t" if name.endswith(".txt") else None)
    path = real_data / name
    column = column or list_columns(path, tab)[0]
    table = read_table(path, numeric=[column], files=tab)
    expected = pd.read_csv(path, sep=tab.delimiter or ",")[column].to_numpy(float)
    np.testing.assert_array_equal(table.columns[column], expected)
    assert len(expected) == n
