"""``jointz collect pool``: a catalog's rows pooled, and written with the page of what is known."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd

from jointz.analysis.results_folder import MARKER, new_folder, write_marker
from jointz.collections.catalog import catalog_file, query_catalog
from jointz.collections.catalog_file import CATALOG_FILE, RESULTS, catalog_about
from jointz.collections.catalog_query import CatalogFilter, without_onset_told
from jointz.collections.coverage_page import CoverageTables, render_coverage
from jointz.collections.pool import RULES, pool_catalog
from jointz.collections.pool_result import DEFAULT_BY, CollectionPool
from jointz.collections.reanalysis import (
    Progress,
    RawStudy,
    checked_method,
    reanalysed,
)
from jointz.core.errors import DataError
from jointz.core.provenance import now, own_version
from jointz.io.formats.columns import file_sha256

#: What the marker of the folder says that it holds.
POOL = "pool"
PAGE = "coverage.html"


@dataclass(frozen=True, slots=True)
class PoolRules:
    """How rows are pooled."""

    by: tuple[str, ...] = DEFAULT_BY  # what places are told apart by
    mix_methods: bool = False  # as :func:`~jointz.collections.pool.pool_catalog` has them
    with_printed: bool = False
    jointly: bool = False
    reanalyse: str = ""  # method by which raw data are analysed again; empty: estimates as they are

    def told(self) -> dict[str, Any]:
        """Return what differs from what is done by default, as plain values; always ``by``."""
        given = {name: value for name, value in asdict(self).items() if value}
        return given | {"by": list(self.by)}


def pool_collection(
    catalog: Path,
    *,
    where: CatalogFilter,
    rules: PoolRules,
    progress: Progress | None = None,
) -> CollectionPool:
    """Pool the rows of a catalog that a filter asks for, estimates and printed values apart."""
    file = catalog_file(catalog)
    about = catalog_about(file)
    if about.get("of") == RESULTS:
        raise DataError(
            f"{catalog}: a catalog of results folders. Who was in them, at which speed, nobody "
            "said: make an entry of each that is to be pooled (jointz collect entry)."
        )
    notes: tuple[str, ...] = ()
    if rules.reanalyse:
        checked_method(rules.reanalyse)
        # Who has no onset by the entry's method may have one by this one.
        rows, _ = _found(catalog, replace(where, phase_pct=None))
        rows, notes = reanalysed(
            rows, rules.reanalyse, collection=file.parent.resolve() / about["collection"],
            raw=_raw_studies(about), phase_pct=where.phase_pct, progress=progress,
        )  # fmt: skip
        if rows.empty:
            raise DataError(" ".join([f"{catalog}: nothing is left to pool.", *notes]))
    else:
        rows, without = _found(catalog, where)
        notes = (without_onset_told(without),) if without else ()
    pooled = pool_catalog(
        rows, by=rules.by, mix_methods=rules.mix_methods, with_printed=rules.with_printed,
        jointly=rules.jointly,
    )  # fmt: skip
    asked = where.told() | rules.told()
    return replace(pooled, notes=(*pooled.notes, *notes), asked=asked)


def _found(catalog: Path, where: CatalogFilter) -> tuple[pd.DataFrame, int]:
    """Return estimates and printed values, and how many have no onset for the phases asked for."""
    both = [query_catalog(catalog, replace(where, kind=kind)) for kind in ("estimates", "printed")]
    tables = [one.table for one in both]
    rows = pd.concat([table for table in tables if len(table)] or tables, ignore_index=True)
    if rows.empty:
        raise DataError(f"{catalog}: no row is what is asked for. Ask for less.")
    return rows, sum(one.without_onset for one in both)


def _raw_studies(about: Mapping[str, Any]) -> dict[str, RawStudy]:
    return {
        name: RawStudy(tuple(entry["conditions"]), entry["raw_sha256"])
        for name, entry in about["entries"].items()
    }


def write_pool(pool: CollectionPool, catalog: Path, out: Path, *, overwrite: bool = False) -> Path:
    """Write what was pooled: tables, and the page of what is known."""
    file = catalog_file(catalog)
    used = {*pool.studies["study"], *pool.printed["study"]}
    cited = [one for one in _citations(file) if one["study"] in used]
    if len(cited) < len(used):
        raise DataError(f"{file}: was built anew while it was pooled. Pool again.", path=str(file))
    tables = {"pooled": pool.table, "studies": pool.studies, "printed": pool.printed}
    provenance = {"jointz": own_version(), "created": now(), f"{CATALOG_FILE} SHA-256":
                  file_sha256(file)}  # fmt: skip
    page = render_coverage(
        CoverageTables(pool.table, pool.studies, pool.printed, pool.by),
        citations=cited,
        asked=pool.asked,
        rules=RULES,
        notes=pool.notes,
        provenance=provenance,
    )
    with new_folder(out, marker=MARKER, overwrite=overwrite, made_by=POOL) as folder:
        for name, table in tables.items():
            table.to_csv(folder / f"{name}.csv", index=False, float_format="%.10g")
        (folder / PAGE).write_text(page, encoding="utf-8")
        write_marker(folder, MARKER, _marked(pool, provenance))
    return out / PAGE


def _marked(pool: CollectionPool, provenance: Mapping[str, str]) -> dict[str, Any]:
    asked, notes = dict(pool.asked), list(pool.notes)
    return {"made_by": POOL, **provenance, "asked": asked, "notes": notes}


def _citations(file: Path) -> list[dict[str, str]]:
    told = ("study", "cite", "licence", "consent")
    return [{key: e[key] for key in told} for e in catalog_about(file)["entries"].values()]
