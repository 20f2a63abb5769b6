"""An analysis that can be saved as a folder of results and loaded from one."""

import os
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import xarray as xr

from jointz.analysis.results_folder import write_results
from jointz.core.errors import DataError
from jointz.core.method_names import FORMER_NAMES
from jointz.core.study import Study
from jointz.io.formats.columns import file_sha256
from jointz.io.new_folder import CHECKSUMS, MARKER
from jointz.io.small_files import LARGEST_RESULTS, read_json
from jointz.io.study_reader import open_study
from jointz.results.figure_style import WIDTH_MM, Figure
from jointz.results.study_analysis import StudyAnalysis

_AGAIN = "Analyse the study again: jointz analyze."


@dataclass(frozen=True, slots=True, repr=False)
class Analysis(StudyAnalysis):
    """Analysis of a study, as :func:`jointz.analyze` and :func:`jointz.load` return it."""

    def save(
        self,
        folder: str | os.PathLike[str],
        *,
        overwrite: bool = False,
        figures: bool = True,
        pdf: bool = False,
        tables: bool = False,
    ) -> Path:
        """Write the folder of results that ``jointz analyze`` writes: whole or not at all.

        Parameters
        ----------
        folder : path
            The folder to make.
        overwrite : bool
            Replace a folder of results that exists.
        figures : bool
            Whether to draw figures.
        pdf : bool
            Whether to write the figures as PDF, too.
        tables : bool
            Whether to write all tables, too, as ``jointz analyze --tables`` does.

        Returns
        -------
        pathlib.Path
            The report in it.

        Raises
        ------
        OutputError
            When the folder exists and may not be replaced.
        WriteError
            When it cannot be written.
        """
        return write_results(
            self, Path(folder), overwrite=overwrite, figures=figures, pdf=pdf, tables=tables
        )

    def figure(
        self,
        name: str = "impedance",
        *,
        parameters: Sequence[str] | None = None,
        width_mm: float = WIDTH_MM,
    ) -> "Figure":
        """Draw a figure of the report, for a paper.

        ``name`` is ``impedance``, or another file of ``figures`` without its suffix. For
        ``impedance``, ``parameters`` are its panels, by default K, B and J, per kg of body mass
        where there are such values. Raises ValueError for an unknown figure or option, DataError
        if the analysis has no data for it.
        """
        from jointz.analysis.page.figure_files import draw_paper_figure

        return draw_paper_figure(self, name, parameters=parameters, width_mm=width_mm)

    def responses(self, study: Study | str | os.PathLike[str] | None = None) -> list[xr.Dataset]:
        """Return the responses to the pulses as arrays, baseline removed.

        Parameters
        ----------
        study : Study or path, optional
            The analysed study. With it, single pulses are cut from its recordings as the method
            does, which takes seconds for each participant.

        Returns
        -------
        list of xarray.Dataset
            One for each estimate and shape of pulse, the most frequent shape first.
            ``mean_angle`` (rad), ``mean_torque`` (N*m) and the fit (``fitted_angle`` or
            ``fitted_torque``) over ``time`` (s from the onset); with a study also ``angle`` and
            ``torque`` of every averaged pulse, ``(pulse, time)``, with ``onset_s`` and
            ``recording``. Attributes: ``participant``, ``session``, ``side``, ``timing_point``,
            ``method``, ``shape``, ``n_pulses``.

        Raises
        ------
        DataError
            When it is another study, or recordings or ``study.toml`` were changed since.
        """
        from jointz.analysis.pulse_traces import response_datasets

        opened = study if study is None or isinstance(study, Study) else open_study(study)
        if opened is not None and opened.sha256 != self.provenance.get("study_sha256"):
            raise _another_study(opened, "this analysis")
        return list(response_datasets(self, opened))


def load(folder: str | os.PathLike[str]) -> Analysis:
    """Load the analysis that a folder of results holds.

    Parameters
    ----------
    folder : path
        A folder that ``jointz analyze`` or ``save`` made.

    Returns
    -------
    Analysis
        The analysis: estimates, other methods, everything left out, settings, provenance.

    Raises
    ------
    DataError
        When the folder is another one, or its files are damaged or ``analysis.json`` was changed.

    Warns
    -----
    UserWarning
        When other files of the folder were changed after jointz wrote them.
    """
    place = Path(folder)
    file = place / "analysis.json"
    missing = [name for name in (file.name, MARKER) if not (place / name).is_file()]
    if missing:
        raise DataError(
            f"{place}: expected a folder that jointz analyze made, found no {missing[0]}. Name "
            "one.",
            path=str(place),
        )
    content = read_json(file, _AGAIN, largest=LARGEST_RESULTS)
    try:
        analysis = Analysis.from_dict(_renamed(content))
    except Exception as exc:  # the file may hold anything
        raise DataError(f"{file}: cannot be read ({exc}). {_AGAIN}", path=str(file)) from exc
    changed = _changed_files(place)
    if file.name in changed:
        raise DataError(
            f"{file}: was changed after jointz wrote it: its SHA-256 is not the one in {MARKER}. "
            "Restore it from a copy, or analyse the study again: jointz analyze.",
            path=str(file),
        )
    if changed:
        warnings.warn(
            f"{place}: changed after jointz wrote them: {', '.join(changed)}. The analysis is "
            f"loaded from {file.name}, which is unchanged.",
            stacklevel=2,
        )
    return analysis


def _renamed(content: Any) -> Any:
    """Return content with the present names of methods."""
    if isinstance(content, list):
        return [_renamed(value) for value in content]
    if not isinstance(content, dict):
        return content
    renamed = {key: _renamed(value) for key, value in content.items()}
    if isinstance(renamed.get("method"), str):
        renamed["method"] = FORMER_NAMES.get(renamed["method"], renamed["method"])
    return renamed


def _changed_files(folder: Path) -> list[str]:
    """Return the files that differ from their checksums; none in folders without checksums."""
    marker = folder / MARKER
    content = read_json(marker, f"Restore it from a copy. {_AGAIN}")
    try:
        written = content.get(CHECKSUMS, {})
        files = {name: str(sha256) for name, sha256 in written.items()}
        present = {name for name in files if (folder / name).is_file()}
        return sorted(name for name in present if file_sha256(folder / name) != files[name])
    except Exception as exc:  # the file may hold anything
        raise DataError(
            f"{marker}: cannot be read ({exc}). Restore it from a copy, or analyse the study "
            "again: jointz analyze.",
            path=str(marker),
        ) from exc


def _another_study(study: Study, results: str) -> DataError:
    return DataError(
        f"{study.root}: expected the study that was analysed for {results}, found another "
        "study.toml, or one that was changed since. Name that study, or analyse this "
        "one again: jointz analyze."
    )


def study_of(
    analysis: StudyAnalysis, folder: Path, named: str | os.PathLike[str] | None
) -> Study | None:
    """Return the study that was analysed; refuse another study that is named."""
    if named is not None:
        study = open_study(named)
        if study.sha256 != analysis.provenance.get("study_sha256"):
            raise _another_study(study, str(folder))
        return study
    name = str(analysis.settings.get("study", ""))
    above = folder.resolve().parent
    if not name or Path(name).name != name:
        return None
    for place in (above / name, above.parent / name, Path.cwd() / name):
        if (place / "study.toml").is_file():
            study = open_study(place)
            if study.sha256 == analysis.provenance.get("study_sha256"):
                return study
    return None
