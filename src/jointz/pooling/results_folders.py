"""Results folders to pool: estimates, provenance, and what a study's people share."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from jointz.core.errors import DataError
from jointz.core.method_names import PRESENT_NAMES, present_settings
from jointz.core.study import FilesSpec
from jointz.io.formats.columns import file_sha256
from jointz.io.formats.registry import list_columns, read_table
from jointz.io.new_folder import ANALYSIS, CHECKSUMS
from jointz.io.small_files import read_json
from jointz.report.wording import ALL_PARAMETERS
from jointz.results.estimates import ESTIMATE_COLUMNS

_ESTIMATES, _PROVENANCE = "estimates.csv", "provenance.json"
_LABELS = ("participant", "timing_point", "parameter", "unit", "method", "status")
_UNIT = ("session", "side")
_KEY: Final = ["participant", *_UNIT, "timing_point", "parameter"]
AVAILABLE: Final = ("ok", "at_bound")
_GAINS = ("torque_gain", "angle_gain")
_STATUS: Final = r"ok|at_bound|undecided|failed:\w+"
_AGAIN = "Run jointz analyze again."


@dataclass(frozen=True)
class ResultsFolder:
    """A results folder of ``jointz analyze``."""

    name: str  # the end of its path that no other folder has
    estimates: pd.DataFrame  # in the columns of ``estimates.csv``
    provenance: Mapping[str, Any]
    sha256: Mapping[str, str]  # file -> hash

    @property
    def study(self) -> Mapping[str, Any]:
        """The content of ``study.toml``."""
        study: Mapping[str, Any] = self.provenance["study"]
        return study

    @property
    def settings(self) -> Mapping[str, Any]:
        """The settings of the analysis."""
        settings = self.provenance["settings"]
        return present_settings(settings, [settings.get("method")])

    @cached_property
    def recordings(self) -> frozenset[str]:
        """Hashes of the analysed recordings with perturbations."""
        names = {
            one["file"]
            for one in self.study["recordings"]
            if one.get("condition") not in ("unperturbed", "no_device")
        }
        inputs = self.provenance.get("inputs", ())
        return frozenset(str(one["sha256"]) for one in inputs if one.get("file") in names)

    @cached_property
    def calibrations(self) -> list[dict[str, Any]]:
        """The calibration of each recording: the study's, overridden by person and recording."""
        study = self.study
        people = {person["id"]: person for person in study["participants"]}
        parts = ((study, people[one["participant"]], one) for one in study["recordings"])
        return [
            {k: v for part in levels for k, v in (part.get("calibration") or {}).items() if v}
            for levels in parts
        ]

    @property
    def gain_sd(self) -> float:
        """Relative SD of the gains that all recordings share, which does not average out."""
        shared = [
            self.calibrations[0][name]
            for name in _GAINS
            if self.calibrations and len({str(one.get(name)) for one in self.calibrations}) == 1
            and name in self.calibrations[0]
        ]  # fmt: skip
        return float(np.linalg.norm([gain["sd"] / gain["value"] for gain in shared]))

    @property
    def groups(self) -> dict[str, str]:
        """The groups of participants by the study file."""
        return {str(p["id"]): str(p.get("group") or "") for p in self.study["participants"]}


def read_folder(path: Path, name: str) -> ResultsFolder:
    """Read a results folder."""
    for file in (_ESTIMATES, _PROVENANCE):
        if not (path / file).is_file():
            problem = "does not exist" if not path.exists() else f"contains no {file}"
            raise DataError(
                f"{path}: {problem}; expected a results folder of jointz analyze. Correct the "
                "name, or run jointz analyze first."
            )
    provenance = _provenance(path)
    hashes = {file: file_sha256(path / file) for file in (_ESTIMATES, _PROVENANCE)}
    written = (provenance.get(CHECKSUMS) or {}).get(_ESTIMATES, hashes[_ESTIMATES])
    if written != hashes[_ESTIMATES]:
        raise DataError(
            f"{path / _ESTIMATES}: was changed after the analysis (its checksum in {_PROVENANCE} "
            f"differs). {_AGAIN}"
        )
    return ResultsFolder(name, _estimates(path), provenance, hashes)


def _provenance(path: Path) -> dict[str, Any]:
    error = DataError(
        f"{path / _PROVENANCE}: cannot be read as jointz analyze writes it, with study and "
        "settings. Name its results folders, or run jointz analyze again."
    )
    try:
        content = read_json(path / _PROVENANCE, _AGAIN)
        folder = ResultsFolder("", pd.DataFrame(), content, {})
        is_read = all(isinstance(folder.study[key], str) for key in ("joint", "kind", "positive"))
        is_read &= np.isfinite(folder.gain_sd) and isinstance(folder.groups, dict)
        window_s = folder.settings.get("window_s")
        is_read &= window_s is None or bool(np.isfinite(window_s))
        is_read &= isinstance(folder.recordings, frozenset)
        is_read &= content.get("made_by", ANALYSIS) == ANALYSIS
    except (OSError, ValueError, KeyError, TypeError, AttributeError, ZeroDivisionError) as exc:
        raise error from exc
    if not is_read:
        raise error
    return dict(content)


def _estimates(path: Path) -> pd.DataFrame:
    file = path / _ESTIMATES
    try:
        return _checked_estimates(file)
    except DataError as exc:
        text = str(exc).replace(_ESTIMATES, str(file), 1) if str(file) not in str(exc) else str(exc)
        raise DataError(text if text.endswith(_AGAIN) else f"{text} {_AGAIN}") from exc


def _checked_estimates(file: Path) -> pd.DataFrame:
    stated = list_columns(file, FilesSpec()) or ()
    units = [name for name in _UNIT if name in stated]  # older results have none
    numbers = [name for name in ESTIMATE_COLUMNS if name not in (*_LABELS, *_UNIT)]
    columns = read_table(
        file, numeric=numbers, labels=[*_LABELS, *units], files=FilesSpec(), as_written=True
    )
    table = pd.DataFrame(dict(columns.columns)).assign(
        **{name: "" for name in _UNIT if name not in stated}
    )
    table = table[list(ESTIMATE_COLUMNS)].replace({"method": PRESENT_NAMES})
    is_available = table["status"].isin(AVAILABLE)
    is_ordered = (table["ci_low"] <= table["value"]) & (table["value"] <= table["ci_high"])
    problems = (
        (table.duplicated(_KEY), "a second row of the same estimate"),
        (~table["status"].str.fullmatch(_STATUS), "an unknown status"),
        (is_available != table["value"].notna(), "status and value disagree"),
        (~table["parameter"].isin(ALL_PARAMETERS), "a parameter that jointz does not estimate"),
        (np.isinf(table[numbers]).any(axis=1), "an infinite number"),
        (is_available & ~is_ordered, "a value without an interval around it"),
    )
    for is_wrong, what in problems:
        if is_wrong.any():
            row = columns.first_row + int(np.argmax(is_wrong))
            raise DataError(f"{file}, row {row}: {what}. {_AGAIN}", path=str(file), row=row)
    return table
