"""Collections of studies: entries to ``catalog.parquet``, and queries of it."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from jointz.collections.catalog_columns import CATALOG_COLUMNS
from jointz.collections.catalog_file import (
    CATALOG_FILE,
    catalog_about,
    check_filter,
    count_rows,
    read_catalog,
    require_scale,
    write_catalog,
)
from jointz.collections.catalog_query import CatalogFilter, QueryResult
from jointz.collections.checking.check_collection import (
    CheckedEntry,
    checked_entries,
    common_findings,
)
from jointz.collections.checking.covariance_checks import COLUMNS as COVARIANCES
from jointz.collections.checking.findings import CatalogBuild
from jointz.collections.entry_model import ENTRY_FILE, Entry
from jointz.collections.entry_reader import ConditionTables, EntryFolder
from jointz.core.errors import DataError
from jointz.core.gait_phases import ALL_POINTS
from jointz.core.method_names import FORMER_NAMES
from jointz.core.provenance import now, software
from jointz.core.study import Calibrated
from jointz.io.relative_paths import seen_from

_CELL = ["participant", "session", "side", "timing_point", "parameter"]


def build_catalog(folder: Path, *, out: Path | None = None) -> CatalogBuild:
    """Make the catalog of a collection out of all entries without problems.

    Parameters
    ----------
    folder : pathlib.Path
        The collection, with a folder for each entry.
    out : pathlib.Path, optional
        The file; by default ``catalog.parquet`` in the collection's folder. An existing file is
        replaced.

    Returns
    -------
    CatalogBuild
        The entries in the catalog, and those that were skipped with every reason. If no entry is
        without problems, ``entries`` is empty and nothing is written.

    Raises
    ------
    DataError
        If the folder does not exist or holds no entry, or the extra ``scale`` is not installed.
    WriteError
        If the system does not let the catalog be written.

    Notes
    -----
    An entry with a problem is left out whole. Of two entries with the same study, person or table,
    the later by the order of the folders is left out.
    Entries are read one after the other: reading and checking 50 of 200 people takes seconds.
    """
    require_scale()
    file = folder / CATALOG_FILE if out is None else out
    entries = checked_entries(folder)
    sound = [checked for checked in entries if not checked.findings]
    between = common_findings(sound)
    refused = {finding.entry for finding in between}
    kept = [checked for checked in sound if checked.name not in refused]
    skipped = [finding for checked in entries for finding in checked.findings] + between
    tables = [catalog_rows(checked) for checked in kept]
    if kept:
        collection = folder.resolve().parent if (folder / ENTRY_FILE).is_file() else folder
        about = {
            "collection": seen_from(collection, file.parent),
            "created": now(),
            "software": software(),
            "entries": {c.name: _entry_metadata(c.entry) for c in kept if c.entry},
            "skipped": list(map(str, skipped)),
        }
        write_catalog(pd.concat(tables, ignore_index=True), file, about)
    return CatalogBuild(
        str(file),
        tuple(checked.name for checked in kept),
        tuple(skipped),
        sum(map(len, tables)),
        sum(_n_people(checked.entry.spec) for checked in kept if checked.entry),
    )


def query_catalog(catalog: Path, where: CatalogFilter | None = None) -> QueryResult:
    """Return the rows of a catalog that match a filter.

    Parameters
    ----------
    catalog : pathlib.Path
        The file, or the collection's folder that holds it.
    where : CatalogFilter, optional
        The filter; by default all estimates.

    Returns
    -------
    QueryResult
        The rows, the number of matching rows of the other kind of values, and what to cite.

    Raises
    ------
    DataError
        If there is no catalog, it is damaged, a range is not valid, or the extra ``scale`` is not
        installed.
    """
    file = catalog_file(catalog)
    asked = where or CatalogFilter()
    check_filter(asked)
    about = catalog_about(file)  # refuses a file of another schema or of another program
    # Searching one column is faster than searching two of which either may hold a name.
    by_folder = replace(asked, entry=_folders(about["entries"], asked.entry))
    table, without_onset = read_catalog(file, by_folder)
    cited = table[["study", "cite"]].drop_duplicates().astype(str)
    cites = {study: cite for study, cite in cited.itertuples(index=False, name=None) if cite}
    other_kind = "printed" if asked.kind == "estimates" else "estimates"
    also = count_rows(file, replace(by_folder, kind=other_kind))
    return QueryResult(table, asked, also, cites, without_onset)


def _folders(entries: Mapping[str, Mapping[str, Any]], names: Sequence[str]) -> tuple[str, ...]:
    """Return the folders of entries that are named by their folder or by their study's id."""
    by_study = {
        name: [folder for folder, entry in entries.items() if entry["study"] == name]
        for name in names
    }
    return tuple(folder for name in names for folder in by_study[name] or [name])


def catalog_file(catalog: Path) -> Path:
    """Return the file of a catalog."""
    return catalog / CATALOG_FILE if catalog.is_dir() else catalog


def _n_people(spec: Entry) -> int:
    return len(spec.participants) or (spec.sample.n if spec.sample else 0)


def _entry_metadata(entry: EntryFolder) -> dict[str, Any]:
    spec = entry.spec
    return {
        "study": spec.study,
        "version": spec.version,
        "title": spec.title,
        "licence": spec.licence,
        "consent": spec.ethics.consent,
        "cite": spec.cite,
        "conditions": [condition.name for condition in spec.conditions],
        "raw_sha256": spec.raw_data.sha256,
        "sha256": entry.sha256,
        "hashes": dict(spec.hashes),
    }


# --- rows ----------------------------------------------------------------------------------------


def catalog_rows(checked: CheckedEntry) -> pd.DataFrame:
    """Return an entry in the columns of a catalog."""
    if checked.entry is None:
        raise DataError(f"{checked.name}: has problems. See jointz collect check.")
    parts = [_condition_rows(checked.entry, tables) for tables in checked.tables]
    return pd.concat(parts, ignore_index=True)


def _condition_rows(entry: EntryFolder, tables: ConditionTables) -> pd.DataFrame:
    spec, condition = entry.spec, tables.condition
    rows = tables.rows
    if spec.kind == "printed":
        rows = rows.assign(method=spec.method.name)
    else:
        rows = rows.assign(statistic="individual", source="", sd=np.nan, n=1.0)
    rows = with_covariance(rows, tables.covariance, spec.method.name)
    people = _described_people(spec, rows["participant"])
    raw = os.path.normpath(Path(entry.name) / spec.raw_data.study)  # from the collection's folder
    rows = rows.assign(
        **people.assign(side=rows["side"].where(rows["side"] != "", people["side"])),
        entry=entry.name, study=spec.study, version=spec.version, values=spec.kind,
        joint=spec.joint.name, positive=spec.joint.positive,
        condition=condition.name, activity=condition.activity,
        walking_speed_m_s=_number(condition.walking_speed_m_s),
        slope_deg=_number(condition.slope_deg), surface=condition.surface,
        software=f"{spec.software.name} {spec.software.version}",
        torque_gain_sd=_relative_sd(spec.calibration.torque_gain),
        angle_gain_sd=_relative_sd(spec.calibration.angle_gain),
        raw_study=raw if spec.raw_data.study else "",
        licence=spec.licence, consent=spec.ethics.consent, cite=spec.cite,
    )  # fmt: skip
    return in_catalog_columns(rows)


def in_catalog_columns(rows: pd.DataFrame) -> pd.DataFrame:
    """Return rows in the columns of a catalog; missing columns are empty."""
    empty = {
        column: "" if kind == "text" else np.nan
        for column, kind in CATALOG_COLUMNS.items()
        if column not in rows
    }
    in_order = rows.assign(**empty)[list(CATALOG_COLUMNS)]
    return in_order.replace({"method": FORMER_NAMES})


def _described_people(spec: Entry, participants: pd.Series) -> pd.DataFrame:
    """Return the participant of each row as the entry describes it; empty if it does not."""
    texts, numbers = ["person", "age_band", "sex", "group", "side"], ["mass_kg", "height_m"]
    people = pd.DataFrame(
        [person.model_dump() for person in spec.participants], columns=["id", *texts, *numbers]
    ).set_index("id")
    described = people.reindex(participants).set_axis(participants.index)
    described["side"] = described["side"].fillna(spec.joint.side)
    return described.astype(dict.fromkeys(numbers, float)).fillna(dict.fromkeys(texts, ""))


def _relative_sd(gain: Calibrated | None) -> float:
    return float("nan") if gain is None else gain.sd / gain.value


def _number(value: float | None) -> float:
    return float("nan") if value is None else value


def with_covariance(
    rows: pd.DataFrame, covariance: pd.DataFrame | None, method: str
) -> pd.DataFrame:
    """Return the values with their covariances beside them, NaN if there are none.

    An inertia that all timing points share has its covariance at each of them in the file. In the
    catalog, K and B of each timing point have it, and the row of the inertia its variance only.
    """
    if covariance is None:
        return rows.assign(**dict.fromkeys(COVARIANCES, np.nan))
    if (twice := covariance.duplicated(_CELL)).any():
        cell = " ".join(map(str, covariance.loc[twice, _CELL].iloc[0]))
        raise DataError(
            f"covariances: expected one row for each estimate; found two of {cell}. Delete one, "
            "or run jointz analyze again."
        )
    joined = rows.merge(covariance, on=_CELL, how="left")
    shared = (joined["parameter"] == "inertia") & (joined["timing_point"] == ALL_POINTS)
    if shared.any():
        inertia = covariance[covariance["parameter"] == "inertia"]
        variance = inertia.groupby(_CELL[:3])["with_inertia"].first()
        of_rows = variance.reindex(pd.MultiIndex.from_frame(joined.loc[shared, _CELL[:3]]))
        joined.loc[shared, "with_inertia"] = joined.loc[shared, "with_inertia"].fillna(
            pd.Series(of_rows.to_numpy(), joined.index[shared])
        )
    joined.loc[joined["method"] != method, list(COVARIANCES)] = np.nan
    return joined
