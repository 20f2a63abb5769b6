"""``catalog.parquet``: written by pyarrow, queried by DuckDB (extra ``scale``)."""

import glob
import json
import math
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import pandas as pd

from jointz.collections.catalog_columns import CATALOG_COLUMNS, CATALOG_SCHEMA
from jointz.collections.catalog_query import CatalogFilter
from jointz.core.errors import DataError
from jointz.core.whole_file import whole_file
from jointz.io.formats.memory_limit import check_unpacked
from jointz.io.formats.parquet_format import declared_bytes

#: Name of the file in a collection's folder.
CATALOG_FILE = "catalog.parquet"
#: Marks, under ``of``, a catalog of results folders instead of a collection's entries.
RESULTS = "results"
_KEY = b"jointz"
_SORTED_BY = ["values", "joint", "parameter", "timing_point", "entry", "condition", "participant"]
#: A query skips groups whose smallest and largest values do not fit: small groups are best.
_ROWS_PER_GROUP = 8_192
_EXACT = ("joint", "parameter", "condition", "activity", "method", "entry")


def require_scale() -> tuple[Any, Any]:
    """Return the modules ``duckdb`` and ``pyarrow``."""
    try:
        import duckdb
        import pyarrow as pa
        import pyarrow.parquet
    except ImportError as exc:
        raise DataError(
            f"catalogs need {exc.name}, which is not installed. Install it: "
            'pip install "jointz[scale]".'
        ) from exc
    return duckdb, pa


def write_catalog(table: pd.DataFrame, file: Path, about: Mapping[str, Any]) -> None:
    """Write a catalog whole or not at all."""
    _, arrow = require_scale()
    text = arrow.dictionary(arrow.int32(), arrow.string())
    kinds = {"text": text, "number": arrow.float64()}
    fields = [arrow.field(name, kinds[kind]) for name, kind in CATALOG_COLUMNS.items()]
    metadata = json.dumps({"schema": CATALOG_SCHEMA, **about}, allow_nan=False)
    schema = arrow.schema(fields, metadata={_KEY: metadata.encode()})
    # Sorting makes runs of equal values, which pack well and let a query skip groups.
    rows = table.sort_values(_SORTED_BY, kind="stable", ignore_index=True)
    packed = arrow.Table.from_pandas(rows[list(CATALOG_COLUMNS)], schema, preserve_index=False)
    with whole_file(file, "Make room, or name a file in an existing folder.") as partial:
        arrow.parquet.write_table(
            packed.replace_schema_metadata(schema.metadata), partial,
            compression="zstd", row_group_size=_ROWS_PER_GROUP,
        )  # fmt: skip


def catalog_about(file: Path) -> dict[str, Any]:
    """Return the metadata of a catalog."""
    _, arrow = require_scale()
    if not file.is_file():
        raise DataError(
            f"{file}: does not exist. Name a catalog that jointz collect build or results made.",
            path=str(file),
        )
    try:
        schema, metadata = arrow.parquet.read_schema(file), arrow.parquet.read_metadata(file)
        about = json.loads((schema.metadata or {})[_KEY])
    except (arrow.ArrowException, OSError, KeyError, ValueError) as exc:
        raise _no_catalog(file, "none, or damaged") from exc
    check_unpacked(file, declared_bytes(metadata))
    if about.get("schema") != CATALOG_SCHEMA:
        raise _no_catalog(file, f"schema {about.get('schema')!r}")
    if lacking := [name for name in CATALOG_COLUMNS if name not in schema.names]:
        raise _no_catalog(file, f"none of the columns {', '.join(lacking)}")
    return dict(about)


@cache  # opening one takes longer than most queries
def _database() -> Any:
    duckdb, _ = require_scale()
    # For a few hundred thousand rows threads wait for each other more than they read.
    database = duckdb.connect(config={"threads": 1})
    database.execute("SET parquet_metadata_cache = true")
    return database


def read_catalog(file: Path, where: CatalogFilter) -> tuple[pd.DataFrame, int]:
    """Return matching rows of a catalog, and how many a range of phases leaves out unseen."""
    # Rows come in the file's order, which is sorted. One query takes less time than two.
    rows = _query(file, "SELECT *", where, or_without_onset=True)
    if where.phase_pct is None:
        return rows, 0
    has_onset = rows["onset_gait_pct"].notna()
    return rows[has_onset].reset_index(drop=True), int((~has_onset).sum())


def count_rows(file: Path, where: CatalogFilter) -> int:
    """Return the number of matching rows of a catalog."""
    return int(_query(file, "SELECT count(*) AS n", where)["n"].iloc[0])


def _query(
    file: Path, select: str, where: CatalogFilter, *, or_without_onset: bool = False
) -> pd.DataFrame:
    duckdb, _ = require_scale()
    conditions, values = _conditions(where, or_without_onset=or_without_onset)
    # All values are parameters of the query; a bracket in a folder's name is no pattern.
    query = f"{select} FROM read_parquet(?) WHERE {' AND '.join(conditions)}"
    try:
        with _database().cursor() as connection:
            result = connection.sql(query, params=[glob.escape(str(file)), *values])
            table: pd.DataFrame = result.to_arrow_table().to_pandas()
    except duckdb.Error as exc:
        raise _no_catalog(file, str(exc).partition("\n")[0]) from exc
    return table


def _conditions(where: CatalogFilter, *, or_without_onset: bool) -> tuple[list[str], list[Any]]:
    """Return the conditions of a query, with a ? for each value."""
    conditions: list[str] = ['"values" = ?']
    values: list[Any] = [where.kind]
    for column in _EXACT:
        if names := getattr(where, column):
            conditions.append(f"{column} IN ({', '.join('?' * len(names))})")
            values += names
    if where.speed_m_s is not None:
        conditions.append("walking_speed_m_s BETWEEN ? AND ?")
        values += where.speed_m_s
    if where.phase_pct is not None:
        low, high = where.phase_pct
        joined = "AND" if low <= high else "OR"  # around heel strike
        without = " OR onset_gait_pct IS NULL" if or_without_onset else ""
        conditions.append(f"(onset_gait_pct >= ? {joined} onset_gait_pct <= ?{without})")
        values += [low, high]
    if where.standing:
        conditions.append("status IN ('ok', 'at_bound')")
    return conditions, values


def check_filter(where: CatalogFilter) -> None:
    """Refuse a filter with an impossible range."""
    for name, pair in (("phase", where.phase_pct), ("speed", where.speed_m_s)):
        if pair is not None and not all(map(math.isfinite, pair)):
            raise DataError(f"{name}: expected two numbers, found {pair[0]} and {pair[1]}.")
    if where.speed_m_s is not None and where.speed_m_s[0] > where.speed_m_s[1]:
        low, high = where.speed_m_s
        raise DataError(f"speed: expected the lower value first, found {low:g} and {high:g} m/s.")
    if where.phase_pct is not None and not all(0 <= pct <= 100 for pct in where.phase_pct):
        low, high = where.phase_pct
        raise DataError(f"phase: expected 0 to 100 % of the cycle, found {low:g} and {high:g}.")


def _no_catalog(file: Path, found: str) -> DataError:
    return DataError(
        f"{file}: expected a catalog of jointz collect build; found {found}. Build it again.",
        path=str(file),
    )
