"""Style of all figures, and files of them that are the same on every run."""

import io
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from jointz.core.gait_phases import PHASES
from jointz.results.figure_style import MM_PER_INCH, MUTED, PANEL, SMALL_PT, WIDTH_MM

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

# Two decimals of a point are 4 micrometres. Numbers below one may be scales and stay.
_LONG_NUMBER = re.compile(r"(?<![\w.#])(-?[1-9]\d*\.\d\d)\d+")
#: Tables of a font that only typesetting needs.
_LAYOUT_TABLES: Final = ("GDEF", "GPOS", "GSUB", "MATH", "kern")
_PROLOGUE = re.compile(r"\A.*?(?=<svg)", re.DOTALL)
_COMMENT = re.compile(r"\s*<!--.*?-->", re.DOTALL)
_METADATA = re.compile(r"\s*<metadata>.*?</metadata>", re.DOTALL)


def new_figure(height_mm: float, *, width_mm: float = WIDTH_MM) -> "Figure":
    """Return an empty figure outside pyplot."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width_mm / MM_PER_INCH, height_mm / MM_PER_INCH))


def width_of(figure: "Figure") -> float:
    """Return the width of a figure, mm."""
    return float(figure.get_figwidth() * MM_PER_INCH)


def place_axes(
    figure: "Figure", left_mm: float, top_mm: float, *, width_mm: float, height_mm: float
) -> "Axes":
    """Add axes at a place counted from the figure's upper left corner."""
    total = figure.get_figheight() * MM_PER_INCH
    bottom = total - top_mm - height_mm
    across = width_of(figure)
    box = (left_mm / across, bottom / total, width_mm / across, height_mm / total)
    return figure.add_axes(box)


def place_panels(
    figure: "Figure", count: int, *, left_mm: float, top_mm: float, height_mm: float
) -> "list[Axes]":
    """Add up to three panels side by side, each with a margin on its left."""
    pitch = (WIDTH_MM - 2.0) / 3
    return [
        place_axes(
            figure,
            left_mm + column * pitch,
            top_mm,
            width_mm=pitch - left_mm - 1.0,
            height_mm=height_mm,
        )
        for column in range(count)
    ]


def place_text(figure: "Figure", left_mm: float, top_mm: float, text: str, **style: Any) -> None:
    """Write text at a place counted from the figure's upper left corner."""
    total = figure.get_figheight() * MM_PER_INCH
    figure.text(left_mm / width_of(figure), 1.0 - top_mm / total, text, **style)


def place_legend(
    figure: "Figure", handles: "Sequence[Artist]", *, columns: int | None = None
) -> None:
    """Put a legend at the top of a figure, by default in one row."""
    below_edge = 1.0 / (figure.get_figheight() * MM_PER_INCH)
    figure.legend(
        handles=handles,
        loc="upper center",
        bbox_to_anchor=(0.5, 1.0 - below_edge),
        ncols=columns or len(handles),
        columnspacing=1.6,
        handletextpad=0.5,
        borderaxespad=0.0,
        borderpad=0.0,
    )


def legend_line(label: str, colour: str, **style: Any) -> "Line2D":
    """Return a handle for :func:`place_legend`."""
    from matplotlib.lines import Line2D

    small = {"markersize": 4.0, "markeredgewidth": 0.8, "linewidth": 1.0}
    return Line2D([], [], color=colour, label=label, **(small | style))


def panel_heading(axes: "Axes", text: str, *, note: str = "", stacked: bool = False) -> None:
    """Write a panel's name above it on the left and a note on the right."""
    above: dict[str, Any] = {
        "xycoords": "axes fraction",
        "textcoords": "offset points",
        "va": "bottom",
    }
    height = 12 if stacked and note else 3
    axes.annotate(text, (0, 1), xytext=(0, height), fontweight="bold", ha="left", **above)
    if note:
        x, side = (0, "left") if stacked else (1, "right")
        axes.annotate(note, (x, 1), xytext=(0, 3), fontsize=SMALL_PT, color=MUTED, ha=side, **above)


def shade_phases(axes: "Axes", *, names: bool) -> None:
    """Shade every second gait phase and write the names along the upper edge."""
    spans = list(PHASES.values())
    axes.broken_barh(
        [(start, end - start) for start, end in spans[::2]],
        (0, 1),
        transform=axes.get_xaxis_transform(),
        facecolor=PANEL,
        edgecolor="none",
        zorder=0,
    )
    for name, (start, end) in PHASES.items() if names else ():
        # The first phase is 2 % wide: its name ends where its band ends, to leave the next room.
        narrow = end - start < 5.0
        axes.text(
            end + 0.4 if narrow else 0.5 * (start + end),
            0.985,
            name,
            transform=axes.get_xaxis_transform(),
            ha="right" if narrow else "center",
            va="top",
            fontsize=SMALL_PT,
            color=MUTED,
        )


def broken_line(segments: Iterable[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """Join curves to one path, with NaN between them."""
    parts = [(np.append(x, np.nan), np.append(y, np.nan)) for x, y in segments]
    if not parts:
        return np.empty(0), np.empty(0)
    return np.concatenate([x for x, _ in parts]), np.concatenate([y for _, y in parts])


def ticks_at(positions: np.ndarray, low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a path of vertical strokes between two heights."""
    return broken_line((np.array([x, x]), np.array([low, high])) for x in positions)


def to_svg(figure: "Figure") -> str:
    """Write a figure as SVG without date, prologue or outside references.

    Must be called inside :func:`figure_style`.
    """
    buffer = io.BytesIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = buffer.getvalue().decode("utf-8")
    for pattern in (_PROLOGUE, _METADATA, _COMMENT):
        text = pattern.sub("", text)
    return _LONG_NUMBER.sub(lambda number: number[1], text)


def to_pdf(figure: "Figure") -> bytes:
    """Write a figure as PDF that is the same on every run.

    Must be called inside :func:`figure_style`.
    """
    buffer = io.BytesIO()
    nothing = dict.fromkeys(("CreationDate", "Creator", "Producer"))
    with _letters_only():
        figure.savefig(buffer, format="pdf", metadata=nothing)
    return buffer.getvalue()


@contextmanager
def _letters_only() -> Iterator[None]:
    """Embed the letters of fonts without the tables for typesetting.

    Text in a figure is typeset before it is written, and reducing these tables takes most of the
    time of a figure. matplotlib offers no choice of tables; if a later fontTools has no such list,
    fonts are embedded with all tables.
    """
    from fontTools.subset import Options

    name = "_drop_tables_default"
    dropped = getattr(Options, name, None)
    if dropped is None:
        yield
        return
    setattr(Options, name, [*dropped, *_LAYOUT_TABLES])
    try:
        yield
    finally:
        setattr(Options, name, dropped)
