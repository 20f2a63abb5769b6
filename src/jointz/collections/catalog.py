"""Collections of studies: entries to ``catalog.parquet``, and questions to it."""

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
from jointz.collections.checking.findings import CatalogBuild, Finding
from jointz.collections.entry_model import ENTRY_FILE, Entry
from jointz.collections.entry_reader import ConditionTables, EntryFolder
from jointz.core.errors import DataError
from jointz.core.gait_phases import ALL_POINTS
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
        The file; by default ``catalog.parquet`` in the collection's folder. One that exists is
        replaced.

    Returns
    -------
    CatalogBuild
        What is in it, and which entries are not, with every reason. Nothing is written, and
        ``entries`` is empty, where no entry stands.

    Raises
    ------
    DataError
        When the folder is none or holds no entry, or the extra ``scale`` is not installed.
    WriteError
        When the system does not let the catalog be written.

    Notes
    -----
    An entry with a problem is left out whole. What two entries cannot both hold (a study or a
    person twice) leaves out the later of them, by the order of the folders.
    Entries are read one after the other: reading and checking 50 of 200 people takes seconds.
    """
    require_scale()
    file = folder / CATALOG_FILE if out is None else out
    checked = checked_entries(folder)
    sound = [one for one in checked if not one.findings]
    between = common_findings(sound)
    refused = {finding.entry for finding in between}
    kept = [one for one in sound if one.name not in refused]
    skipped = [finding for one in checked for finding in one.findings] + between
    tables = [catalog_rows(one) for one in kept]
    table = pd.concat(tables, ignore_index=True) if tables else pd.DataFrame()
    if kept:
        collection = folder.resolve().parent if (folder / ENTRY_FILE).is_file() else folder
        place = {"collection": seen_from(collection, file.parent)}
        write_catalog(table, file, place | _about(kept, skipped))
    return CatalogBuild(
        str(file),
        tuple(one.name for one in kept),
        tuple(skipped),
        len(table),
        sum(_people(one.entry.spec) for one in kept if one.entry is not None),
        tuple(finding for one in kept for finding in one.accepted),
    )


def query_catalog(catalog: Path, where: CatalogFilter | None = None) -> QueryResult:
    """Return the rows of a catalog that a filter asks for.

    Parameters
    ----------
    catalog : pathlib.Path
        The file, or the collection's folder that holds it.
    where : CatalogFilter, optional
        What is wanted; by default all estimates.

    Returns
    -------
    QueryResult
        The rows, how many of the other kind of values were kept apart, and what to cite.

    Raises
    ------
    DataError
        When there is no catalog, it is damaged, a range is none, or the extra ``scale`` is not
        installed.
    """
    file = catalog_file(catalog)
    asked = where or CatalogFilter()
    check_filter(asked)
    about = catalog_about(file)  # a file of another schema, or of somebody else, says so
    # One column is asked faster than two of which either may hold a name.
    wanted = replace(asked, entry=_folders(about["entries"], asked.entry))
    table, without_onset = read_catalog(file, wanted)
    cited = table[["study", "cite"]].drop_duplicates().astype(str)
    cites = {study: cite for study, cite in cited.itertuples(index=False, name=None) if cite}
    also = count_rows(file, _other_kind(wanted))
    return QueryResult(table, asked, also, cites, without_onset)


def _folders(entries: Mapping[str, Mapping[str, Any]], asked: Sequence[str]) -> tuple[str, ...]:
    """Return the folders of what is asked for by folder or by the id of a study."""
    of_study = {
        wanted: [name for name, entry in entries.items() if entry["study"] == wanted]
        for wanted in asked
    }
    return tuple(name for wanted in asked for name in of_study[wanted] or [wanted])


def catalog_file(catalog: Path) -> Path:
    """Return the file of a catalog."""
    return catalog / CATALOG_FILE if catalog.is_dir() else catalog


def _other_kind(asked: CatalogFilter) -> CatalogFilter:
    other = "printed" if asked.kind == "estimates" else "estimates"
    return replace(asked, kind=other)


def _people(spec: Entry) -> int:
    return len(spec.participants) or (spec.sample.n if spec.sample else 0)


def _about(kept: Sequence[CheckedEntry], skipped: Sequence[Finding]) -> dict[str, Any]:
    entries = {
        one.name: {
            "study": one.entry.spec.study,
            "version": one.entry.spec.version,
            "title": one.entry.spec.title,
            "licence": one.entry.spec.licence,
            "consent": one.entry.spec.ethics.consent,
            "cite": one.entry.spec.cite,
            "conditions": [condition.name for condition in one.entry.spec.conditions],
            "raw_sha256": one.entry.spec.raw_data.sha256,
            "sha256": one.entry.sha256,
            "hashes": dict(one.entry.spec.hashes),
        }
        for one in kept
        if one.entry is not None
    }
    return {"created": now(), "software": software(), "entries": entries,
            "skipped": list(map(str, skipped))}  # fmt: skip


# --- rows ----------------------------------------------------------------------------------------


def catalog_rows(checked: CheckedEntry) -> pd.DataFrame:
    """Return an entry in the columns of a catalog."""
    if checked.entry is None:
        raise DataError(f"{checked.name}: has problems. See jointz collect check.")
    entry = checked.entry
    parts = [_rows(entry, tables) for tables in checked.tables]
    return pd.concat(parts, ignore_index=True)


def _rows(entry: EntryFolder, tables: ConditionTables) -> pd.DataFrame:
    spec, condition = entry.spec, tables.condition
    rows = tables.rows
    if spec.kind == "printed":
        rows = rows.assign(method=spec.method.name)
    rows = with_covariance(rows, tables.covariance, spec.method.name)
    rows = rows.assign(
        **_of_entry(entry),
        condition=condition.name, activity=condition.activity,
        walking_speed_m_s=_number(condition.walking_speed_m_s),
        slope_deg=_number(condition.slope_deg), surface=condition.surface,
    )  # fmt: skip
    people = _of_people(spec, rows["participant"])
    people["side"] = rows["side"].where(rows["side"] != "", people["side"]).to_numpy()
    rows = rows.assign(**people)
    if spec.kind == "estimates":
        rows = rows.assign(statistic="individual", source="", sd=np.nan, n=1.0)
    return in_catalog_columns(rows)


def in_catalog_columns(rows: pd.DataFrame) -> pd.DataFrame:
    """Return rows in the columns of a catalog, empty where they say nothing."""
    empty = {
        column: "" if kind == "text" else np.nan
        for column, kind in CATALOG_COLUMNS.items()
        if column not in rows
    }
    return rows.assign(**empty)[list(CATALOG_COLUMNS)]


def _of_people(spec: Entry, participants: pd.Series) -> dict[str, np.ndarray]:
    """Return what an entry says of the participant of each row, empty where it says nothing."""
    code, names = pd.factorize(participants)
    people = {person.id: person for person in spec.participants}
    told = [people.get(str(name)) for name in names]
    columns = {
        column: np.array([getattr(one, column) if one else "" for one in told], dtype=object)
        for column in ("person", "age_band", "sex", "group")
    }
    for column in ("mass_kg", "height_m"):
        columns[column] = np.array([_number(getattr(one, column, None)) for one in told])
    sides = [(one.side if one else None) or spec.joint.side for one in told]
    columns["side"] = np.array(sides, dtype=object)
    return {column: values[code] for column, values in columns.items()}


def _of_entry(entry: EntryFolder) -> dict[str, Any]:
    """Return what all rows of an entry share."""
    spec = entry.spec
    raw = os.path.normpath(Path(entry.name) / spec.raw_data.study)  # from the collection's folder
    return {
        "entry": entry.name,
        "study": spec.study,
        "version": spec.version,
        "values": spec.kind,
        "joint": spec.joint.name,
        "positive": spec.joint.positive,
        "software": f"{spec.software.name} {spec.software.version}",
        "torque_gain_sd": _gain_sd(spec.calibration.torque_gain),
        "angle_gain_sd": _gain_sd(spec.calibration.angle_gain),
        "raw_study": raw if spec.raw_data.study else "",
        "licence": spec.licence,
        "consent": spec.ethics.consent,
        "cite": spec.cite,
    }


def _gain_sd(gain: Calibrated | None) -> float:
    """Return the relative sd of a calibrated gain, NaN where it is not known."""
    return float("nan") if gain is None else gain.sd / gain.value


def _number(value: float | None) -> float:
    return float("nan") if value is None else value


def with_covariance(
    rows: pd.DataFrame, covariance: pd.DataFrame | None, method: str
) -> pd.DataFrame:
    """Return the values with their covariances beside them, NaN where there are none.

    The covariance of an inertia that all timing points share stands at each of them in its file,
    and with K and B of each in the catalog; the row of the inertia has its variance alone.
    """
    if covariance is None:
        return rows.assign(**dict.fromkeys(COVARIANCES, np.nan))
    if (twice := covariance.duplicated(_CELL)).any():
        found = " ".join(map(str, covariance.loc[twice, _CELL].iloc[0]))
        raise DataError(
            f"covariances: expected one row for each estimate; found two of {found}. Delete one, "
            "or run jointz analyze again."
        )
    made = rows.merge(covariance, on=_CELL, how="left")
    shared = (made["parameter"] == "inertia") & (made["timing_point"] == ALL_POINTS)
    if shared.any():
        told = covariance[covariance["parameter"] == "inertia"]
        variance = told.groupby(_CELL[:3])["with_inertia"].first()
        known = variance.reindex(pd.MultiIndex.from_frame(made.loc[shared, _CELL[:3]]))
        made.loc[shared, "with_inertia"] = made.loc[shared, "with_inertia"].fillna(
            pd.Series(known.to_numpy(), made.index[shared])
        )
    made.loc[made["method"] != method, list(COVARIANCES)] = np.nan
    return made
