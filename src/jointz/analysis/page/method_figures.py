"""Figures of the chosen method beside others, and of estimates against the truth."""

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Final

import numpy as np
import pandas as pd

from jointz.analysis.page.method_means import available, cells_by_method, method_mean
from jointz.analysis.summary import chosen_method
from jointz.core.channels import PARAMETER_UNITS, axis_label, pretty_unit
from jointz.core.gait_phases import ALL_POINTS
from jointz.report.style import legend_line, new_figure, panel_heading, place_legend, place_panels
from jointz.report.subjects import shown_parameters, subjects, timing_points
from jointz.report.wording import PARAMETERS, format_count, method_name, parameter_name
from jointz.results.figure_style import (
    BLUE,
    FAINT,
    GREEN,
    INK,
    MUTED,
    ORANGE,
    PURPLE,
    SMALL_PT,
    VERMILION,
    WIDTH_MM,
)
from jointz.results.study_analysis import StudyAnalysis

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

# The chosen method is drawn in ink; the others take these in turn.
_LOOKS: Final = (
    (VERMILION, "s"),
    (BLUE, "^"),
    (GREEN, "o"),
    (PURPLE, "v"),
    (ORANGE, "P"),
)
_TRUTH_TICKS: Final = 4  # more labels would touch
_LONGEST_REACH: Final = 1.5  # of the panels of truth, with intervals over without
_LEFT_MM: Final = 14.0
#: Height of a panel as wide as it is high, with its margin.
_SQUARE_MM: Final = (WIDTH_MM - 2.0) / 3 - _LEFT_MM - 4.0


def draw_methods(analysis: StudyAnalysis) -> "Figure | None":
    """Draw the means of the chosen method beside those of the other methods.

    The bars are t intervals over people, calculated alike for all methods from the available
    estimates; for one person they are the person's own. Means over unlike loads are not drawn.
    """
    parameters = shown_parameters((*analysis.cells, *analysis.comparison))
    unlike_loads = subjects(analysis).loads and len({c.participant for c in analysis.cells}) > 1
    if not analysis.comparison or not parameters or unlike_loads:
        return None
    by_method = cells_by_method(analysis)
    chosen = chosen_method(analysis)
    looks = _method_looks(by_method, chosen)
    figure = new_figure(67.0)
    panels = place_panels(figure, len(parameters), left_mm=_LEFT_MM, top_mm=14.0, height_mm=46.0)
    for axes, parameter in zip(panels, parameters, strict=True):
        _draw_method_panel(axes, analysis, parameter, looks)
    place_legend(figure, _method_legend(looks, chosen))
    return figure


def draw_truth(truth: pd.DataFrame) -> "Figure | None":
    """Draw estimates against the truth of a simulated study."""
    known = truth.dropna(subset=["truth", "estimate"])
    present = set(known["parameter"])
    parameters = [name for name in PARAMETERS if name in present][:3]
    if not parameters:
        return None
    figure = new_figure(66.0)
    panels = place_panels(
        figure, len(parameters), left_mm=_LEFT_MM, top_mm=13.0, height_mm=_SQUARE_MM
    )
    for axes, parameter in zip(panels, parameters, strict=True):
        _draw_truth_panel(axes, known[known["parameter"] == parameter], parameter)
    place_legend(figure, _truth_legend())
    return figure


def _method_looks(methods: Iterable[str], chosen: str) -> dict[str, tuple[str, str]]:
    others = [name for name in methods if name != chosen]
    looks = {name: _LOOKS[i % len(_LOOKS)] for i, name in enumerate(others)}
    return {chosen: (INK, "D")} | looks


def _draw_method_panel(
    axes: "Axes",
    analysis: StudyAnalysis,
    parameter: str,
    looks: Mapping[str, tuple[str, str]],
) -> None:
    by_method = cells_by_method(analysis)
    every = [c for own in by_method.values() for c in own]
    cells = [c for c in every if (p := c.parameter(parameter)) is not None and p.available]
    names = timing_points(cells)
    names += [ALL_POINTS] if any(c.timing_point == ALL_POINTS for c in cells) else []
    dodge = min(0.26, 0.6 / max(1, len(looks) - 1))
    for i, (method, (colour, marker)) in enumerate(looks.items()):
        found = [available(by_method[method], parameter, name) for name in names]
        means = [
            method_mean(analysis, method, own, name) for own, name in zip(found, names, strict=True)
        ]
        at = np.arange(len(names)) + (i - 0.5 * (len(looks) - 1)) * dodge
        _draw_method(axes, at, np.array(means, dtype=float), colour=colour, marker=marker)
        for place, own, mean in zip(at, found, means, strict=True):
            if np.isnan(mean[0]):
                values = np.array([p.value for p in own], dtype=float)
                axes.plot([place] * len(own), values, ".", markersize=3.0, color=colour, alpha=0.6)
    for edge in range(1, len(names)):
        axes.axvline(edge - 0.5, color=FAINT, linewidth=0.4, zorder=0)
    axes.set_xlim(-0.5, len(names) - 0.5)
    axes.set_xticks(range(len(names)), names, rotation=45 if len(names) > 8 else 0)
    axes.tick_params(axis="x", labelsize=SMALL_PT, length=0)
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    panel_heading(axes, axis_label(parameter))


def _draw_method(
    axes: "Axes", at: np.ndarray, means: np.ndarray, *, colour: str, marker: str
) -> None:
    value, low, high = means.reshape(-1, 3).T
    axes.vlines(at, low, high, colors=colour, linewidth=1.0)
    axes.plot(
        at, value, linestyle="none", marker=marker, markersize=4.0, color=colour,
        markeredgecolor="white", markeredgewidth=0.4,
    )  # fmt: skip


def _method_legend(looks: Mapping[str, tuple[str, str]], chosen: str) -> "list[Line2D]":
    return [
        legend_line(
            f"{method_name(method)} (chosen)" if method == chosen else method_name(method),
            colour,
            marker=marker,
            markeredgecolor="white",
            markeredgewidth=0.4,
        )
        for method, (colour, marker) in looks.items()
    ]


def _draw_truth_panel(axes: "Axes", rows: pd.DataFrame, parameter: str) -> None:
    covered = rows["covered"].astype(bool).to_numpy()
    x = rows["truth"].to_numpy(dtype=float)
    y = rows["estimate"].to_numpy(dtype=float)
    low, high = (rows[name].to_numpy(dtype=float) for name in ("ci_low", "ci_high"))
    reach = 1.12 * max(np.abs(x).max(), np.abs(y).max())
    # Intervals in full, unless they would squeeze the values.
    reach = min(max(reach, 1.04 * np.nanmax(high)), _LONGEST_REACH * reach)
    start = min(0.0, 1.12 * min(x.min(), y.min()))
    axes.plot([start, reach], [start, reach], color=FAINT, linewidth=0.8, zorder=0)
    for mask, colour, face in ((covered, BLUE, BLUE), (~covered, VERMILION, "white")):
        axes.vlines(x[mask], low[mask], high[mask], colors=colour, linewidth=0.6, alpha=0.6)
        axes.plot(
            x[mask], y[mask], linestyle="none", marker="o", markersize=3.0,
            markerfacecolor=face, markeredgecolor=colour, markeredgewidth=0.7,
        )  # fmt: skip
    axes.set(xlim=(start, reach), ylim=(start, reach))
    axes.set_xlabel(f"Truth ({pretty_unit(PARAMETER_UNITS[parameter])})")
    axes.set_ylabel("Estimate (same unit)")
    from matplotlib.ticker import MaxNLocator

    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(_TRUTH_TICKS))
    note = f"{format_count(int(covered.sum()), 'interval')} of {covered.size} contain it"
    panel_heading(axes, parameter_name(parameter).replace(" per body mass", " / mass"))
    axes.text(
        0.97, 0.04, note, transform=axes.transAxes, ha="right", fontsize=SMALL_PT, color=MUTED
    )  # fmt: skip


def _truth_legend() -> "list[Line2D]":
    return [
        legend_line("interval contains the truth", BLUE, marker="o"),
        legend_line("interval does not", VERMILION, marker="o", markerfacecolor="white"),
        legend_line("estimate = truth", FAINT),
    ]
