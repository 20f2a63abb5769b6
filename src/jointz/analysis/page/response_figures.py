"""Figure of the average responses to the pulses, with the fitted model."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from jointz.report.pulse_words import onset_is_commanded
from jointz.report.style import (
    broken_line,
    legend_line,
    new_figure,
    place_axes,
    place_legend,
    place_text,
)
from jointz.report.subjects import timing_points
from jointz.report.wording import DASH, format_vaf
from jointz.results.estimates import CellEstimate, Response
from jointz.results.figure_style import (
    BLUE,
    FAINT,
    INK,
    MUTED,
    PANEL,
    SMALL_PT,
    VERMILION,
    WIDTH_MM,
)
from jointz.results.study_analysis import StudyAnalysis

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

_MOST_COLUMNS: Final = 6
_LEFT_MM: Final = 17.0
_BETWEEN_MM: Final = 11.0
_BLOCK_MM: Final = (WIDTH_MM - _LEFT_MM - _BETWEEN_MM - 1.0) / 2
_TOP_MM: Final = 17.0
_GAP: Final = 0.12
#: Number of letters of all names that fit side by side above the panels.
_NAMES_IN_A_LINE: Final = 50
# Share of a panel's height kept free for the text in it.
_HEADROOM: Final = 0.30

#: Participants from which on all responses are drawn on top of each other.
_BAND_FROM: Final = 4
_Cells = Mapping[tuple[str, str], CellEstimate]


@dataclass(frozen=True, slots=True)
class _Row:
    """A row of panels: a participant at up to six timing points."""

    participant: str  # label with session and side
    names: Sequence[str]  # timing points of the panels
    first: bool  # whether it is the participant's first row


class _Block(NamedTuple):
    """One half of a figure: the panels of one quantity."""

    left_mm: float
    quantity: str  # ``angle`` or ``torque``
    heading: str
    scale: float  # to the unit of the heading
    colour: str


_BLOCKS: Final = (
    _Block(_LEFT_MM, "angle", "Angle response (deg)", 180.0 / np.pi, BLUE),
    _Block(_LEFT_MM + _BLOCK_MM + _BETWEEN_MM, "torque", "Torque response (N·m)", 1.0, INK),
)


def draw_responses(analysis: StudyAnalysis) -> "Figure | None":
    """Draw average angle and torque of every participant at every timing point.

    The panels of a row are drawn side by side on one pair of axes, which is quick even with sixty
    and more panels.
    """
    cells = {(c.label, c.timing_point): c for c in analysis.cells}
    responses = [r for c in analysis.cells for r in c.responses]
    if not responses:
        return None
    window_s = max(float(r.time_s[-1]) for r in responses)
    rows = _rows(analysis.cells)
    wrapped = any(not row.first for row in rows)
    height = 32.0 if len(rows) <= 3 else 24.0 if len(rows) <= 6 else 17.0
    pitch = height + (6.0 if wrapped else 3.0)
    figure = new_figure(_TOP_MM + pitch * len(rows) + 8.0)
    label = _time_label(analysis)
    for block in _BLOCKS:
        place_text(figure, block.left_mm, 10.0, block.heading, fontweight="bold", va="center")
    for i, row in enumerate(rows):
        top = _TOP_MM + i * pitch
        if row.first:
            lines = row.participant.split(", ")  # with session and side, one below the other
            middle = top + 0.5 * height
            place_text(figure, 1.0, middle, "\n".join(lines), va="center", fontsize=SMALL_PT,
                       fontweight="bold")  # fmt: skip
        for block in _BLOCKS:
            axes = place_axes(figure, block.left_mm, top, width_mm=_BLOCK_MM, height_mm=height)
            _draw_row(axes, row, cells, block, window_s)
            _time_axis(axes, len(row.names), window_s, label=label if i == len(rows) - 1 else "")
            if i == 0 or wrapped:
                _name_columns(axes, row.names, window_s)
    place_legend(figure, _legend(responses))
    return figure


def draw_response_overview(analysis: StudyAnalysis) -> "Figure | None":
    """Draw all people's responses on top of each other, and fits of three examples.

    None for few people, whose responses have room beside each other.
    """
    cells = [c for c in analysis.cells if c.response is not None]
    names = timing_points(cells)
    if len({c.label for c in cells}) < _BAND_FROM or len(names) > _MOST_COLUMNS:
        return None
    window_s = max(float(c.response.time_s[-1]) for c in cells if c.response is not None)
    figure = new_figure(_TOP_MM + 37.0 + 46.0)
    for block in _BLOCKS:
        place_text(figure, block.left_mm, 10.0, block.heading, fontweight="bold", va="center")
        axes = place_axes(figure, block.left_mm, _TOP_MM, width_mm=_BLOCK_MM, height_mm=30.0)
        _draw_band(axes, cells, names, block, window_s)
        _time_axis(axes, len(names), window_s, label="")
        _name_columns(axes, names, window_s)
    examples = example_cells(cells)
    row = _Row("", [f"{c.label}, {c.timing_point}" for c in examples], first=True)
    by_name = {("", name): c for name, c in zip(row.names, examples, strict=True)}
    place_text(figure, 1.0, _TOP_MM + 58.0, "Examples", va="center", fontsize=SMALL_PT,
               fontweight="bold")  # fmt: skip
    for block in _BLOCKS:
        top = _TOP_MM + 40.0
        axes = place_axes(figure, block.left_mm, top, width_mm=_BLOCK_MM, height_mm=34.0)
        _draw_row(axes, row, by_name, block, window_s)
        _time_axis(axes, len(row.names), window_s, label=_time_label(analysis))
        _name_columns(axes, row.names, window_s)
    handles = [
        legend_line("each participant", FAINT),
        legend_line("angle", BLUE),
        legend_line("torque", INK),
        legend_line("fitted model (VAF)", VERMILION, dashes=(2.5, 1.5)),
    ]
    place_legend(figure, handles)
    return figure


def example_cells(cells: Sequence[CellEstimate]) -> list[CellEstimate]:
    """Return the cells with the highest, the median and the lowest VAF."""
    known = [c for c in cells if c.response is not None and c.vaf_pct is not None]
    ordered = sorted(known, key=lambda c: -(c.vaf_pct or 0.0))
    at = (0, len(ordered) // 2, len(ordered) - 1)
    return [ordered[i] for i in dict.fromkeys(at)] if ordered else []


def _time_label(analysis: StudyAnalysis) -> str:
    return f"Time from {'commanded ' if onset_is_commanded(analysis) else ''}onset (ms)"


def _draw_band(
    axes: "Axes",
    cells: Sequence[CellEstimate],
    names: Sequence[str],
    block: _Block,
    window_s: float,
) -> None:
    pitch = _panels(axes, len(names), window_s)
    groups = [[c.response for c in cells if c.response and c.timing_point == n] for n in names]
    at = {name: i * pitch for i, name in enumerate(names)}
    curves = [(at[c.timing_point], r) for c in cells for r in c.responses]
    axes.plot(*_joined(curves, block.quantity, block.scale), color=FAINT, linewidth=0.6)
    means = [
        (i * pitch + own[0].time_s, block.scale * _mean(own, block.quantity))
        for i, own in enumerate(groups)
        if own and len(curves) == len(cells)  # a mean of several shapes would be of none
    ]
    axes.plot(*broken_line(means), color=block.colour, linewidth=1.3)
    _leave_headroom(axes)
    _write_in_panels(axes, [f"n {len(own)}" for own in groups], window_s)


def _write_in_panels(axes: "Axes", texts: Sequence[str], window_s: float) -> None:
    for i, text in enumerate(texts):
        axes.text(
            i * window_s * (1.0 + _GAP) + 0.05 * window_s, 0.97, text,
            transform=axes.get_xaxis_transform(), va="top", fontsize=SMALL_PT, color=MUTED,
        )  # fmt: skip


def _mean(responses: Sequence[Response], name: str) -> np.ndarray:
    """Return the mean curve at the times of the first response."""
    at = responses[0].time_s
    curves = [
        np.interp(at, r.time_s, getattr(r, name), left=np.nan, right=np.nan) for r in responses
    ]
    return np.asarray(np.mean(curves, axis=0))


def _panels(axes: "Axes", count: int, window_s: float) -> float:
    """Shade the panels that stand side by side on one pair of axes; return their distance."""
    pitch = window_s * (1.0 + _GAP)
    axes.broken_barh(
        [(i * pitch, window_s) for i in range(count)],
        (0, 1),
        transform=axes.get_xaxis_transform(),
        facecolor=PANEL,
        edgecolor="none",
        zorder=0,
    )
    return pitch


def _rows(cells: Sequence[CellEstimate]) -> list[_Row]:
    names = timing_points(cells)
    people = dict.fromkeys(c.label for c in cells)
    known = {(c.label, c.timing_point) for c in cells}
    rows = []
    for person in people:
        own = names if len(names) <= _MOST_COLUMNS else [n for n in names if (person, n) in known]
        chunks = [own[i : i + _MOST_COLUMNS] for i in range(0, len(own), _MOST_COLUMNS)]
        rows += [_Row(person, chunk, first=i == 0) for i, chunk in enumerate(chunks)]
    return rows


def _draw_row(axes: "Axes", row: _Row, cells: _Cells, block: _Block, window_s: float) -> None:
    pitch = _panels(axes, len(row.names), window_s)
    row_cells = [cells.get((row.participant, name)) for name in row.names]
    curves = [(i * pitch, r) for i, c in enumerate(row_cells) if c for r in c.responses]
    axes.plot(*_joined(curves, block.quantity, block.scale), color=block.colour, linewidth=1.1)
    fitted = [(at, r) for at, r in curves if _fitted(r) == block.quantity]
    if fitted:
        axes.plot(
            *_joined(fitted, f"fitted_{block.quantity}", block.scale),
            color=VERMILION, linewidth=1.1, dashes=(2.5, 1.5),
        )  # fmt: skip
    _leave_headroom(axes)
    _write_in_panels(axes, [_panel_text(cell, block.quantity) for cell in row_cells], window_s)


def _joined(
    curves: Sequence[tuple[float, Response]], name: str, scale: float
) -> tuple[np.ndarray, np.ndarray]:
    return broken_line((shift + r.time_s, scale * getattr(r, name)) for shift, r in curves)


def _fitted(response: Response) -> str:
    """Return the signal that the model was fitted to."""
    return "torque" if response.fitted_angle is None else "angle"


def _panel_text(cell: CellEstimate | None, quantity: str) -> str:
    """Return the number of pulses above the angle, and VAF above the fitted signal."""
    if cell is None or cell.response is None:
        return DASH
    n_drawn = sum(r.n_pulses or cell.n_used for r in cell.responses)
    texts = [f"n {n_drawn}"] if quantity == "angle" else []
    if quantity == _fitted(cell.response):
        texts.append(DASH if cell.vaf_pct is None else f"{format_vaf(cell.vaf_pct)} %")
    return "\n".join(texts)


def _leave_headroom(axes: "Axes") -> None:
    heights = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for line in axes.lines])
    heights = heights[np.isfinite(heights)]
    low, high = (min(0.0, heights.min()), max(0.0, heights.max())) if heights.size else (0.0, 1.0)
    span = (high - low) or 1.0
    axes.set_ylim(low - 0.06 * span, high + _HEADROOM * span)
    axes.locator_params(axis="y", nbins=3)
    axes.axhline(0.0, color=MUTED, linewidth=0.4, zorder=1)


def _time_axis(axes: "Axes", count: int, window_s: float, *, label: str) -> None:
    pitch = window_s * (1.0 + _GAP)
    axes.spines["bottom"].set_visible(False)
    starts = np.arange(count) * pitch
    ticks = np.sort(np.concatenate([starts, starts + window_s]))
    axes.set_xlim(0.0, starts[-1] + window_s)
    if not label:
        axes.set_xticks([])
        return
    axes.set_xticks(ticks, ["0", f"{1000 * window_s:.0f}"] * count, fontsize=SMALL_PT)
    for i, tick in enumerate(axes.get_xticklabels()):
        tick.set_horizontalalignment("right" if i % 2 else "left")
    axes.set_xlabel(label, fontsize=SMALL_PT)


def _name_columns(axes: "Axes", names: Sequence[str], window_s: float) -> None:
    long = max(map(len, names)) * len(names) > _NAMES_IN_A_LINE
    for i, name in enumerate(names):
        # The names of groups are edges: "-0.45..-0.15 rad".
        text = name.replace("..", " to\n") if long else name
        axes.text(
            i * window_s * (1.0 + _GAP) + 0.5 * window_s, 1.03, text,
            transform=axes.get_xaxis_transform(), ha="center", va="bottom",
            fontsize=SMALL_PT, linespacing=1.0,
        )  # fmt: skip


def _legend(responses: Sequence[Response]) -> "list[Line2D]":
    fitted = list(dict.fromkeys(_fitted(r) for r in responses))
    return [
        legend_line("measured angle (n pulses)", BLUE),
        legend_line("measured torque", INK),
        legend_line(
            f"{' or '.join(fitted)} of the fitted model (VAF)", VERMILION, dashes=(2.5, 1.5)
        ),
    ]
