"""Tabs of impedance over the gait cycle, and of methods side by side."""

from collections.abc import Iterable
from typing import Any

from jointz.explorer.estimate_curves import (
    METHOD_COLOURS,
    Curve,
    curve_of,
    curve_of_cells,
    cycle_figure,
    mean_curve,
    method_label,
    methods_figure,
)
from jointz.explorer.figures import BLUE, GREEN, GREY
from jointz.explorer.results_files import cell_of
from jointz.explorer.tab import Tab, parameter_choice, table_columns
from jointz.explorer.view import estimate_or_status
from jointz.report.wording import DASH, method_name, parameter_name
from jointz.results.estimates import CellEstimate, ParameterEstimate

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
                self._title = ui.label()
                ui.space()
                self._parameter = parameter_choice(self._view, self.refresh)
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
                self._title = ui.label()
                ui.space()
                self._parameter = parameter_choice(self._view, self.refresh)
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
        self._plot.update_figure(
            methods_figure(
                view.parameter,
                [
                    self._curve(m, points, METHOD_COLOURS[k % len(METHOD_COLOURS)])
                    for k, m in enumerate(methods)
                ],
            )
        )
        self._table.columns = [
            *table_columns({"point": ""}, align="left"),
            *table_columns({m: method_name(m) for m in methods}, align="right"),
        ]
        self._table.rows = [
            {"point": point, **{m: self._text(m, point) for m in methods}} for point in points
        ]

    def _curve(self, method: str, points: list[str], colour: str) -> Curve:
        estimates = [self._estimate(method, point) for point in points]
        standing = [p if p is not None and p.available else None for p in estimates]
        return curve_of(method_label(method), points, standing, colour)

    def _estimate(self, method: str, point: str) -> ParameterEstimate | None:
        cell = cell_of(self._view.explorer.analysis, self._view.person, point, method=method)
        return None if cell is None else cell.parameter(self._view.parameter)

    def _text(self, method: str, point: str) -> str:
        estimate = self._estimate(method, point)
        if estimate is None:
            return DASH
        return estimate_or_status(estimate)

    def _add(self, event: Any) -> None:
        if isinstance(event.value, str):
            self._view.explorer.compare(event.value)
