"""Files to take away, what was left out, and the command that makes the same numbers."""

import asyncio
from functools import partial
from typing import Any

from jointz.analysis.page.figure_files import FIGURES
from jointz.core.events import PulseRecord
from jointz.explorer.downloads import (
    TABLES,
    figure_svg,
    file_name,
    table_csv,
    traces_netcdf,
)
from jointz.explorer.exclusions import FILE, excluded, last_line
from jointz.explorer.traces import PulseKey
from jointz.explorer.view import View

_COLUMNS = ("participant", "point", "onset", "reason", "since")


class FilesTab:
    """Downloads and exclusions."""

    def __init__(self, view: View) -> None:
        self._view = view

    def build(self) -> None:
        """Make the tab."""
        from nicegui import ui

        with ui.element("div").classes("card"):
            ui.label("Numbers as they stand now").classes("head")
            with ui.element("div").classes("line wraps"):
                for name in TABLES:
                    button = ui.button(f"{name}.csv", icon="table_view")
                    button.on_click(partial(self._table, name))
                    button.props("outline no-caps")
            ui.label("Figures").classes("head")
            with ui.element("div").classes("line wraps"):
                for name in FIGURES:
                    button = ui.button(f"{name}.svg", icon="insert_chart_outlined")
                    button.on_click(partial(self._figure, name)).props("outline no-caps")
            ui.label("Pulses with baseline, response, fit and residual").classes("head")
            self._traces = ui.button("traces.nc", icon="timeline", on_click=self._netcdf)
            self._traces.props("outline no-caps")
        with ui.element("div").classes("card"):
            ui.label("Left out by you").classes("head")
            self._none = ui.label(f"Nothing: the study has no {FILE}, or all was restored.")
            self._left = ui.table(columns=_columns(), rows=[], row_key="key", pagination=0)
            self._left.props("dense flat hide-bottom").classes("methods")
        with ui.element("div").classes("card"):
            ui.label("The same numbers without this page").classes("head")
            ui.label(
                f"Exclusions are in the study, {FILE}, a line each with its reason and time. "
                "The results folder stays as it was analysed until this is run:"
            ).classes("foot")
            self._command = ui.label().classes("command")

    def refresh(self) -> None:
        """Draw anew."""
        view = self._view
        known = view.explorer.traces(view.participant) is not None
        self._traces.set_text(file_name("pulses", view.person, "nc"))
        self._traces.set_enabled(known)
        self._left.rows = self._rows()
        self._left.set_visibility(bool(self._left.rows))
        self._none.set_visibility(not self._left.rows)
        self._command.set_text(view.explorer.found.command())

    def _rows(self) -> list[dict[str, Any]]:
        found = self._view.explorer.found
        study, pulses = found.study, found.analysed.pulses
        changed = {PulseKey.of(p) for p in self._view.explorer.changed}
        out = [p.code == "user" for p in pulses] if study is None else excluded(study, pulses)
        rows = []
        for k, pulse in enumerate(p for p, left in zip(pulses, out, strict=True) if left):
            line = None if study is None else last_line(study, pulse)
            since = "since the analysis" if PulseKey.of(pulse) in changed else "as analysed"
            rows.append(_row(k, pulse, "" if line is None else line.reason, since))
        return rows

    async def _table(self, name: str) -> None:
        content = await asyncio.to_thread(table_csv, self._view.explorer.analysis, name)
        _give(content, file_name(name, "csv"))

    async def _figure(self, name: str) -> None:
        from nicegui import ui

        explorer = self._view.explorer
        content = await explorer.call(partial(figure_svg, explorer.analysis, name))
        if content is None:
            ui.notify("There is nothing to draw in this figure.", type="warning")
            return
        _give(content, file_name(name, "svg"))

    async def _netcdf(self) -> None:
        view = self._view
        traces = view.explorer.traces(view.participant)
        if traces is not None:
            content = await asyncio.to_thread(
                traces_netcdf, view.explorer.analysis, view.person, traces
            )
            _give(content, file_name("pulses", view.person, "nc"))


def _give(content: bytes, name: str) -> None:
    from nicegui import ui

    ui.download.content(content, name)


def _columns() -> list[dict[str, Any]]:
    labels = {"point": "timing point", "onset": "onset (s)"}
    return [
        {"name": name, "label": labels.get(name, name), "field": name, "align": "left"}
        for name in _COLUMNS
    ]


def _row(k: int, pulse: PulseRecord, reason: str, since: str) -> dict[str, Any]:
    return {
        "key": k,
        "participant": pulse.label,
        "point": pulse.timing_point,
        "onset": f"{pulse.onset_s:.3f}",
        "reason": reason,
        "since": since,
    }
