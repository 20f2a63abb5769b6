"""Catalog of a lab's own results folders: without metadata of entries, and not for pooling."""

import json
import os
from collections.abc import Sequence
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
    """Make one catalog of many results folders, to be queried like that of a collection.

    ``study`` is the beginning of the study's hash: two analyses of one study share it. Speed,
    surface, licence and identity of the participants are unknown, so it cannot be pooled.
    """
    require_scale()
    file = out / CATALOG_FILE if out.is_dir() else out
    tables, entries, skipped = {}, {}, []
    results, unreadable = _results_folders(folders)
    for folder, reason in unreadable.items():
        name = seen_from(folder, file.parent)
        skipped.append(Finding(name, "results_unreadable", ".", "a readable folder", reason))
    for folder in results:
        name = seen_from(folder, file.parent)
        try:
            tables[name], entries[name] = _rows_of(folder, name)
        except (ValueError, OSError, KeyError, TypeError, AttributeError) as exc:
            is_sentence = isinstance(exc, DataError | OSError)
            reason = str(exc) if is_sentence else f"{_PROVENANCE}: {exc!r}"
            skipped.append(Finding(name, "results_unreadable", ".", "a results folder", reason))
    if tables:
        about = {"created": now(), "software": software(), "of": RESULTS, "entries": entries,
                 "skipped": list(map(str, skipped))}  # fmt: skip
        write_catalog(pd.concat(tables.values(), ignore_index=True), file, about)
    people = {
        (entries[name]["study"], person)
        for name, table in tables.items()
        for person in table["participant"].unique()
    }
    n_rows = sum(map(len, tables.values()))
    return CatalogBuild(str(file), tuple(tables), tuple(skipped), n_rows, len(people))


def _results_folders(folders: Sequence[Path]) -> tuple[list[Path], dict[Path, str]]:
    """Return results folders, and folders that cannot be read with the system's reason."""
    errors: list[OSError] = []
    results = set()
    for folder in folders:
        for place, inner, files in os.walk(folder, onerror=errors.append):
            inner[:] = sorted(name for name in inner if not name.startswith("."))
            if _PROVENANCE in files and (_ESTIMATES in files or _had_estimates(Path(place))):
                results.add(Path(place).resolve())
    unreadable = {Path(exc.filename).resolve(): exc.strerror or repr(exc) for exc in errors}
    if not results:
        reasons = "".join(f" {path}: cannot be read ({why})." for path, why in unreadable.items())
        raise DataError(
            f"{', '.join(map(str, folders))}: expected results folders of jointz analyze, there or "
            f"below; found none with a {_PROVENANCE}. Correct the name, or run jointz analyze "
            f"first.{reasons}"
        )
    return sorted(results), unreadable


def _had_estimates(folder: Path) -> bool:
    """Tell whether a folder without estimates is a results folder that lost them."""
    try:
        content = json.loads((folder / _PROVENANCE).read_text(encoding="utf-8"))
        return _ESTIMATES in content["files"]
    except (OSError, ValueError, KeyError, TypeError):
        return False  # of another kind of folder


def _rows_of(folder: Path, name: str) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Return the rows of a results folder, and its metadata."""
    provenance = read_provenance(folder)
    spec = provenance["study"]
    values, sha256, _ = read_values(folder / _ESTIMATES, "estimates")
    covariances = folder / _COVARIANCE
    covariance = read_values(covariances, "covariance")[0] if covariances.is_file() else None
    _check_finite(folder, values, covariance)
    study = str(provenance.get("study_sha256", ""))[:_STUDY_DIGITS]
    people = {person["id"]: described_person(spec, person) for person in spec["participants"]}
    of_rows = [people.get(str(person), {}) for person in values["participant"]]
    method = provenance["settings"]["method"]
    sides = [str(person.get("side") or "") for person in of_rows]
    rows = with_covariance(values, covariance, method).assign(
        entry=name, study=study, values="estimates", statistic="individual",
        joint=spec["joint"], positive=spec["positive"], activity=spec["kind"], n=1.0,
        software=f"jointz {provenance.get('jointz', '')}",
        side=values["side"].where(values["side"] != "", sides),
        group=[str(person.get("group") or "") for person in of_rows],
        **{key: [person.get(key) or np.nan for person in of_rows]
           for key in ("mass_kg", "height_m")},
    )  # fmt: skip
    hashes = {_ESTIMATES: sha256, _PROVENANCE: file_sha256(folder / _PROVENANCE)}
    return in_catalog_columns(rows), {"study": study, "cite": "", "hashes": hashes}


def _check_finite(folder: Path, *tables: pd.DataFrame | None) -> None:
    """Refuse infinite numbers, which no analysis writes and neither pools nor JSON can hold."""
    for table in tables:
        numbers = pd.DataFrame() if table is None else table.select_dtypes("number")
        for column in numbers:
            if np.isinf(numbers[column]).any():
                raise DataError(
                    f"{folder}: column {column} holds an infinite number. Run jointz analyze again."
                )
