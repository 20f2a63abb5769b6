"""Parquet: columns, units, and what is refused."""

import builtins
import hashlib

import numpy as np
import pytest

from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.io.formats.registry import list_columns, read_table

pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")
PLAIN = FilesSpec()


@pytest.fixture
def path(tmp_path):
    fields = [
        pa.field("t", pa.float64(), metadata={b"units": b"ms"}),
        pa.field("count", pa.int64()),
        pa.field("on", pa.bool_()),
        pa.field("trial", pa.float64()),
        pa.field("side", pa.dictionary(pa.int8(), pa.string())),
        pa.field("when", pa.timestamp("s")),
    ]
    side = pa.array(["left", None, "right"]).dictionary_encode().cast(fields[4].type)
    columns = [
        [0.5, None, 1.5],
        [1, None, 3],
        [True, False, True],
        [1.0, 2.0, None],
        side,
        [0, 1, 2],
    ]
    file = tmp_path / "a.parquet"
    pq.write_table(pa.table(columns, schema=pa.schema(fields)), file)
    return file


def test_columns_come_with_the_units_of_their_fields(path):
    table = read_table(path, numeric=["t", "count", "on"], labels=["side", "trial"], files=PLAIN)
    np.testing.assert_array_equal(table.columns["t"], [0.5, np.nan, 1.5])
    np.testing.assert_array_equal(table.columns["count"], [1, np.nan, 3])
    np.testing.assert_array_equal(table.columns["on"], [1, 0, 1])
    assert table.columns["side"].tolist() == ["left", "", "right"]
    assert table.columns["trial"].tolist() == ["1", "2", ""]
    assert table.units == {"t": "ms"}
    assert table.first_row == 1
    assert table.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.mark.parametrize(("column", "kind"), [("side", "text"), ("when", "dates")])
def test_what_is_no_number_is_refused(path, column, kind):
    with pytest.raises(DataError, match=f"column '{column}': .*{kind}"):
        read_table(path, numeric=[column], files=PLAIN)


def test_without_pyarrow_the_extra_is_named(path, monkeypatch):
    real = builtins.__import__

    def without_arrow(name, *args, **kwargs):
        if name.startswith("pyarrow"):
            raise ImportError(name)
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without_arrow)
    with pytest.raises(DataError, match=r'pip install "jointz\[parquet\]"'):
        list_columns(path, PLAIN)
