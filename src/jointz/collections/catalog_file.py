"""``catalog.parquet``: written through pyarrow, asked through DuckDB (extra ``scale``)."""

import glob
import json
import math
from collections.abc import Mapping, Sequence
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
#: Says, under ``of``, that a catalog is one of results folders, not of a collection's entries.
RESULTS = "results"
_KEY = b"jointz"
_SORTED_BY = ["values", "joint", "parameter", "timing_point", "entry", "condition", "participant"]
#: A query reads the groups whose smallest and largest values may fit: small ones leave more out.
_ROWS_PER_GROUP = 8_192
_EXACT = ("joint", "parameter", "condition", "activity", "method")


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
    told = json.dumps({"schema": CATALOG_SCHEMA, **about}, allow_nan=False)
    schema = arrow.schema(fields, metadata={_KEY: told.encode()})
    # A value that many conditions share makes runs, which pack well and let a query skip groups.
    rows = table.sort_values(_SORTED_BY, kind="stable", ignore_index=True)
    made = arrow.Table.from_pandas(rows[list(CATALOG_COLUMNS)], schema, preserve_index=False)
    todo = "Make room, or name a file in a folder that is there."
    with whole_file(file, todo) as partial:
        arrow.parquet.write_table(
            made.replace_schema_metadata(schema.metadata), partial,
            compression="zstd", row_group_size=_ROWS_PER_GROUP,
        )  # fmt: skip


def catalog_about(file: Path) -> dict[str, Any]:
    """Return what a catalog says of itself."""
    _, arrow = require_scale()
    if not file.is_file():
        raise DataError(
            f"{file}: is not there. Make it: jointz collect build {file.parent}", path=str(file)
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


@cache  # opening one takes longer than most questions
def _database() -> Any:
    duckdb, _ = require_scale()
    # For a few hundred thousand rows threads wait for each other more than they read.
    database = duckdb.connect(config={"threads": 1})
    database.execute("SET parquet_metadata_cache = true")
    return database


def read_catalog(file: Path, where: CatalogFilter) -> tuple[pd.DataFrame, int]:
    """Return the rows of a catalog that a filter asks for, and what phases leave out unseen."""
    # Rows come back in the file's order, which is sorted. One question takes less than two.
    found = _asked(file, "SELECT *", where, or_without_onset=True)
    if where.phase_pct is None:
        return found, 0
    told = found["onset_gait_pct"].notna()
    return found[told].reset_index(drop=True), int((~told).sum())


def count_rows(file: Path, where: CatalogFilter) -> int:
    """Return how many rows of a catalog a filter asks for."""
    return int(_asked(file, "SELECT count(*) AS n", where)["n"].iloc[0])


def _asked(
    file: Path, what: str, where: CatalogFilter, *, or_without_onset: bool = False
) -> pd.DataFrame:
    duckdb, _ = require_scale()
    conditions, values = _conditions(where, or_without_onset=or_without_onset)
    # What is asked for goes in as parameters only; a bracket in a folder's name is no pattern.
    query = f"{what} FROM read_parquet(?) WHERE {' AND '.join(conditions)}"
    try:
        with _database().cursor() as connection:
            found = connection.sql(query, params=[glob.escape(str(file)), *values])
            table: pd.DataFrame = found.to_arrow_table().to_pandas()
    except duckdb.Error as exc:
        raise _no_catalog(file, str(exc).partition("\n")[0]) from exc
    return table


def _conditions(where: CatalogFilter, *, or_without_onset: bool) -> tuple[list[str], list[Any]]:
    """Return the conditions of a query, with a ? for each value."""
    conditions: list[str] = ['"values" = ?']
    values: list[Any] = [where.kind]
    for column in _EXACT:
        _one_of(column, getattr(where, column), conditions, values)
    _one_of("entry", where.entry, conditions, values)
    if where.speed_m_s is not None:
        conditions.append("walking_speed_m_s BETWEEN ? AND ?")
        values += where.speed_m_s
    if where.phase_pct is not None:
        low, high = where.phase_pct
        joined = "AND" if low <= high else "OR"  # over heel strike
        without = " OR onset_gait_pct IS NULL" if or_without_onset else ""
        conditions.append(f"(onset_gait_pct >= ? {joined} onset_gait_pct <= ?{without})")
        values += [low, high]
    if where.standing:
        conditions.append("status IN ('ok', 'at_bound')")
    return conditions, values


def _one_of(column: str, wanted: Sequence[str], conditions: list[str], values: list[Any]) -> None:
    if wanted:
        conditions.append(f"{column} IN ({', '.join('?' * len(wanted))})")
        values += wanted


def check_filter(where: CatalogFilter) -> None:
    """Refuse a filter that cannot find anything."""
    for name, pair in (("phase", where.phase_pct), ("speed", where.speed_m_s)):
        if pair is not None and not all(map(math.isfinite, pair)):
            raise DataError(f"{name}: expected two numbers, found {pair[0]} and {pair[1]}.")
    if where.speed_m_s is not None and where.speed_m_s[0] > where.speed_m_s[1]:
        low, high = where.speed_m_s
        raise DataError(f"speed: expected the lower first, found {low:g} and {high:g} m/s.")
    if where.phase_pct is not None and not all(0 <= pct <= 100 for pct in where.phase_pct):
        low, high = where.phase_pct
        raise DataError(f"phase: expected 0 to 100 % of the cycle, found {low:g} and {high:g}.")


def _no_catalog(file: Path, found: str) -> DataError:
    return DataError(
        f"{file}: expected a catalog of jointz collect build; found {found}. Build it again.",
        path=str(file),
    )
