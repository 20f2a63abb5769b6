"""Tabs of impedance over the gait cycle, and of methods side by side."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

from jointz.core.channels import axis_label
from jointz.core.gait_phases import PHASES
from jointz.explorer.figures import (
    AMBER,
    BLUE,
    GREEN,
    GREY,
    PURPLE,
    VERMILION,
    Figure,
    base_layout,
    figure,
    plain,
    span,
)
from jointz.explorer.results_files import cell_of
from jointz.explorer.tab import Tab, table_columns
from jointz.explorer.view import estimate_or_status
from jointz.report.wording import DASH, method_name, parameter_name
from jointz.results.estimates import CellEstimate, ParameterEstimate
from jointz.results.study_analysis import PopulationEstimate, StudyAnalysis

_PHASE: Final = "rgba(139,149,161,0.10)"
#: The first is for the chosen method; none is the green of the mean over people.
METHOD_COLOURS: Final = (
    BLUE, VERMILION, PURPLE, AMBER, "#1597a8", "#c2507a", "#7d8b2e", "#5b6ee1", GREY
)  # fmt: skip


def cycle_figure(parameter: str, curves: Sequence["Curve"]) -> Figure:
    """Draw one parameter over the gait cycle."""
    data = list(map(_line, curves))
    layout = base_layout(plain(axis_label(parameter)), "Gait cycle (%)")
    layout["xaxis"] |= {"range": [-1, 101], "dtick": 10, "showgrid": False, "zeroline": False}
    layout["yaxis"] |= {"rangemode": "tozero"}
    for k, (name, (begin, end)) in enumerate(PHASES.items()):
        if k % 2:
            layout["shapes"].append(span((begin, end), colour=_PHASE))
        if end - begin > 5:
            layout["annotations"].append(
                {"x": (begin + end) / 2, "y": 1.0, "yref": "paper", "yanchor": "bottom",
                 "text": name, "showarrow": False, "font": {"size": 10, "color": GREY}}
            )  # fmt: skip
    return figure(data, layout, name=parameter)


@dataclass(frozen=True, slots=True)
class Curve:
    """Estimates over the gait cycle."""

    name: str  # name in the legend
    x: Sequence[float | str]  # % of the gait cycle, or names of timing points
    estimates: Sequence[ParameterEstimate | PopulationEstimate | None]  # None for a gap
    colour: str  # colour of line and marks
    faint: bool = False  # whether it is one of many in the background
    symbol: str = "circle"  # symbol of the marks


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
    """Return the available estimates as a curve."""
    points = [
        (cell.onset_gait_pct + shift, p)
        for cell in cells
        if cell.onset_gait_pct is not None
        and (p := cell.parameter(parameter)) is not None
        and p.available
    ]
    points.sort(key=lambda point: point[0])
    x, estimates = [x for x, _ in points], [p for _, p in points]
    return Curve(name, x, estimates, colour, faint=faint, symbol=symbol)


def mean_curve(analysis: StudyAnalysis, parameter: str, *, colour: str) -> Curve | None:
    """Return the means over people, None if there are none."""
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
    x = [row.onset_gait_pct or 0.0 for row in rows]
    return Curve("mean over people", x, rows, colour, symbol="diamond")


def methods_figure(parameter: str, curves: Sequence[Curve]) -> Figure:
    """Draw methods side by side at every timing point."""
    data = []
    for k, curve in enumerate(curves):
        offset = (k - (len(curves) - 1) / 2) * min(0.14, 0.7 / max(1, len(curves)))
        places = [position + offset for position in range(len(curve.x))]
        marks = _marks(curve, places)
        data.append({**marks, "mode": "markers", "text": [str(x) for x in curve.x]})
    layout = base_layout(plain(axis_label(parameter)), "")
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


def _line(curve: Curve) -> dict[str, Any]:
    line = {"color": curve.colour, "width": 1 if curve.faint else 2.2}
    trace = _marks(curve, curve.x) | {"mode": "lines+markers", "line": line}
    if curve.faint:
        trace |= {"opacity": 0.45, "error_y": {"visible": False}, "showlegend": False}
    return trace


def _marks(curve: Curve, x: Sequence[float | str]) -> dict[str, Any]:
    # At its bound a value is an upper limit: an open triangle, with the bar below it.
    at_bound = [p is not None and p.status == "at_bound" for p in curve.estimates]
    ends = [(None, None) if p is None else (p.ci_low, p.ci_high) for p in curve.estimates]
    values = [
        high if bound and high is not None else None if p is None else p.value
        for p, bound, (_, high) in zip(curve.estimates, at_bound, ends, strict=True)
    ]
    symbols = ["triangle-down-open" if bound else curve.symbol for bound in at_bound]
    return {
        "type": "scatter",
        "name": plain(curve.name),
        "x": list(x),
        "y": values,
        "error_y": {
            "type": "data", "symmetric": False,
            "array": [_reach(high, v) for v, (_, high) in zip(values, ends, strict=True)],
            "arrayminus": [_reach(v, low) for v, (low, _) in zip(values, ends, strict=True)],
            "color": curve.colour, "thickness": 1.5, "width": 3,
        },
        "marker": {"color": curve.colour, "size": 5 if curve.faint else 9, "symbol": symbols},
        "hovertemplate": "%{fullData.name}<br>%{y:.4g}<extra></extra>",
    }  # fmt: skip


def _reach(far: float | None, near: float | None) -> float:
    return 0.0 if far is None or near is None else max(0.0, far - near)


def method_label(method: str) -> str:
    """Return a method as legends name it."""
    return plain(method_name(method))


#: Shift between the curves of methods, % of the gait cycle.
_SHIFT_PCT = 0.8
#: Names of the switches of curves.
_PEOPLE, _MEAN, _METHODS = "other people", "mean over people", "other methods"
_ANALYSED = "as analysed"


class CycleTab(Tab):
    """Curves over the gait cycle."""

    def build(self) -> None:
        """Make the elements of the tab."""
        from nicegui import ui

        with ui.element("div").classes("card"):
            with ui.element("div").classes("head line wraps"):
                self.make_head()
            with ui.element("div").classes("line wraps switches"):
                self._shown = {
                    name: ui.checkbox(name, value=name != _METHODS, on_change=self.refresh)
                    for name in (_PEOPLE, _MEAN, _METHODS, _ANALYSED)
                }
            self._plot = ui.plotly(cycle_figure(self._view.parameter, [])).classes("plot full")

    def refresh(self) -> None:
        """Update the elements."""
        view = self._view
        self._parameter.set_value(view.parameter)
        self._title.set_text(f"{parameter_name(view.parameter)} of {view.person}")
        self._plot.update_figure(cycle_figure(view.parameter, self._curves()))

    def _curves(self) -> list[Curve]:
        view, shown = self._view, {name for name, box in self._shown.items() if box.value}
        parameter, person = view.parameter, view.person
        analysis, results = view.explorer.analysis, view.explorer.results
        curves: list[Curve | None] = []
        if _PEOPLE in shown:
            curves += [
                curve_of_cells(_of(other, analysis.cells), parameter, name=other, colour=GREY,
                               faint=True)
                for other in results.labels if other != person
            ]  # fmt: skip
        if _MEAN in shown:
            curves.append(mean_curve(analysis, parameter, colour=GREEN))
        cells, analysed = _of(person, analysis.cells), _of(person, results.analysed.cells)
        if _ANALYSED in shown and analysed != cells:
            curves.append(
                curve_of_cells(analysed, parameter, name=f"{person} as analysed", colour=GREY,
                               symbol="circle-open", shift=-_SHIFT_PCT)
            )  # fmt: skip
        for k, method in enumerate(results.methods()[1:] if _METHODS in shown else (), 1):
            of_method = [c for c in _of(person, analysis.comparison) if c.method == method]
            colour = METHOD_COLOURS[k % len(METHOD_COLOURS)]
            curves.append(
                curve_of_cells(of_method, parameter, name=f"{person} {method_label(method)}",
                               colour=colour, shift=k * _SHIFT_PCT)
            )  # fmt: skip
        curves.append(curve_of_cells(cells, parameter, name=person, colour=BLUE))
        return [curve for curve in curves if curve is not None]


def _of(label: str, cells: Iterable[CellEstimate]) -> list[CellEstimate]:
    return [cell for cell in cells if cell.label == label]


class MethodsTab(Tab):
    """Methods on the same recordings."""

    def build(self) -> None:
        """Make the elements of the tab."""
        from nicegui import ui

        with ui.element("div").classes("card"):
            with ui.element("div").classes("head line wraps"):
                self.make_head()
                self._more = ui.select([], label="Add a method", on_change=self._add)
                self._more.props("dense outlined options-dense").classes("choice")
            self._plot = ui.plotly(methods_figure(self._view.parameter, [])).classes("plot half")
            self._table = ui.table(columns=[], rows=[], row_key="point", pagination=0)
            self._table.classes("methods").props("dense flat hide-bottom")

    def refresh(self) -> None:
        """Update the elements."""
        view = self._view
        methods = view.explorer.results.methods()
        self._parameter.set_value(view.parameter)
        self._title.set_text(f"{parameter_name(view.parameter)} of {view.person} by method")
        more = {m: method_name(m) for m in view.explorer.results.more_methods()}
        self._more.set_options(more, value=None)
        self._more.set_visibility(bool(more))
        points = view.points()
        curves = [
            self._curve(m, points, METHOD_COLOURS[k % len(METHOD_COLOURS)])
            for k, m in enumerate(methods)
        ]
        self._plot.update_figure(methods_figure(view.parameter, curves))
        self._table.columns = [
            *table_columns({"point": ""}, align="left"),
            *table_columns({m: method_name(m) for m in methods}, align="right"),
        ]
        self._table.rows = [
            {"point": point, **{m: self._text(m, point) for m in methods}} for point in points
        ]

    def _curve(self, method: str, points: list[str], colour: str) -> Curve:
        estimates = [self._estimate(method, point) for point in points]
        available = [p if p is not None and p.available else None for p in estimates]
        return Curve(method_label(method), points, available, colour)

    def _estimate(self, method: str, point: str) -> ParameterEstimate | None:
        cell = cell_of(self._view.explorer.analysis, self._view.person, point, method=method)
        return None if cell is None else cell.parameter(self._view.parameter)

    def _text(self, method: str, point: str) -> str:
        estimate = self._estimate(method, point)
        return DASH if estimate is None else estimate_or_status(estimate)

    def _add(self, event: Any) -> None:
        if isinstance(event.value, str):
            self._view.explorer.compare(event.value)
