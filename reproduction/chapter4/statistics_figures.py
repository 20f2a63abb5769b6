"""Figures of the statistics of chapter IV: gait, pairs of timing points, replicates as people."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from jointz.core.channels import pretty_unit
from jointz.report.style import (
    broken_line,
    legend_line,
    new_figure,
    panel_heading,
    place_axes,
    place_legend,
    shade_phases,
)
from jointz.report.wording import MINUS
from jointz.results.figure_style import (
    BLUE,
    FAINT,
    GREEN,
    INK,
    MUTED,
    PANEL,
    SKY,
    SMALL_PT,
    VERMILION,
    WIDTH_MM,
)
from reproduction.chapter_page import Drawings, numbers

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Every so many nodes of a single stride are drawn.
_EVERY: Final = 2
_HALF_MM: Final = 72.0


def _draw_strides(curve: Mapping[str, Any]) -> "Figure":
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


def _draw_device_effect(curve: Mapping[str, Any]) -> "Figure":
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


# --- pairs ---------------------------------------------------------------------------------------


_SUPERSCRIPT: Final = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
#: Smaller p are not shown, log10.
_SMALLEST: Final = -40.0
_MARK: Final[Mapping[str, Any]] = {"linestyle": "none", "markeredgewidth": 1.0, "zorder": 4}
#: What is printed, and whether ours differs -> colour and look of the mark.
_LOOKS: Final[Mapping[tuple[str, bool], tuple[str, Mapping[str, Any]]]] = {
    ("different", True): (VERMILION, {"marker": "s", "markersize": 4.6}),
    ("different", False): (VERMILION, {"marker": "s", "markersize": 4.6, "markerfacecolor": "w"}),
    ("similar", True): (BLUE, {"marker": "o", "markersize": 4.8}),
    ("similar", False): (BLUE, {"marker": "o", "markersize": 4.8, "markerfacecolor": "w"}),
    ("not stated", True): (MUTED, {"marker": "d", "markersize": 4.0}),
    ("not stated", False): (MUTED, {"marker": "d", "markersize": 4.0, "markerfacecolor": "w"}),
}
_SYMBOLS: Final[Mapping[str, tuple[str, str]]] = {
    "stiffness_per_mass": ("K", "-"),
    "damping_per_mass": ("B", "--"),
    "inertia": ("J", ":"),
}

# --- pairs ---------------------------------------------------------------------------------------


def _draw_pairs(curves: Mapping[str, Any]) -> "Figure":
    figure = new_figure(104.0)
    pitch = (WIDTH_MM - 22.0) / len(curves)
    for column, curve in enumerate(curves.values()):
        axes = place_axes(figure, 24.0 + column * pitch, 16.0, width_mm=pitch - 8.0, height_mm=74.0)
        _pairs_panel(axes, curve)
        if column:
            axes.tick_params(axis="y", labelleft=False)
        name = str(curve["name"])
        panel_heading(axes, name[0].upper() + name[1:])
    place_legend(
        figure,
        [
            *_pairs_legend(),
            legend_line("±20 % of the grand mean", PANEL, linewidth=6.0),
            legend_line("beyond: found with replicates as people", VERMILION, linestyle=":"),
        ],
        columns=3,
    )
    return figure


def _pairs_legend() -> list[Any]:
    said = (
        ("printed as different, found here", ("different", True)),
        ("printed as different, not found", ("different", False)),
        ("printed as similar, not found different", ("similar", False)),
        ("not stated, not found different", ("not stated", False)),
    )
    made = []
    for label, key in said:
        colour, look = _LOOKS[key]
        made.append(legend_line(label, colour, **{**_MARK, **look}))
    return made


def _pairs_panel(axes: "Axes", curve: Mapping[str, Any]) -> None:
    pairs: Sequence[Mapping[str, Any]] = curve["pairs"]
    axes.axvspan(-curve["band"], curve["band"], color=PANEL, linewidth=0.0, zorder=0)
    axes.axvline(0.0, color=FAINT, linewidth=0.7, zorder=1)
    if curve["rows_find"] is not None:
        for side in (-1.0, 1.0):
            axes.axvline(side * curve["rows_find"], color=VERMILION, linewidth=0.9, linestyle=":",
                         zorder=1)  # fmt: skip
    for row, pair in enumerate(pairs):
        differs = pair["ci_low"] > 0.0 or pair["ci_high"] < 0.0
        colour, look = _LOOKS[pair["printed"], differs]
        axes.hlines(row, pair["ci_low"], pair["ci_high"], colors=colour, linewidth=1.0, zorder=3)
        axes.plot(pair["difference"], row, color=colour, **{**_MARK, **look})
    labels = [
        f"{'-'.join(pair['points'])}  {'-'.join(map(str, pair['numbers']))}" for pair in pairs
    ]
    axes.set_yticks(range(len(pairs)), labels)
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(pairs) - 0.4, -0.6)
    largest = 1.06 * max(max(abs(pair["ci_low"]), abs(pair["ci_high"])) for pair in pairs)
    axes.set_xlim(-largest, largest)
    axes.locator_params(axis="x", nbins=4)
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}".replace("-", MINUS))
    axes.set_xlabel(f"First minus second ({pretty_unit(curve['unit'])})")


# --- replicates ----------------------------------------------------------------------------------


def _draw_replicates(curve: Mapping[str, Any]) -> "Figure":
    figure = new_figure(79.0)
    shares = place_axes(figure, 15.0, 13.0, width_mm=88.0, height_mm=52.0)
    scatters = place_axes(figure, 120.0, 13.0, width_mm=56.0, height_mm=52.0)
    _p_panel(shares, curve["parameters"])
    _scatter_panel(scatters, curve)
    panel_heading(shares, "No effect of the timing point")
    panel_heading(scatters, "p < 0.001", note=f"{curve['n_rows']} rows a cell as people")
    place_legend(
        figure,
        [
            legend_line("one value a cell", BLUE, linewidth=1.4),
            legend_line(f"{curve['n_rows']} rows a cell as people", VERMILION, linewidth=1.4),
            legend_line("as it should be", FAINT, linewidth=2.6),
            *(legend_line(symbol, INK, linestyle=dashes) for symbol, dashes in _SYMBOLS.values()),
        ],
    )
    return figure


def _p_panel(axes: "Axes", parameters: Mapping[str, Any]) -> None:
    even = np.linspace(_SMALLEST, 0.0, 400)
    axes.plot(even, 100.0 * 10.0**even, color=FAINT, linewidth=2.6, zorder=1)
    for parameter, found in parameters.items():
        for key, colour in (("cells", BLUE), ("rows", VERMILION)):
            p = numbers(found[f"log10_p_{key}"])
            share = np.linspace(0.0, 100.0, p.size)
            axes.plot(p, share, color=colour, linewidth=1.2, linestyle=_SYMBOLS[parameter][1],
                      zorder=2)  # fmt: skip
    for level in (0.001, 0.05):
        at = float(np.log10(level))
        axes.axvline(at, color=MUTED, linewidth=0.6, zorder=1)
        axes.annotate(
            f"p = {level:g}", (at, 0.4), xycoords=("data", "axes fraction"), xytext=(-1.5, 0),
            textcoords="offset points", ha="right", va="center", fontsize=SMALL_PT, color=MUTED,
            rotation=90,
        )  # fmt: skip
    axes.set_xlim(_SMALLEST, 0.0)
    axes.set_ylim(0.0, 101.0)
    ticks = np.arange(_SMALLEST, 1.0, 10.0)
    axes.set_xticks(
        ticks, [f"10{str(int(t)).translate(_SUPERSCRIPT)}" if t else "1" for t in ticks]
    )
    axes.set_xlabel("p of the timing point")
    axes.set_ylabel("Studies with a smaller p (%)")


def _scatter_panel(axes: "Axes", curve: Mapping[str, Any]) -> None:
    parameters: Mapping[str, Any] = curve["parameters"]
    for parameter, found in parameters.items():
        share = 100.0 * numbers(found["rows_below_strict"])
        axes.plot(numbers(found["scatter"]), share, color=VERMILION, linewidth=1.2,
                  linestyle=_SYMBOLS[parameter][1], zorder=2)  # fmt: skip
    axes.axhline(0.1, color=FAINT, linewidth=2.6, zorder=1)
    fitting = {p: found["fitting_scatter"] for p, found in parameters.items()}
    if any(fitting.values()):
        axes.annotate("all printed claims come out", (0.0, 31.0), xytext=(2, 0), fontsize=SMALL_PT,
                      textcoords="offset points", va="center")  # fmt: skip
    for row, (parameter, ends) in enumerate(fitting.items()):
        if ends is None:
            continue
        low, high = ends
        at = 24.0 - 7.0 * row
        axes.plot([low, high], [at, at], color=INK, linewidth=2.2, solid_capstyle="butt", zorder=3)
        axes.annotate(_SYMBOLS[parameter][0], (high, at), xytext=(3, 0), fontsize=SMALL_PT,
                      textcoords="offset points", va="center")  # fmt: skip
    axes.set_xlim(0.0, None)
    axes.set_ylim(0.0, 101.0)
    axes.set_xlabel("Scatter of rows in a cell (residual SD)")
    axes.set_ylabel("Studies (%)")


GAIT_DRAWINGS: Final[Drawings] = {
    "figure_4_2": ("strides", _draw_strides),
    "figure_4_3": ("device_effect", _draw_device_effect),
}
STATISTICS_DRAWINGS: Final[Drawings] = {
    "figure_pairs": ("pairs", _draw_pairs),
    "figure_replicates": ("replicates", _draw_replicates),
}
