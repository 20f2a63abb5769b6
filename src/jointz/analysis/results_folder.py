"""Write an analysis as a folder: whole or not at all."""

import fnmatch
import json
import secrets
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

import pandas as pd

from jointz.analysis.page.details_tables import details_frame, models_frame
from jointz.analysis.page.figure_files import FIGURES, Picture, draw_picture, to_picture
from jointz.analysis.page.method_figures import truth_figure
from jointz.analysis.page.report_page import render_report
from jointz.analysis.paper.methods_text import methods_latex, methods_text
from jointz.analysis.paper.paper_tables import captions_text, paper_tables
from jointz.core.errors import OutputError, WriteError
from jointz.experiment.stop_signals import signals_held
from jointz.report.style import figure_style
from jointz.report.subjects import report_title
from jointz.results.run_report import RunReport
from jointz.results.study_analysis import StudyAnalysis
from jointz.tasks.engine import Engine, Serial
from jointz.tasks.shared_memory import shared_out

#: The file that shows a folder to be one of ours, and so replaceable.
MARKER = "provenance.json"
#: What a folder may hold, as its marker says (``made_by``); one never replaces another.
ANALYSIS, COMPARISON, REPRODUCTION = "analysis", "comparison", "reproduction"
#: What tells it of a folder whose marker is older and does not.
_TELLING = (
    (ANALYSIS, "estimates.csv"),
    (COMPARISON, "comparison.json"),
    (REPRODUCTION, "chapter[0-9].json"),
)
_FLOAT_FORMAT = "%.10g"
#: Columns of moments, which may count from 1970: that takes ten digits before the point.
_MOMENTS = ("onset_s", "start_s")


def write_results(
    analysis: StudyAnalysis,
    out: Path,
    *,
    overwrite: bool = False,
    truth: pd.DataFrame | None = None,
    run: RunReport | None = None,
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
    truth : pandas.DataFrame, optional
        Truth against estimate of a simulated study, for the report.
    run : RunReport, optional
        How the experiment went, for the report.
    engine : Engine, optional
        Draws several figures at once.

    Returns
    -------
    pathlib.Path
        The report.

    Raises
    ------
    OutputError
        When the folder exists and may not be replaced, or cannot be written.
    """
    with new_folder(out, marker=MARKER, overwrite=overwrite, made_by=ANALYSIS) as folder:
        drawings = _drawings(analysis, engine or Serial())
        _write_tables(analysis, folder)
        _write_json(folder / "statistics.json", dict(analysis.statistics))
        _write_json(folder / "analysis.json", analysis.to_dict(), indent=None)
        _write_paper(analysis, folder, simulated=truth is not None)
        drawn = {name: drawing() for name, drawing in drawings.items()}
        if truth is not None:
            drawn["truth"] = _draw_truth(truth)
        pictures = {name: picture for name, picture in drawn.items() if picture is not None}
        _write_figures(pictures, folder / "figures")
        title = report_title(analysis)
        figures = {name: picture.svg for name, picture in pictures.items()}
        page = render_report(analysis, figures, title=title, truth=truth, run=run)
        (folder / "report.html").write_text(page, encoding="utf-8")
        settings = {"settings": dict(analysis.settings)}
        kind = {"made_by": ANALYSIS}
        write_marker(folder, MARKER, {**analysis.provenance, **settings, **kind})
    return out / "report.html"


def _drawings(analysis: StudyAnalysis, engine: Engine) -> dict[str, Callable[[], Picture | None]]:
    """Have the figures drawn; the last, which takes longest, first."""
    calls: list[Callable[[], Picture | None]] = [
        partial(draw_picture, analysis, name) for name in FIGURES
    ]
    calls = shared_out(engine, calls[::-1])[::-1]
    return dict(zip(FIGURES, calls, strict=True))


def _draw_truth(truth: pd.DataFrame) -> Picture | None:
    with figure_style():
        figure = truth_figure(truth)
        return None if figure is None else to_picture(figure)


def _write_figures(pictures: Mapping[str, Picture], folder: Path) -> None:
    folder.mkdir()
    for name, picture in pictures.items():
        (folder / f"{name}.svg").write_text(picture.svg, encoding="utf-8")
        (folder / f"{name}.pdf").write_bytes(picture.pdf)


def _write_paper(analysis: StudyAnalysis, folder: Path, *, simulated: bool) -> None:
    """Write what goes into a paper: the methods and the tables."""
    texts = {"txt": methods_text, "tex": methods_latex}
    for suffix, written in texts.items():
        text = written(analysis, simulated=simulated)
        (folder / f"methods.{suffix}").write_text(text, encoding="utf-8")
    tables = paper_tables(analysis)
    (folder / "tables").mkdir()
    for name, table in tables.items():
        # With a mark of its encoding: a spreadsheet takes the dashes for something else without.
        table.to_frame().to_csv(
            folder / "tables" / f"{name}.csv", index=False, encoding="utf-8-sig"
        )
        text = table.to_latex(name)
        (folder / "tables" / f"{name}.tex").write_text(text, encoding="utf-8")
    (folder / "tables" / "captions.txt").write_text(captions_text(tables), encoding="utf-8")


def check_free(out: Path, *, marker: str, overwrite: bool, made_by: str | None = None) -> None:
    """Raise unless a folder can be made or replaced here."""
    if out.name in ("", ".."):  # a folder is made beside it and takes its name in the end
        raise OutputError(
            f"{out}: is no name for a new folder. Write its own, such as results or ../results."
        )
    with _refusals_told(out):
        if not out.exists() or (out.is_dir() and not any(out.iterdir())):
            return
    if not out.is_dir():
        raise OutputError(f"{out}: is a file. Name a folder that does not exist yet.")
    if not overwrite:
        raise OutputError(
            f"{out}: exists and is kept. Name another folder, or add --overwrite to replace it."
        )
    own = _own_files(out / marker)
    if own is None:
        raise OutputError(
            f"{out}: holds no {marker} of jointz, so jointz did not make it and will not replace "
            "it. Name another folder."
        )
    if made_by is not None:
        _check_kind(out, out / marker, made_by)
    foreign = sorted(_files(out) - own - {marker})
    if foreign:
        raise OutputError(
            f"{out}: holds files that jointz did not write ({', '.join(foreign[:3])}"
            f"{', ...' if len(foreign) > 3 else ''}) and will not replace it. Move them, or name "
            "another folder."
        )


def write_marker(folder: Path, marker: str, content: Mapping[str, object]) -> None:
    """Write the file that shows a folder to be ours; it lists all others, and comes last."""
    _write_json(folder / marker, {**content, "files": sorted(_files(folder) - {marker})})


def _files(folder: Path) -> set[str]:
    return {p.relative_to(folder).as_posix() for p in folder.rglob("*") if not p.is_dir()}


def _own_files(marker: Path) -> set[str] | None:
    """Return the files that a marker lists, None where it is none of ours."""
    try:
        listed = json.loads(marker.read_text(encoding="utf-8"))["files"]
        return set(map(str, listed))
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _kind(marker: Path) -> str:
    """Return what a folder holds, empty where its marker does not tell."""
    content = json.loads(marker.read_text(encoding="utf-8"))
    if "made_by" in content:
        return str(content["made_by"])
    names = list(map(str, content["files"]))
    return next((kind for kind, name in _TELLING if fnmatch.filter(names, name)), "")


def _check_kind(out: Path, marker: Path, made_by: str) -> None:
    """Refuse to replace what holds something else."""
    if (found := _kind(marker)) != made_by:
        raise OutputError(
            f"{out}: jointz made it as {found or 'something else'}, not as {made_by or 'this'}: it "
            "is kept, for --overwrite replaces the same kind only. Name another folder."
        )


@contextmanager
def new_folder(
    out: Path, *, marker: str, overwrite: bool, made_by: str | None = None
) -> Iterator[Path]:
    """Give a folder to fill, which takes its name only when all went well."""
    check_free(out, marker=marker, overwrite=overwrite, made_by=made_by)
    with _refusals_told(out), _parents(out), _partial(out) as partial:
        yield partial
        if (out / marker).exists():
            _check_kind(out, out / marker, _kind(partial / marker))
        with signals_held():
            _take_place(partial, out)


@contextmanager
def _refusals_told(out: Path) -> Iterator[None]:
    """Make a WriteError of what the system has against a folder."""
    try:
        yield
    except OSError as exc:
        todo = "Make room or ask for permission, or name another folder."
        raise WriteError(str(out), exc, todo) from exc


@contextmanager
def _parents(out: Path) -> Iterator[None]:
    """Make the folders above ``out``; those that were not there go when an exception passes."""
    missing = [parent for parent in out.parents if not parent.exists()]
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException:
        for parent in missing:
            with suppress(OSError):  # not empty any more, or never made
                parent.rmdir()
        raise


@contextmanager
def _partial(out: Path) -> Iterator[Path]:
    """Give a folder beside ``out`` that goes when an exception passes."""
    partial = _beside(out)
    try:  # from before it is there: an interrupt may come at any time
        partial.mkdir()
        yield partial
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        raise


def _beside(out: Path) -> Path:
    """Return a new name for a hidden folder beside another."""
    return out.with_name(f".{out.name}.partial-{secrets.token_hex(8)}")


def _take_place(partial: Path, out: Path) -> None:
    if not out.exists():
        partial.rename(out)
        return
    retired = _beside(out)
    retired.mkdir()
    old = out.rename(retired / out.name)
    try:
        partial.rename(out)
    except OSError:
        old.rename(out)
        raise
    finally:
        shutil.rmtree(retired, ignore_errors=True)


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
    if analysis.single:
        tables["single_pulses"] = analysis.single_frame()
    if rows := analysis.statistics.get("quasi_stiffness"):
        tables["quasi_stiffness"] = pd.DataFrame(rows)
    if analysis.models:
        tables["models"] = models_frame(analysis)
    if analysis.pooled:
        tables["pooled"] = analysis.pooled_frame()
    if (certificate := analysis.certificate) is not None:
        tables["certificate"] = certificate.to_frame()
    covariance = analysis.covariance_frame()
    if not covariance.empty:
        tables["covariance"] = covariance
    for name, table in tables.items():
        (folder / f"{name}.csv").write_bytes(csv_bytes(table))
    _write_parquet(tables["estimates"], covariance, folder / "estimates.parquet")


def csv_bytes(table: pd.DataFrame) -> bytes:
    """Return a table as the csv files of a results folder hold it."""
    digits = "{:.15g}".format
    moments = {n: table[n].map(digits, na_action="ignore") for n in _MOMENTS if n in table}
    text = table.assign(**moments).to_csv(index=False, float_format=_FLOAT_FORMAT)
    return str(text).encode("utf-8")


def _write_json(file: Path, content: object, indent: int | None = 2) -> None:
    file.write_text(json.dumps(content, indent=indent, allow_nan=False) + "\n", encoding="utf-8")


def _write_parquet(estimates: pd.DataFrame, covariance: pd.DataFrame, path: Path) -> bool:
    """Write estimates as Parquet, each with its covariances beside it."""
    try:
        import pyarrow  # noqa: F401 - only whether it is there
    except ImportError:
        return False
    keys = ["participant", "session", "side", "timing_point", "parameter"]
    together = estimates.merge(covariance, on=keys, how="left", validate="one_to_one")
    together.to_parquet(path, engine="pyarrow", index=False, compression="zstd")
    return True
