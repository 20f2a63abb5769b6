"""``jointz collect pool --reanalyse``: what has raw data is estimated again, by one method."""

from collections.abc import Callable
from pathlib import Path

import pandas as pd

from jointz.core.analysis import StudyAnalysis
from jointz.core.collection_tables import CATALOG_COLUMNS
from jointz.core.errors import DataError
from jointz.core.estimates import COVARIANCE_COLUMNS, ESTIMATE_COLUMNS
from jointz.core.plain_tables import typed_table
from jointz.core.provenance import own_version

#: Called with (entries done, of how many, what comes next).
Progress = Callable[[int, int, str], None]
_CELL = list(COVARIANCE_COLUMNS[:3])
#: What an entry says of its values and not of its people.
_OF_VALUES = {*ESTIMATE_COLUMNS, *COVARIANCE_COLUMNS, "sd", "n", "software"} - {"participant"}


def reanalysed(
    rows: pd.DataFrame,
    method: str,
    *,
    collection: Path,
    seed: int = 0,
    progress: Progress | None = None,
) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Estimate again, by one method, what has raw data; other rows are left out.

    Parameters
    ----------
    rows : pandas.DataFrame
        In the columns of the catalog.
    method : str
        As :func:`jointz.analyze` takes it.
    collection : pathlib.Path
        The collection's folder: ``raw_study`` says from there where study folders are.
    seed : int
        Of its resampling.
    progress : callable, optional
        Called with (entries done, of how many, what comes next).

    Returns
    -------
    rows : pandas.DataFrame
        In the same columns, of one method; printed values as they were.
    notes : tuple of str
        Entries that are not in them, and why.
    """
    from jointz.workflows.analysis import analyze  # estimators are loaded where they are needed

    made, notes = [rows[rows["values"] == "printed"]], []
    own = rows[rows["values"] != "printed"]
    entries = list(own.groupby("entry", sort=True, observed=True))
    for done, (name, entry) in enumerate(entries):
        if progress:
            progress(done, len(entries), str(name))
        raw = str(entry["raw_study"].iloc[0] or "")
        if not raw:
            notes.append(f"{name}: left out, it has no raw data to analyse by {method}.")
        elif len(set(entry["condition"])) > 1:
            notes.append(f"{name}: left out, raw data of several conditions cannot be told apart.")
        else:
            try:
                analysis = analyze(collection / raw, method=method, seed=seed)
            except DataError as exc:
                notes.append(f"{name}: left out, its raw data cannot be analysed: {exc}")
                continue
            made.append(_estimated_again(entry, analysis))
    together = pd.concat([typed_table(part, CATALOG_COLUMNS) for part in made], ignore_index=True)
    return together, tuple(notes)


def _estimated_again(entry: pd.DataFrame, analysis: StudyAnalysis) -> pd.DataFrame:
    """Return the estimates of the entry's people, of the parameters that were asked for."""
    known = entry.drop_duplicates("participant").set_index("participant")
    estimates = analysis.to_frame()
    asked = estimates["participant"].isin(known.index)
    asked &= estimates["parameter"].isin(set(entry["parameter"]))
    fresh = estimates[asked].merge(analysis.covariance_frame(), on=_CELL, how="left")
    about = [c for c in CATALOG_COLUMNS if c not in _OF_VALUES and c != "participant"]
    told = known.loc[fresh["participant"], about].reset_index(drop=True)
    made = pd.concat([fresh, told], axis=1)
    return made.assign(software=f"jointz {own_version()}", n=1.0)
