"""Impedance over the gait cycle beside the values of others, and methods side by side."""

from typing import Any

from jointz.explorer.estimate_curves import (
    METHOD_COLOURS,
    Curve,
    curve_of_cells,
    cycle_figure,
    mean_curve,
    method_label,
    methods_figure,
)
from jointz.explorer.figures import BLUE, GREEN, GREY
from jointz.explorer.literature_curves import reference_curves
from jointz.explorer.results_files import cell_of
from jointz.explorer.view import View
from jointz.report.wording import DASH, PARAMETERS, format_estimate, method_name, parameter_name
from jointz.results.estimates import CellEstimate

#: Sideways steps of the gait cycle between methods, %.
_SHIFT_PCT = 0.8


class CycleTab:
    """Curves over the gait cycle."""

    def __init__(self, view: View) -> None:
        self._view = view

    def build(self) -> None:
        """Make the tab."""
        from nicegui import ui

        with ui.element("div").classes("card"):
            with ui.element("div").classes("head line wraps"):
                self._title = ui.label()
                ui.space()
                self._parameter = _parameter_choice(self._view, self.refresh)
            with ui.element("div").classes("line wraps switches"):
                self._people = ui.checkbox("other people", value=True, on_change=self.refresh)
                self._mean = ui.checkbox("mean over people", value=True, on_change=self.refresh)
                self._others = ui.checkbox("other methods", value=False, on_change=self.refresh)
                self._published = ui.checkbox("published", value=True, on_change=self.refresh)
                self._before = ui.checkbox("as analysed", value=True, on_change=self.refresh)
            self._plot = ui.plotly(cycle_figure(self._view.parameter, [], [])).classes("plot full")
            self._note = ui.label().classes("foot")

    def refresh(self) -> None:
        """Draw anew."""
        view = self._view
        self._parameter.set_value(view.parameter)
        self._title.set_text(f"{parameter_name(view.parameter)} of {view.person}")
        joint = str(view.explorer.analysis.settings["joint"])
        references = reference_curves(joint, view.parameter) if self._published.value else ()
        self._plot.update_figure(cycle_figure(view.parameter, self._curves(), references))
        missing = self._published.value and not references
        self._note.set_text(
            f"No published values of this parameter of the {joint} are known to jointz."
            if missing
            else " ".join(f"{r.name}: {r.meaning}." for r in references)
        )

    def _curves(self) -> list[Curve]:
        view, name = self._view, self._view.parameter
        analysis = view.explorer.analysis
        curves = []
        if self._people.value:
            curves = [
                curve_of_cells(
                    [c for c in analysis.cells if c.label == person],
                    name, name=person, colour=GREY, faint=True,
                )
                for person in view.explorer.found.labels
                if person != view.person
            ]  # fmt: skip
        mean = mean_curve(analysis, name, colour=GREEN) if self._mean.value else None
        curves += [mean] if mean is not None else []
        own = [c for c in analysis.cells if c.label == view.person]
        before = [c for c in view.explorer.found.analysed.cells if c.label == view.person]
        if self._before.value and before != own:
            curves.append(
                curve_of_cells(
                    before, name, name=f"{view.person} as analysed", colour=GREY,
                    symbol="circle-open", shift=-_SHIFT_PCT,
                )
            )  # fmt: skip
        if self._others.value:
            curves += self._by_others(name)
        curves.append(curve_of_cells(own, name, name=view.person, colour=BLUE))
        return curves

    def _by_others(self, name: str) -> list[Curve]:
        view = self._view
        methods = view.explorer.found.methods()[1:]
        return [
            curve_of_cells(
                [
                    c
                    for c in view.explorer.analysis.comparison
                    if (c.label, c.method) == (view.person, method)
                ],
                name,
                name=f"{view.person} {method_label(method)}",
                colour=METHOD_COLOURS[(k + 1) % len(METHOD_COLOURS)],
                shift=(k + 1) * _SHIFT_PCT,
            )
            for k, method in enumerate(methods)
        ]


class MethodsTab:
    """Methods on the same recordings."""

    def __init__(self, view: View) -> None:
        self._view = view

    def build(self) -> None:
        """Make the tab."""
        from nicegui import ui

        with ui.element("div").classes("card"):
            with ui.element("div").classes("head line wraps"):
                self._title = ui.label()
                ui.space()
                self._parameter = _parameter_choice(self._view, self.refresh)
                self._more = ui.select([], label="Add a method", on_change=self._add)
                self._more.props("dense outlined options-dense").classes("choice")
            self._plot = ui.plotly(methods_figure(self._view.parameter, [])).classes("plot half")
            self._table = ui.table(columns=[], rows=[], row_key="point", pagination=0)
            self._table.classes("methods").props("dense flat hide-bottom")

    def refresh(self) -> None:
        """Draw anew."""
        view = self._view
        methods = view.explorer.found.methods()
        self._parameter.set_value(view.parameter)
        self._title.set_text(f"{parameter_name(view.parameter)} of {view.person} by method")
        more = {m: method_name(m) for m in view.explorer.found.more_methods()}
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
            {"name": "point", "label": "", "field": "point", "align": "left"},
            *({"name": m, "label": method_name(m), "field": m, "align": "right"} for m in methods),
        ]
        self._table.rows = [
            {"point": point, **{m: self._text(m, point) for m in methods}} for point in points
        ]

    def _curve(self, method: str, points: list[str], colour: str) -> Curve:
        found = [self._estimate(method, point) for point in points]
        standing = [p if p is not None and p.stands else None for p in found]
        return Curve(
            method_label(method),
            tuple(points),
            tuple(None if p is None else p.value for p in standing),
            tuple(None if p is None else p.ci_low for p in standing),
            tuple(None if p is None else p.ci_high for p in standing),
            tuple(p is not None and p.status == "at_bound" for p in standing),
            colour,
        )

    def _estimate(self, method: str, point: str) -> Any:
        cell: CellEstimate | None = cell_of(
            self._view.explorer.analysis, self._view.person, point, method=method
        )
        return None if cell is None else cell.parameter(self._view.parameter)

    def _text(self, method: str, point: str) -> str:
        estimate = self._estimate(method, point)
        if estimate is None:
            return DASH
        if not estimate.stands:
            return str(estimate.status).removeprefix("failed:").replace("_", " ")
        return format_estimate(estimate)

    def _add(self, event: Any) -> None:
        if isinstance(event.value, str):
            self._view.explorer.compare(event.value)


def _parameter_choice(view: View, changed: Any) -> Any:
    """Make the choice of a parameter; every tab shows the same one."""
    from nicegui import ui

    def choose(event: Any) -> None:
        if event.value in PARAMETERS and event.value != view.parameter:
            view.parameter = event.value
            changed()

    there = {p.name for cell in view.explorer.analysis.cells for p in cell.parameters}
    names = {name: parameter_name(name) for name in PARAMETERS if name in there}
    choice = ui.select(names, value=view.parameter if view.parameter in names else None)
    choice.on_value_change(choose)
    return choice.props("dense outlined options-dense").classes("choice")
