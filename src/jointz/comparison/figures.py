"""Figures of a comparison: means with single people, and differences with intervals."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from jointz.comparison.comparison_result import Comparison
from jointz.core.channels import PARAMETER_UNITS, axis_label, pretty_unit
from jointz.report.style import (
    broken_line,
    legend_line,
    new_figure,
    panel_heading,
    place_axes,
    place_legend,
    to_svg,
)
from jointz.report.wording import MINUS, PARAMETERS, point_name
from jointz.results.figure_style import (
    BLUE,
    FAINT,
    GREEN,
    INK,
    MUTED,
    ORANGE,
    PANEL,
    PURPLE,
    VERMILION,
    WIDTH_MM,
    figure_style,
)
from jointz.results.statistics.comparison_rows import PAIRED, Difference, PersonValue

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LOOKS: Final = ((BLUE, "D"), (VERMILION, "o"), (GREEN, "s"), (PURPLE, "^"), (ORANGE, "P"))
_PUBLISHED: Final = (MUTED, "v")
#: Marks in a panel; with more, panels are placed below each other.
_MOST_IN_A_THIRD: Final = 18
_LEFT_MM, _GAP_MM, _TOP_MM, _BELOW_MM = 13.0, 14.0, 13.0, 10.0
_DODGE: Final = 0.8
_LETTERS_IN_A_ROW: Final = 125
_LONGEST_CONTRAST: Final = 24
_ALPHA: Final = 0.05

_Panel = tuple[str, list[str]]


def draw_comparison(comparison: Comparison) -> dict[str, str]:
    """Draw the figures of a comparison."""
    with figure_style():
        figures = {}
        if any(m.mean is not None for m in comparison.means):
            figures["means"] = to_svg(_means(comparison))
        if any(d.available for d in comparison.differences):
            figures["differences"] = to_svg(_differences(comparison))
        return figures


def source_looks(comparison: Comparison) -> dict[str, tuple[str, str]]:
    """Return colour and mark of every source."""
    names = [s.name for s in comparison.sources if not s.published]
    looks = {name: _LOOKS[k % len(_LOOKS)] for k, name in enumerate(names)}
    return looks | {s.name: _PUBLISHED for s in comparison.sources if s.published}


# --- means ---------------------------------------------------------------------------------------


def _means(comparison: Comparison) -> "Figure":
    panels = [(p, _points_of(comparison, p)) for p in comparison.parameters]
    columns = _columns(comparison)
    crowded = max(len(points) for _, points in panels) * len(columns) > _MOST_IN_A_THIRD
    handles = _legend(comparison)
    figure, places = _placed(panels, stacked=crowded, top=_TOP_MM + _second_row_mm(handles))
    for axes, (parameter, points) in zip(places, panels, strict=True):
        for k, name in enumerate(columns):
            at = {point: i + _offset(k, len(columns)) for i, point in enumerate(points)}
            _draw_column(axes, comparison, (parameter, name), at)
        if not crowded or len(points) > 1:
            _draw_people_lines(axes, comparison, parameter, points)
        _draw_stated(axes, comparison, parameter, points)
        _finish_points(axes, parameter, points)
    _place_in_rows(figure, handles)
    return figure


def _columns(comparison: Comparison) -> list[str]:
    """Return the names of a timing point's columns: the sources, then the published mean."""
    beside = {r.name for r in comparison.references if r.value is not None}
    return [*(s.name for s in comparison.sources), *sorted(beside)]


def _points_of(comparison: Comparison, parameter: str) -> list[str]:
    return list(dict.fromkeys(m.timing_point for m in comparison.means if m.parameter == parameter))


def _placed(panels: Sequence[_Panel], *, stacked: bool, top: float) -> "tuple[Figure, list[Axes]]":
    if stacked:
        height = 44.0
        pitch = height + _BELOW_MM + 6.0
        figure = new_figure(top + pitch * len(panels))
        return figure, [
            place_axes(figure, _LEFT_MM, top + k * pitch,
                       width_mm=WIDTH_MM - _LEFT_MM - 2.0, height_mm=height)
            for k in range(len(panels))
        ]  # fmt: skip
    figure = new_figure(top + 64.0)
    shares = np.array([len(points) + 0.6 for _, points in panels])
    room = WIDTH_MM - _LEFT_MM - 2.0 - _GAP_MM * (len(panels) - 1)
    widths = np.minimum(room * shares / shares.sum(), 90.0)
    lefts = _LEFT_MM + np.concatenate([[0.0], np.cumsum(widths + _GAP_MM)[:-1]])
    return figure, [
        place_axes(figure, float(left), top, width_mm=float(width), height_mm=58.0)
        for left, width in zip(lefts, widths, strict=True)
    ]


def _offset(k: int, n: int) -> float:
    return 0.0 if n == 1 else _DODGE * ((k + 0.5) / n - 0.5)


def _draw_column(
    axes: "Axes", comparison: Comparison, of: tuple[str, str], at: Mapping[str, float]
) -> None:
    """Draw people as dots, and the mean with its interval, of one column."""
    parameter, name = of
    colour, mark = source_looks(comparison).get(name, _PUBLISHED)
    dots = [(at[v.timing_point], v.value) for v in comparison.values
            if (v.source, v.parameter) == (name, parameter) and v.value is not None]  # fmt: skip
    if dots and len(comparison.sources) > 1:
        axes.plot(*zip(*dots, strict=True), ".", color=colour, alpha=0.45, markersize=3.8,
                  markeredgewidth=0.0, zorder=2)  # fmt: skip
    for point, value, low, high in _bars(comparison, parameter, name):
        axes.vlines(at[point], low, high, colors=colour, linewidth=1.3, zorder=4)
        face = "white" if mark == _PUBLISHED[1] else colour
        axes.plot(at[point], value, mark, color=colour, markerfacecolor=face, markersize=4.4,
                  markeredgewidth=0.9, zorder=5)  # fmt: skip


def _bars(
    comparison: Comparison, parameter: str, name: str
) -> Iterator[tuple[str, float, float, float]]:
    """Yield timing point, mean and ends of its interval."""
    for m in comparison.means:
        if (m.parameter, m.source) == (parameter, name) and m.mean is not None:
            yield m.timing_point, m.mean, m.ci_low or 0.0, m.ci_high or 0.0
    for r in comparison.references:
        if (r.parameter, r.name) == (parameter, name) and r.value is not None:
            yield r.timing_point, r.value, r.low, r.high


def _draw_people_lines(
    axes: "Axes", comparison: Comparison, parameter: str, points: Sequence[str]
) -> None:
    """Join the values of one person: timing points of one source, or adjacent sources."""
    columns = _columns(comparison)
    known = {(v.source, v.participant, v.timing_point): v for v in comparison.values
            if v.parameter == parameter and v.value is not None}  # fmt: skip
    segments = []
    if len(comparison.sources) == 1:
        source = comparison.sources[0]
        for person in source.participants:
            row = [known.get((source.name, person, point)) for point in points]
            x = np.arange(len(points)) + _offset(0, len(columns))
            segments.append((x, np.array([np.nan if v is None else v.value for v in row])))
    paired = {(d.first, d.second) for d in comparison.differences if d.design == PAIRED}
    for k, (first, second) in enumerate(pairwise(columns)):
        if (first, second) in paired:
            x = np.array([_offset(k, len(columns)), _offset(k + 1, len(columns))])
            segments += _slopes(known, first, second, x=x, points=points)
    x, y = broken_line(segments)
    axes.plot(x, y, color=FAINT, linewidth=0.5, zorder=1)


def _slopes(
    known: Mapping[tuple[str, str, str], PersonValue],
    first: str,
    second: str,
    *,
    x: np.ndarray,
    points: Sequence[str],
) -> list[tuple[np.ndarray, np.ndarray]]:
    return [
        (points.index(point) + x, np.array([v.value, other.value], dtype=float))
        for (source, person, point), v in known.items()
        if source == first and (other := known.get((second, person, point))) is not None
    ]


def _draw_stated(
    axes: "Axes", comparison: Comparison, parameter: str, points: Sequence[str]
) -> None:
    """Draw the ranges stated in the literature; equal ranges of studies share a bar."""
    stated = [
        (r.timing_point, r.low, r.high)
        for r in comparison.references
        if r.value is None and r.parameter == parameter
    ]
    for point, low, high in dict.fromkeys(stated):
        axes.bar(points.index(point), high - low, bottom=low, width=0.9, color=PANEL,
                 edgecolor=FAINT, linewidth=0.5, zorder=0)  # fmt: skip


def _finish_points(axes: "Axes", parameter: str, points: Sequence[str]) -> None:
    axes.set_xticks(range(len(points)), [point_name(point) for point in points])
    axes.set_xlim(-0.6, len(points) - 0.4)
    axes.tick_params(axis="x", length=0)
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, 0.0) if low < 0.4 * high else low, high)
    panel_heading(axes, axis_label(parameter))


def _legend(comparison: Comparison) -> "list[Artist]":
    handles: list[Artist] = []
    looks = source_looks(comparison)
    for name in _columns(comparison):
        colour, mark = looks.get(name, _PUBLISHED)
        face = "white" if mark == _PUBLISHED[1] else colour
        n = next((len(s.participants) for s in comparison.sources if s.name == name), None)
        label = f"{name}, {n} people" if n else f"{name} (dissertation)"
        handles.append(legend_line(label, colour, marker=mark, markerfacecolor=face))
    handles.append(_people_handle(comparison))
    ranges = sorted({r.name for r in comparison.references if r.value is None})
    if ranges:
        handles.append(legend_line(f"{', '.join(ranges)}: range in words", FAINT, linewidth=4.0))
    return handles


def _second_row_mm(handles: "Sequence[Artist]") -> float:
    """Return the height of a second row of the legend, if one row is too narrow."""
    letters = sum(len(str(handle.get_label())) + 8 for handle in handles)
    return 4.5 if letters > _LETTERS_IN_A_ROW else 0.0


def _place_in_rows(figure: "Figure", handles: "Sequence[Artist]") -> None:
    halves = -(-len(handles) // 2) if _second_row_mm(handles) else len(handles)
    place_legend(figure, handles, columns=halves)


def _people_handle(comparison: Comparison) -> "Artist":
    if len(comparison.sources) == 1 or any(d.design == PAIRED for d in comparison.differences):
        return legend_line("a person", FAINT, linewidth=0.7)
    return legend_line("a person", MUTED, marker=".", linestyle="none", alpha=0.5)


# --- differences ---------------------------------------------------------------------------------


def _differences(comparison: Comparison) -> "Figure":
    shown = [d for d in comparison.differences if d.available]
    series = _series(shown)
    panels = [(p, _rows_of(shown, p)) for p in comparison.parameters]
    panels = [(p, rows) for p, rows in panels if rows]
    longest = max(len(rows) for _, rows in panels)
    height = longest * max(4.6, 2.6 * len(series) + 1.5)
    top = _TOP_MM + (4.0 if len(series) > 1 or comparison.margin_pct else -6.0)
    figure = new_figure(top + height + _BELOW_MM)
    left, gap = 22.0 if not shown[0].timing_point else 16.0, 9.0
    same = all(rows == panels[0][1] for _, rows in panels)
    room = WIDTH_MM - 2.0 - left - (len(panels) - 1) * (gap if same else left)
    width = room / len(panels)
    for k, (parameter, rows) in enumerate(panels):
        x = left + k * (width + (gap if same else left))
        axes = place_axes(figure, x, top, width_mm=width, height_mm=height * len(rows) / longest)
        _forest(axes, [d for d in shown if d.parameter == parameter], rows, series)
        axes.tick_params(axis="y", length=0, labelleft=k == 0 or not same)
        axes.set_xlabel(f"{_contrast(series)} ({pretty_unit(PARAMETER_UNITS[parameter])})")
        panel_heading(axes, PARAMETERS[parameter][1])
    _differences_legend(figure, comparison, series)
    return figure


def _series(shown: Sequence[Difference]) -> dict[tuple[str, str], tuple[str, str]]:
    """Return colour and mark of every pair of sources; timing points are one series."""
    if not shown[0].timing_point:
        return {("", ""): (INK, "o")}
    pairs = list(dict.fromkeys((d.first, d.second) for d in shown))
    if len(pairs) == 1:
        return {pairs[0]: (INK, "o")}
    return {pair: _LOOKS[k % len(_LOOKS)] for k, pair in enumerate(pairs)}


def _label(row: Difference) -> str:
    return point_name(row.timing_point) if row.timing_point else f"{row.first} {MINUS} {row.second}"


def _rows_of(shown: Sequence[Difference], parameter: str) -> list[str]:
    return list(dict.fromkeys(_label(d) for d in shown if d.parameter == parameter))


def _contrast(series: Mapping[tuple[str, str], Any]) -> str:
    (first, second), *more = series
    text = f"{first} {MINUS} {second}"
    return "difference" if more or not first or len(text) > _LONGEST_CONTRAST else text


def _forest(
    axes: "Axes",
    differences: Sequence[Difference],
    rows: Sequence[str],
    series: Mapping[tuple[str, str], tuple[str, str]],
) -> None:
    axes.axvline(0.0, color=MUTED, linewidth=0.7, zorder=1)
    pairs = list(series)
    axes.use_sticky_edges = False
    for d in differences:
        if d.difference is None or d.ci_low is None or d.ci_high is None:
            continue
        k = pairs.index((d.first, d.second)) if d.timing_point else 0
        y = rows.index(_label(d)) + _offset(k, len(pairs))
        colour, mark = series[pairs[k]]
        if d.margin is not None:
            axes.barh(y, 2.0 * d.margin, left=-d.margin, height=_DODGE / len(pairs), color=PANEL,
                      edgecolor=FAINT, linewidth=0.4, zorder=0)  # fmt: skip
        axes.hlines(y, d.ci_low, d.ci_high, colors=colour, linewidth=1.2, zorder=2)
        differs = d.p_adjusted is not None and d.p_adjusted < _ALPHA
        axes.plot(d.difference, y, mark, color=colour, markersize=4.0, markeredgewidth=0.9,
                  markerfacecolor=colour if differs else "white", zorder=3)  # fmt: skip
    axes.set_yticks(range(len(rows)), rows)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.locator_params(axis="x", nbins=4)


def _differences_legend(
    figure: "Figure", comparison: Comparison, series: Mapping[tuple[str, str], tuple[str, str]]
) -> None:
    handles: list[Artist] = [
        legend_line(f"{first} {MINUS} {second}", colour, marker=mark)
        for (first, second), (colour, mark) in series.items()
        if len(series) > 1
    ]
    if comparison.margin_pct is not None and len(comparison.sources) > 1:
        label = f"equivalence margin, {comparison.margin_pct:g} %"
        handles.append(legend_line(label, FAINT, linewidth=4.0))
    if handles:
        _place_in_rows(figure, handles)
