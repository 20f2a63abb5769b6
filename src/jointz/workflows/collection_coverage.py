"""``jointz collect pool``: a catalog's rows pooled, and written with the page of what is known."""

from dataclasses import dataclass, replace
from pathlib import Path

import pandas as pd

from jointz.core.catalog_query import CatalogFilter
from jointz.core.collection_pool import DEFAULT_BY, CollectionPool
from jointz.core.errors import DataError
from jointz.core.provenance import now, own_version
from jointz.io.collection_catalog import CATALOG_FILE, RESULTS, catalog_about
from jointz.io.registry import file_sha256
from jointz.report.coverage_page import CoverageTables, render_coverage
from jointz.workflows.collection import catalog_file, query_catalog
from jointz.workflows.collection_pool import RULES, pool_catalog
from jointz.workflows.collection_reanalysis import Progress, reanalysed
from jointz.workflows.results_folder import MARKER, new_folder, write_marker

#: What the marker of the folder says that it holds.
POOL = "pool"
PAGE = "coverage.html"


@dataclass(frozen=True, slots=True)
class PoolRules:
    """How rows are pooled.

    Parameters
    ----------
    by : tuple of str
        What places are told apart by.
    mix_methods, with_printed, jointly : bool
        As :func:`~jointz.workflows.collection_pool.pool_catalog` has them.
    reanalyse : str
        Method by which raw data are analysed again; empty: estimates as they are.
    """

    by: tuple[str, ...] = DEFAULT_BY
    mix_methods: bool = False
    with_printed: bool = False
    jointly: bool = False
    reanalyse: str = ""


def pool_collection(
    catalog: Path,
    *,
    where: CatalogFilter,
    rules: PoolRules,
    progress: Progress | None = None,
) -> CollectionPool:
    """Pool the rows of a catalog that a filter asks for, estimates and printed values apart.

    Parameters
    ----------
    catalog : pathlib.Path
        The file, or the collection's folder.
    where : CatalogFilter
        What is wanted; its ``kind`` does not matter.
    rules : PoolRules
        How.
    progress : callable, optional
        Called with (entries analysed again, of how many, what comes next).

    Raises
    ------
    DataError
        When there is no catalog, nothing is found, or it cannot be pooled so.
    """
    if catalog_about(catalog_file(catalog)).get("of") == RESULTS:
        raise DataError(
            f"{catalog}: a catalog of results folders. Who was in them, at which speed, nobody "
            "said: make an entry of each that is to be pooled (jointz collect entry)."
        )
    both = [
        query_catalog(catalog, replace(where, kind=kind)).table for kind in ("estimates", "printed")
    ]
    rows = pd.concat([table for table in both if len(table)] or both, ignore_index=True)
    if rows.empty:
        raise DataError(f"{catalog}: no row is what is asked for. Ask for less.")
    notes: tuple[str, ...] = ()
    if rules.reanalyse:
        collection = catalog_file(catalog).parent
        rows, notes = reanalysed(rows, rules.reanalyse, collection=collection, progress=progress)
    pooled = pool_catalog(
        rows, by=rules.by, mix_methods=rules.mix_methods, with_printed=rules.with_printed,
        jointly=rules.jointly,
    )  # fmt: skip
    return replace(pooled, notes=(*pooled.notes, *notes))


def write_pool(pool: CollectionPool, catalog: Path, out: Path, *, overwrite: bool = False) -> Path:
    """Write what was pooled: tables, and the page of what is known.

    Parameters
    ----------
    pool : CollectionPool
        What was pooled.
    catalog : pathlib.Path
        The file, or the collection's folder, for the citations.
    out : pathlib.Path
        The folder to make.
    overwrite : bool
        Replace such a folder.

    Returns
    -------
    pathlib.Path
        The page.

    Raises
    ------
    DataError
        When the catalog is another by now.
    OutputError
        When the folder must be kept or cannot be written.
    """
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
        rules=RULES,
        notes=pool.notes,
        provenance=provenance,
    )
    with new_folder(out, marker=MARKER, overwrite=overwrite, made_by=POOL) as folder:
        for name, table in tables.items():
            table.to_csv(folder / f"{name}.csv", index=False, float_format="%.10g")
        (folder / PAGE).write_text(page, encoding="utf-8")
        write_marker(folder, MARKER, {"made_by": POOL, **provenance, "notes": list(pool.notes)})
    return out / PAGE


def _citations(file: Path) -> list[dict[str, str]]:
    told = ("study", "cite", "licence")
    return [{key: e[key] for key in told} for e in catalog_about(file)["entries"].values()]
