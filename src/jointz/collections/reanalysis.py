"""``jointz collect pool --reanalyse``: what has raw data is estimated again, by one method."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from jointz.collections.catalog_columns import CATALOG_COLUMNS
from jointz.collections.catalog_query import without_onset_told
from jointz.core.errors import DataError, EstimationError
from jointz.core.plain_tables import typed_table
from jointz.core.provenance import own_version
from jointz.results.estimates import COVARIANCE_COLUMNS, ESTIMATE_COLUMNS
from jointz.results.study_analysis import StudyAnalysis

#: Called with (entries done, of how many, what comes next).
Progress = Callable[[int, int, str], None]
_CELL = [*COVARIANCE_COLUMNS[:3], "session", "side"]
#: What an entry says of its values and not of its people.
_OF_VALUES = {*ESTIMATE_COLUMNS, *COVARIANCE_COLUMNS, "sd", "n", "software"} - {"participant"}


@dataclass(frozen=True, slots=True)
class RawStudy:
    """Raw data behind an entry, as a catalog tells of them."""

    conditions: tuple[str, ...]  # all that the entry has, whichever are asked for
    # hash of the ``study.toml`` that the entry vouches for; empty where it does for none
    sha256: str = ""


def checked_method(method: str) -> str:
    """Return a method to analyse by, if there is one of that name."""
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
    """Estimate again, by one method, what has raw data; other rows are left out."""
    checked_method(method)
    made, notes = [rows[rows["values"] == "printed"]], []
    own = rows[rows["values"] != "printed"]
    entries = list(own.groupby("entry", sort=True, observed=True))
    for done, (name, entry) in enumerate(entries):
        if progress:
            progress(done, len(entries), str(name))
        try:
            analysis = _analysed(entry, raw[str(name)], collection, method=method, seed=seed)
            missing = _without_raw_data(entry, analysis)
        except DataError as exc:
            notes.append(f"{name}: left out, {exc}")
            continue
        if missing:
            notes.append(f"{name}: left out {', '.join(missing)}: not in its raw data.")
        made.append(_estimated_again(entry, analysis))
    together = pd.concat([typed_table(part, CATALOG_COLUMNS) for part in made], ignore_index=True)
    if phase_pct is not None:
        together, without = _in_phase(together, phase_pct)
        notes += [without_onset_told(without)] if without else []
    return together, tuple(notes)


def _analysed(
    entry: pd.DataFrame, raw: RawStudy, collection: Path, *, method: str, seed: int
) -> StudyAnalysis:
    """Analyse an entry's raw data; errors say why that cannot be."""
    from jointz.analysis.analyze import analyze  # estimators are loaded where they are needed
    from jointz.io.study_reader import open_study

    place = str(entry["raw_study"].iloc[0] or "")
    if not place:
        raise DataError(f"it has no raw data to analyse by {method}.")
    if len(raw.conditions) > 1:
        raise DataError("raw data of several conditions cannot be told apart.")
    try:
        study = open_study(collection / place)
        if raw.sha256 and study.sha256 != raw.sha256.lower():
            raise DataError(
                f"study.toml is not the one that the entry vouches for: expected SHA-256 "
                f"{raw.sha256[:12]}..., found {study.sha256[:12]}..."
            )
        return analyze(study, method=method, seed=seed)
    except (ValueError, EstimationError, OSError) as exc:
        raise DataError(f"its raw data cannot be analysed: {exc}") from exc


def _without_raw_data(entry: pd.DataFrame, analysis: StudyAnalysis) -> list[str]:
    """Return the entry's people whom its raw data do not hold; an error where that is everybody."""
    people = set(entry["participant"])
    missing = people - set(analysis.to_frame()["participant"])
    if missing == people:
        raise DataError(
            "its raw data hold none of the entry's people. Give them the ids that they have in "
            "study.toml."
        )
    return sorted(missing)


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
    made["side"] = made["side"].where(
        made["side"] != "", known["side"].loc[made["participant"]].array
    )
    return made.assign(software=f"jointz {own_version()}", n=1.0)


def _in_phase(rows: pd.DataFrame, phase_pct: tuple[float, float]) -> tuple[pd.DataFrame, int]:
    """Return the rows whose onset is asked for, and how many have none; as a query does."""
    low, high = phase_pct
    onset = rows["onset_gait_pct"]
    late, early = onset >= low, onset <= high
    asked = late & early if low <= high else late | early
    return rows[asked].reset_index(drop=True), int(onset.isna().sum())
