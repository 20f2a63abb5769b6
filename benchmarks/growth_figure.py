"""Time and memory over the number of participants, on logarithmic axes."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointz.report.style import (
    legend_line,
    new_figure,
    panel_heading,
    place_axes,
    place_legend,
    to_svg,
)
from jointz.results.figure_style import BLUE, FAINT, INK, VERMILION, WIDTH_MM, figure_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_HEIGHT_MM, _LEFT_MM, _TOP_MM, _GAP_MM = 72.0, 16.0, 14.0, 20.0
_MEMORY_MB = (100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0, 10000.0)
#: Shapes and strokes tell the lines apart in grey too.
_TIME: Mapping[str, Any] = {"marker": "o", "color": INK}
_CLIENT: Mapping[str, Any] = {"marker": "s", "color": BLUE}
_WORKER: Mapping[str, Any] = {"marker": "^", "color": VERMILION, "linestyle": "--"}
_IN_PROPORTION: Mapping[str, Any] = {"color": FAINT, "linestyle": ":"}


def draw_growth(measured: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Draw the figure.

    Parameters
    ----------
    measured : sequence of mapping
        One a number of participants, as ``benchmarks.scale`` returns them.
    path : pathlib.Path
        SVG to write.
    """
    counts = [one["count"] for one in measured]
    with figure_style():
        figure = new_figure(_HEIGHT_MM)
        width = (WIDTH_MM - _LEFT_MM - 2.0 - _GAP_MM) / 2.0
        size = {"width_mm": width, "height_mm": _HEIGHT_MM - _TOP_MM - 12.0}
        time = place_axes(figure, _LEFT_MM, _TOP_MM, **size)
        memory = place_axes(figure, _LEFT_MM + width + _GAP_MM, _TOP_MM, **size)
        seconds = [one["wall_s"] for one in measured]
        time.plot(counts, [seconds[-1] / counts[-1] * n for n in counts], **_IN_PROPORTION)
        time.plot(counts, seconds, markersize=4.0, **_TIME)
        for name, style in (("client_mb", _CLIENT), ("worker_mb", _WORKER)):
            memory.plot(counts, [one[name] for one in measured], markersize=4.0, **style)
        _label(time, counts, "time", "s")
        _label(memory, counts, "most memory", "MB")
        memory.set_ylim(_MEMORY_MB[0], max(1.2 * memory.get_ylim()[1], _MEMORY_MB[3]))
        memory.set_yticks([mb for mb in _MEMORY_MB if mb <= memory.get_ylim()[1]])
        handles = [
            legend_line("whole job", **_called(_TIME)),
            legend_line("in proportion", **_called(_IN_PROPORTION)),
            legend_line("client", **_called(_CLIENT)),
            legend_line("largest worker", **_called(_WORKER)),
        ]
        place_legend(figure, handles)
        svg = to_svg(figure)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(svg + "\n", encoding="utf-8")


def _label(axes: "Axes", counts: Sequence[int], what: str, unit: str) -> None:
    from matplotlib.ticker import FuncFormatter, NullFormatter

    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,g}"))
        axis.set_minor_formatter(NullFormatter())
    axes.set_xticks(counts, labels=[f"{n:,}" for n in counts])
    axes.minorticks_off()
    axes.set_xlabel("participants")
    panel_heading(axes, f"{what}, {unit}")


def _called(style: Mapping[str, Any]) -> dict[str, Any]:
    """Return a style with the colour under the name that a legend's handle wants."""
    return {"colour": style["color"], **{k: v for k, v in style.items() if k != "color"}}
