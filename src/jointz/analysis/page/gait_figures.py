"""Figures of the mean stride with the onsets of the pulses, and of one pulse with its fit."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from jointz.analysis.device_effect import stored_device_effect, strides_by_person
from jointz.core.gait_phases import circular_mean_pct
from jointz.report.style import legend_line, new_figure, panel_heading, place_legend, place_panels
from jointz.report.subjects import timing_points
from jointz.results.estimates import CellEstimate
from jointz.results.figure_style import BLUE, FAINT, INK, MUTED, PANEL, SMALL_PT, VERMILION
from jointz.results.mean_stride import MeanStride
from jointz.results.statistics.waveform_test import WaveformTest
from jointz.results.study_analysis import StudyAnalysis

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

_LEFT_MM: Final = 13.0
_TOP_MM: Final = 13.0
_HEIGHT_MM: Final = 38.0
#: Number and letters of timing points whose names have room above the panels.
_MOST_NAMES: Final = 7
_LONGEST_NAME: Final = 4
_LOOKS: Final = {
    "no_device": ("without the device", INK, "--"),
    "unperturbed": ("with the device", BLUE, "-"),
    "perturbed": ("perturbed recordings, strides without a pulse", VERMILION, ":"),
}


# --- mean stride -----------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class _Condition:
    """Mean strides of the people of a condition; sessions and sides of a person are averaged."""

    angle: np.ndarray  # (person, n) rad
    angle_sd: np.ndarray  # (n,) between people, or between the strides of the only one, rad
    torque: np.ndarray | None  # (person, n) N*m, of those with torque; None without

    @classmethod
    def of(cls, people: Mapping[str, Sequence[MeanStride]]) -> "_Condition":
        """Return the condition of people with their mean strides."""
        angle = np.array([np.mean([m.angle for m in own], axis=0) for own in people.values()])
        torques = [[m.torque for m in own if m.torque is not None] for own in people.values()]
        known = [np.mean(own, axis=0) for own in torques if own]
        first = next(iter(people.values()))
        sd = angle.std(axis=0, ddof=1) if len(angle) > 1 else first[0].angle_sd
        return cls(angle, sd, np.array(known) if known else None)


def draw_gait(analysis: StudyAnalysis) -> "Figure | None":
    """Draw mean angle and torque over the cycle with the onsets, and the effect of the device."""
    conditions = shown_conditions(analysis)
    if not conditions:
        return None
    test = stored_device_effect(analysis.statistics)
    figure = new_figure(_TOP_MM + _HEIGHT_MM + 10.0)
    axes = place_panels(figure, 3, left_mm=_LEFT_MM, top_mm=_TOP_MM, height_mm=_HEIGHT_MM)
    headings = ["Angle (deg)", "Torque of the device (N·m)", "Effect of the device (deg)"]
    with_torque = any(c.torque is not None for c in conditions.values())
    for panel, heading, drawn in zip(axes, headings, (True, with_torque, test), strict=True):
        if not drawn:
            panel.remove()
            continue
        panel_heading(panel, heading)
        panel.set(xlim=(0.0, 100.0), xticks=range(0, 101, 20), xlabel="Gait cycle (%)")
    for name, condition in conditions.items():
        degrees, sd = np.degrees(condition.angle), np.degrees(condition.angle_sd)
        _draw_mean(axes[0], degrees.mean(axis=0), sd, name)
        if condition.torque is not None:
            several = len(condition.torque) > 1
            sd = condition.torque.std(axis=0, ddof=1) if several else np.zeros(len(sd))
            _draw_mean(axes[1], condition.torque.mean(axis=0), sd, name)
    if test is not None:
        _draw_effect(axes[2], test)
    for panel in axes[: 1 + with_torque]:
        _mark_onsets(panel, analysis)
    place_legend(figure, [_handle(name, c) for name, c in conditions.items()])
    return figure


def shown_conditions(analysis: StudyAnalysis) -> dict[str, _Condition]:
    """Return the conditions without the device and with it."""
    people = strides_by_person(analysis.mean_strides)
    # Perturbed recordings are drawn if nothing else was recorded with the device.
    worn = "unperturbed" if "unperturbed" in people else "perturbed"
    return {name: _Condition.of(people[name]) for name in ("no_device", worn) if name in people}


def _handle(name: str, condition: _Condition) -> "Line2D":
    text, colour, line = _LOOKS[name]
    return legend_line(f"{text} (n {len(condition.angle)})", colour, linestyle=line)


def _draw_mean(axes: "Axes", mean: np.ndarray, sd: np.ndarray, condition: str) -> None:
    _, colour, line = _LOOKS[condition]
    at = np.linspace(0.0, 100.0, mean.size)
    axes.plot(at, mean, line, color=colour, linewidth=1.2)
    axes.fill_between(at, mean - sd, mean + sd, color=colour, alpha=0.15, linewidth=0)


def _mark_onsets(axes: "Axes", analysis: StudyAnalysis) -> None:
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.22 * (high - low))
    onsets = {
        name: [
            c.onset_gait_pct
            for c in analysis.cells
            if c.timing_point == name and c.onset_gait_pct is not None
        ]
        for name in timing_points(analysis.cells)
    }
    places = sorted((circular_mean_pct(own), name) for name, own in onsets.items() if own)
    # More or longer names would lie on each other.
    named = len(places) <= _MOST_NAMES and max(map(len, onsets), default=0) <= _LONGEST_NAME
    for k, (at, name) in enumerate(places):
        axes.axvline(at, color=FAINT, linewidth=0.8, zorder=0)
        if named:
            axes.text(
                at, 1.0 - 0.08 * (k % 2), name, transform=axes.get_xaxis_transform(),
                ha="center", va="top", fontsize=SMALL_PT, color=MUTED,
            )  # fmt: skip


def _draw_effect(axes: "Axes", test: WaveformTest) -> None:
    at = np.linspace(0.0, 100.0, len(test.t))
    low, middle, high = (np.degrees(c) for c in (test.ci_low, test.difference, test.ci_high))
    per_node = 100.0 / (len(test.t) - 1)
    for cluster in test.clusters:
        axes.axvspan(
            cluster.start_node * per_node, cluster.end_node * per_node, color=PANEL, zorder=0
        )
    axes.axhline(0.0, color=FAINT, linewidth=0.8)
    axes.fill_between(at, low, high, color=BLUE, alpha=0.2, linewidth=0)
    axes.plot(at, middle, color=BLUE, linewidth=1.2)


# --- one pulse -------------------------------------------------------------------------------


def draw_pulse_example(analysis: StudyAnalysis) -> "Figure | None":
    """Draw one pulse as measured, its baseline, response, fit and residual."""
    cell = example_cell(analysis)
    if cell is None or cell.example is None or cell.response is None:
        return None
    example, response = cell.example, cell.response
    by_angle = response.fitted_angle is not None
    fitted = response.fitted_torque if response.fitted_angle is None else response.fitted_angle
    scale, unit = (180.0 / np.pi, "deg") if by_angle else (1.0, "N·m")
    colour = BLUE if by_angle else INK
    figure = new_figure(_TOP_MM + _HEIGHT_MM + 10.0)
    sizes = {"left_mm": _LEFT_MM, "top_mm": _TOP_MM, "height_mm": _HEIGHT_MM}
    torque, angle, right = place_panels(figure, 3, **sizes)
    at = 1000.0 * example.time_s
    torque.plot(at, example.torque, color=INK)
    torque.plot(at, example.baseline_torque, color=VERMILION, linestyle=":", linewidth=1.2)
    panel_heading(torque, "Torque (N·m)")
    angle.plot(at, np.degrees(example.angle), color=BLUE)
    angle.plot(
        at, np.degrees(example.baseline_angle), color=VERMILION, linestyle=":", linewidth=1.2
    )
    panel_heading(angle, "Angle (deg)")
    upper, lower = _halves(figure, right)
    upper.plot(at, scale * example.response, color=colour)
    fit = np.interp(example.time_s, response.time_s, fitted, left=np.nan, right=np.nan)
    upper.plot(at, scale * fit, color=VERMILION, dashes=(2.5, 1.5), linewidth=1.2)
    panel_heading(upper, f"Response ({unit})")
    upper.set_xticklabels([])
    lower.axhline(0.0, color=FAINT, linewidth=0.8)
    lower.plot(at, scale * (example.response - fit), color=MUTED)
    panel_heading(lower, f"Residual ({unit})")
    for panel in (torque, angle, upper, lower):
        panel.axvline(0.0, color=FAINT, linewidth=0.8, zorder=0)
        panel.set_xlim(at[0], at[-1])
    for panel in (torque, angle, lower):
        panel.set_xlabel("Time from onset (ms)")
    handles = [
        legend_line("measured torque", INK),
        legend_line("measured angle", BLUE),
        legend_line("baseline", VERMILION, linestyle=":"),
        legend_line("fit to the average", VERMILION, dashes=(2.5, 1.5)),
        legend_line("residual", MUTED),
    ]
    place_legend(figure, handles)
    return figure


def example_cell(analysis: StudyAnalysis) -> CellEstimate | None:
    """Return the cell of median VAF among those with an example."""
    known = [
        c
        for c in analysis.cells
        if c.example is not None and c.response is not None and c.vaf_pct is not None
    ]
    ordered = sorted(known, key=lambda c: c.vaf_pct or 0.0)
    return ordered[len(ordered) // 2] if ordered else None


def _halves(figure: "Figure", axes: "Axes") -> "tuple[Axes, Axes]":
    """Replace axes by two, the lower of which is smaller."""
    box = axes.get_position()
    axes.remove()
    upper = figure.add_axes((box.x0, box.y0 + 0.48 * box.height, box.width, 0.52 * box.height))
    lower = figure.add_axes((box.x0, box.y0, box.width, 0.27 * box.height))
    return upper, lower
