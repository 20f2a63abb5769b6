"""Figures of pulses: all of a timing point together, and a single one."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from jointz.analysis.pulse_traces import PulseTrace, Window
from jointz.explorer.figures import (
    AMBER,
    BLUE,
    GREEN,
    GREY,
    PURPLE,
    VERMILION,
    Figure,
    axis,
    base_layout,
    figure,
    span,
)
from jointz.results.estimates import CellEstimate

_FAINT: Final = "rgba(139,149,161,0.30)"
_DEG: Final = 180.0 / np.pi
_MS: Final = 1000.0


@dataclass(frozen=True, slots=True)
class Overlaid:
    """A pulse among the others of its timing point."""

    number: int  # position in the list, from 0
    window: Window  # its window by the selected method
    used: bool  # whether it is part of the average


def overlay_figure(
    pulses: Sequence[Overlaid], cell: CellEstimate | None, picked: int | None, *, quantity: str
) -> Figure:
    """Draw the responses of all pulses of a timing point; by shape, their average and the fit."""
    scale = _DEG if quantity == "angle" else 1.0
    data = [_overlaid(p, quantity, scale) for p in pulses if p.number != picked]
    data += [] if cell is None else _averages(cell, quantity, scale)
    for pulse in (p for p in pulses if p.number == picked):
        line = {"color": PURPLE, "width": 2.5, "dash": "solid" if pulse.used else "dot"}
        data.append(_overlaid(pulse, quantity, scale) | {"line": line, "showlegend": True})
    unit = "deg" if quantity == "angle" else "N·m"
    turned = ", turned by the sign of the pulse" if any(p.window.factor < 0 for p in pulses) else ""
    title = f"{quantity.capitalize()} response{turned} ({unit})"
    return figure(data, base_layout(title, "Time from onset (ms)"), name="responses")


def _averages(cell: CellEstimate, quantity: str, scale: float) -> list[dict[str, Any]]:
    """Return the average of every shape of pulse, and the fit to it."""
    parts = any(r.n_pulses not in (None, cell.n_used) for r in cell.responses)
    name = f"average by shape, size and sign ({len(cell.responses)})" if parts else "average"
    width, data = 1.8 if parts else 3.0, []
    for k, response in enumerate(cell.responses):
        legend, average = {"showlegend": k == 0}, scale * getattr(response, quantity)
        data.append(_line(response.time_s, average, BLUE, name=name, width=width) | legend)
        if (response.fitted_angle is not None) == (quantity == "angle"):
            fitted = scale * getattr(response, f"fitted_{quantity}")
            line = _line(response.time_s, fitted, VERMILION, name="fit", width=width, dash="dash")
            data.append(line | legend)
    return [line | {"legendgroup": line["name"]} for line in data]


def _overlaid(pulse: Overlaid, quantity: str, scale: float) -> dict[str, Any]:
    trace = _line(
        pulse.window.time_s,
        scale * getattr(pulse.window, f"response_{quantity}"),
        _FAINT if pulse.used else VERMILION,
        name=f"pulse {pulse.number + 1}",
        width=1,
        dash="solid" if pulse.used else "dot",
    )
    trace |= {"showlegend": False, "customdata": [pulse.number] * len(trace["x"])}
    trace["hovertemplate"] = f"pulse {pulse.number + 1}<extra></extra>"
    return trace


def pulse_figure(trace: PulseTrace | None, window: Window | None) -> Figure:
    """Draw one pulse: measured signals with baseline, response with fit and residual."""
    data: list[dict[str, Any]] = []
    for column, quantity in enumerate(("angle", "torque")):
        scale = _DEG if quantity == "angle" else 1.0
        if trace is not None:
            data += _measured(trace, window, quantity, scale, panel=1 + column)
        if window is not None:
            data += _response(window, quantity, scale, panel=3 + column)
    return figure(data, _pulse_layout(window), name="pulse")


def _measured(
    trace: PulseTrace, window: Window | None, quantity: str, scale: float, *, panel: int
) -> list[dict[str, Any]]:
    recorded = scale * getattr(trace, quantity)
    lines = [_line(trace.time_s, recorded, GREY, name="recorded", width=1.3)]
    if window is not None:
        measured = scale * getattr(window, quantity)
        baseline = scale * getattr(window, f"baseline_{quantity}")
        lines.append(_line(window.time_s, measured, BLUE, name="measured", width=2.4))
        lines.append(_line(window.time_s, baseline, GREEN, name="baseline", width=2, dash="dash"))
    return [_on(line, panel, legend=panel == 1) for line in lines]


def _response(window: Window, quantity: str, scale: float, *, panel: int) -> list[dict[str, Any]]:
    time_s, values = window.time_s, scale * getattr(window, f"response_{quantity}")
    response = _line(time_s, values, PURPLE, name="response", width=2.4)
    lines = [_on(response, panel, legend=panel == 3)]
    fit, residual = window.fitted, window.residual
    if fit is not None and residual is not None and window.fits == quantity:
        fitted = _line(time_s, scale * fit, VERMILION, name="fit", width=2, dash="dash")
        error = _line(time_s, scale * residual, AMBER, name="residual", width=1.6)
        error |= {"fill": "tozeroy", "fillcolor": "rgba(217,154,28,0.15)"}
        lines += [_on(fitted, panel, legend=True), _on(error, panel, legend=True)]
    return lines


def _pulse_layout(window: Window | None) -> dict[str, Any]:
    layout = base_layout("", "")
    columns, rows = ((0.0, 0.46), (0.54, 1.0)), ((0.57, 1.0), (0.0, 0.43))
    titles = ("Angle (deg)", "Torque (N·m)", "Angle response (deg)", "Torque response (N·m)")
    for k, title in enumerate(titles):
        suffix = "" if k == 0 else str(k + 1)
        below = k > 1
        layout[f"xaxis{suffix}"] = {
            **axis("Time from onset (ms)" if below else ""),
            "domain": columns[k % 2],
            "anchor": f"y{suffix}",
        }
        layout[f"yaxis{suffix}"] = {
            **axis(title),
            "domain": rows[k // 2],
            "anchor": f"x{suffix}",
            "zeroline": below,
        }
    if window is not None:
        ends = (_MS * float(window.time_s[0]), _MS * float(window.time_s[-1]))
        layout["shapes"] = [span(ends, x=f"x{k}", y=f"y{k}") for k in ("", "2")]
    return layout


def _line(
    time_s: np.ndarray,
    values: np.ndarray,
    colour: str,
    *,
    name: str,
    width: float,
    dash: str = "solid",
) -> dict[str, Any]:
    """Return a line over time in ms."""
    return {
        "type": "scatter",
        "mode": "lines",
        "x": _list(_MS * time_s),
        "y": _list(values),
        "name": name,
        "line": {"color": colour, "width": width, "dash": dash},
        "hovertemplate": "%{x:.0f} ms: %{y:.4g}<extra>" + name + "</extra>",
    }


def _on(line: dict[str, Any], panel: int, *, legend: bool) -> dict[str, Any]:
    suffix = "" if panel == 1 else str(panel)
    return {
        **line,
        "xaxis": f"x{suffix}",
        "yaxis": f"y{suffix}",
        "legendgroup": line["name"],
        "showlegend": legend,
    }


def _list(values: np.ndarray) -> list[float | None]:
    """Return numbers for JSON, to five digits; NaN becomes None."""
    return [None if value != value else float(f"{value:.5g}") for value in values.tolist()]
