"""Write an analysis as a folder: whole or not at all."""

from collections.abc import Callable, Mapping
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import pandas as pd

from jointz.analysis.classical import comparison_table
from jointz.analysis.page.details_tables import details_frame, models_frame
from jointz.analysis.page.figure_files import FIGURES, Picture, draw_picture, draw_truth_picture
from jointz.analysis.page.report_page import render_report
from jointz.analysis.paper.methods_text import methods_latex, methods_text
from jointz.analysis.paper.paper_tables import captions_text, paper_tables
from jointz.io.folder_place import FolderState
from jointz.io.formats.columns import file_sha256
from jointz.io.new_folder import (
    ANALYSIS,
    CHECKSUMS,
    MARKER,
    files_in,
    new_folder,
    write_json,
    write_marker,
)
from jointz.report.subjects import report_title
from jointz.results.study_analysis import StudyAnalysis
from jointz.tasks.engine import Engine, Serial
from jointz.tasks.shared_memory import shared_out

_FLOAT_FORMAT = "%.10g"
#: Files of a folder -> content, in the order in which people need them.
_CONTENTS = {
    "report.html": "the report; opens offline. Start here",
    "estimates.csv": "K, B and J with 95 % intervals and status, by participant and timing point",
    "details.csv": "displacement, phase, unbounded value and stiffness without gravity of each",
    "population.csv": "means over people",
    "comparison.csv": "the same data by a second method",
    "single_pulses.csv": "estimates of single pulses",
    "quasi_stiffness.csv": "slopes of torque over angle in walking without a device",
    "certificate.csv": "errors to expect, from simulated people in the same protocol",
    "excluded.csv": "pulses and strides that were excluded, with the reason",
    "models.csv": "parameters that speak against the model, for each participant with doubts",
    "pulses.csv": "every pulse, with its planned and measured phase",
    "strides.csv": "every stride",
    "log_posterior.csv": "means and SDs of the logarithms of K, B and J, with their priors",
    "estimates.parquet": "estimates.csv as Parquet",
    "methods.txt": "methods section for a paper",
    "methods.tex": "the same in LaTeX",
    "tables": "rounded tables for print, as csv and LaTeX",
    "figures": "figures of the report for a paper (SVG)",
    "statistics.json": "tests, onsets, strides, warnings and notes",
    "provenance.json": "versions, settings, seed, and SHA-256 of all files",
    "analysis.json": "everything, for Python: jointz.load(FOLDER)",
}
#: Columns of times, which may count from 1970 and then have ten digits before the point.
_TIMES = ("onset_s", "start_s")


def write_results(  # noqa: PLR0913 - a public face, keywords only
    analysis: StudyAnalysis,
    out: Path,
    *,
    overwrite: bool = False,
    before: FolderState | None = None,
    truth: pd.DataFrame | None = None,
    accuracy: pd.DataFrame | None = None,
    figures: bool = True,
    pdf: bool = False,
    tables: bool = False,
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
        What ``check_free`` returned before the analysis; what appeared at ``out`` since then
        is never replaced.
    truth : pandas.DataFrame, optional
        Truth and estimates of a simulated study, for the report.
    accuracy : pandas.DataFrame, optional
        What several protocols decide of the same simulated people, for the report beside ``truth``:
        ``protocol, parameter, n_decided, n_cells, rms_error_pct, coverage``.
    figures : bool
        Whether to draw figures, which takes as long as the estimates of a few people.
    pdf : bool
        Whether to write the figures as PDF, too.
    tables : bool
        Whether to write all tables, too: pulses, strides, posteriors, Parquet, rounded tables for
        print, and LaTeX.
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
        drawings = _drawings(analysis, engine or Serial(), pdf=pdf) if figures else {}
        _write_tables(analysis, folder)
        write_json(folder / "statistics.json", dict(analysis.statistics))
        write_json(folder / "analysis.json", analysis.to_dict(), indent=None)
        (folder / "methods.txt").write_text(methods_text(analysis), encoding="utf-8")
        if tables:
            _write_more_tables(analysis, folder)
            _write_for_print(analysis, folder)
        drawn = {name: drawing() for name, drawing in drawings.items()}
        if truth is not None and figures:
            drawn["truth"] = draw_truth_picture(truth, pdf=pdf)
        pictures = {name: picture for name, picture in drawn.items() if picture is not None}
        _write_figures(pictures, folder / "figures")
        title = report_title(analysis)
        drawn_svgs = {name: picture.svg for name, picture in pictures.items()}
        page = render_report(analysis, drawn_svgs, title=title, truth=truth, accuracy=accuracy)
        (folder / "report.html").write_text(page, encoding="utf-8")
        (folder / "README.txt").write_text(_readme(analysis, folder), encoding="utf-8")
        content = {
            "settings": dict(analysis.settings),
            "made_by": ANALYSIS,
            CHECKSUMS: {name: file_sha256(folder / name) for name in sorted(files_in(folder))},
        }
        write_marker(folder, MARKER, {**analysis.provenance, **content})
    return out / "report.html"


def _drawings(
    analysis: StudyAnalysis, engine: Engine, *, pdf: bool
) -> dict[str, Callable[[], Picture | None]]:
    """Start to draw the figures; the last, which takes longest, first."""
    names = FIGURES[::-1]
    calls = [partial(draw_picture, analysis, name, pdf=pdf) for name in names]
    return dict(zip(names, shared_out(engine, calls), strict=True))


def _write_figures(pictures: Mapping[str, Picture], folder: Path) -> None:
    if pictures:
        folder.mkdir()
    for name, picture in pictures.items():
        (folder / f"{name}.svg").write_text(picture.svg, encoding="utf-8")
        if picture.pdf is not None:
            (folder / f"{name}.pdf").write_bytes(picture.pdf)


def _readme(analysis: StudyAnalysis, folder: Path) -> str:
    """Say what each file of a folder contains."""
    present = {p.name for p in folder.iterdir()} | {MARKER}
    made = analysis.provenance
    about = [report_title(analysis), f"{made.get('created', '')}"[:10]]
    about += [f"jointz {made['jointz']}"] if "jointz" in made else []
    lines = [f"{name:20} {content}" for name, content in _CONTENTS.items() if name in present]
    return "\n".join([
        f"{', '.join(filter(None, about))}. SI units, except _pct (%); empty fields are missing.",
        *lines,
        *([] if "strides.csv" in present else ["More tables, also for LaTeX: analyze --tables"]),
        "",
    ])  # fmt: skip


def _write_tables(analysis: StudyAnalysis, folder: Path) -> None:
    _write_csv(
        {
            "estimates": analysis.to_frame(),
            "details": details_frame(analysis),
            "comparison": comparison_table(analysis),
            "population": analysis.population_frame(),
            "excluded": analysis.excluded_frame(),
        },
        folder,
    )
    certificate = analysis.certificate
    where_they_apply = {
        "single_pulses": analysis.single_frame(),
        "quasi_stiffness": pd.DataFrame(analysis.statistics.get("quasi_stiffness") or ()),
        "models": models_frame(analysis),
        "certificate": pd.DataFrame() if certificate is None else certificate.to_frame(),
    }
    _write_csv({n: table for n, table in where_they_apply.items() if not table.empty}, folder)


def _write_more_tables(analysis: StudyAnalysis, folder: Path) -> None:
    """Write what few people need: every pulse and stride, posteriors, Parquet."""
    tables = {"pulses": analysis.pulses_frame(), "strides": analysis.strides_frame()}
    if analysis.log_posteriors:
        tables["log_posterior"] = analysis.log_posterior_frame()
    _write_csv(tables, folder)
    if find_spec("pyarrow"):
        parquet = folder / "estimates.parquet"
        analysis.to_frame().to_parquet(parquet, engine="pyarrow", index=False, compression="zstd")


def _write_for_print(analysis: StudyAnalysis, folder: Path) -> None:
    """Write methods in LaTeX and rounded tables."""
    (folder / "methods.tex").write_text(methods_latex(analysis), encoding="utf-8")
    printed, tables = paper_tables(analysis), folder / "tables"
    tables.mkdir()
    for name, table in printed.items():
        # With a mark of its encoding, without which a spreadsheet misreads the dashes.
        table.to_frame().to_csv(tables / f"{name}.csv", index=False, encoding="utf-8-sig")
        (tables / f"{name}.tex").write_text(table.to_latex(name), encoding="utf-8")
    (tables / "captions.txt").write_text(captions_text(printed), encoding="utf-8")


def _write_csv(tables: Mapping[str, pd.DataFrame], folder: Path) -> None:
    for name, table in tables.items():
        (folder / f"{name}.csv").write_bytes(csv_bytes(table))


def csv_bytes(table: pd.DataFrame) -> bytes:
    """Return a table as in the csv files of a results folder."""
    digits = "{:.15g}".format
    times = {n: table[n].map(digits, na_action="ignore") for n in _TIMES if n in table}
    text = table.assign(**times).to_csv(index=False, float_format=_FLOAT_FORMAT)
    return str(text).encode("utf-8")
