"""Tab of downloads, of excluded pulses, and of the command for the same numbers."""

import asyncio
import io
import re
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from jointz.analysis.page.figure_files import FIGURES, draw_figure
from jointz.analysis.results_folder import csv_bytes
from jointz.explorer.exclusions import FILE, excluded, last_line
from jointz.explorer.tab import Tab, table_columns
from jointz.explorer.traces import PulseKey, PulseTrace, Window
from jointz.results.study_analysis import StudyAnalysis

#: Tables to download, as in a results folder.
TABLES = ("estimates", "comparison", "population", "pulses", "excluded")
_ROWS = {
    "angle": ("rad", "as the method sees it"),
    "torque": ("N*m", "as the method sees it"),
    "baseline_angle": ("rad", "predicted without the pulse"),
    "baseline_torque": ("N*m", "predicted without the pulse"),
    "response_angle": ("rad", "measured minus baseline, times the sign"),
    "response_torque": ("N*m", "measured minus baseline, times the sign"),
}


def table_csv(analysis: StudyAnalysis, name: str) -> bytes:
    """Return a table as ``jointz analyze`` writes it."""
    frames = {
        "estimates": analysis.to_frame,
        "comparison": analysis.comparison_frame,
        "population": analysis.population_frame,
        "pulses": analysis.pulses_frame,
        "excluded": analysis.excluded_frame,
    }
    return csv_bytes(frames[name]())


def figure_svg(analysis: StudyAnalysis, name: str) -> bytes | None:
    """Return a figure of the report, None where the analysis has no data for it."""
    if name not in FIGURES:
        raise ValueError(f"name: expected one of {', '.join(FIGURES)}; got {name!r}.")
    svg = draw_figure(analysis, name)
    return None if svg is None else svg.encode("utf-8")


def traces_netcdf(
    analysis: StudyAnalysis, label: str, traces: Mapping[PulseKey, PulseTrace]
) -> bytes:
    """Return a participant's pulses with baseline, response, fit and residual, as netCDF.

    Dimensions are ``pulse`` and, for each method, ``time_METHOD``. Pulses that a method does not
    use are NaN.
    """
    records = [p for p in analysis.pulses if p.label == label]
    of_pulses = [traces.get(PulseKey.of(p)) for p in records]
    dataset = xr.Dataset(
        {
            "onset_s": ("pulse", [p.onset_s for p in records], {"units": "s"}),
            "recording": ("pulse", [p.recording for p in records]),
            "timing_point": ("pulse", [p.timing_point for p in records]),
            "amplitude": ("pulse", [_number(p.amplitude) for p in records]),
            "measured_pct": ("pulse", [_number(p.measured_pct) for p in records]),
            "code": ("pulse", [p.code for p in records], {"long_name": "reason of exclusion"}),
        },
        attrs={"participant": label, "jointz": str(analysis.provenance.get("jointz", ""))},
    )
    methods = dict.fromkeys(name for trace in of_pulses if trace for name in trace.windows)
    for method in methods:
        windows = [trace.windows.get(method) if trace else None for trace in of_pulses]
        dataset = dataset.assign(_of_method(method, windows))
    file = io.BytesIO()
    dataset.to_netcdf(file, engine="h5netcdf")
    return file.getvalue()


_Variable = tuple[tuple[str, ...], np.ndarray, dict[str, str]]


def _of_method(method: str, windows: list[Window | None]) -> dict[str, _Variable]:
    first = next(w for w in windows if w is not None)
    dim = f"time_{method}"
    time = {"units": "s", "long_name": "time from the onset"}
    variables: dict[str, _Variable] = {dim: ((dim,), first.time_s, time)}
    unit = "rad" if first.fits == "angle" else "N*m"
    fit = f"{first.fits} of the model fitted to the average of the timing point"
    residual = f"{first.fits} response of the pulse minus the fit"
    signals = _ROWS | {"fitted": (unit, fit), "residual": (unit, residual)}
    for name, (unit, meaning) in signals.items():
        rows = np.full((len(windows), first.time_s.size), np.nan)
        for row, window in zip(rows, windows, strict=True):
            values = None if window is None else getattr(window, name)
            if values is not None:  # a pulse of a slower recording has fewer samples
                n = min(row.size, values.size)
                row[:n] = values[:n]
        about = {"units": unit, "long_name": meaning}
        variables[f"{method}_{name}"] = (("pulse", dim), rows, about)
    return variables


def _number(value: float | None) -> float:
    return np.nan if value is None else value


def file_name(*parts: str) -> str:
    """Return a file name that is valid on every system."""
    *words, ending = parts
    safe = [re.sub(r"[^\w.-]+", "_", word).strip("._") or "unnamed" for word in words]
    return f"{'_'.join(safe)}.{ending}"


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
