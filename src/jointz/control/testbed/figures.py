"""Figures of a comparison in the test bed: scores, angles over the cycle, pushes."""

from typing import TYPE_CHECKING, Final

from jointz.control.testbed.bed_comparison import INTACT, BedComparison, BedTrace, draw_score
from jointz.control.testbed.scores import PLAIN, TESTS
from jointz.report.style import legend_line, new_figure, place_axes, place_legend, to_svg
from jointz.report.wording import pretty_unit
from jointz.results.figure_style import BLUE, MUTED, SMALL_PT, VERMILION, WIDTH_MM, figure_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Panels of the scores: test, score, heading.
_PANELS: Final = (
    (PLAIN, "tracking", "deviation (deg)"),
    (PLAIN, "fallen_strides", "strides with a fall"),
    (PLAIN, "absolute_work", "absolute work (J)"),
    (PLAIN, "net_work", "net work (J)"),
    (PLAIN, "peak_torque", "peak torque (N*m)"),
    (PLAIN, "clearance", "toe clearance (m)"),
    ("push_stance", "push_deviation", "push at 20 % (deg)"),
    ("push_swing", "push_deviation", "push at 75 % (deg)"),
)
_COLUMNS = 4
_NAMES_MM, _ROW_MM, _HIGH_MM = 53.0, 66.0, 50.0
_LEFT_MM, _SMALL_MM, _SMALL_HIGH_MM = 12.0, 40.0, 26.0


def bed_figures(found: BedComparison) -> dict[str, str]:
    """Return the figures of a comparison as SVG, by name."""
    with figure_style():
        return {
            "scores": to_svg(_scores(found)),
            "angles": to_svg(_angles(found)),
            "pushes": to_svg(_pushes(found)),
        }


def _scores(found: BedComparison) -> "Figure":
    figure = new_figure(2 * _ROW_MM)
    width = (WIDTH_MM - _NAMES_MM - 3.0) / _COLUMNS
    for k, (test, score, heading) in enumerate(_PANELS):
        row, column = divmod(k, _COLUMNS)
        axes = place_axes(
            figure, _NAMES_MM + column * width, 6.0 + row * _ROW_MM,
            width_mm=width - 5.0, height_mm=_HIGH_MM,
        )  # fmt: skip
        draw_score(axes, found, test, score)
        names = found.controllers if column == 0 else ("",) * len(found.controllers)
        axes.set_yticks(range(len(names)), names)
        axes.tick_params(axis="y", length=0.0)
        axes.set_title(pretty_unit(heading), loc="left")
        axes.locator_params(axis="x", nbins=4)
    return figure


def _panels(found: BedComparison) -> "tuple[Figure, dict[str, Axes]]":
    """Return a figure with a panel for each controller."""
    rows = -(-len(found.controllers) // _COLUMNS)
    figure = new_figure(16.0 + rows * (_SMALL_HIGH_MM + 9.0))
    axes: dict[str, Axes] = {}
    for k, name in enumerate(found.controllers):
        row, column = divmod(k, _COLUMNS)
        panel = place_axes(
            figure, _LEFT_MM + column * (_SMALL_MM + 1.0), 13.0 + row * (_SMALL_HIGH_MM + 9.0),
            width_mm=_SMALL_MM - 3.0, height_mm=_SMALL_HIGH_MM,
        )  # fmt: skip
        title = pretty_unit(name.replace("impedance_continuous,", "continuous,"))
        panel.set_title(title, loc="left", fontsize=SMALL_PT)
        if column:
            panel.set_yticklabels([])
        if k + _COLUMNS < len(found.controllers):
            panel.set_xticklabels([])
        axes[name] = panel
    return figure, axes


def _angles(found: BedComparison) -> "Figure":
    figure, panels = _panels(found)
    intact = next(trace for trace in found.traces if trace.controller == INTACT)
    for trace in found.traces:
        if trace.controller == INTACT or trace.test != PLAIN:
            continue
        axes = panels[trace.controller]
        axes.plot(intact.x, intact.y, color=MUTED, linestyle="--")
        axes.plot(trace.x, trace.y, color=BLUE)
        _mark_fall(axes, trace)
        axes.set(xlim=(0.0, 100.0), ylim=(-15.0, 95.0), xticks=(0, 50), yticks=(0, 45, 90))
    place_legend(figure, [
        legend_line("intact", MUTED, linestyle="--"), legend_line("with the controller", BLUE),
        legend_line("fall", VERMILION, marker="x", linestyle=""),
    ])  # fmt: skip
    _name_axes(figure, "gait cycle (%)", "knee flexion (deg)")
    return figure


def _pushes(found: BedComparison) -> "Figure":
    figure, panels = _panels(found)
    colours = {"push_stance": BLUE, "push_swing": VERMILION}
    for trace in found.traces:
        if trace.test in colours and trace.y.size:
            panels[trace.controller].plot(trace.x, trace.y, color=colours[trace.test])
    for axes in panels.values():
        if not axes.lines:
            axes.text(0.4, 10.0, "falls", ha="center", va="center", color=MUTED, fontsize=SMALL_PT)
        axes.axhline(0.0, color=MUTED, linewidth=0.4, zorder=0.0)
        axes.set(xlim=(0.0, 0.8), ylim=(-30.0, 30.0), xticks=(0, 0.4), yticks=(-30, 0, 30))
    place_legend(
        figure, [legend_line(TESTS[test].label, colour) for test, colour in colours.items()]
    )
    _name_axes(figure, "time since the push (s)", "deviation (deg)")
    return figure


def _mark_fall(axes: "Axes", trace: BedTrace) -> None:
    if trace.x.size and trace.x[-1] < 100.0:  # it has no end of the cycle
        axes.plot(trace.x[-1], trace.y[-1], "x", color=VERMILION, markersize=5.0)


def _name_axes(figure: "Figure", across: str, up: str) -> None:
    figure.supxlabel(across, fontsize=8.0, y=0.005)
    figure.supylabel(up, fontsize=8.0, x=0.005)
