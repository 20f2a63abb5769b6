"""Figures of chapter III again: torque models, chirps, static and dynamic stiffness."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from jointz.report.style import legend_line, new_figure, panel_heading, place_axes, place_legend
from jointz.report.wording import MINUS, format_signed
from jointz.results.figure_style import BLUE, FAINT, INK, MUTED, SKY, SMALL_PT, VERMILION, WIDTH_MM
from reproduction.chapter_page import Drawings, draw_figures, every, mark, numbers

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Slower than this share of the fastest, a joint stands.
_STANDING_SHARE: Final = 0.1
_REGIMES: Final = (("backward", BLUE), ("standing", MUTED), ("forward", VERMILION))
_SCATTER_POINTS: Final = 1200
_STRETCH_S: Final = 1.6
_PANELS: Final = 3
_PITCH_MM: Final = (WIDTH_MM - 4.0) / _PANELS
_OURS: Final[Mapping[str, Any]] = {"marker": "o", "markersize": 5.5, "linestyle": "none"}
_PRINTED: Final[Mapping[str, Any]] = {
    "marker": "v", "markersize": 6.0, "linestyle": "none", "markerfacecolor": "white",
}  # fmt: skip


def draw_chapter3(curves: Mapping[str, Any]) -> dict[str, str]:
    """Draw the figures of chapter III that the curves allow."""
    return draw_figures(_DRAWINGS, curves)


# --- figure 3.3 ----------------------------------------------------------------------------------


def _draw_torque_models(curve: Mapping[str, Any]) -> "Figure":
    models: Mapping[str, Sequence[float]] = curve["models"]
    sensor = numbers(curve["sensor_nm"])
    regimes = _regimes(numbers(curve["speed_rad_s"]))
    torques = {name: numbers(values) for name, values in models.items()}
    largest_error = max(float(np.nanmax(np.abs(t - sensor))) for t in torques.values())
    figure = new_figure(104.0)
    for column, (name, torque) in enumerate(torques.items()):
        left = 12.0 + column * _PITCH_MM
        upper = place_axes(figure, left, 14.0, width_mm=_PITCH_MM - 13.0, height_mm=44.0)
        lower = place_axes(figure, left, 64.0, width_mm=_PITCH_MM - 13.0, height_mm=30.0)
        _identity(upper, sensor)
        _scatter(upper, sensor, torque, regimes)
        lower.axhline(0.0, color=MUTED, linewidth=0.7, zorder=1)
        _scatter(lower, sensor, torque - sensor, regimes)
        lower.set_ylim(-1.08 * largest_error, 1.08 * largest_error)
        upper.tick_params(labelbottom=False)
        lower.set_xlabel("Torque sensor (N·m)")
        rms = float(curve["rms_nm"][name])  # of every sample; those drawn are fewer
        panel_heading(upper, f"Model {name}", note=f"RMS error {rms:.3g} N·m")
    upper, lower = figure.axes[:2]
    upper.set_ylabel("Torque model (N·m)")
    lower.set_ylabel(f"Model {MINUS} sensor (N·m)")
    place_legend(
        figure,
        [
            legend_line(name, colour, marker="o", linestyle="none", markeredgewidth=0.0)
            for name, colour in _REGIMES
        ],
    )
    return figure


def _regimes(speed: np.ndarray) -> np.ndarray:
    """Return of every sample the index of its regime: backward, standing, forward."""
    slow = np.abs(speed) < _STANDING_SHARE * np.nanmax(np.abs(speed))
    return np.where(slow, 1, np.where(speed < 0.0, 0, 2))


def _identity(axes: "Axes", values: np.ndarray) -> None:
    ends = [float(np.nanmin(values)), float(np.nanmax(values))]
    axes.plot(ends, ends, color=MUTED, linewidth=0.7, zorder=1)


def _scatter(axes: "Axes", x: np.ndarray, y: np.ndarray, regimes: np.ndarray) -> None:
    # Standing first: those that move are few among them, and lie on top.
    for regime in (1, 0, 2):
        there = regimes == regime
        part = every(int(there.sum()), most=_SCATTER_POINTS // len(_REGIMES))
        axes.plot(x[there][part], y[there][part], ".", color=_REGIMES[regime][1], markersize=2.6,
                  markeredgewidth=0.0, zorder=2)  # fmt: skip


# --- figure 3.4 ----------------------------------------------------------------------------------


def _draw_chirp(curve: Mapping[str, Any]) -> "Figure":
    time, sensor, model = (numbers(curve[key]) for key in ("time_s", "sensor_nm", "model_nm"))
    segments = curve["segments"]
    rows = -(-len(segments) // 2)
    figure = new_figure(8.0 + 48.0 * rows)
    for i, (start, end, amplitude) in enumerate(segments):
        row, column = divmod(i, 2)
        axes = place_axes(
            figure, 14.0 + 87.0 * column, 14.0 + 48.0 * row,
            width_mm=73.0, height_mm=31.0,
        )  # fmt: skip
        whole = (time >= start) & (time < end)
        # In the middle a chirp is fast enough to see lags and slow enough to see lines.
        middle = 0.5 * (start + end)
        shown = whole & (np.abs(time - middle) <= 0.5 * _STRETCH_S)
        part = every(int(shown.sum()))
        axes.plot(time[shown][part], sensor[shown][part], color=INK, linewidth=0.8)
        axes.plot(time[shown][part], model[shown][part], color=VERMILION, linewidth=0.8)
        axes.set_xlim(middle - 0.5 * _STRETCH_S, middle + 0.5 * _STRETCH_S)
        axes.locator_params(axis="y", nbins=5)
        rms = float(np.sqrt(np.nanmean((model - sensor)[whole] ** 2)))
        panel_heading(axes, f"Chirp of {amplitude:g} N·m", note=f"RMS error {rms:.2f} N·m")
        axes.set_ylabel("Torque (N·m)" if column == 0 else "")
        axes.set_xlabel("Time (s)" if row == rows - 1 else "")
    place_legend(figure, [legend_line("torque sensor", INK), legend_line("model 3.3", VERMILION)])
    return figure


# --- figure 3.5 ----------------------------------------------------------------------------------


def _draw_static(curve: Mapping[str, Any]) -> "Figure":
    figure = new_figure(78.0)
    torques = place_axes(figure, 14.0, 12.0, width_mm=76.0, height_mm=54.0)
    remainders = place_axes(figure, 110.0, 12.0, width_mm=68.0, height_mm=54.0)
    deflection = numbers(curve["deflection_rad"])
    line = _static_line(curve, "sensor")
    handles = []
    for key, dots, colour, dashes in (
        ("sensor", FAINT, INK, (None, None)),
        ("model", SKY, BLUE, (4, 2)),
    ):
        torque, fitted = numbers(curve[f"{key}_nm"]), _static_line(curve, key)
        part = every(deflection.size)
        ends = [int(np.nanargmin(deflection)), int(np.nanargmax(deflection))]
        for axes, base in ((torques, 0.0), (remainders, line)):
            axes.plot(np.degrees(deflection)[part], (torque - base)[part], color=dots,
                      linewidth=0.6, zorder=1)  # fmt: skip
            axes.plot(np.degrees(deflection)[ends], (fitted - base)[ends], color=colour,
                      linewidth=1.3, dashes=dashes, zorder=2)  # fmt: skip
        stiffness = f"torque {key}: {curve[f'{key}_stiffness']:.1f} N·m/rad"
        handles.append(legend_line(stiffness, colour, linewidth=1.3, dashes=dashes))
    for axes in (torques, remainders):
        axes.set_xlabel("Deflection (deg)")
    torques.set_ylabel("Torque (N·m)")
    remainders.set_ylabel(f"Torque {MINUS} line of the sensor (N·m)")
    difference = 100.0 * (curve["model_stiffness"] / curve["sensor_stiffness"] - 1.0)
    note = f"stiffness by the model {format_signed(difference, decimals=2)} %"
    panel_heading(remainders, "", note=note)
    place_legend(figure, handles)
    return figure


def _static_line(curve: Mapping[str, Any], key: str) -> np.ndarray:
    """Return the fitted line at every sample; its offset is that of the record."""
    deflection = numbers(curve["deflection_rad"])
    stiffness = float(curve[f"{key}_stiffness"])
    offset = np.nanmean(numbers(curve[f"{key}_nm"]) - stiffness * deflection)
    line: np.ndarray = offset + stiffness * deflection
    return line


# --- figure 3.6 ----------------------------------------------------------------------------------


def _draw_perturbation(curve: Mapping[str, Any]) -> "Figure":
    figure = new_figure(80.0)
    axes = place_axes(figure, 15.0, 10.0, width_mm=WIDTH_MM - 18.0, height_mm=56.0)
    printed, recommended = curve["printed"], curve.get("recommended") or {}
    groups = (
        ("dither\n(no pulses)", (curve["dither"], None), (printed["dither"], None)),
        ("positive pulses", _mean_sd(curve["positive"]), printed["positive"]),
        ("negative pulses", _mean_sd(curve["negative"]), printed["negative"]),
    )
    axes.axhline(curve["truth"], color=FAINT, linewidth=2.2, zorder=1)
    for at, (_, ours, theirs) in enumerate(groups):
        for shift, (value, sd), colour, look in (
            (-0.13, numbers(theirs), MUTED, _PRINTED),
            (0.13, numbers(ours), VERMILION, _OURS),
        ):
            bar = (value, value - sd, value + sd)
            _point(axes, at + shift, bar, colour=colour, look=look)
    whole = numbers([recommended.get(key) for key in ("value", "ci_low", "ci_high")])
    _point(axes, len(groups), whole, colour=BLUE, look={**_OURS, "marker": "D"})
    axes.set_xlim(-0.5, len(groups) + 0.5)
    names = [*(name for name, _, _ in groups), "recommended\n(all pulses)"]
    axes.set_xticks(range(len(names)), names)
    axes.tick_params(axis="x", length=0)
    axes.set_ylabel("K (N·m/rad)")
    axes.margins(y=0.12)
    place_legend(
        figure,
        [
            legend_line("printed", MUTED, **_PRINTED),
            legend_line("dissertation's method", VERMILION, **_OURS),
            legend_line("recommended", BLUE, **{**_OURS, "marker": "D"}),
            legend_line("truth", FAINT, linewidth=2.2),
        ],
    )
    return figure


def _mean_sd(found: Mapping[str, float | None]) -> tuple[float | None, float | None]:
    return found.get("mean"), found.get("sd")


def _point(
    axes: "Axes",
    at: float,
    bar: Sequence[float] | np.ndarray,
    *,
    colour: str,
    look: Mapping[str, Any],
) -> None:
    """Draw a value with its bar and write it beside; nothing where there is none."""
    value = bar[0]
    if not np.isfinite(value):
        return
    mark(axes, at, bar, colour, bar_width=1.4, markeredgecolor=colour, **look)
    axes.annotate(
        f"{value:.1f}", (at, value), xytext=(6, 0), textcoords="offset points", va="center",
        fontsize=SMALL_PT, color=INK, zorder=4,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6},
    )  # fmt: skip


_DRAWINGS: Final[Drawings] = {
    "figure_3_3": ("torque_models", _draw_torque_models),
    "figure_3_4": ("chirp", _draw_chirp),
    "figure_3_5": ("static", _draw_static),
    "figure_3_6": ("perturbation", _draw_perturbation),
}
