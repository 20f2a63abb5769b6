"""``jointz collect pool``: pools the rows of a catalog, and writes tables and a page."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd

from jointz.analysis.results_folder import MARKER, new_folder, write_marker
from jointz.collections.catalog import catalog_file, query_catalog
from jointz.collections.catalog_file import CATALOG_FILE, RESULTS, catalog_about
from jointz.collections.catalog_query import CatalogFilter, without_onset_note
from jointz.collections.coverage_page import render_coverage
from jointz.collections.pool import pool_catalog
from jointz.collections.pool_result import DEFAULT_BY, CollectionPool
from jointz.collections.reanalysis import RawStudy, checked_method, reanalysed
from jointz.core.errors import DataError
from jointz.core.provenance import now, own_version
from jointz.io.formats.columns import file_sha256
from jointz.results.base import plain

#: Kind of the folder, as its marker states it.
POOL = "pool"
PAGE = "coverage.html"


@dataclass(frozen=True, slots=True)
class PoolRules:
    """Settings of pooling; most are those of :func:`~jointz.collections.pool.pool_catalog`."""

    by: tuple[str, ...] = DEFAULT_BY  # columns that distinguish places
    mix_methods: bool = False
    with_printed: bool = False
    jointly: bool = False
    reanalyse: str = ""  # method to analyse raw data by; empty: the entries' own estimates

    def settings(self) -> dict[str, Any]:
        """Return ``by`` and all settings that differ from the default, as plain values."""
        return {name: value for name, value in plain(self).items() if value or name == "by"}


def pool_collection(
    catalog: Path,
    *,
    where: CatalogFilter,
    rules: PoolRules,
    progress: Callable[[int, int, str], None] | None = None,
) -> CollectionPool:
    """Pool the rows of a catalog that match a filter, estimates and printed values apart."""
    file = catalog_file(catalog)
    about = catalog_about(file)
    if about.get("of") == RESULTS:
        raise DataError(
            f"{catalog}: a catalog of results folders, which do not say who the people were and "
            "how fast they walked. Make an entry of each that is to be pooled: jointz collect "
            "entry."
        )
    notes: tuple[str, ...] = ()
    if rules.reanalyse:
        checked_method(rules.reanalyse)
        # A failure by the entry's method may have an onset by the new one.
        rows, _ = _matching_rows(catalog, replace(where, phase_pct=None))
        raw = {
            name: RawStudy(tuple(entry["conditions"]), entry["raw_sha256"])
            for name, entry in about["entries"].items()
        }
        rows, notes = reanalysed(
            rows, rules.reanalyse, collection=file.parent.resolve() / about["collection"],
            raw=raw, phase_pct=where.phase_pct, progress=progress,
        )  # fmt: skip
        if rows.empty:
            raise DataError(" ".join([f"{catalog}: no row is left to pool.", *notes]))
    else:
        rows, without_onset = _matching_rows(catalog, where)
        notes = (without_onset_note(without_onset),) if without_onset else ()
    pooled = pool_catalog(
        rows, by=rules.by, mix_methods=rules.mix_methods, with_printed=rules.with_printed,
        jointly=rules.jointly,
    )  # fmt: skip
    asked = where.settings() | rules.settings()
    return replace(pooled, notes=(*pooled.notes, *notes), asked=asked)


def _matching_rows(catalog: Path, where: CatalogFilter) -> tuple[pd.DataFrame, int]:
    """Return estimates and printed values, and the number of rows without an onset."""
    both = [query_catalog(catalog, replace(where, kind=kind)) for kind in ("estimates", "printed")]
    tables = [result.table for result in both]
    rows = pd.concat([table for table in tables if len(table)] or tables, ignore_index=True)
    if rows.empty:
        raise DataError(f"{catalog}: no row matches the filters. Use fewer filters.")
    return rows, sum(result.without_onset for result in both)


def write_pool(pool: CollectionPool, catalog: Path, out: Path, *, overwrite: bool = False) -> Path:
    """Write the tables of a pool and its page."""
    file = catalog_file(catalog)
    studies = {*pool.studies["study"], *pool.printed["study"]}
    entries = catalog_about(file)["entries"].values()
    cited = [entry for entry in entries if entry["study"] in studies]
    if len(cited) < len(studies):
        raise DataError(f"{file}: was rebuilt while it was pooled. Pool again.", path=str(file))
    provenance = {"jointz": own_version(), "created": now(), f"{CATALOG_FILE} SHA-256":
                  file_sha256(file)}  # fmt: skip
    page = render_coverage(pool, citations=cited, provenance=provenance)
    tables = {"pooled": pool.table, "studies": pool.studies, "printed": pool.printed}
    with new_folder(out, marker=MARKER, overwrite=overwrite, made_by=POOL) as folder:
        for name, table in tables.items():
            table.to_csv(folder / f"{name}.csv", index=False, float_format="%.10g")
        (folder / PAGE).write_text(page, encoding="utf-8")
        settings = {"asked": dict(pool.asked), "notes": list(pool.notes)}
        write_marker(folder, MARKER, {"made_by": POOL, **provenance, **settings})
    return out / PAGE
