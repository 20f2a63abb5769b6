"""Figures of chapter II again: bandwidth, intrinsic impedance, loads, mechanisms."""

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from jointz.core.channels import axis_label, pretty_unit
from jointz.report.style import (
    legend_line,
    new_figure,
    panel_heading,
    place_axes,
    place_legend,
    place_text,
)
from jointz.report.wording import MINUS, format_signed
from jointz.results.figure_style import BLUE, FAINT, INK, MUTED, SMALL_PT, VERMILION, WIDTH_MM
from reproduction.chapter_page import Drawings, draw_figures, numbers

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

_AMPLITUDE_COLOURS: Final = (BLUE, VERMILION)
_HALF_POWER_DB: Final = -3.0
_LOWEST_DB: Final = -15.0
_HIGHEST_DB: Final = 5.0
_FREQUENCY_TICKS_HZ: Final = (1, 2, 5, 10, 20, 40, 60)
_NAME_CHARACTERS: Final = 46
_PARAMETERS: Final = ("stiffness", "damping", "inertia")
_METHODS: Final = (
    # key, marker, ends of the bar, shades of light and dark, shift across the slot
    ("dissertation", "o", ("#f0b48a", "#8f3b00"), -0.16),
    ("recommended", "D", ("#8fc3e3", "#003f66"), 0.16),
)


def draw_chapter2(curves: Mapping[str, Any]) -> dict[str, str]:
    """Draw the figures of chapter II that the curves allow."""
    return draw_figures(_DRAWINGS, curves)


# --- figure 2.5 ----------------------------------------------------------------------------------


def _draw_bandwidth(curve: Mapping[str, Mapping[str, Any]]) -> "Figure":
    figure = new_figure(96.0)
    box = {"width_mm": WIDTH_MM - 18.0}
    gain = place_axes(figure, 15.0, 9.0, height_mm=52.0, **box)
    coherence = place_axes(figure, 15.0, 66.0, height_mm=20.0, **box)
    gain.axhline(_HALF_POWER_DB, color=MUTED, linewidth=0.7, zorder=1)
    gain.text(1.04, _HALF_POWER_DB - 0.3, f"{MINUS}3 dB", va="top", fontsize=SMALL_PT, color=MUTED)
    for colour, one in zip(_AMPLITUDE_COLOURS, curve.values(), strict=False):
        frequency = numbers(one["frequency_hz"])
        relative = _decibels(one["gain"], one["reference_gain"])
        gain.plot(frequency, relative, color=colour, linewidth=1.3)
        coherence.plot(frequency, numbers(one["coherence"]), color=colour, linewidth=1.0)
        if one.get("spa_gain"):
            relative = _decibels(one["spa_gain"], one["spa_reference_gain"])
            frequency = numbers(one["spa_frequency_hz"])
            gain.plot(frequency, relative, color=colour, linewidth=0.8, dashes=(4, 2))
        _mark_bandwidths(gain, one, colour)
    gain.set_ylim(_LOWEST_DB, _HIGHEST_DB)
    gain.set_yticks(np.arange(_LOWEST_DB, _HIGHEST_DB, -_HALF_POWER_DB))
    gain.set_ylabel("Gain over that at low frequency (dB)")
    coherence.set_ylim(0.0, 1.05)
    coherence.set_yticks([0.0, 0.5, 1.0])
    coherence.set_ylabel("Coherence")
    for axes in (gain, coherence):
        _frequency_axis(axes, _FREQUENCY_TICKS_HZ)
        axes.set_xlim(1.0, 60.0)
    gain.set_xlabel("")
    gain.tick_params(labelbottom=False)
    place_legend(figure, _bandwidth_legend(curve))
    return figure


def _decibels(gain: Sequence[float], reference: float) -> np.ndarray:
    """Return a gain over the one that a bandwidth counts from."""
    # A gain of zero has no decibels; it lies below every figure.
    decibels: np.ndarray = 20.0 * np.log10(np.maximum(numbers(gain) / reference, 1e-6))
    return decibels


def _mark_bandwidths(axes: "Axes", one: Mapping[str, Any], colour: str) -> None:
    """Mark ours, the 30-lag one and the printed one on the line of half power."""
    at, low, high = numbers([one.get(key) for key in ("bandwidth_hz", "ci_low", "ci_high")])
    axes.hlines(_HALF_POWER_DB, low, high, colors=colour, linewidth=2.4, zorder=4)
    axes.plot(at, _HALF_POWER_DB, "o", color=colour, markersize=5.0, markeredgecolor="white",
              markeredgewidth=0.5, zorder=6)  # fmt: skip
    spa, printed = numbers([one.get(key) for key in ("spa_bandwidth_hz", "printed_hz")])
    axes.plot(spa, _HALF_POWER_DB, "x", color=colour, markersize=5.5, markeredgewidth=1.2, zorder=7)
    # Above the line, so that it hides none of ours.
    axes.plot(printed, _HALF_POWER_DB + 1.0, "v", markersize=6.0, markerfacecolor="white",
              markeredgecolor=colour, markeredgewidth=1.1, zorder=5)  # fmt: skip


def _frequency_axis(axes: "Axes", ticks_hz: Sequence[float]) -> None:
    axes.set_xscale("log")
    axes.set_xticks(ticks_hz, [f"{tick:g}" for tick in ticks_hz])
    axes.minorticks_off()
    axes.set_xlabel("Frequency (Hz)")


def _bandwidth_legend(curve: Mapping[str, Mapping[str, Any]]) -> "list[Line2D]":
    handles = []
    for colour, (amplitude, one) in zip(_AMPLITUDE_COLOURS, curve.items(), strict=False):
        resolution = one.get("resolution_hz")
        note = f" (resolution {resolution:.1f} Hz)" if resolution else ""
        handles.append(legend_line(f"{amplitude} N·m{note}", colour, linewidth=1.3))
    dashed = "--" if any(one.get("spa_gain") for one in curve.values()) else "none"
    return [
        *handles,
        legend_line("bandwidth", INK, marker="o", linewidth=2.2),
        legend_line("30-lag window", INK, marker="x", linestyle=dashed, linewidth=0.8),
        legend_line("printed", INK, marker="v", linestyle="none", markerfacecolor="white"),
    ]


# --- intrinsic impedance -------------------------------------------------------------------------


def _draw_intrinsic(curve: Mapping[str, Any]) -> "Figure":
    figure = new_figure(68.0)
    frequency = numbers(curve["frequency_hz"])
    panels = (
        ("gain", "Magnitude (N·m/rad)", 15.0),
        ("phase_deg", "Phase (deg)", 106.0),
    )
    for key, label, left in panels:
        axes = place_axes(figure, left, 9.0, width_mm=71.0, height_mm=48.0)
        axes.plot(frequency, numbers(curve[key]), ".", color=BLUE, markersize=3.0)
        axes.plot(frequency, numbers(curve[f"model_{key}"]), color=INK, linewidth=1.2)
        axes.set_ylabel(label)
        ticks = [t for t in (0.5, 1, 2, 5, 10, 20, 50) if frequency[0] <= t <= frequency[-1]]
        _frequency_axis(axes, ticks)
    magnitude, phase = figure.axes
    magnitude.set_yscale("log")
    _plain_log_ticks(magnitude)
    measured = numbers([*curve["phase_deg"], *curve["model_phase_deg"]])
    low, high = np.nanpercentile(measured, [1.0, 99.0])
    phase.set_ylim(low - 15.0, high + 15.0)
    phase.locator_params(axis="y", nbins=6, steps=[1.5, 3, 4.5, 9])
    place_legend(
        figure,
        [
            legend_line("measured", BLUE, marker=".", linestyle="none", markersize=6.0),
            legend_line("second-order model", INK, linewidth=1.2),
        ],
    )
    return figure


def _plain_log_ticks(axes: "Axes") -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_locator(NullLocator())


# --- figure 2.6 ----------------------------------------------------------------------------------


def _draw_loads(loads: Sequence[Mapping[str, Any]]) -> "Figure":
    cases = list(dict.fromkeys(str(one["case"]) for one in loads))
    trajectories = sorted({str(one["trajectory"]) for one in loads})
    present = [name for name in _PARAMETERS if any(one["parameter"] == name for one in loads)]
    figure = new_figure(14.0 + 49.0 * len(present))
    pitch = (WIDTH_MM - 8.0) / len(cases)
    for row, parameter in enumerate(present):
        top = 18.0 + 49.0 * row
        place_text(figure, 1.0, top - 4.5, axis_label(parameter), fontweight="bold")
        mine = [one for one in loads if one["parameter"] == parameter]
        for column, case in enumerate(cases):
            axes = place_axes(
                figure, 13.0 + column * pitch, top, width_mm=pitch - 12.0, height_mm=36.0
            )
            own = [one for one in mine if str(one["case"]) == case]
            _draw_case(axes, own, trajectories)
            _case_limits(axes, own, mine, absolute=parameter == "damping")
            _case_name(axes, case)
    place_legend(figure, _load_legend())
    return figure


def _draw_case(axes: "Axes", own: Sequence[Mapping[str, Any]], trajectories: Sequence[str]) -> None:
    for one in own:
        slot = trajectories.index(str(one["trajectory"]))
        axes.hlines(one["truth"], slot - 0.5, slot + 0.5, colors=FAINT, linewidth=2.2, zorder=1)
        for key, marker, ends, shift in _METHODS:
            colour = _shade(ends, slot, len(trajectories))
            value, low, high = _value_and_bar(one, key)
            axes.vlines(slot + shift, low, high, colors=colour, linewidth=1.1, zorder=3)
            axes.plot(slot + shift, value, marker, color=colour, markersize=3.6,
                      markeredgewidth=0.0, zorder=4)  # fmt: skip
    axes.set_xlim(-0.6, len(trajectories) - 0.4)
    axes.set_xticks(range(len(trajectories)), trajectories)
    axes.tick_params(axis="x", length=0, labelsize=SMALL_PT)
    axes.tick_params(axis="y", labelsize=SMALL_PT)


def _value_and_bar(one: Mapping[str, Any], key: str) -> tuple[float, float, float]:
    if key == "recommended":
        value, low, high = numbers([one.get(name) for name in (key, "ci_low", "ci_high")])
        return float(value), float(low), float(high)
    value, sd = numbers([one.get(key), one.get(f"{key}_sd")])
    return float(value), float(value - sd), float(value + sd)


def _shade(ends: tuple[str, str], slot: int, slots: int) -> str:
    """Return a colour between light and dark."""
    from matplotlib.colors import to_hex, to_rgb

    share = slot / max(1, slots - 1)
    light, dark = (to_rgb(end) for end in ends)
    red, green, blue = ((1.0 - share) * a + share * b for a, b in zip(light, dark, strict=True))
    return to_hex((red, green, blue))


def _case_limits(
    axes: "Axes",
    own: Sequence[Mapping[str, Any]],
    parameter: Sequence[Mapping[str, Any]],
    *,
    absolute: bool,
) -> None:
    """Give all cases of a parameter one scale about their truths: absolute, or in percent."""
    if not own:
        return
    centre = float(np.mean([one["truth"] for one in own]))
    deviations = np.concatenate(
        [
            (np.array([_value_and_bar(one, key) for key, *_ in _METHODS]).ravel() - one["truth"])
            / (1.0 if absolute else abs(one["truth"]))
            for one in parameter
        ]
    )
    low = min(0.0, float(np.nanmin(deviations)))
    high = max(0.0, float(np.nanmax(deviations)))
    margin = 0.08 * (high - low) or 0.1
    scale = 1.0 if absolute else abs(centre)
    axes.set_ylim(centre + scale * (low - margin), centre + scale * (high + margin))
    axes.locator_params(axis="y", nbins=5)


def _case_name(axes: "Axes", case: str) -> None:
    name = f"case {case}" if len(case) == 1 else case
    axes.text(0.5, 1.02, name, transform=axes.transAxes, ha="center", va="bottom",
              fontsize=SMALL_PT, color=MUTED)  # fmt: skip


def _load_legend() -> "list[Line2D]":
    (_, circle, (_, warm), _), (_, diamond, (_, cold), _) = _METHODS
    return [
        legend_line("dissertation's method (± SD)", warm, marker=circle),
        legend_line("recommended (95 % interval)", cold, marker=diamond),
        legend_line("truth", FAINT, linewidth=2.2),
    ]


# --- mechanisms ----------------------------------------------------------------------------------


def _draw_mechanisms(mechanisms: Sequence[Mapping[str, Any]]) -> "Figure":
    names = [fill(pretty_unit(str(one["mechanism"])), _NAME_CHARACTERS) for one in mechanisms]
    height = 6.0 * len(names)
    figure = new_figure(height + 20.0)
    left = 58.0
    pitch = (WIDTH_MM - left - 2.0) / 3
    panels = (
        ("stiffness_pct", "Stiffness (%)", 1),
        ("damping", "Damping (N·m·s/rad)", 3),
        ("inertia_pct", "Inertia (%)", 1),
    )
    rows = np.arange(len(names))
    for column, (key, heading, decimals) in enumerate(panels):
        axes = place_axes(
            figure, left + column * pitch, 8.0, width_mm=pitch - 6.0, height_mm=height
        )
        values = numbers([one.get(key) for one in mechanisms])
        colours = [VERMILION if value < 0 else BLUE for value in values]
        axes.barh(rows, values, height=0.62, color=colours, zorder=2)
        axes.axvline(0.0, color=INK, linewidth=0.7, zorder=3)
        _write_values(axes, values, decimals)
        axes.set_ylim(len(names) - 0.5, -0.5)
        axes.set_yticks(rows, names if column == 0 else [])
        axes.tick_params(axis="y", length=0, labelsize=SMALL_PT + 0.3)
        axes.spines["left"].set_visible(False)
        axes.locator_params(axis="x", nbins=4)
        panel_heading(axes, heading)
    place_text(
        figure, left + 1.5 * pitch, height + 17.5, "Error of the dissertation's method", ha="center"
    )
    return figure


def _write_values(axes: "Axes", values: np.ndarray, decimals: int) -> None:
    """Write every value beyond its bar, and make room for it."""
    known = values[np.isfinite(values)]
    reach = max(float(np.abs(known).max(initial=0.0)), 10.0**-decimals)
    low, high = min(0.0, float(known.min(initial=0.0))), max(0.0, float(known.max(initial=0.0)))
    axes.set_xlim(low - (0.55 if low < 0 else 0.1) * reach, high + 0.55 * reach)
    for row, value in enumerate(np.round(values, decimals) + 0.0):  # no minus before a zero
        side = -1.0 if value < 0 else 1.0
        axes.text(
            (value if np.isfinite(value) else 0.0) + side * 0.03 * reach, row,
            format_signed(value, decimals=decimals), ha="left" if side > 0 else "right",
            va="center", fontsize=SMALL_PT, color=INK,
        )  # fmt: skip


_DRAWINGS: Final[Drawings] = {
    "figure_2_5": ("bandwidth", _draw_bandwidth),
    "figure_intrinsic": ("intrinsic", _draw_intrinsic),
    "figure_2_6": ("loads", _draw_loads),
    "figure_mechanisms": ("mechanisms", _draw_mechanisms),
}
