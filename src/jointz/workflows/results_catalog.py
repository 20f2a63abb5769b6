"""A catalog of a lab's own results folders: no pages of metadata, nothing to pool."""

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from jointz.core.collection_findings import CatalogBuild, Finding
from jointz.core.errors import DataError
from jointz.core.provenance import now, software
from jointz.io.collection import read_values
from jointz.io.collection_catalog import CATALOG_FILE, RESULTS, require_scale, write_catalog
from jointz.io.registry import file_sha256
from jointz.workflows.collection import in_catalog_columns, with_covariance
from jointz.workflows.collection_entry import described_person, read_provenance

_ESTIMATES, _COVARIANCE, _PROVENANCE = "estimates.csv", "covariance.csv", "provenance.json"
_STUDY_DIGITS = 12


def build_results_catalog(folders: Sequence[Path], *, out: Path) -> CatalogBuild:
    """Make one catalog of many results folders, to be asked like that of a collection.

    Parameters
    ----------
    folders : sequence of pathlib.Path
        Results folders of ``jointz analyze``, or folders with such somewhere below.
    out : pathlib.Path
        The catalog, or the folder it goes to; one that exists is replaced.

    Returns
    -------
    CatalogBuild
        ``entries`` are the results folders as seen from the catalog; ``skipped`` says why others
        are not in it. Nothing is written where none stands.

    Raises
    ------
    DataError
        When there is no results folder, or the extra ``scale`` is not installed.
    WriteError
        When the system does not let the catalog be written.

    Notes
    -----
    ``study`` is the beginning of the study's hash: two analyses of one study share it. Nothing is
    known of speed, surface, licence and of who a participant is, so such a catalog is not pooled.
    """
    require_scale()
    file = out / CATALOG_FILE if out.is_dir() else out
    tables, entries, skipped = {}, {}, []
    for folder in _results_folders(folders):
        name = os.path.relpath(folder, file.parent)
        try:
            tables[name], entries[name] = _rows_of(folder, name)
        except (DataError, KeyError, TypeError, AttributeError) as exc:
            told = str(exc) if isinstance(exc, DataError) else f"{_PROVENANCE}: {exc!r}"
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


def _results_folders(folders: Sequence[Path]) -> list[Path]:
    found = {path.resolve() for folder in folders for path in _below(folder)}
    if not found:
        told = ", ".join(map(str, folders))
        raise DataError(
            f"{told}: no results folder of jointz analyze there or below, which would hold a "
            f"{_PROVENANCE}. Correct the name, or run jointz analyze first."
        )
    return sorted(found)


def _below(folder: Path) -> Iterator[Path]:
    for place, inner, files in os.walk(folder):
        inner[:] = sorted(name for name in inner if not name.startswith("."))
        if _PROVENANCE in files and _ESTIMATES in files:
            yield Path(place)


def _rows_of(folder: Path, name: str) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Return the rows of a results folder, and what a catalog says of it."""
    provenance = read_provenance(folder)
    spec = provenance["study"]
    values, sha256, _ = read_values(folder / _ESTIMATES, "estimates")
    covariances = folder / _COVARIANCE
    covariance = read_values(covariances, "covariance")[0] if covariances.is_file() else None
    study = str(provenance.get("study_sha256", ""))[:_STUDY_DIGITS]
    people = {one["id"]: described_person(spec, one) for one in spec["participants"]}
    told = [people.get(str(person), {}) for person in values["participant"]]
    rows = with_covariance(values, covariance).assign(
        entry=name, study=study, values="estimates", statistic="individual",
        joint=spec["joint"], positive=spec["positive"], activity=spec["kind"], n=1.0,
        software=f"jointz {provenance.get('jointz', '')}",
        **{key: [str(one.get(key) or "") for one in told] for key in ("side", "group")},
        **{key: [one.get(key) or np.nan for one in told] for key in ("mass_kg", "height_m")},
    )  # fmt: skip
    hashes = {_ESTIMATES: sha256, _PROVENANCE: file_sha256(folder / _PROVENANCE)}
    return in_catalog_columns(rows), {"study": study, "cite": "", "hashes": hashes}
