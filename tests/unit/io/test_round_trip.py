"""Properties of csv of other programs: read exactly, and damage never crashes."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from packaging.version import Version

from jointz.core.errors import DataError
from jointz.core.study import FilesSpec
from jointz.io.formats.registry import list_columns, read_table

Table = dict[str, np.ndarray]
PLAIN = FilesSpec()
ROWS = "".join(f"{i * 0.001:.3f},{i * 0.5:.2f},{-i:.3f}\n" for i in range(12))
CSV = f"time_s,angle_deg,torque_nm\n{ROWS}".encode()
SAMPLES = st.floats(allow_nan=True, allow_infinity=True, width=64)
in_tmp_path = settings(
    deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40
)


@st.composite
def tables(draw: st.DrawFn) -> Table:
    """1 to 4 columns of one length, 2 to 20 samples, any float."""
    names = draw(st.lists(st.sampled_from("abcdef"), min_size=1, max_size=4, unique=True))
    n = draw(st.integers(2, 20))
    column = st.lists(SAMPLES, min_size=n, max_size=n).map(np.array)
    return {name: draw(column) for name in names}


@st.composite
def damaged(draw: st.DrawFn, content: bytes) -> bytes:
    """The content after 1 to 4 truncations, flips and insertions."""
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, len(content)))
        kind = draw(st.sampled_from(["truncate", "flip", "insert"]))
        if kind == "truncate":
            content = content[:at]
        elif kind == "flip":
            content = content[:at] + bytes([draw(st.integers(0, 255))]) + content[at + 1 :]
        else:
            piece = draw(st.sampled_from([b"\n", b"\r", b",", b'"', b"\x00", b";", b" "]))
            content = content[:at] + piece + content[at:]
    return content


@pytest.mark.parametrize("name", ["a.csv", "a.csv.gz"])
@given(table=tables())
@in_tmp_path
def test_numbers_of_another_program_are_read_exactly(
    tmp_path: Path, name: str, table: Table
) -> None:
    path = tmp_path / name
    pd.DataFrame(table).map(repr).to_csv(path, index=False)
    back = read_table(path, numeric=list(table), files=PLAIN).columns
    # Before 3.1 pandas reads text to within one unit in the last place.
    exact = Version(pd.__version__) >= Version("3.1")
    for column, values in table.items():
        np.testing.assert_allclose(back[column], values, rtol=0 if exact else 5e-16, atol=0)


@given(content=damaged(CSV), labels=st.booleans(), header=st.booleans())
@settings(in_tmp_path, max_examples=150)
def test_a_damaged_csv_is_read_or_refused(tmp_path, content, labels, header):
    path = tmp_path / "a.csv"
    path.write_bytes(content)
    files = FilesSpec(header=header)
    columns = ["time_s", "angle_deg", "torque_nm"] if header else [1, 2, 3]
    try:
        list_columns(path, files)
        table = read_table(
            path, numeric=columns[:2], labels=columns[2:] if labels else (), files=files
        )
    except DataError:
        return
    assert len({len(values) for values in table.columns.values()}) == 1
