"""Write an analysis as a folder: whole or not at all."""

from collections.abc import Callable, Mapping
from functools import partial
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
        _write_paper(analysis, folder)
        drawn = {name: drawing() for name, drawing in drawings.items()}
        if truth is not None and figures:
            drawn["truth"] = draw_truth_picture(truth, pdf=pdf)
        pictures = {name: picture for name, picture in drawn.items() if picture is not None}
        _write_figures(pictures, folder / "figures")
        title = report_title(analysis)
        drawn_svgs = {name: picture.svg for name, picture in pictures.items()}
        page = render_report(analysis, drawn_svgs, title=title, truth=truth, accuracy=accuracy)
        (folder / "report.html").write_text(page, encoding="utf-8")
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


def _write_paper(analysis: StudyAnalysis, folder: Path) -> None:
    """Write the methods and the tables of a paper."""
    texts = {"txt": methods_text, "tex": methods_latex}
    for suffix, written in texts.items():
        (folder / f"methods.{suffix}").write_text(written(analysis), encoding="utf-8")
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


def _write_tables(analysis: StudyAnalysis, folder: Path) -> None:
    tables = {
        "estimates": analysis.to_frame(),
        "details": details_frame(analysis),
        "comparison": comparison_table(analysis),
        "population": analysis.population_frame(),
        "excluded": analysis.excluded_frame(),
        "pulses": analysis.pulses_frame(),
        "strides": analysis.strides_frame(),
    }
    optional = {
        "single_pulses": analysis.single_frame(),
        "quasi_stiffness": pd.DataFrame(analysis.statistics.get("quasi_stiffness") or ()),
        "models": models_frame(analysis),
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


def _write_parquet(estimates: pd.DataFrame, covariance: pd.DataFrame, path: Path) -> None:
    """Write estimates with their covariances as Parquet, if pyarrow is installed."""
    try:
        import pyarrow  # noqa: F401 - is it installed?
    except ImportError:
        return
    keys = ["participant", "session", "side", "timing_point", "parameter"]
    together = estimates.merge(covariance, on=keys, how="left", validate="one_to_one")
    together.to_parquet(path, engine="pyarrow", index=False, compression="zstd")
