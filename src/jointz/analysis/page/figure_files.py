"""Figures of an analysis: how each is drawn, captioned, written and placed on the page."""

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any, Final, TypeVar

import pandas as pd

from jointz.analysis.page.captions import captions
from jointz.analysis.page.event_figures import draw_onset_accuracy, draw_strides
from jointz.analysis.page.gait_figures import draw_gait, draw_pulse_example
from jointz.analysis.page.impedance_figures import (
    draw_impedance_column,
    draw_impedance_over_gait,
    draw_impedance_overview,
)
from jointz.analysis.page.method_figures import draw_methods, draw_truth
from jointz.analysis.page.response_figures import draw_response_overview, draw_responses
from jointz.core.errors import DataError
from jointz.core.grouping import by_key
from jointz.report.html_page import page_figures
from jointz.report.style import to_pdf, to_svg
from jointz.results.figure_style import WIDTH_MM, Figure, figure_style
from jointz.results.study_analysis import StudyAnalysis

Format = TypeVar("Format")


@dataclass(frozen=True, slots=True)
class _ReportFigure:
    """How a figure is drawn from an analysis, and its heading and place on the page."""

    draw: "Callable[[StudyAnalysis], Figure | None] | None"  # None: drawn from the truth
    heading: str = ""
    section: str = ""  # of the template ``report.html.j2``; "": not on the page


#: In the order of the page.
_REPORT_FIGURES: Final[Mapping[str, _ReportFigure]] = {
    "impedance_overview": _ReportFigure(draw_impedance_overview, "Impedance", "first"),
    "impedance_over_gait": _ReportFigure(draw_impedance_over_gait, "Impedance", "participants"),
    "pulse_example": _ReportFigure(draw_pulse_example, "One pulse", "responses"),
    "response_overview": _ReportFigure(
        draw_response_overview, "Responses to the pulses", "responses"
    ),
    "responses": _ReportFigure(draw_responses, "Responses to the pulses", "responses"),
    "methods": _ReportFigure(draw_methods, "Comparison of methods", "methods"),
    "truth": _ReportFigure(None, "Truth against estimate", "truth"),
    "gait": _ReportFigure(draw_gait, "Mean stride", "recordings"),
    "onset_accuracy": _ReportFigure(draw_onset_accuracy, "Accuracy of the onset", "recordings"),
    "strides": _ReportFigure(draw_strides, "Strides", "recordings"),
    "impedance_column": _ReportFigure(draw_impedance_column),
}
#: Names of the figures that every analysis may have.
FIGURES: Final = tuple(name for name, figure in _REPORT_FIGURES.items() if figure.draw)
#: Widths of pages and columns.
_NARROWEST_MM: Final = 60.0
_WIDEST_MM: Final = 400.0
#: Short names.
_FOR_PAPERS: Final = {"impedance": "impedance_over_gait"}
#: Fonts for scripts that the figures' own font lacks, such as Chinese; none is installed with it.
_OTHER_FONTS: Final = (
    "Noto Sans CJK SC",
    "Noto Sans CJK JP",
    "Noto Sans CJK KR",
    "WenQuanYi Zen Hei",
    "Microsoft YaHei",
    "Yu Gothic",
    "Malgun Gothic",
    "Hiragino Sans",
    "PingFang SC",
    "Arial Unicode MS",
)


@dataclass(frozen=True, slots=True)
class Picture:
    """A figure in the formats that it is written in."""

    svg: str  # one ``<svg>`` element; text is outlines
    pdf: bytes | None = None  # the same, with text in embedded TrueType fonts, if requested


def draw_figures(analysis: StudyAnalysis) -> dict[str, str]:
    """Draw every figure that the analysis has data for, as SVG.

    The same analysis gives the same text. The user's matplotlib settings are neither read nor
    changed.
    """
    figures = {n: _written(_REPORT_FIGURES[n].draw, analysis, to_svg) for n in FIGURES}
    return {name: svg for name, svg in figures.items() if svg is not None}


def draw_paper_figure(
    analysis: StudyAnalysis, name: str, *, parameters: Sequence[str] | None, width_mm: float
) -> "Figure":
    """Return a figure of the report; raise ValueError for another name, DataError without data."""
    named = _FOR_PAPERS.get(name, name)
    if named not in FIGURES:
        raise ValueError(
            f"figure: expected one of {', '.join((*_FOR_PAPERS, *FIGURES))}, got {name!r}."
        )
    draw: Callable[[StudyAnalysis], Figure | None] | None = _REPORT_FIGURES[named].draw
    if named == _FOR_PAPERS["impedance"]:
        _check_options(analysis, parameters, width_mm)
        draw = partial(draw_impedance_over_gait, parameters=parameters, width_mm=width_mm)
    elif parameters is not None or width_mm != WIDTH_MM:
        raise ValueError(f"figure: parameters and width_mm are for 'impedance', not for {name!r}.")
    if (figure := _written(draw, analysis, lambda drawn: drawn)) is None:
        raise DataError(f"figure: the analysis has no data for {name!r}.")
    return figure


def _check_options(
    analysis: StudyAnalysis, parameters: Sequence[str] | None, width_mm: float
) -> None:
    names = {p.name for c in analysis.cells for p in c.parameters}
    if parameters is not None and (isinstance(parameters, str) or not names.issuperset(parameters)):
        raise ValueError(
            f"figure: parameters: expected some of {', '.join(sorted(names))}, got {parameters!r}."
        )
    if not _NARROWEST_MM <= width_mm <= _WIDEST_MM:
        raise ValueError(
            f"figure: width_mm: expected {_NARROWEST_MM:g} to {_WIDEST_MM:g}, got {width_mm:g}."
        )


def draw_picture(analysis: StudyAnalysis, name: str, *, pdf: bool = False) -> Picture | None:
    """Draw one figure once, as SVG and on request as PDF; None if there is no data for it."""
    return _written(_REPORT_FIGURES[name].draw, analysis, partial(_to_picture, pdf=pdf))


def draw_truth_picture(truth: pd.DataFrame, *, pdf: bool = False) -> Picture | None:
    """Draw estimates against the truth of a simulation; None if there is nothing to compare."""
    return _written(draw_truth, truth, partial(_to_picture, pdf=pdf))


def figures_by_section(
    analysis: StudyAnalysis, svgs: Mapping[str, str]
) -> dict[str, list[dict[str, Any]]]:
    """Return the figures of each section of the page, numbered in the order of the page."""
    texts = captions(analysis)
    # Of many people, the panels of each would be the longest part of the page.
    left_out = "responses" if "response_overview" in svgs else ""
    shown = {
        name: figure
        for name, figure in _REPORT_FIGURES.items()
        if figure.section and name in svgs and name != left_out
    }
    numbered = page_figures((n, svgs[n], f.heading, texts[n]) for n, f in shown.items())
    return by_key((shown[name].section, figure) for name, figure in numbered.items())


def _to_picture(figure: "Figure", *, pdf: bool) -> Picture:
    return Picture(to_svg(figure), to_pdf(figure) if pdf else None)


def _written(
    draw: "Callable[[Any], Figure | None] | None",
    data: StudyAnalysis | pd.DataFrame,
    write: "Callable[[Figure], Format]",
) -> "Format | None":
    with figure_style(), _fonts_of_any_script():
        figure = None if draw is None else draw(data)
        return None if figure is None else write(figure)


@contextmanager
def _fonts_of_any_script() -> Iterator[None]:
    """Use another font for letters that the usual one lacks, or boxes without a warning.

    A letter of the usual font is never taken from another: figures stay alike everywhere.
    """
    import matplotlib
    from matplotlib.font_manager import fontManager

    installed = {font.name for font in fontManager.ttflist}
    usual = matplotlib.rcParams["font.family"]
    family = [*usual, *(name for name in _OTHER_FONTS if name in installed)]
    with matplotlib.rc_context({"font.family": family}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"Glyph \d+ .* missing from", UserWarning)
        yield
