"""Figures of impedance over the gait cycle, on a page and in a column."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from jointz.analysis.classical import cells_of_both, classical_analysis
from jointz.core.channels import axis_label
from jointz.core.gait_phases import ALL_POINTS, circular_mean_pct
from jointz.report.style import (
    legend_line,
    new_figure,
    panel_heading,
    place_axes,
    place_legend,
    place_panels,
    shade_phases,
)
from jointz.report.subjects import shown_parameters, subjects, timing_points
from jointz.report.wording import ABSOLUTE, format_count, parameter_name
from jointz.results.estimates import CellEstimate, ParameterEstimate
from jointz.results.figure_style import BLUE, COLUMN_MM, FAINT, GREY, INK, SKY, WIDTH_MM
from jointz.results.study_analysis import PopulationEstimate, StudyAnalysis

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

_LEFT_MM: Final = 16.0
_LEGEND_ROW_MM: Final = 4.0
_MOST_NARROW_TICKS: Final = 8
#: Where the name of the first phase, which stands left of its band, has room in a column.
_NARROW_START_PCT: Final = -9.0
_MEAN_MARK: Final = {"marker": "D", "markeredgecolor": "white", "linewidth": 1.8}
_WIDEST_FAN_PCT: Final = 4.5
# An interval this many times longer than the largest value would hide all others.
_LONGEST_INTERVAL: Final = 1.8


@dataclass(frozen=True, slots=True)
class _Layout:
    """Sizes of the figure for one width of a page."""

    width_mm: float  # width of the figure
    panel_mm: float  # height of a panel
    between_mm: float  # distance between panels
    above_mm: float  # space above the first panel, without the legend
    below_mm: float  # space below the last panel, added to ``between_mm``
    marks: float = 1.0  # scale of marks and lines
    phase_names: bool = True  # whether the gait phases are named in the panels
    bars_beside_means: bool = True  # whether people have bars where there are means over them

    @property
    def narrow(self) -> bool:
        """Whether text that stands side by side on a page must be stacked."""
        return self.width_mm < WIDTH_MM


_CellParameter = tuple[CellEstimate, ParameterEstimate]
_PAGE: Final = _Layout(WIDTH_MM, 42.0, 16.0, 9.0, -5.0)
_COLUMN: Final = _Layout(COLUMN_MM, 32.0, 18.5, 10.5, -2.0, marks=0.7)
#: One of three panels side by side.
_THIRD: Final = _Layout(
    WIDTH_MM / 3, 42.0, 0.0, 14.0, 14.0, marks=0.7, phase_names=False, bars_beside_means=False
)


@dataclass(frozen=True, slots=True)
class _Mark:
    """One estimate to draw: place, value, interval, and whether it is at its bound."""

    x: float  # position on the axis: % of the gait cycle, or number of the group from 0
    value: float  # SI unit of the parameter, as are the ends of the interval
    low: float | None  # lower end of the interval
    high: float | None  # upper end of the interval
    at_bound: bool


def draw_impedance_column(analysis: StudyAnalysis) -> "Figure | None":
    """Draw the impedance at the width of a single column."""
    return _draw_impedance(analysis, _COLUMN)


def draw_impedance_over_gait(
    analysis: StudyAnalysis,
    parameters: Sequence[str] | None = None,
    width_mm: float = WIDTH_MM,
) -> "Figure | None":
    """Draw each person's estimates and the means over people, one panel for each parameter."""
    layout = _PAGE if width_mm > COLUMN_MM else _COLUMN
    return _draw_impedance(analysis, replace(layout, width_mm=width_mm), parameters)


def draw_impedance_overview(analysis: StudyAnalysis) -> "Figure | None":
    """Draw people and means over them in one row of panels, for the first page of a report."""
    beside = overview_marks(analysis)
    parameters = list(beside)
    if not parameters:
        return None
    figure = new_figure(_THIRD.above_mm + _THIRD.panel_mm + _THIRD.below_mm)
    panels = place_panels(
        figure,
        len(parameters),
        left_mm=_LEFT_MM - 2.0,
        top_mm=_THIRD.above_mm,
        height_mm=_THIRD.panel_mm,
    )
    for axes, parameter in zip(panels, parameters, strict=True):
        _draw_parameter(axes, analysis, parameter, _THIRD, beside=beside[parameter])
    bars = {m.parameter for m in mean_estimates(analysis, parameters)} < set(parameters)
    handles = _legend(analysis, parameters, people_bars=bars)
    if any(beside.values()):
        handles.append(legend_line("classical", GREY, **_MEAN_MARK))
    place_legend(figure, handles)
    return figure


def quantities_without_panel(analysis: StudyAnalysis, drawn: Sequence[str] = ()) -> list[str]:
    """Name the quantities without an available estimate: they have no panel."""
    estimates = [p for c in analysis.cells for p in c.parameters]
    missing = {p.name for p in estimates} - {p.name for p in estimates if p.available}
    missing -= {name.removesuffix("_per_mass") for name in drawn}
    return [parameter_name(n).lower() for n in ABSOLUTE if n in missing]


def _draw_impedance(
    analysis: StudyAnalysis, layout: "_Layout", parameters: Sequence[str] | None = None
) -> "Figure | None":
    available = {p.name for c in analysis.cells for p in c.parameters if p.available}
    names = shown_parameters(analysis.cells) if parameters is None else parameters
    parameters = [name for name in names if name in available]
    if not parameters:
        return None
    handles = _legend(analysis, parameters)
    top = layout.above_mm + (len(handles) * _LEGEND_ROW_MM if layout.narrow else _LEGEND_ROW_MM)
    pitch = layout.panel_mm + layout.between_mm
    height = top + pitch * len(parameters) + layout.below_mm
    figure = new_figure(height, width_mm=layout.width_mm)
    for row, parameter in enumerate(parameters):
        axes = place_axes(
            figure,
            _LEFT_MM,
            top + row * pitch,
            width_mm=layout.width_mm - _LEFT_MM - 3.0,
            height_mm=layout.panel_mm,
        )
        _draw_parameter(axes, analysis, parameter, layout)
    place_legend(figure, handles, columns=1 if layout.narrow else None)
    return figure


def _draw_parameter(
    axes: "Axes",
    analysis: StudyAnalysis,
    parameter: str,
    layout: "_Layout",
    *,
    beside: Mapping[str, _Mark] | None = None,
) -> None:
    estimates = [(c, p) for c in analysis.cells if (p := c.parameter(parameter)) is not None]
    means = mean_estimates(analysis, [parameter])
    groups = {c.timing_point for c, p in estimates if p.available}
    grey: list[_Mark] = []
    if groups == {ALL_POINTS}:
        marks, mean_marks = _draw_people_axis(axes, estimates, means)
    else:
        positions, fan = _group_axis(
            axes, [c for c, _ in estimates], phase_names=layout.phase_names
        )
        marks = _fan_out(estimates, positions, fan, with_mean=bool(means))
        placed = [m for m in means if m.timing_point in positions]
        mean_marks = [_mark(m, positions[m.timing_point]) for m in placed]
        grey = [replace(mark, x=positions[name]) for name, mark in (beside or {}).items()]
    if mean_marks and not layout.bars_beside_means:
        marks = [replace(m, low=None, high=m.high if m.at_bound else None) for m in marks]
    low, high = _fit_height(axes, [*marks, *mean_marks, *grey])
    mean_size, mean_width = 4.0 * layout.marks, 1.8 * layout.marks
    beyond = _draw_cut_ends(axes, marks, low, high, colour=SKY, size=2.8 * layout.marks)
    beyond += _draw_cut_ends(axes, mean_marks, low, high, colour=INK, size=mean_size)
    marks, mean_marks, grey = (
        [_clipped(m, low, high) for m in some] for some in (marks, mean_marks, grey)
    )
    if grey:
        _draw_marks(axes, grey, colour=GREY, size=mean_size, width=mean_width, marker="D")
    _draw_marks(axes, marks, colour=SKY, size=2.8 * layout.marks, width=0.9 * layout.marks)
    _draw_marks(axes, mean_marks, colour=INK, size=mean_size, width=mean_width, marker="D")
    axes.set_ylabel(axis_label(parameter))
    if layout.narrow:
        _fit_to_column(axes)
    note = _note([p for _, p in estimates], len(marks), beyond)
    panel_heading(axes, parameter_name(parameter), note=note, stacked=layout.narrow)


def overview_marks(analysis: StudyAnalysis) -> dict[str, dict[str, _Mark]]:
    """Return the parameters that have a value to draw -> timing point -> classical value."""
    classical = classical_analysis(analysis)
    marks = _classical_marks(analysis, classical)
    own = shown_parameters(analysis.cells)
    names = shown_parameters(cells_of_both(analysis, classical))
    return {name: marks[name] for name in names if name in own or marks[name]}


def _classical_marks(
    analysis: StudyAnalysis, classical: StudyAnalysis | None
) -> dict[str, dict[str, _Mark]]:
    """Return parameter -> timing point -> classical value, where the joint's own has no mark.

    A mean over people, or the value of the only person.
    """
    marks: dict[str, dict[str, _Mark]] = defaultdict(dict)
    if classical is None:
        return marks
    own = {(c.timing_point, p.name) for c in analysis.cells for p in c.parameters if p.available}
    own |= {(m.timing_point, m.parameter) for m in analysis.population if m.value is not None}
    several = len({c.label for c in classical.cells}) > 1
    means = [(m.timing_point, m.parameter, m) for m in classical.population if m.value is not None]
    alone = [(c.timing_point, p.name, p) for c in classical.cells for p in c.parameters]
    for point, parameter, estimate in means if several else alone:
        if (several or estimate.status == "ok") and (point, parameter) not in own:
            marks[parameter][point] = _mark(estimate, 0.0)
    return marks


def _fit_to_column(axes: "Axes") -> None:
    """Make room along an axis: names are turned, numbers written half as often."""
    from matplotlib.ticker import ScalarFormatter

    ticks = axes.get_xticks()
    if not isinstance(axes.xaxis.get_major_formatter(), ScalarFormatter):
        axes.tick_params(axis="x", labelrotation=60 if ticks.size > _MOST_NARROW_TICKS else 0)
        return
    axes.set_xticks(ticks[::2])
    axes.set_xlim(left=min(axes.get_xlim()[0], _NARROW_START_PCT))


def mean_estimates(analysis: StudyAnalysis, parameters: Sequence[str]) -> list[PopulationEstimate]:
    """Return the means over more than one participant."""
    means = (m for m in analysis.population if m.parameter in parameters)
    return [m for m in means if m.value is not None and m.n_participants > 1]


def _draw_people_axis(
    axes: "Axes",
    estimates: Sequence[_CellParameter],
    means: Sequence[PopulationEstimate],
) -> tuple[list[_Mark], list[_Mark]]:
    """Put people side by side, for a value that their timing points share."""
    people = list(dict.fromkeys(cell.label for cell, _ in estimates))
    names = [*people, "mean"] if means else people
    axes.set_xlim(-0.6, len(names) - 0.4)
    axes.set_xticks(range(len(names)), names, rotation=45 if len(names) > 16 else 0)
    axes.set_xlabel("Participant (one value for all timing points)")
    marks = [_mark(p, people.index(c.label)) for c, p in estimates if p.available]
    return marks, [_mark(m, len(people)) for m in means[:1]]


def _group_axis(
    axes: "Axes", cells: Sequence[CellEstimate], *, phase_names: bool
) -> tuple[dict[str, float], float]:
    """Set up the axis of gait phase, or of the groups of a bench study."""
    onsets: dict[str, list[float]] = {}
    for cell in cells:
        if cell.onset_gait_pct is not None:
            onsets.setdefault(cell.timing_point, []).append(cell.onset_gait_pct)
    if not onsets:
        names = timing_points(cells)
        axes.set_xlim(-0.6, len(names) - 0.4)
        axes.set_xticks(range(len(names)), names, rotation=30 if len(names) > 10 else 0)
        return {name: float(i) for i, name in enumerate(names)}, 0.36
    positions = {name: circular_mean_pct(values) for name, values in onsets.items()}
    x = np.sort(list(positions.values()))
    fan = min(_WIDEST_FAN_PCT, 0.42 * float(np.diff(x).min())) if x.size > 1 else _WIDEST_FAN_PCT
    axes.set_xlim(min(-5.0, x[0] - fan - 1.0), max(100.0, x[-1] + fan + 1.0))
    axes.set_xticks(np.arange(0, 101, 10))
    several = len({c.label for c in cells}) > 1
    between = "; " if phase_names else "\n"
    axes.set_xlabel(f"Gait cycle (%){f'{between}participants side by side' if several else ''}")
    shade_phases(axes, names=phase_names)
    return positions, fan


def _fan_out(
    estimates: Sequence[_CellParameter],
    positions: Mapping[str, float],
    fan: float,
    *,
    with_mean: bool,
) -> list[_Mark]:
    """Spread people around each position so that bars do not overlap."""
    people = list(dict.fromkeys(cell.label for cell, _ in estimates))
    offsets = dict(zip(people, _offsets(len(people), fan, gap=with_mean), strict=True))
    return [
        _mark(p, positions[c.timing_point] + offsets[c.label])
        for c, p in estimates
        if p.available and c.timing_point in positions
    ]


def _offsets(count: int, fan: float, *, gap: bool) -> np.ndarray:
    """Return sideways offsets, with a gap for the mean in the middle."""
    if not gap:
        return np.linspace(-fan, fan, count) if count > 1 else np.zeros(1)
    half = count // 2
    inner = 0.34 * fan
    left = np.linspace(-fan, -inner, count - half)
    right = np.linspace(fan, inner, half)[::-1]
    return np.concatenate([left, right])


def _mark(estimate: ParameterEstimate | PopulationEstimate, x: float) -> _Mark:
    value = estimate.value if estimate.value is not None else estimate.ci_low or 0.0
    return _Mark(x, value, estimate.ci_low, estimate.ci_high, estimate.status == "at_bound")


def _draw_marks(
    axes: "Axes",
    marks: Sequence[_Mark],
    *,
    colour: str,
    size: float,
    width: float,
    marker: str = "o",
) -> None:
    """Draw two-sided intervals as bars, upper limits as open triangles."""
    with_bar = [m for m in marks if m.low is not None and m.high is not None]
    edge = BLUE if colour == SKY else colour
    zorder = 3 if colour == SKY else 5
    axes.vlines(
        [m.x for m in with_bar],
        [m.low for m in with_bar if m.low is not None],
        [m.high for m in with_bar if m.high is not None],
        colors=colour,
        linewidth=width,
        linestyles="solid",
        zorder=zorder,
    )
    two_sided = [m for m in marks if not m.at_bound]
    axes.plot(
        [m.x for m in two_sided],
        [m.value for m in two_sided],
        linestyle="none",
        marker=marker,
        markersize=size,
        markerfacecolor=edge,
        markeredgecolor="white",
        markeredgewidth=0.4,
        zorder=zorder + 1,
    )
    limits = [m for m in marks if m.at_bound and m.high is not None]
    axes.plot(
        [m.x for m in limits],
        [m.high for m in limits if m.high is not None],
        linestyle="none",
        marker="v",
        markersize=size + 1.0,
        markerfacecolor="white",
        markeredgecolor=edge,
        markeredgewidth=0.9,
        zorder=zorder + 1,
    )


def _draw_cut_ends(
    axes: "Axes", marks: Sequence[_Mark], low: float, high: float, *, colour: str, size: float
) -> int:
    """Draw an arrowhead at each end that is cut off; return their number."""
    above = [m.x for m in marks if m.high is not None and _beyond(m.high, low, high)]
    below = [m.x for m in marks if m.low is not None and _beyond(m.low, low, high)]
    heads = [(above, high, "^")] * bool(above) + [(below, low, "v")] * bool(below)
    for x, at, marker in heads:
        axes.plot(
            x, [at] * len(x), linestyle="none", marker=marker, markersize=size, color=colour,
            markeredgewidth=0.0, zorder=4,
        )  # fmt: skip
    return len(above) + len(below)


def _beyond(end: float, low: float, high: float) -> bool:
    return end > high + 1e-12 or end < low - 1e-12


def _clipped(mark: _Mark, low: float, high: float) -> _Mark:
    """Return a mark whose interval ends below the names of the phases."""
    ends = [None if e is None else min(max(e, low), high) for e in (mark.low, mark.high)]
    return replace(mark, low=ends[0], high=ends[1])


def _fit_height(axes: "Axes", marks: Sequence[_Mark]) -> tuple[float, float]:
    """Set the limits of the axis; return those within which intervals are drawn."""
    values = np.array([m.value for m in marks] + [m.high for m in marks if m.at_bound and m.high])
    ends = np.array([e for m in marks for e in (m.low, m.high) if e is not None] or [0.0])
    # If no value differs from zero, as the damping of a spring, intervals set the scale.
    usual = max(float(np.abs(values).max()), float(np.median(np.abs(ends))))
    reach = _LONGEST_INTERVAL * usual
    top = min(max(ends.max(), values.max()), reach)
    bottom = max(min(ends.min(), values.min(), 0.0), -reach)
    span = (top - bottom) or 1.0
    # The upper margin is for the names of the gait phases.
    axes.set_ylim(bottom - (0.04 * span if bottom < 0 else 0.0), top + 0.14 * span)
    if bottom < 0:
        axes.axhline(0.0, color=FAINT, linewidth=0.6, zorder=1)
    return float(bottom), float(top)


def _note(estimates: Sequence[ParameterEstimate], drawn: int, beyond: int) -> str:
    counts = {
        "failed": sum(p.status.startswith("failed") for p in estimates),
        "undecided": sum(p.status == "undecided" for p in estimates),
        "without an onset": sum(p.available for p in estimates) - drawn,
    }
    missing = ", ".join(f"{count} {words}" for words, count in counts.items() if count)
    texts = [f"not drawn: {missing}"] if missing else []
    texts += [f"{format_count(beyond, 'interval')} cut off"] if beyond else []
    return " · ".join(texts)


def _legend(
    analysis: StudyAnalysis, parameters: Sequence[str], *, people_bars: bool = True
) -> "list[Line2D]":
    drawn = [
        p for c in analysis.cells for p in c.parameters if p.name in parameters and p.available
    ]
    if not drawn:
        return []
    level = f"{100 * drawn[0].ci_level:g} % interval"
    several = len({c.label for c in analysis.cells}) > 1
    dot = {"marker": "o", "markerfacecolor": BLUE, "markeredgecolor": "white"}
    label = subjects(analysis).one if several else "estimate"
    bar = {} if people_bars else {"linestyle": "none"}
    text = f"{label}, {level}" if people_bars else label
    handles = [legend_line(text, SKY, **dot, **bar)]
    if mean_estimates(analysis, parameters):
        handles.append(legend_line(f"mean over participants, {level}", INK, **_MEAN_MARK))
    if any(p.status == "at_bound" for p in drawn):
        open_triangle = {"marker": "v", "markerfacecolor": "white", "markeredgecolor": BLUE}
        handles.append(legend_line("at its bound: upper limit only", SKY, **open_triangle))
    return handles
