"""Write an analysis as a folder: whole or not at all."""

import fnmatch
import json
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

import pandas as pd

from jointz.analysis.folder_place import FolderState, beside, check_name, take_place
from jointz.analysis.page.details_tables import details_frame, models_frame
from jointz.analysis.page.figure_files import FIGURES, Picture, draw_picture, draw_truth_picture
from jointz.analysis.page.report_page import render_report
from jointz.analysis.paper.methods_text import methods_latex, methods_text
from jointz.analysis.paper.paper_tables import captions_text, paper_tables
from jointz.core.errors import OutputError, WriteError
from jointz.core.stop_signals import signals_held
from jointz.io.formats.columns import file_sha256
from jointz.report.subjects import report_title
from jointz.results.run_report import RunReport
from jointz.results.study_analysis import StudyAnalysis
from jointz.tasks.engine import Engine, Serial
from jointz.tasks.shared_memory import shared_out

#: File that shows that jointz made a folder, and so may replace it.
MARKER = "provenance.json"
#: Key of the marker with the SHA-256 of every other file of a results folder, by name.
CHECKSUMS = "sha256"
#: Contents of a folder by its marker (``made_by``); one kind never replaces another.
ANALYSIS, COMPARISON, REPRODUCTION = "analysis", "comparison", "reproduction"
#: File that shows the kind of a folder whose marker is older and does not name it.
_KIND_FILES = (
    (ANALYSIS, "estimates.csv"),
    (COMPARISON, "comparison.json"),
    (REPRODUCTION, "chapter[0-9].json"),
)
_FLOAT_FORMAT = "%.10g"
#: Columns of times, which may count from 1970 and then have ten digits before the point.
_TIMES = ("onset_s", "start_s")


def write_results(
    analysis: StudyAnalysis,
    out: Path,
    *,
    overwrite: bool = False,
    before: FolderState | None = None,
    truth: pd.DataFrame | None = None,
    run: RunReport | None = None,
    figures: bool = True,
    engine: Engine | None = None,
) -> Path:
    """Write estimates, exclusions, figures and report of an analysis.

    Parameters
    ----------
    analysis : StudyAnalysis
        The analysis.
    out : pathlib.Path
        The folder to make.
    overwrite : bool
        Replace a results folder that exists.
    before : FolderState, optional
        What :func:`check_free` returned before the analysis; what appeared at ``out`` since then
        is never replaced.
    truth : pandas.DataFrame, optional
        Truth and estimates of a simulated study, for the report.
    run : RunReport, optional
        Report of the experiment, for the report.
    figures : bool
        Whether to draw figures, which takes as long as the estimates of a few people.
    engine : Engine, optional
        Engine that draws several figures at once.

    Returns
    -------
    pathlib.Path
        The report.

    Raises
    ------
    OutputError
        When the folder exists and may not be replaced, or cannot be written.
    """
    with new_folder(
        out, marker=MARKER, overwrite=overwrite, made_by=ANALYSIS, before=before
    ) as folder:
        drawings = _drawings(analysis, engine or Serial()) if figures else {}
        _write_tables(analysis, folder)
        _write_json(folder / "statistics.json", dict(analysis.statistics))
        _write_json(folder / "analysis.json", analysis.to_dict(), indent=None)
        _write_paper(analysis, folder, simulated=truth is not None)
        drawn = {name: drawing() for name, drawing in drawings.items()}
        if truth is not None and figures:
            drawn["truth"] = draw_truth_picture(truth)
        pictures = {name: picture for name, picture in drawn.items() if picture is not None}
        _write_figures(pictures, folder / "figures")
        title = report_title(analysis)
        drawn_svgs = {name: picture.svg for name, picture in pictures.items()}
        page = render_report(analysis, drawn_svgs, title=title, truth=truth, run=run)
        (folder / "report.html").write_text(page, encoding="utf-8")
        content = {
            "settings": dict(analysis.settings),
            "made_by": ANALYSIS,
            CHECKSUMS: {name: file_sha256(folder / name) for name in sorted(_files(folder))},
        }
        write_marker(folder, MARKER, {**analysis.provenance, **content})
    return out / "report.html"


def _drawings(analysis: StudyAnalysis, engine: Engine) -> dict[str, Callable[[], Picture | None]]:
    """Start to draw the figures; the last, which takes longest, first."""
    names = FIGURES[::-1]
    calls = [partial(draw_picture, analysis, name) for name in names]
    return dict(zip(names, shared_out(engine, calls), strict=True))


def _write_figures(pictures: Mapping[str, Picture], folder: Path) -> None:
    folder.mkdir()
    for name, picture in pictures.items():
        (folder / f"{name}.svg").write_text(picture.svg, encoding="utf-8")
        (folder / f"{name}.pdf").write_bytes(picture.pdf)


def _write_paper(analysis: StudyAnalysis, folder: Path, *, simulated: bool) -> None:
    """Write the methods and the tables of a paper."""
    texts = {"txt": methods_text, "tex": methods_latex}
    for suffix, written in texts.items():
        text = written(analysis, simulated=simulated)
        (folder / f"methods.{suffix}").write_text(text, encoding="utf-8")
    tables = paper_tables(analysis)
    (folder / "tables").mkdir()
    for name, table in tables.items():
        # With a mark of its encoding, without which a spreadsheet misreads the dashes.
        table.to_frame().to_csv(
            folder / "tables" / f"{name}.csv", index=False, encoding="utf-8-sig"
        )
        text = table.to_latex(name)
        (folder / "tables" / f"{name}.tex").write_text(text, encoding="utf-8")
    (folder / "tables" / "captions.txt").write_text(captions_text(tables), encoding="utf-8")


def check_free(
    out: Path, *, marker: str, overwrite: bool, made_by: str | None = None
) -> FolderState:
    """Raise unless a folder can be made or replaced here; return what is there."""
    check_name(out)
    if out.name in ("", ".."):  # a folder beside it is filled first and then takes its name
        raise OutputError(
            f"{out}: is no name for a new folder. Give the name itself, such as results or "
            "../results."
        )
    with _write_errors(out):
        before = FolderState.of(out)  # first: what changes during the checks is seen at the end
        if before.identity is None or (out.is_dir() and not any(out.iterdir())):
            return before
    if out.is_symlink() and not out.exists():
        raise OutputError(f"{out}: is a link to nothing. Remove it, or name another folder.")
    if not out.is_dir():
        raise OutputError(f"{out}: is a file. Name a folder that does not exist yet.")
    if not overwrite:
        raise OutputError(
            f"{out}: exists and is kept. Name another folder, or replace it: --overwrite, "
            "overwrite=True."
        )
    listed = _listed_files(out / marker)
    if listed is None:
        raise OutputError(
            f"{out}: contains no {marker} of jointz, so jointz did not make it and will not "
            "replace it. Name another folder."
        )
    if made_by is not None:
        _check_kind(out, out / marker, made_by)
    foreign = sorted(_files(out) - listed - {marker})
    if foreign:
        raise OutputError(
            f"{out}: contains files that jointz did not write ({', '.join(foreign[:3])}"
            f"{', ...' if len(foreign) > 3 else ''}) and will not replace it. Move them, or name "
            "another folder."
        )
    return before


def write_marker(folder: Path, marker: str, content: Mapping[str, object]) -> None:
    """Write the marker of a folder last; it lists all other files."""
    _write_json(folder / marker, {**content, "files": sorted(_files(folder) - {marker})})


def _files(folder: Path) -> set[str]:
    return {p.relative_to(folder).as_posix() for p in folder.rglob("*") if not p.is_dir()}


def _listed_files(marker: Path) -> set[str] | None:
    """Return the files that a marker lists, None if jointz did not write it."""
    try:
        listed = json.loads(marker.read_text(encoding="utf-8"))["files"]
        return set(map(str, listed))
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _kind(marker: Path) -> str:
    """Return the kind of a folder, empty if its marker does not show it."""
    content = json.loads(marker.read_text(encoding="utf-8"))
    if "made_by" in content:
        return str(content["made_by"])
    names = list(map(str, content["files"]))
    return next((kind for kind, name in _KIND_FILES if fnmatch.filter(names, name)), "")


def _check_kind(out: Path, marker: Path, made_by: str) -> None:
    """Refuse to replace a folder of another kind."""
    if (kind := _kind(marker)) != made_by:
        raise OutputError(
            f"{out}: jointz made it as {kind or 'something else'}, not as {made_by or 'this'}. It "
            "is kept, as overwriting replaces the same kind only. Name another folder."
        )


@contextmanager
def new_folder(
    out: Path,
    *,
    marker: str,
    overwrite: bool,
    made_by: str | None = None,
    before: FolderState | None = None,
) -> Iterator[Path]:
    """Yield a folder to fill, which takes its name only if there was no error.

    It replaces nothing but what was there at the beginning, or at an earlier :func:`check_free`
    that returned ``before``.
    """
    if before is None:
        before = check_free(out, marker=marker, overwrite=overwrite, made_by=made_by)
    with _write_errors(out), _parents(out), _partial_folder(out) as partial:
        yield partial
        with suppress(FileNotFoundError):  # replaced by another process: take_place sees it
            if (out / marker).exists() and FolderState.of(out) == before:
                _check_kind(out, out / marker, _kind(partial / marker))
        with signals_held():
            take_place(partial, out, before)


@contextmanager
def _write_errors(out: Path) -> Iterator[None]:
    """Raise errors of the file system as WriteError."""
    try:
        yield
    except OSError as exc:
        todo = "Make room or ask for permission, or name another folder."
        raise WriteError(str(out), exc, todo) from exc


@contextmanager
def _parents(out: Path) -> Iterator[None]:
    """Create the folders above ``out``, and remove them again after an exception."""
    missing = [parent for parent in out.parents if not parent.exists()]
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException:
        for parent in missing:
            with suppress(OSError):  # no longer empty, or never created
                parent.rmdir()
        raise


@contextmanager
def _partial_folder(out: Path) -> Iterator[Path]:
    """Yield a new folder beside ``out`` that is removed after an exception."""
    partial = beside(out, "partial")
    try:  # before the folder exists, as an interrupt may come at any time
        partial.mkdir()
        yield partial
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        raise


def _write_tables(analysis: StudyAnalysis, folder: Path) -> None:
    tables = {
        "estimates": analysis.to_frame(),
        "details": details_frame(analysis),
        "comparison": analysis.comparison_frame(),
        "population": analysis.population_frame(),
        "excluded": analysis.excluded_frame(),
        "pulses": analysis.pulses_frame(),
        "strides": analysis.strides_frame(),
    }
    optional = {
        "single_pulses": analysis.single_frame(),
        "quasi_stiffness": pd.DataFrame(analysis.statistics.get("quasi_stiffness") or ()),
        "models": models_frame(analysis),
        "pooled": analysis.pooled_frame(),
        "covariance": analysis.covariance_frame(),
        "log_posterior": analysis.log_posterior_frame(),
    }
    tables |= {name: table for name, table in optional.items() if not table.empty}
    if analysis.certificate is not None:
        tables["certificate"] = analysis.certificate.to_frame()
    for name, table in tables.items():
        (folder / f"{name}.csv").write_bytes(csv_bytes(table))
    _write_parquet(tables["estimates"], optional["covariance"], folder / "estimates.parquet")


def csv_bytes(table: pd.DataFrame) -> bytes:
    """Return a table as in the csv files of a results folder."""
    digits = "{:.15g}".format
    times = {n: table[n].map(digits, na_action="ignore") for n in _TIMES if n in table}
    text = table.assign(**times).to_csv(index=False, float_format=_FLOAT_FORMAT)
    return str(text).encode("utf-8")


def _write_json(file: Path, content: object, indent: int | None = 2) -> None:
    file.write_text(json.dumps(content, indent=indent, allow_nan=False) + "\n", encoding="utf-8")


def _write_parquet(estimates: pd.DataFrame, covariance: pd.DataFrame, path: Path) -> None:
    """Write estimates with their covariances as Parquet, if pyarrow is installed."""
    try:
        import pyarrow  # noqa: F401 - is it installed?
    except ImportError:
        return
    keys = ["participant", "session", "side", "timing_point", "parameter"]
    together = estimates.merge(covariance, on=keys, how="left", validate="one_to_one")
    together.to_parquet(path, engine="pyarrow", index=False, compression="zstd")
