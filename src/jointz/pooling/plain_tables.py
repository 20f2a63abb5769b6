"""Tables of results: typed columns, to and from JSON."""

import math
from collections.abc import Iterable, Mapping
from typing import Any, Literal

import pandas as pd

#: ``text``: objects, empty where there is none; ``number``: floats, NaN where there is none;
#: ``count``: whole numbers.
Kind = Literal["text", "number", "count"]


def typed_table(
    rows: Iterable[Mapping[Any, Any]] | pd.DataFrame, kinds: Mapping[str, Kind]
) -> pd.DataFrame:
    """Return rows as a table with typed columns, also without rows."""
    table = rows if isinstance(rows, pd.DataFrame) else pd.DataFrame(list(rows))
    columns = {name: _typed(table.get(name), kind, table.index) for name, kind in kinds.items()}
    return pd.DataFrame(columns, index=table.index).reset_index(drop=True)


def _typed(column: pd.Series | None, kind: Kind, index: pd.Index) -> pd.Series:
    if kind == "text":
        text = pd.Series("", index, dtype=object) if column is None else column.astype(object)
        return text.where(text.notna(), "")
    number = pd.Series(float("nan"), index) if column is None else column.astype(float)
    return number.fillna(0.0).astype("int64") if kind == "count" else number


def plain_rows(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return a table's rows as plain values for JSON, None for missing ones.

    JSON has no infinite number: such a one is the text ``inf`` or ``-inf``, which
    :func:`typed_table` reads as the number again.
    """
    rows = table.astype(object).where(table.notna(), None).to_dict("records")
    return [{str(name): _plain(value) for name, value in row.items()} for row in rows]


def _plain(value: Any) -> Any:
    return str(value) if isinstance(value, float) and math.isinf(value) else value
