"""Figures of the recordings: strides over time, and accuracy of the onsets."""

from bisect import bisect_left
from collections import Counter
from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from typing import TYPE_CHECKING, Final

import numpy as np

from jointz.core.codes import Exclusion
from jointz.core.events import StrideRecord
from jointz.core.grouping import by_key
from jointz.report.style import (
    legend_line,
    new_figure,
    place_axes,
    place_legend,
    place_text,
    ticks_at,
)
from jointz.report.wording import MINUS, format_signed
from jointz.results.figure_style import (
    BLUE,
    GREEN,
    INK,
    MUTED,
    ORANGE,
    PURPLE,
    SKY,
    SMALL_PT,
    VERMILION,
    WIDTH_MM,
)
from jointz.results.study_analysis import StudyAnalysis
from jointz.stats.description import onset_errors

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

# Strides with a pulse are excluded by design. They are many: strokes on the axis, not marks.
BY_DESIGN: Final = Exclusion.PULSE_IN_STRIDE.value
_CODE_LOOKS: Final = ((VERMILION, "x"), (PURPLE, "^"), (ORANGE, "s"), (GREEN, "v"), (INK, "+"))
_LEFT_MM: Final = 22.0
_HISTOGRAM_MM: Final = 22.0
_BINS: Final = 24

_Grid = Mapping[tuple[str, int], Mapping[str, Sequence[StrideRecord]]]


def draw_strides(analysis: StudyAnalysis) -> "Figure | None":
    """Draw stride durations over time in every recording, and their histogram."""
    if not analysis.strides:
        return None
    conditions = list(dict.fromkeys(s.condition for s in analysis.strides))
    grid = _stride_grid(analysis.strides)
    looks = _code_looks(analysis.strides)
    with_pulse = strides_with_pulse(analysis)
    height = 24.0 if len(grid) <= 4 else 13.0
    pitch = height + 4.0
    figure = new_figure(15.0 + pitch * len(grid) + 7.0)
    longest = _longest(analysis.strides)
    boxes = _column_boxes([longest[name] for name in conditions])
    for (left, _), name in zip(boxes, [*conditions, "accepted"], strict=True):
        place_text(figure, left, 11.0, name.replace("_", " "), fontsize=SMALL_PT, va="center")
    for i, ((person, _), by_condition) in enumerate(grid.items()):
        top, last = 14.0 + i * pitch, i == len(grid) - 1
        place_text(figure, 1.0, top + 0.5 * height, person, fontweight="bold", va="center",
                   fontsize=SMALL_PT)  # fmt: skip
        limits = _duration_limits([s for own in by_condition.values() for s in own])
        for (left, width), condition in zip(boxes[:-1], conditions, strict=True):
            axes = place_axes(figure, left, top, width_mm=width, height_mm=height)
            _draw_recording(axes, by_condition.get(condition, ()), analysis, with_pulse)
            _draw_rejected(axes, by_condition.get(condition, ()), looks, limits)
            axes.set_xlim(0.0, longest[condition])
            _duration_axis(axes, limits, labelled=condition == conditions[0], last=last)
        left, width = boxes[-1]
        axes = place_axes(figure, left, top, width_mm=width, height_mm=height)
        _draw_histogram(axes, by_condition, limits)
        _duration_axis(axes, limits, labelled=False, last=last)
        axes.set_xticks([])
        axes.set_xlabel("strides" if last else "")
    place_text(figure, 1.0, 11.0, "Stride time (s)", fontsize=7.0, va="center")
    place_legend(figure, _stride_legend(looks, analysis, with_pulse))
    return figure


def strides_with_pulse(analysis: StudyAnalysis) -> set[tuple[str, str, float]]:
    """Return the strides in which a pulse begins, or that were excluded for a pulse."""
    pulses = sorted(analysis.pulses, key=lambda pulse: pulse.onset_s)
    onsets = by_key(((p.participant, p.recording), p.onset_s) for p in pulses)
    return {
        (s.participant, s.recording, s.start_s)
        for s in analysis.strides
        if s.code == BY_DESIGN or _has_onset(s, onsets.get((s.participant, s.recording), ()))
    }


def _has_onset(stride: StrideRecord, onsets_s: Sequence[float]) -> bool:
    following = bisect_left(onsets_s, stride.start_s)
    end_s = stride.start_s + stride.duration_s
    return following < len(onsets_s) and onsets_s[following] < end_s


def draw_onset_accuracy(analysis: StudyAnalysis) -> "Figure | None":
    """Draw the onset of each pulse in the gait cycle, relative to its target."""
    pulses = onset_errors(analysis.pulses)
    errors = {key: known for key, all_ in pulses.items() if (known := all_[~np.isnan(all_)]).size}
    if not errors:
        return None
    figure = new_figure(72.0)
    axes = place_axes(figure, 14.0, 4.0, width_mm=WIDTH_MM - 17.0, height_mm=53.0)
    reach = max(1.0, 1.1 * max(float(np.abs(e).max()) for e in errors.values()))
    axes.set_ylim(-reach, 1.5 * reach)  # above the pulses stand their SD, mean and number
    axes.set_yticks([tick for tick in axes.get_yticks() if abs(tick) <= reach])
    axes.set_xlim(-0.55, len(errors) - 0.45)
    axes.axhline(0.0, color=MUTED, linewidth=0.8, zorder=1)
    for at, error in enumerate(errors.values()):
        _draw_onsets(axes, at, error)
    axes.set_xticks(range(len(errors)), [f"{name}\n{target:.1f} %" for name, target in errors])
    axes.tick_params(axis="x", length=0)
    axes.set_xlabel("Timing point and target (% of gait cycle)")
    axes.set_ylabel(f"Onset {MINUS} target (% of gait cycle)")
    return figure


def _stride_grid(strides: Sequence[StrideRecord]) -> _Grid:
    """Group strides by participant and repetition of a condition, then by condition."""
    recordings = by_key(((s.participant, s.condition, s.recording), s) for s in strides)
    repeats: Counter[tuple[str, str]] = Counter()
    grid: dict[tuple[str, int], dict[str, list[StrideRecord]]] = {}
    for (person, condition, _), own in recordings.items():
        grid.setdefault((person, repeats[person, condition]), {})[condition] = own
        repeats[person, condition] += 1
    return grid


def _code_looks(strides: Sequence[StrideRecord]) -> dict[str, tuple[str, str]]:
    codes = sorted({s.code for s in strides if s.code and s.code != BY_DESIGN})
    return {code: _CODE_LOOKS[i % len(_CODE_LOOKS)] for i, code in enumerate(codes)}


def _longest(strides: Sequence[StrideRecord]) -> dict[str, float]:
    """Return the end of the longest recording of each condition, s."""
    ends: dict[str, float] = {}
    for s in strides:
        ends[s.condition] = max(ends.get(s.condition, 1.0), s.start_s + s.duration_s)
    return ends


def _column_boxes(longest_s: Sequence[float]) -> list[tuple[float, float]]:
    """Return left and width of each column, mm: wider where walking took longer."""
    # Long and short recordings differ thirtyfold; the root keeps the short ones readable.
    weights = np.sqrt(longest_s)
    free = WIDTH_MM - _LEFT_MM - _HISTOGRAM_MM - 2.0 - 4.0 * len(longest_s)
    widths = free * weights / weights.sum()
    lefts = _LEFT_MM + np.concatenate([[0.0], np.cumsum(widths + 4.0)])
    return [*zip(lefts[:-1], widths, strict=True), (lefts[-1], _HISTOGRAM_MM)]


def _duration_limits(strides: Sequence[StrideRecord]) -> tuple[float, float]:
    """Return limits that fit the accepted strides; others may lie beyond."""
    usable = [s.duration_s for s in strides if s.code in ("", BY_DESIGN)]
    durations = np.array(usable or [s.duration_s for s in strides])
    low, high = np.percentile(durations, [1.0, 99.0])
    margin = max(0.35 * (high - low), 0.02 * high)
    return float(low - 1.8 * margin), float(high + 1.8 * margin)


def _draw_recording(
    axes: "Axes",
    strides: Sequence[StrideRecord],
    analysis: StudyAnalysis,
    with_pulse: AbstractSet[tuple[str, str, float]],
) -> None:
    if not strides:
        axes.text(0.5, 0.5, "no recording", transform=axes.transAxes, ha="center", va="center",
                  fontsize=SMALL_PT, color=MUTED)  # fmt: skip
        return
    start = np.array([s.start_s for s in strides])
    duration = np.array([s.duration_s for s in strides])
    codes = np.array([s.code for s in strides])
    few = len(strides) <= 150
    accepted = np.where(codes == "", duration, np.nan)
    axes.plot(start, accepted, color=BLUE, linewidth=0.7, marker="." if few else "",
              markersize=2.5)  # fmt: skip
    rug = axes.get_xaxis_transform()
    where = (strides[0].participant, strides[0].recording)
    holding = np.array([(*where, s) in with_pulse for s in start.tolist()], dtype=bool)
    in_pulse = ticks_at(start[holding], 0.0, 0.09)
    axes.plot(*in_pulse, color=MUTED, linewidth=0.6, transform=rug)
    gaps = [g.start_s for g in analysis.gaps if (g.participant, g.recording) == where]
    axes.plot(*ticks_at(np.array(gaps), 0.0, 1.0), color=VERMILION, linewidth=0.8,
              dashes=(2, 1.5), transform=rug)  # fmt: skip


def _draw_rejected(
    axes: "Axes",
    strides: Sequence[StrideRecord],
    looks: Mapping[str, tuple[str, str]],
    limits: tuple[float, float],
) -> None:
    """Mark the excluded strides by their code; those beyond the limits at the edge."""
    inset = 0.11 * (limits[1] - limits[0])
    for code, (colour, marker) in looks.items():
        own = [s for s in strides if s.code == code]
        height = np.clip([s.duration_s for s in own], limits[0] + inset, limits[1] - inset)
        axes.plot([s.start_s for s in own], height, linestyle="none", marker=marker,
                  markersize=3.2, color=colour, markeredgewidth=0.9, zorder=5)  # fmt: skip


def _duration_axis(
    axes: "Axes", limits: tuple[float, float], *, labelled: bool, last: bool
) -> None:
    axes.set_ylim(*limits)
    axes.locator_params(axis="y", nbins=3)
    axes.locator_params(axis="x", nbins=5)
    axes.tick_params(labelsize=SMALL_PT, labelleft=labelled, labelbottom=last)
    if last:
        axes.set_xlabel("Time (s)", fontsize=SMALL_PT)


def _draw_histogram(
    axes: "Axes", by_condition: Mapping[str, Sequence[StrideRecord]], limits: tuple[float, float]
) -> None:
    accepted = [s.duration_s for own in by_condition.values() for s in own if not s.code]
    counts, edges = np.histogram(accepted, bins=_BINS, range=limits)
    axes.stairs(counts, edges, orientation="horizontal", fill=True, color=SKY)
    if accepted:
        mean = float(np.mean(accepted))
        axes.axhline(mean, color=INK, linewidth=0.7)
        sd = f" ± {np.std(accepted, ddof=1):.3f}" if len(accepted) > 1 else ""
        axes.text(
            1.0, 0.96, f"{mean:.2f}{sd} s", transform=axes.transAxes,
            ha="right", va="top", fontsize=SMALL_PT, color=MUTED,
        )  # fmt: skip


def _stride_legend(
    looks: Mapping[str, tuple[str, str]],
    analysis: StudyAnalysis,
    with_pulse: AbstractSet[tuple[str, str, float]],
) -> "list[Line2D]":
    handles = [legend_line("accepted", BLUE)]
    if with_pulse:
        handles.append(legend_line("contains a pulse", MUTED, marker="|", linestyle="none"))
    handles += [
        legend_line(code.replace("_", " "), colour, marker=marker, linestyle="none")
        for code, (colour, marker) in looks.items()
    ]
    if analysis.gaps:
        handles.append(legend_line("gap in the time stamps", VERMILION, dashes=(2.0, 1.5)))
    return handles


def _draw_onsets(axes: "Axes", at: int, error: np.ndarray) -> None:
    """Draw the pulses as a strip on the right and their histogram on the left."""
    spread = np.modf(np.arange(error.size) * 0.618034)[0]  # even, and the same on every run
    axes.plot(
        at + 0.06 + 0.30 * spread, error, linestyle="none", marker="o", markersize=1.6,
        color=BLUE, markeredgewidth=0.0, alpha=0.45, zorder=3,
    )  # fmt: skip
    counts, edges = np.histogram(error, bins=_BINS, range=(error.min() - 0.1, error.max() + 0.1))
    width = 0.34 * counts / counts.max()
    axes.stairs(at - width, edges, baseline=at, orientation="horizontal", fill=True, color=SKY)
    mean = float(error.mean())
    axes.plot([at - 0.38, at + 0.38], [mean, mean], color=INK, linewidth=1.2, zorder=4)
    sd = f"SD {error.std(ddof=1):.2f} %" if error.size > 1 else "one pulse"
    axes.text(
        at, 0.985, f"{sd}\nmean {format_signed(mean, decimals=2)} %\nn {error.size}",
        transform=axes.get_xaxis_transform(), ha="center", va="top", fontsize=SMALL_PT,
        linespacing=1.35,
    )  # fmt: skip
