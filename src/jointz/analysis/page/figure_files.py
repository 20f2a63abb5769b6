"""All figures of an analysis, as SVG text and as PDF."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, TypeVar

from jointz.analysis.page.budget_figure import draw_budget
from jointz.analysis.page.event_figures import draw_onset_accuracy, draw_strides
from jointz.analysis.page.method_figures import draw_methods
from jointz.analysis.page.response_figures import draw_responses
from jointz.report.impedance_figures import draw_impedance_column, draw_impedance_over_gait
from jointz.report.style import figure_style, to_pdf, to_svg
from jointz.report.subjects import subjects
from jointz.results.study_analysis import StudyAnalysis

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from matplotlib.figure import Figure

_DRAWN: "Final[Mapping[str, Callable[[StudyAnalysis], Figure | None]]]" = {
    "impedance_over_gait": draw_impedance_over_gait,
    "responses": draw_responses,
    "methods": draw_methods,
    "budget": draw_budget,
    "onset_accuracy": draw_onset_accuracy,
    "strides": draw_strides,
    "impedance_column": draw_impedance_column,
}
Format = TypeVar("Format")
#: Fonts for what the figures' own cannot write, as a name in Chinese; none of them comes along.
_OTHER_FONTS: "Final" = (
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
#: Names of all figures, in the order of the report; what it does not show comes last.
FIGURES = tuple(_DRAWN)


@dataclass(frozen=True, slots=True)
class Picture:
    """A figure in the formats that it is written in."""

    svg: str  # one ``<svg>`` element; text is outlines
    pdf: bytes  # the same, with text in embedded TrueType fonts


def draw_figures(analysis: StudyAnalysis) -> dict[str, str]:
    """Draw every figure the analysis has data for.

    The same analysis gives the same text. Nothing of the user's matplotlib
    settings is read or changed.
    """
    drawn = {name: draw_figure(analysis, name) for name in FIGURES}
    return {name: svg for name, svg in drawn.items() if svg is not None}


def draw_figure(analysis: StudyAnalysis, name: str) -> str | None:
    """Draw one figure; None where the analysis has no data for it."""
    return _drawn(analysis, name, to_svg)


def draw_picture(analysis: StudyAnalysis, name: str) -> Picture | None:
    """Draw one figure once, and write it in every format; None where there is no data for it."""
    return _drawn(analysis, name, to_picture)


def to_picture(figure: "Figure") -> Picture:
    """Write a figure in every format; inside :func:`~jointz.report.style.figure_style` only."""
    return Picture(to_svg(figure), to_pdf(figure))


def _drawn(
    analysis: StudyAnalysis, name: str, written: "Callable[[Figure], Format]"
) -> "Format | None":
    loads = {c.participant for c in analysis.cells} if subjects(analysis).loads else ()
    # The methods are compared by means, and those over unlike loads mean nothing.
    if name == "methods" and len(loads) > 1:
        return None
    with figure_style(), _any_script():
        figure = _DRAWN[name](analysis)
        return None if figure is None else written(figure)


@contextmanager
def _any_script() -> Iterator[None]:
    """Write what the usual font lacks in another where there is one, else as boxes in silence.

    A letter that the usual font has is never taken from another: figures stay alike everywhere.
    """
    import matplotlib
    from matplotlib.font_manager import fontManager

    there = {font.name for font in fontManager.ttflist}
    usual = matplotlib.rcParams["font.family"]
    family = [*usual, *(name for name in _OTHER_FONTS if name in there)]
    with matplotlib.rc_context({"font.family": family}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"Glyph \d+ .* missing from", UserWarning)
        yield
