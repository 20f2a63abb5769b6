"""Tab of downloads, of excluded pulses, and of the command for the same numbers."""

import asyncio
from functools import partial
from typing import Any

from jointz.analysis.page.figure_files import FIGURES
from jointz.explorer.downloads import (
    TABLES,
    figure_svg,
    file_name,
    table_csv,
    traces_netcdf,
)
from jointz.explorer.exclusions import FILE, excluded, last_line
from jointz.explorer.tab import Tab, table_columns
from jointz.explorer.traces import PulseKey

_COLUMNS = {
    "participant": "participant", "point": "timing point", "onset": "onset (s)",
    "reason": "reason", "since": "since",
}  # fmt: skip


class FilesTab(Tab):
    """Downloads and exclusions."""

    def build(self) -> None:
        """Make the elements of the tab."""
        from nicegui import ui

        with ui.element("div").classes("card"):
            for title, names, suffix, icon, download in (
                ("Current numbers", TABLES, "csv", "table_view", self._table),
                ("Figures", FIGURES, "svg", "insert_chart_outlined", self._figure),
            ):
                ui.label(title).classes("head")
                with ui.element("div").classes("line wraps"):
                    for name in names:
                        button = ui.button(f"{name}.{suffix}", icon=icon)
                        button.on_click(partial(download, name)).props("outline no-caps")
            ui.label("Pulses with baseline, response, fit and residual").classes("head")
            self._traces = ui.button("traces.nc", icon="timeline", on_click=self._netcdf)
            self._traces.props("outline no-caps")
        with ui.element("div").classes("card"):
            ui.label("Excluded by you").classes("head")
            self._none = ui.label(
                f"No pulse: the study has no {FILE}, or all pulses were restored."
            )
            self._left = ui.table(
                columns=table_columns(_COLUMNS, align="left"), rows=[], row_key="key", pagination=0
            )
            self._left.props("dense flat hide-bottom").classes("methods")
        with ui.element("div").classes("card"):
            ui.label("The same numbers without this page").classes("head")
            ui.label(
                f"Exclusions are in the study's {FILE}, a line each with its reason and time. "
                "The results folder stays as analysed until you run this command:"
            ).classes("foot")
            self._command = ui.label().classes("command")

    def refresh(self) -> None:
        """Update the elements."""
        view = self._view
        known = view.explorer.traces(view.participant) is not None
        self._traces.set_text(file_name("pulses", view.person, "nc"))
        self._traces.set_enabled(known)
        self._left.rows = self._rows()
        self._left.set_visibility(bool(self._left.rows))
        self._none.set_visibility(not self._left.rows)
        self._command.set_text(view.explorer.results.command())

    def _rows(self) -> list[dict[str, Any]]:
        results = self._view.explorer.results
        study, pulses = results.study, results.analysed.pulses
        changed = {PulseKey.of(p) for p in self._view.explorer.changed}
        flags = [p.code == "user" for p in pulses] if study is None else excluded(study, pulses)
        rows: list[dict[str, Any]] = []
        for pulse in (p for p, is_excluded in zip(pulses, flags, strict=True) if is_excluded):
            line = None if study is None else last_line(study, pulse)
            since = "since the analysis" if PulseKey.of(pulse) in changed else "as analysed"
            rows.append(
                {"key": len(rows), "participant": pulse.label, "point": pulse.timing_point,
                 "onset": f"{pulse.onset_s:.3f}", "reason": line.reason if line else "",
                 "since": since}
            )  # fmt: skip
        return rows

    async def _table(self, name: str) -> None:
        content = await asyncio.to_thread(table_csv, self._view.explorer.analysis, name)
        _download(content, file_name(name, "csv"))

    async def _figure(self, name: str) -> None:
        from nicegui import ui

        explorer = self._view.explorer
        content = await explorer.call(partial(figure_svg, explorer.analysis, name))
        if content is None:
            ui.notify("The analysis has no data for this figure.", type="warning")
            return
        _download(content, file_name(name, "svg"))

    async def _netcdf(self) -> None:
        view = self._view
        traces = view.explorer.traces(view.participant)
        if traces is not None:
            content = await asyncio.to_thread(
                traces_netcdf, view.explorer.analysis, view.person, traces
            )
            _download(content, file_name("pulses", view.person, "nc"))


def _download(content: bytes, name: str) -> None:
    from nicegui import ui

    ui.download.content(content, name)
