"""``jointz collect pool``: pools the rows of a catalog, and writes tables and a page."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd

from jointz.collections.catalog import catalog_file, query_catalog
from jointz.collections.catalog_columns import CATALOG_COLUMNS
from jointz.collections.catalog_file import CATALOG_FILE, RESULTS, catalog_about
from jointz.collections.catalog_query import CatalogFilter, without_onset_note
from jointz.collections.coverage_page import render_coverage
from jointz.collections.pool import pool_catalog
from jointz.collections.pool_result import DEFAULT_BY, CollectionPool
from jointz.core.errors import DataError, EstimationError
from jointz.core.plain_tables import typed_table
from jointz.core.provenance import now, own_version
from jointz.io.formats.columns import file_sha256
from jointz.io.new_folder import MARKER, new_folder, write_marker
from jointz.results.base import plain
from jointz.results.estimates import COVARIANCE_COLUMNS, ESTIMATE_COLUMNS
from jointz.results.study_analysis import StudyAnalysis

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


#: Called with (number of entries done, number of entries, name of the next one).
Progress = Callable[[int, int, str], None]
_CELL = [*COVARIANCE_COLUMNS[:3], "session", "side"]
#: Columns that an entry has for its values, not for its people.
_OF_VALUES = {*ESTIMATE_COLUMNS, *COVARIANCE_COLUMNS, "sd", "n", "software"} - {"participant"}


@dataclass(frozen=True, slots=True)
class RawStudy:
    """Raw data of an entry, as a catalog describes them."""

    conditions: tuple[str, ...]  # all conditions of the entry, whatever the filter
    sha256: str = ""  # hash of ``study.toml`` as the entry states it; empty if it states none


def checked_method(method: str) -> str:
    """Return the name of a method, after checking that there is one."""
    from jointz.analysis.analyze import check_method

    try:
        return check_method(method)
    except ValueError as exc:
        raise DataError(f"reanalyse: {exc}") from exc


def reanalysed(
    rows: pd.DataFrame,
    method: str,
    *,
    collection: Path,
    raw: Mapping[str, RawStudy],
    phase_pct: tuple[float, float] | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Replace estimates by new ones of their raw data; rows without raw data are left out."""
    checked_method(method)
    parts, notes = [rows[rows["values"] == "printed"]], []
    estimates = rows[rows["values"] != "printed"]
    entries = list(estimates.groupby("entry", sort=True, observed=True))
    for done, (name, entry) in enumerate(entries):
        if progress:
            progress(done, len(entries), str(name))
        try:
            analysis = _analysed(entry, raw[str(name)], collection, method=method, seed=seed)
            missing = _missing_people(entry, analysis)
        except DataError as exc:
            notes.append(f"{name}: left out, {exc}")
            continue
        if missing:
            notes.append(f"{name}: left out {', '.join(missing)}: not in its raw data.")
        parts.append(_new_estimates(entry, analysis))
    table = pd.concat([typed_table(part, CATALOG_COLUMNS) for part in parts], ignore_index=True)
    if phase_pct is not None:
        table, without_onset = _in_phase(table, phase_pct)
        notes += [without_onset_note(without_onset)] if without_onset else []
    return table, tuple(notes)


def _analysed(
    entry: pd.DataFrame, raw: RawStudy, collection: Path, *, method: str, seed: int
) -> StudyAnalysis:
    """Analyse the raw data of an entry; errors state why this is impossible."""
    from jointz.analysis.analyze import analyze  # estimators are loaded where they are needed
    from jointz.io.study_reader import open_study

    folder = str(entry["raw_study"].iloc[0] or "")
    if not folder:
        raise DataError(f"it has no raw data to analyse by {method}.")
    if len(raw.conditions) > 1:
        raise DataError("its raw data do not show which recording is of which condition.")
    try:
        study = open_study(collection / folder)
        if raw.sha256 and study.sha256 != raw.sha256.lower():
            raise DataError(
                "study.toml is not the one of the entry: expected SHA-256 "
                f"{raw.sha256[:12]}..., found {study.sha256[:12]}..."
            )
        return analyze(study, method=method, seed=seed)
    except (ValueError, EstimationError, OSError) as exc:
        raise DataError(f"its raw data cannot be analysed: {exc}") from exc


def _missing_people(entry: pd.DataFrame, analysis: StudyAnalysis) -> list[str]:
    """Return the people of an entry who are not in its raw data; raise DataError if all are."""
    people = set(entry["participant"])
    missing = people - set(analysis.to_frame()["participant"])
    if missing == people:
        raise DataError(
            "its raw data hold none of the entry's people. Give these the ids of study.toml."
        )
    return sorted(missing)


def _new_estimates(entry: pd.DataFrame, analysis: StudyAnalysis) -> pd.DataFrame:
    """Return the estimates of the entry's people and parameters."""
    people = entry.drop_duplicates("participant").set_index("participant")
    estimates = analysis.to_frame()
    wanted = estimates["participant"].isin(people.index)
    wanted &= estimates["parameter"].isin(set(entry["parameter"]))
    rows = estimates[wanted].merge(analysis.covariance_frame(), on=_CELL, how="left")
    people = people.loc[rows["participant"]].reset_index(drop=True)
    side = rows["side"].where(rows["side"] != "", people["side"].astype(object))
    about = [c for c in CATALOG_COLUMNS if c not in _OF_VALUES and c != "participant"]
    rows = pd.concat([rows, people[about]], axis=1)
    return rows.assign(side=side, software=f"jointz {own_version()}", n=1.0)


def _in_phase(rows: pd.DataFrame, phase_pct: tuple[float, float]) -> tuple[pd.DataFrame, int]:
    """Return the rows with an onset in a range, and the number of rows without an onset."""
    low, high = phase_pct
    onset = rows["onset_gait_pct"]
    late, early = onset >= low, onset <= high
    inside = late & early if low <= high else late | early
    return rows[inside].reset_index(drop=True), int(onset.isna().sum())
