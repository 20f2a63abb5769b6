"""Figures 4.2 and 4.3 again: strides of a person, and what the device does to gait."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from jointz.report.style import (
    BLUE,
    FAINT,
    GREEN,
    INK,
    MUTED,
    SKY,
    VERMILION,
    WIDTH_MM,
    broken_line,
    legend_line,
    new_figure,
    panel_heading,
    place_axes,
    place_legend,
    shade_phases,
)
from jointz.report.wording import MINUS
from jointz.reproduction.chapter_figures import numbers

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Every so many nodes of a single stride are drawn.
_EVERY: Final = 2
_HALF_MM: Final = 72.0


def draw_strides(curve: Mapping[str, Any]) -> "Figure":
    """Draw single and mean angle and torque over the gait cycle."""
    figure = new_figure(74.0)
    gait = numbers(curve["gait_pct"])
    strides = (
        (np.degrees(numbers(curve["angle_rad"])), "Knee flexion (deg)"),
        (numbers(curve["torque_nm"]), "Torque of the device (N·m)"),
    )
    for column, (rows, label) in enumerate(strides):
        axes = place_axes(figure, 13.0 + column * 92.0, 11.0, width_mm=_HALF_MM, height_mm=50.0)
        _over_cycle(axes)
        if rows.size:
            x, y = broken_line((gait[::_EVERY], row[::_EVERY]) for row in rows)
            axes.plot(x, y, color=FAINT, linewidth=0.4, zorder=1)
            axes.plot(gait, rows.mean(axis=0), color=INK, linewidth=1.4, zorder=2)
        axes.set_ylabel(label)
    count = len(curve["angle_rad"])
    place_legend(
        figure,
        [
            legend_line(f"{count} strides of {curve['person']}", FAINT, linewidth=0.8),
            legend_line("their mean", INK, linewidth=1.4),
        ],
    )
    return figure


def _over_cycle(axes: "Axes") -> None:
    shade_phases(axes, names=False)
    axes.set_xlim(0.0, 100.0)
    axes.set_xlabel("Gait cycle (%)")


def draw_device_effect(curve: Mapping[str, Any]) -> "Figure":
    """Draw t over the gait cycle with its thresholds, the mean angles, and their difference."""
    figure = new_figure(128.0)
    gait = numbers(curve["gait_pct"])
    upper = place_axes(figure, 13.0, 11.0, width_mm=WIDTH_MM - 16.0, height_mm=48.0)
    _draw_t(upper, gait, curve)
    left = place_axes(figure, 13.0, 76.0, width_mm=_HALF_MM, height_mm=40.0)
    _over_cycle(left)
    for key, colour, dashes in (
        ("no_device_rad", INK, (None, None)),
        ("device_rad", VERMILION, (4, 2)),
    ):
        left.plot(gait, np.degrees(numbers(curve[key])), color=colour, dashes=dashes)
    left.set_ylabel("Knee flexion (deg)")
    panel_heading(left, "", note="solid: without device; dashed: with it")
    right = place_axes(figure, 105.0, 76.0, width_mm=_HALF_MM, height_mm=40.0)
    _draw_difference(right, gait, curve)
    place_legend(
        figure,
        [
            legend_line("t", INK, linewidth=1.6),
            legend_line("threshold by random field theory", BLUE, dashes=(4, 2)),
            legend_line("threshold by sign flips", GREEN, dashes=(1, 1.5)),
            legend_line("printed threshold", MUTED, linewidth=0.8),
        ],
    )
    return figure


def _draw_t(axes: "Axes", gait: np.ndarray, curve: Mapping[str, Any]) -> None:
    shade_phases(axes, names=True)
    axes.set_xlim(0.0, 100.0)
    axes.axhline(0.0, color=FAINT, linewidth=0.7, zorder=1)
    for side in (-1.0, 1.0):
        axes.axhline(side * curve["printed_threshold"], color=MUTED, linewidth=0.8, zorder=1)
        axes.axhline(side * curve["threshold"], color=BLUE, dashes=(4, 2), zorder=2)
        axes.axhline(side * curve["flip_threshold"], color=GREEN, dashes=(1, 1.5), zorder=2)
    t = numbers(curve["t"])
    axes.plot(gait, t, color=INK, linewidth=1.6, zorder=3)
    beyond = np.where(np.abs(t) > curve["threshold"], t, np.nan)
    axes.plot(gait, beyond, color=VERMILION, linewidth=2.0, zorder=4)
    heights = (curve["printed_threshold"], curve["threshold"], float(np.nanmax(np.abs(t))))
    reach = 1.25 * max(heights)
    axes.set_ylim(-reach, reach)
    axes.set_ylabel(f"t of {curve['n_people']} people")
    axes.set_xlabel("Gait cycle (%)")


def _draw_difference(axes: "Axes", gait: np.ndarray, curve: Mapping[str, Any]) -> None:
    _over_cycle(axes)
    margin = float(np.degrees(curve["margin_rad"]))
    low, high = (np.degrees(numbers(curve[key])) for key in ("low_rad", "high_rad"))
    axes.fill_between(gait, low, high, color=SKY, alpha=0.5, linewidth=0.0, zorder=1.5)
    axes.plot(gait, np.degrees(numbers(curve["difference_rad"])), color=BLUE, zorder=2)
    axes.axhline(0.0, color=MUTED, linewidth=0.6, zorder=1.6)
    for side in (-margin, margin):
        axes.axhline(side, color=MUTED, linewidth=0.8, dashes=(1, 1.5), zorder=1.6)
    axes.set_ylabel(f"Without {MINUS} with device (deg)")
    note = f"95 % band of all nodes at once; dotted: margin of {margin:g}\N{DEGREE SIGN}"
    panel_heading(axes, "", note=note)
