"""Page of the explorer: participants and timing points left, pulses and curves right."""

import time
from collections.abc import Callable
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from jointz.analysis.pulse_traces import PulseKey
from jointz.core.channels import pretty_unit
from jointz.core.codes import LISTED, Exclusion
from jointz.explorer.cycle_page import CycleTab, MethodsTab
from jointz.explorer.exclusions import FILE, excluded, last_line
from jointz.explorer.explorer_app import Explorer
from jointz.explorer.pulses_page import PulsesTab
from jointz.explorer.results_files import Exploration, cell_of
from jointz.explorer.tab import Tab, table_columns
from jointz.explorer.view import View, estimate_or_status
from jointz.report.subjects import subjects
from jointz.report.wording import (
    DASH,
    format_count,
    format_estimate,
    method_name,
    onset_note,
    parameter_name,
    status_meaning,
)
from jointz.results.estimates import CellEstimate, ParameterEstimate
from jointz.web.server import require_app, serve

if TYPE_CHECKING:
    from fastapi import FastAPI
    from nicegui.element import Element
    from nicegui.events import KeyEventArguments
    from starlette.requests import Request
    from starlette.responses import Response

_STYLE = Path(__file__).parent / "static" / "explore.css"
#: NiceGUI resizes a plot even when its tab is left, and Plotly refuses a hidden plot.
_RESIZE_DISPLAYED_ONLY = """<script type="module">
import { Plotly } from "nicegui-plotly";
const { Plots } = Plotly, resize = Plots.resize;
Plots.resize = (plot) => plot.offsetParent ? resize(plot) : Promise.resolve();
</script>"""
_EVERY_S = 0.2
_LOOK_EVERY_S = 2.0
_FIRST_TAB = "Pulses"


class ExplorePage:
    """A page of one browser."""

    def __init__(self, explorer: Explorer) -> None:
        self._explorer = explorer
        self._view = View(explorer)
        self._seen = -1
        self._pulses = PulsesTab(self._view, self._refresh)
        self._tabs: dict[str, Tab] = {
            "Pulses": self._pulses,
            "Gait cycle": CycleTab(self._view),
            "Methods": MethodsTab(self._view),
            "Exclusions": ExclusionsTab(self._view),
        }
        self._tab = _FIRST_TAB
        self._words = subjects(explorer.results.analysed)
        if self._words.bench:
            del self._tabs["Gait cycle"]

    def build(self) -> None:
        """Make the page."""
        from nicegui import ui

        ui.add_css(_STYLE.read_text(encoding="utf-8"))
        ui.add_body_html(_RESIZE_DISPLAYED_ONLY)
        ui.colors(primary="#2b6cb0", secondary="#5b6b7c", accent="#a566b5", negative="#c4432b")
        self._header()
        with ui.element("div").classes("explore"):
            with ui.element("aside").classes("side"):
                self._people = ui.element("div").classes("card people")
                self._points = ui.element("div").classes("card points")
                self._numbers = ui.element("div").classes("card numbers")
            with ui.element("main").classes("stage"):
                self._notices = ui.element("div").classes("notices")
                self._main()
        ui.keyboard(on_key=self._key)
        ui.timer(_EVERY_S, self._follow)
        ui.timer(_LOOK_EVERY_S, self._explorer.check_study)

    def _header(self) -> None:
        from nicegui import ui

        settings = self._explorer.results.analysed.settings
        with ui.header().classes("bar"):
            ui.label("jointz explore").classes("brand")
            ui.label(str(settings.get("study", ""))).classes("study")
            what = ", ".join(dict.fromkeys([settings["joint"], settings["kind"]]))
            ui.label(f"{what} · {method_name(settings['method'])}").classes("about")
            ui.space()
            if (self._explorer.results.folder / REPORT).is_file():
                ui.link("report", f"/report/{REPORT}", new_tab=True).classes("report")
            self._state = ui.label().classes("state")
            dark = ui.dark_mode(None)
            contrast = ui.button(icon="contrast", on_click=lambda: _switch(dark))
            contrast.props('flat round dense color=white aria-label="light or dark"')
        self._progress = ui.linear_progress(show_value=False).props("indeterminate")
        self._progress.classes("progress")

    def _main(self) -> None:
        from nicegui import ui

        with ui.tabs() as tabs:
            for name in self._tabs:
                ui.tab(name)
        tabs.classes("tabs").props(
            "align=left dense no-caps active-color=primary indicator-color=primary"
        )
        with ui.tab_panels(tabs, value=_FIRST_TAB, animated=False).classes("panels"):
            for name, tab in self._tabs.items():
                with ui.tab_panel(name):
                    tab.build()
        tabs.on_value_change(lambda event: self._open_tab(str(event.value)))

    def _open_tab(self, name: str) -> None:
        if name in self._tabs:
            self._tab = name
            self._tabs[name].refresh()

    def _follow(self) -> None:
        """Update the page after any change, on this page or another."""
        if self._seen != self._explorer.version:
            self._refresh()
        self._state.set_text(self._status())

    def _refresh(self) -> None:
        self._explorer.request(self._view.participant)
        self._seen = self._explorer.version
        self._progress.set_visibility(bool(self._explorer.working))
        self._show_notices()
        self._list_people()
        self._list_points()
        self._list_numbers()
        self._tabs[self._tab].refresh()

    def _status(self) -> str:
        explorer = self._explorer
        if explorer.working:
            task, began = next(iter(explorer.working.items()))
            more = f" and {len(explorer.working) - 1} more" if len(explorer.working) > 1 else ""
            return f"{task}{more} … {time.monotonic() - began:.0f} s"
        reestimated = ", ".join(explorer.results.reestimated)
        changed = len(explorer.changed)
        words = [f"{format_count(changed, 'pulse')} changed since the analysis"] if changed else []
        words += [f"{reestimated} re-estimated, not saved"] if reestimated else []
        return " · ".join(words) or "as analysed"

    def _show_notices(self) -> None:
        """Show errors, and that the study is missing."""
        from nicegui import ui

        self._notices.clear()
        with self._notices:
            if self._explorer.results.study is None:
                ui.label(
                    "The study was not found beside these results: pulses cannot be shown or "
                    "excluded. Open them with  jointz explore RESULTS --study STUDY"
                ).classes("notice")
            elif stale := self._explorer.stale:
                self._offer_estimation(stale)
            if self._explorer.problem:
                with ui.element("div").classes("notice bad"):
                    ui.label(self._explorer.problem)
                    retry = ui.button("Try again", on_click=self._explorer.dismiss)
                    retry.props("flat dense no-caps")

    def _offer_estimation(self, stale: tuple[str, ...]) -> None:
        from nicegui import ui

        seconds = self._explorer.seconds
        takes = "up to a minute each" if seconds is None else f"about {len(stale) * seconds:.0f} s"
        with ui.element("div").classes("notice"):
            ui.label(
                f"Pulses of {', '.join(stale)} were excluded or restored; numbers and curves are "
                "still those from before. Re-estimation saves nothing in the results folder."
            )
            again = ui.button(f"Re-estimate {format_count(len(stale), 'participant')} ({takes})")
            again.props("no-caps no-wrap unelevated color=primary")
            again.on_click(self._explorer.reestimate)
            again.set_enabled(not any(t.startswith("estimating") for t in self._explorer.working))

    def _list_people(self) -> None:
        from nicegui import ui

        analysis = self._explorer.analysis
        self._people.clear()
        with self._people:
            ui.label(self._words.many.capitalize()).classes("head")
            with ui.element("div").classes("list"):
                for person in self._explorer.results.labels:
                    pulses = [p for p in analysis.pulses if p.label == person]
                    n_used = sum(not p.code for p in pulses)
                    with self._item(person == self._view.person, person=person):
                        ui.label(person).classes("name")
                        ui.label(f"{n_used} of {len(pulses)}").classes("count")

    def _item(self, is_selected: bool, **choice: str) -> "Element":  # noqa: FBT001 - of a list
        """Return an item of a list, which selects a participant or a timing point."""
        from nicegui import ui

        item = ui.element("button").classes("item picked" if is_selected else "item")
        return item.on("click", lambda: self._choose(**choice))

    def _list_points(self) -> None:
        from nicegui import ui

        self._points.clear()
        with self._points:
            ui.label(self._words.points.capitalize()).classes("head")
            for point in self._view.points():
                cell = cell_of(self._explorer.analysis, self._view.person, point)
                with self._item(point == self._view.point, point=point):
                    ui.label(point).classes("name")
                    ui.label(_onset(cell)).classes("onset")
                    stiffness = None if cell is None else cell.parameter("stiffness")
                    waits = self._view.participant in self._explorer.stale
                    ui.label(_short(stiffness)).classes("value stale" if waits else "value")
            ui.label(
                "stiffness (N·m/rad)" if self._words.bench else "onset · stiffness (N·m/rad)"
            ).classes("foot")

    def _list_numbers(self) -> None:
        from nicegui import ui

        cell, before = self._view.cell(), self._view.cell_as_analysed()
        waits = self._view.participant in self._explorer.stale
        self._numbers.clear()
        with self._numbers:
            with ui.element("div").classes("head"):
                ui.label(f"{self._view.person} at {self._view.point}")
            if cell is None:
                return
            n_pulses = cell.n_used + cell.n_excluded
            ui.label(f"{cell.n_used} of {n_pulses} pulses used").classes("used")
            if self._view.participant in self._explorer.results.reestimated:
                ui.label("re-estimated on this page, not saved").classes("used")
            for parameter in cell.parameters:
                old = None if before is None else before.parameter(parameter.name)
                with ui.element("div").classes("number stale" if waits else "number"):
                    ui.label(parameter_name(parameter.name)).classes("what")
                    ui.label(pretty_unit(parameter.unit)).classes("unit")
                    value = ui.label(estimate_or_status(parameter)).classes("now")
                    if not parameter.available:
                        value.tooltip(status_meaning(parameter.status))
                    if old is not None and old != parameter:
                        ui.label(f"as analysed {estimate_or_status(old)}").classes("was")
            ui.label("value and 95 % interval").classes("foot")
            if note := onset_note(p.name for p in cell.parameters):
                ui.label(note).classes("foot")

    def _choose(self, *, person: str | None = None, point: str | None = None) -> None:
        self._view.choose(person=person, point=point)
        self._refresh()

    def _key(self, event: "KeyEventArguments") -> None:
        if self._tab == "Pulses" and event.action.keydown and not event.action.repeat:
            if event.key.arrow_left:
                self._pulses.step(-1)
            elif event.key.arrow_right:
                self._pulses.step(1)


def _switch(dark: "object") -> None:
    """Switch from the browser's setting to dark, to light, and back."""
    following = {None: True, True: False, False: None}
    dark.value = following[dark.value]  # type: ignore[attr-defined]


def _onset(cell: CellEstimate | None) -> str:
    onset_pct = None if cell is None else cell.onset_gait_pct
    return "" if onset_pct is None else f"{onset_pct:.1f} %"


def _short(parameter: ParameterEstimate | None) -> str:
    if parameter is None or parameter.value is None or not parameter.available:
        return DASH
    return format_estimate(parameter).split(" [")[0]


def explore(
    results: Exploration,
    *,
    pool: Executor | None,
    host: str,
    port: int,
    announce: Callable[[str], None],
) -> None:
    """Serve the explorer until the process ends."""
    require_app()
    explorer = Explorer(results, pool)
    serve(
        lambda: ExplorePage(explorer).build(),
        title=f"jointz explore: {results.folder.name}",
        host=host,
        port=port,
        routes=lambda app: add_report(app, results.folder),
        announce=announce,
    )


_COLUMNS: Final = {
    "participant": "participant", "point": "timing point", "onset": "onset (s)",
    "by": "by", "reason": "reason", "since": "since",
}  # fmt: skip
_AUTHORS: Final = {Exclusion.USER.value: "you", Exclusion.ABORTED.value: "the rig"}


class ExclusionsTab(Tab):
    """Pulses that the user excluded, or the rig broke off."""

    def build(self) -> None:
        """Make the elements of the tab."""
        from nicegui import ui

        with ui.element("div").classes("card"):
            ui.label("Excluded by you, or broken off by the rig").classes("head")
            self._none = ui.label(f"No pulse: {FILE} of the study excludes none.")
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
        self._left.rows = self._rows()
        self._left.set_visibility(bool(self._left.rows))
        self._none.set_visibility(not self._left.rows)
        self._command.set_text(self._view.explorer.results.command())

    def _rows(self) -> list[dict[str, Any]]:
        results = self._view.explorer.results
        study, pulses = results.study, results.analysed.pulses
        changed = {PulseKey.of(p) for p in self._view.explorer.changed}
        flags = [p.code in LISTED for p in pulses] if study is None else excluded(study, pulses)
        rows: list[dict[str, Any]] = []
        for pulse in (p for p, is_excluded in zip(pulses, flags, strict=True) if is_excluded):
            line = None if study is None else last_line(study, pulse)
            since = "since the analysis" if PulseKey.of(pulse) in changed else "as analysed"
            rows.append(
                {"key": len(rows), "participant": pulse.label, "point": pulse.timing_point,
                 "onset": f"{pulse.onset_s:.3f}", "by": _AUTHORS[line.code if line else pulse.code],
                 "reason": line.reason if line else "", "since": since}
            )  # fmt: skip
        return rows


REPORT: Final = "report.html"
#: The report, and the files it links to.
_FILES: Final = (REPORT, "methods.txt", "methods.tex")
#: A results folder may be a stranger's: its page runs no script beside that of the explorer.
_NO_SCRIPTS: Final = {"content-security-policy": "sandbox allow-same-origin"}


def add_report(app: "FastAPI", folder: Path) -> None:
    """Serve the report of a results folder under ``/report``, and no other file."""
    from starlette.responses import FileResponse, PlainTextResponse

    async def answer(request: "Request") -> "Response":
        name = request.path_params["name"]
        file = folder / name
        # A link may lead to any file of this machine.
        if name not in _FILES or file.is_symlink() or not file.is_file():
            return PlainTextResponse("not found", 404)
        return FileResponse(file, headers=_NO_SCRIPTS)

    app.add_route("/report/{name}", answer)
