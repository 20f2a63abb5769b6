"""Curves over the gait cycle, and methods side by side."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

from jointz.core.gait_phases import PHASES
from jointz.explorer.figures import (
    AMBER,
    BLUE,
    GREY,
    PURPLE,
    VERMILION,
    Figure,
    base_layout,
    figure,
    plain,
    span,
)
from jointz.explorer.literature_curves import ReferenceCurve
from jointz.report.wording import method_name, parameter_label
from jointz.results.estimates import CellEstimate
from jointz.results.study_analysis import StudyAnalysis

_BAND: Final = "rgba(139,149,161,0.16)"
_PHASE: Final = "rgba(139,149,161,0.10)"
#: The first is the chosen method's; none is the green of the mean over people.
METHOD_COLOURS: Final = (
    BLUE, VERMILION, PURPLE, AMBER, "#1597a8", "#c2507a", "#7d8b2e", "#5b6ee1", GREY
)  # fmt: skip


def cycle_figure(
    parameter: str, curves: Sequence["Curve"], references: Sequence[ReferenceCurve]
) -> Figure:
    """Draw one parameter over the gait cycle, beside the values of others."""
    data = [trace for reference in references for trace in _reference(reference)]
    data += [trace for curve in curves for trace in _curve(curve)]
    layout = base_layout(plain(parameter_label(parameter)), "Gait cycle (%)")
    layout["xaxis"] |= {"range": [-1, 101], "dtick": 10, "showgrid": False, "zeroline": False}
    layout["yaxis"] |= {"rangemode": "tozero"}
    for k, (name, (begin, end)) in enumerate(PHASES.items()):
        if k % 2:
            layout["shapes"].append(span((begin, end), colour=_PHASE))
        if end - begin > 5:
            layout["annotations"].append(
                {
                    "x": (begin + end) / 2,
                    "y": 1.0,
                    "yref": "paper",
                    "yanchor": "bottom",
                    "text": name,
                    "showarrow": False,
                    "font": {"size": 10, "color": GREY},
                }
            )
    return figure(data, layout, name=parameter)


@dataclass(frozen=True, slots=True)
class Curve:
    """Estimates over the gait cycle."""

    name: str  # as the legend has it
    x: tuple[float | str, ...]  # % of the gait cycle, or tuple of str: where
    values: tuple[float | None, ...]  # SI
    lows: tuple[float | None, ...]
    highs: tuple[float | None, ...]
    bounds: tuple[bool, ...]  # where the value stands at its bound: only an upper limit is known
    colour: str  # of line and marks
    faint: bool = False  # one of many in the background
    symbol: str = "circle"  # of the marks


def curve_of_cells(
    cells: Iterable[CellEstimate],
    parameter: str,
    *,
    name: str,
    colour: str,
    faint: bool = False,
    symbol: str = "circle",
    shift: float = 0.0,
) -> Curve:
    """Return the estimates that stand as a curve."""
    placed = [
        (cell.onset_gait_pct + shift, p)
        for cell in cells
        if cell.onset_gait_pct is not None
        and (p := cell.parameter(parameter)) is not None
        and p.stands
    ]
    placed.sort(key=lambda at: at[0])
    return Curve(
        name,
        tuple(x for x, _ in placed),
        tuple(p.value for _, p in placed),
        tuple(p.ci_low for _, p in placed),
        tuple(p.ci_high for _, p in placed),
        tuple(p.status == "at_bound" for _, p in placed),
        colour,
        faint,
        symbol,
    )


def mean_curve(analysis: StudyAnalysis, parameter: str, *, colour: str) -> Curve | None:
    """Return the means over people, None where there are none."""
    rows = [
        row
        for row in analysis.population
        if row.parameter == parameter
        and row.value is not None
        and row.n_participants > 1
        and row.onset_gait_pct is not None
    ]
    if not rows:
        return None
    rows.sort(key=lambda row: row.onset_gait_pct or 0.0)
    return Curve(
        "mean over people",
        tuple(row.onset_gait_pct or 0.0 for row in rows),
        tuple(row.value for row in rows),
        tuple(row.ci_low for row in rows),
        tuple(row.ci_high for row in rows),
        tuple(row.status == "at_bound" for row in rows),
        colour,
        symbol="diamond",
    )


def methods_figure(parameter: str, curves: Sequence[Curve]) -> Figure:
    """Draw methods side by side at every timing point."""
    data = []
    for k, curve in enumerate(curves):
        offset = (k - (len(curves) - 1) / 2) * min(0.14, 0.7 / max(1, len(curves)))
        places = [position + offset for position in range(len(curve.x))]
        marks = _marks(curve, places)
        data.append({**marks, "mode": "markers", "text": [str(x) for x in curve.x]})
    layout = base_layout(plain(parameter_label(parameter)), "")
    names = [plain(str(x)) for x in curves[0].x] if curves else []
    layout["xaxis"] |= {
        "tickvals": list(range(len(names))),
        "ticktext": names,
        "range": [-0.6, len(names) - 0.4],
        "showgrid": False,
        "zeroline": False,
    }
    layout["yaxis"] |= {"rangemode": "tozero"}
    return figure(data, layout, name=f"methods_{parameter}")


def _curve(curve: Curve) -> list[dict[str, Any]]:
    trace = _marks(curve, list(curve.x))
    trace["mode"] = "lines+markers"
    trace["line"] = {"color": curve.colour, "width": 1 if curve.faint else 2.2}
    if curve.faint:
        trace |= {"opacity": 0.45, "error_y": {"visible": False}, "showlegend": False}
    return [trace]


def _marks(curve: Curve, x: Sequence[float | str]) -> dict[str, Any]:
    shown = [
        high if bound and high is not None else value
        for value, high, bound in zip(curve.values, curve.highs, curve.bounds, strict=True)
    ]
    ends = list(zip(shown, curve.lows, curve.highs, strict=True))
    # At its bound an upper limit is all there is: an open triangle, with the bar below it.
    symbols = ["triangle-down-open" if bound else curve.symbol for bound in curve.bounds]
    return {
        "type": "scatter",
        "name": plain(curve.name),
        "x": list(x),
        "y": shown,
        "error_y": {
            "type": "data",
            "symmetric": False,
            "array": [_reach(high, value) for value, _, high in ends],
            "arrayminus": [_reach(value, low) for value, low, _ in ends],
            "color": curve.colour,
            "thickness": 1.5,
            "width": 3,
        },
        "marker": {"color": curve.colour, "size": 5 if curve.faint else 9, "symbol": symbols},
        "hovertemplate": "%{fullData.name}<br>%{y:.4g}<extra></extra>",
    }


def _reach(far: float | None, near: float | None) -> float:
    return 0.0 if far is None or near is None else max(0.0, far - near)


def _reference(reference: ReferenceCurve) -> list[dict[str, Any]]:
    points = reference.points
    x, name = [p.gait_pct for p in points], plain(reference.name)
    if any(p.value is None for p in points):
        middles = [(p.low + p.high) / 2 for p in points]
        bars = [(p.high - p.low) / 2 for p in points]
        bar = {"type": "data", "array": bars, "color": AMBER, "thickness": 6, "width": 0}
        return [
            {
                "type": "scatter",
                "mode": "markers",
                "name": f"{name} (stated range)",
                "x": x,
                "y": middles,
                "error_y": bar,
                "marker": {"color": AMBER, "size": 8, "symbol": "square"},
                "opacity": 0.65,
                "hovertext": plain(reference.meaning),
            }
        ]
    edge = {"type": "scatter", "mode": "lines", "x": x, "line": {"width": 0}, "hoverinfo": "skip"}
    return [
        {**edge, "y": [p.low for p in points], "showlegend": False},
        {
            **edge,
            "y": [p.high for p in points],
            "fill": "tonexty",
            "fillcolor": _BAND,
            "showlegend": False,
        },
        {
            "type": "scatter",
            "mode": "lines+markers",
            "name": f"{name}: mean, SD",
            "x": x,
            "y": [p.value for p in points],
            "line": {"color": GREY, "width": 1.6, "dash": "dot"},
            "marker": {"color": GREY, "size": 6, "symbol": "square"},
            "hovertext": plain(reference.meaning),
        },
    ]


def method_label(method: str) -> str:
    """Return a method as legends name it."""
    return plain(method_name(method))
