"""All figures of an analysis, as SVG text."""

from typing import TYPE_CHECKING, Final

from jointz.core.analysis import StudyAnalysis
from jointz.report.budget_figure import draw_budget
from jointz.report.event_figures import draw_onset_accuracy, draw_strides
from jointz.report.impedance_figures import draw_impedance_over_gait
from jointz.report.method_figures import draw_methods
from jointz.report.response_figures import draw_responses
from jointz.report.style import figure_style, to_svg
from jointz.report.subjects import subjects

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from matplotlib.figure import Figure

_FIGURES: "Final[Mapping[str, Callable[[StudyAnalysis], Figure | None]]]" = {
    "impedance_over_gait": draw_impedance_over_gait,
    "responses": draw_responses,
    "methods": draw_methods,
    "budget": draw_budget,
    "onset_accuracy": draw_onset_accuracy,
    "strides": draw_strides,
}


def draw_figures(analysis: StudyAnalysis) -> dict[str, str]:
    """Draw every figure the analysis has data for.

    The same analysis gives the same text. Nothing of the user's matplotlib
    settings is read or changed.

    Parameters
    ----------
    analysis : StudyAnalysis
        The analysis.

    Returns
    -------
    dict of str to str
        Name of the figure -> SVG text, 180 mm wide; a figure without data is
        not in it.

    Examples
    --------
    >>> draw_figures(StudyAnalysis(cells=()))
    {}
    """
    drawn = {}
    loads = {c.participant for c in analysis.cells} if subjects(analysis).bench else ()
    with figure_style():
        for name, draw in _FIGURES.items():
            # The methods are compared by means, and those over unlike loads mean nothing.
            figure = None if name == "methods" and len(loads) > 1 else draw(analysis)
            if figure is not None:
                drawn[name] = to_svg(figure)
    return drawn
