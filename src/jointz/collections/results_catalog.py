"""A catalog of a lab's own results folders: no pages of metadata, nothing to pool."""

import json
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from jointz.collections.catalog import in_catalog_columns, with_covariance
from jointz.collections.catalog_file import CATALOG_FILE, RESULTS, require_scale, write_catalog
from jointz.collections.checking.findings import CatalogBuild, Finding
from jointz.collections.entry import described_person, read_provenance
from jointz.collections.entry_reader import read_values
from jointz.core.errors import DataError
from jointz.core.provenance import now, software
from jointz.io.formats.columns import file_sha256
from jointz.io.relative_paths import seen_from

_ESTIMATES, _COVARIANCE, _PROVENANCE = "estimates.csv", "covariance.csv", "provenance.json"
_STUDY_DIGITS = 12


def build_results_catalog(folders: Sequence[Path], *, out: Path) -> CatalogBuild:
    """Make one catalog of many results folders, to be asked like that of a collection.

    ``study`` is the beginning of the study's hash: two analyses of one study share it. Nothing is
    known of speed, surface, licence and of who a participant is, so such a catalog is not pooled.
    """
    require_scale()
    file = out / CATALOG_FILE if out.is_dir() else out
    tables, entries, skipped = {}, {}, []
    found, unseen = _results_folders(folders)
    for folder, why in unseen.items():
        name = seen_from(folder, file.parent)
        skipped.append(Finding(name, "results_unreadable", ".", "a folder to look into", why))
    for folder in found:
        name = seen_from(folder, file.parent)
        try:
            tables[name], entries[name] = _rows_of(folder, name)
        except (ValueError, OSError, KeyError, TypeError, AttributeError) as exc:
            is_told = isinstance(exc, DataError | OSError)
            told = str(exc) if is_told else f"{_PROVENANCE}: {exc!r}"
            skipped.append(Finding(name, "results_unreadable", ".", "a results folder", told))
    if tables:
        about = {"created": now(), "software": software(), "of": RESULTS, "entries": entries,
                 "skipped": list(map(str, skipped))}  # fmt: skip
        write_catalog(pd.concat(tables.values(), ignore_index=True), file, about)
    who = {
        (entries[name]["study"], person)
        for name, table in tables.items()
        for person in table["participant"].unique()
    }
    rows = sum(map(len, tables.values()))
    return CatalogBuild(str(file), tuple(tables), tuple(skipped), rows, len(who))


def _results_folders(folders: Sequence[Path]) -> tuple[list[Path], dict[Path, str]]:
    """Return results folders, and what could not be looked into with what the system said."""
    refused: list[OSError] = []
    found = {path.resolve() for folder in folders for path in _below(folder, refused.append)}
    unseen = {Path(exc.filename).resolve(): exc.strerror or repr(exc) for exc in refused}
    if not found:
        told = ", ".join(map(str, folders))
        more = "".join(f" {folder}: cannot be read ({why})." for folder, why in unseen.items())
        raise DataError(
            f"{told}: no results folder of jointz analyze there or below, which would hold a "
            f"{_PROVENANCE}. Correct the name, or run jointz analyze first.{more}"
        )
    return sorted(found), unseen


def _below(folder: Path, refused: Callable[[OSError], object]) -> Iterator[Path]:
    for place, inner, files in os.walk(folder, onerror=refused):
        inner[:] = sorted(name for name in inner if not name.startswith("."))
        if _PROVENANCE in files and (_ESTIMATES in files or _had_estimates(Path(place))):
            yield Path(place)


def _had_estimates(folder: Path) -> bool:
    """Tell whether a folder without estimates is one of an analysis all the same."""
    try:
        content = json.loads((folder / _PROVENANCE).read_text(encoding="utf-8"))
        return _ESTIMATES in content["files"]
    except (OSError, ValueError, KeyError, TypeError):
        return False  # of something else


def _rows_of(folder: Path, name: str) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Return the rows of a results folder, and what a catalog says of it."""
    provenance = read_provenance(folder)
    spec = provenance["study"]
    values, sha256, _ = read_values(folder / _ESTIMATES, "estimates")
    covariances = folder / _COVARIANCE
    covariance = read_values(covariances, "covariance")[0] if covariances.is_file() else None
    _check_finite(folder, values, covariance)
    study = str(provenance.get("study_sha256", ""))[:_STUDY_DIGITS]
    people = {one["id"]: described_person(spec, one) for one in spec["participants"]}
    told = [people.get(str(person), {}) for person in values["participant"]]
    method = provenance["settings"]["method"]
    rows = with_covariance(values, covariance, method).assign(
        entry=name, study=study, values="estimates", statistic="individual",
        joint=spec["joint"], positive=spec["positive"], activity=spec["kind"], n=1.0,
        software=f"jointz {provenance.get('jointz', '')}",
        side=values["side"].where(values["side"] != "", [str(p.get("side") or "") for p in told]),
        group=[str(one.get("group") or "") for one in told],
        **{key: [one.get(key) or np.nan for one in told] for key in ("mass_kg", "height_m")},
    )  # fmt: skip
    hashes = {_ESTIMATES: sha256, _PROVENANCE: file_sha256(folder / _PROVENANCE)}
    return in_catalog_columns(rows), {"study": study, "cite": "", "hashes": hashes}


def _check_finite(folder: Path, *tables: pd.DataFrame | None) -> None:
    """Refuse what no analysis writes, and what no pool or JSON could hold."""
    for table in tables:
        if table is None:
            continue
        for column in table.select_dtypes("number"):
            if np.isinf(table[column]).any():
                raise DataError(
                    f"{folder}: column {column} holds an infinite number. Run jointz analyze again."
                )
