"""Tab of the pulses of a timing point: all together, one by one, excluded and restored."""

from collections.abc import Callable
from typing import Any

from jointz.analysis.pulse_traces import Window
from jointz.core.codes import LISTED, Exclusion
from jointz.core.events import PulseRecord
from jointz.explorer.exclusions import excluded, is_excluded, last_line
from jointz.explorer.plots import Overlaid, overlay_figure, pulse_figure
from jointz.explorer.tab import Tab, table_columns
from jointz.explorer.view import View
from jointz.report.pulse_words import pulse_unit
from jointz.report.wording import exclusion_meaning, method_name

_REASONS = (
    "stumbled",
    "looked aside or spoke",
    "sensor slipped",
    "strap slipped",
    "pulse at the wrong moment",
)
_COLUMNS = {
    "number": "#", "onset": "onset (s)", "phase": "at (%)", "size": "peak (deg)",
    "misfit": "residual", "state": "state",
}  # fmt: skip
_DEG = 57.29578
_ROW = """
<q-tr :props="props" :class="{picked: props.row.picked, out: props.row.out}"
      @click="$parent.$emit('pick', props.row.number)">
  <q-td v-for="col in props.cols" :key="col.name" :props="props">{{ col.value }}</q-td>
</q-tr>
"""


class PulsesTab(Tab):
    """Pulses of a timing point."""

    def __init__(self, view: View, on_change: Callable[[], None]) -> None:
        super().__init__(view)
        self._on_change = on_change

    def build(self) -> None:
        """Make the elements of the tab."""
        from nicegui import ui

        with ui.element("div").classes("grid"):
            with ui.element("div").classes("card wide"):
                with ui.element("div").classes("head line"):
                    self._title = ui.label()
                    ui.space()
                    self._quantity = ui.toggle(
                        {"angle": "Angle", "torque": "Torque"},
                        value="angle",
                        on_change=lambda event: self._show_quantity(str(event.value)),
                    ).props("dense no-caps unelevated size=sm")
                self._overlay = ui.plotly(overlay_figure([], None, None, quantity="angle"))
                self._overlay.classes("plot short").on(
                    "plotly_click",
                    lambda event: self._select(event.args),
                    js_handler="(e) => emit(e.points[0].customdata)",
                )
            with ui.element("div").classes("card narrow"):
                columns = table_columns(_COLUMNS, sortable=True, align="right")
                columns[-1]["align"] = "left"
                self._table = ui.table(columns=columns, rows=[], row_key="number", pagination=0)
                self._table.classes("pulses").props("dense flat hide-bottom")
                self._table.add_slot("body", _ROW)
                self._table.on("pick", lambda event: self._select(event.args, first=1))
        with ui.element("div").classes("card"):
            self._build_pulse()

    def _build_pulse(self) -> None:
        from nicegui import ui

        with ui.element("div").classes("head line wraps"):
            back = ui.button(icon="chevron_left", on_click=lambda: self.step(-1))
            back.props('flat round dense aria-label="previous pulse"')
            self._name = ui.label().classes("pulse-name")
            forward = ui.button(icon="chevron_right", on_click=lambda: self.step(1))
            forward.props('flat round dense aria-label="next pulse"')
            self._about = ui.label().classes("pulse-about")
            ui.space()
            self._methods = ui.toggle([], on_change=lambda event: self._show_method(event.value))
            self._methods.props("dense no-caps unelevated size=sm")
        with ui.element("div").classes("line wraps decide"):
            self._state = ui.label().classes("pulse-state")
            ui.space()
            self._reason = (
                ui.input(label="Reason", autocomplete=list(_REASONS))
                .props("dense outlined maxlength=300")
                .classes("reason")
                .on("keydown.enter", self._exclude)
            )
            self._out = ui.button("Exclude pulse", icon="block", on_click=self._exclude)
            self._out.props("no-caps unelevated color=negative")
            self._back = ui.button("Restore pulse", icon="undo", on_click=self._restore)
            self._back.props("no-caps unelevated color=primary")
        self._plot = ui.plotly(pulse_figure(None, None)).classes("plot tall")

    def step(self, by: int) -> None:
        """Select another pulse, some positions further."""
        number = self._view.number()
        if number is not None:
            self._view.pick(number + by)
            self.refresh()

    def refresh(self) -> None:
        """Update the elements."""
        view = self._view
        names = {name: method_name(name) for name in view.window_methods()}
        if names and view.method not in names:  # a method of whole trials has no windows
            view.method = next(iter(names))
        pulses, picked = view.pulses(), view.number()
        self._title.set_text(f"All pulses of {view.person} at {view.point}")
        windows = [view.window_of(pulse) for pulse in pulses]
        overlaid = [
            Overlaid(k, window, used=not pulse.code)
            for k, (pulse, window) in enumerate(zip(pulses, windows, strict=True))
            if window is not None
        ]
        cell = view.cell(view.method)
        self._overlay.update_figure(overlay_figure(overlaid, cell, picked, quantity=view.quantity))
        study = view.explorer.results.study
        out = [p.code in LISTED for p in pulses] if study is None else excluded(study, pulses)
        self._table.rows = [
            _row(k, pulse, window, out=out[k], picked=k == picked)
            for k, (pulse, window) in enumerate(zip(pulses, windows, strict=True))
        ]
        self._methods.set_options(names, value=view.method if names else None)
        self._show(picked, pulses)

    def _show(self, picked: int | None, pulses: tuple[PulseRecord, ...]) -> None:
        view = self._view
        if picked is None:
            self._name.set_text("no pulse")
            self._about.set_text("")
            self._state.set_text("")
            self._plot.update_figure(pulse_figure(None, None))
            return
        pulse = pulses[picked]
        trace, window = view.trace_of(pulse), view.window_of(pulse)
        self._name.set_text(f"Pulse {picked + 1} of {len(pulses)}")
        self._about.set_text(_about(pulse, pulse_unit(view.explorer.analysis)))
        self._plot.update_figure(pulse_figure(trace, window))
        study = view.explorer.results.study
        out = study is not None and is_excluded(study, pulse)
        self._state.set_text(self._state_text(pulse, excluded=out, window=window))
        add, remove = ("out", "") if pulse.code or out else ("", "out")
        self._state.classes(add=add, remove=remove)
        self._reason.set_visibility(study is not None and not out)
        self._out.set_visibility(study is not None and not out)
        self._back.set_visibility(out)

    def _state_text(self, pulse: PulseRecord, *, excluded: bool, window: Window | None) -> str:
        study = self._view.explorer.results.study
        if study is None:
            return exclusion_meaning(pulse.code) if pulse.code else "used"
        if self._view.trace_of(pulse) is None:
            return "reading the recordings …"
        if excluded:
            line = last_line(study, pulse)
            if line is not None and line.code == Exclusion.ABORTED:
                return f"excluded by the rig: {exclusion_meaning(line.code)}"
            reason = f": {line.reason}" if line is not None and line.reason else ""
            shown = "jointz excludes it too" if window is None else "shown as if restored"
            note = shown if pulse.code in LISTED else "still used in the numbers"
            return f"excluded by you{reason} ({note})"
        if pulse.code in LISTED:
            return "restored (not used in the numbers yet)"
        return f"excluded: {exclusion_meaning(pulse.code)}" if pulse.code else "used"

    def _show_quantity(self, quantity: str) -> None:
        if quantity in ("angle", "torque"):
            self._view.quantity = quantity
            self.refresh()

    def _show_method(self, method: Any) -> None:
        if method in self._view.window_methods() and method != self._view.method:
            self._view.method = str(method)
            self.refresh()

    def _select(self, number: Any, *, first: int = 0) -> None:
        # Browsers may send anything: only the number of a pulse counts.
        is_whole = isinstance(number, int) and not isinstance(number, bool)
        if is_whole and first <= number < first + len(self._view.pulses()):
            self._view.pick(number - first)
            self.refresh()

    async def _exclude(self) -> None:
        from nicegui import ui

        reason = str(self._reason.value or "").strip()
        if not reason:
            self._reason.run_method("focus")
            ui.notify("State a reason; the study's exclusions.csv keeps it.", type="warning")
            return
        pulse = self._view.pulse()
        if pulse is None or self._view.explorer.results.study is None:
            return
        self._view.pick(self._view.number() or 0)  # keeps the selection if other pulses change
        if await self._view.explorer.decide(pulse, "exclude", reason=reason):
            self._reason.set_value("")
        self._on_change()

    async def _restore(self) -> None:
        pulse = self._view.pulse()
        if pulse is None:
            return
        self._view.pick(self._view.number() or 0)
        await self._view.explorer.decide(pulse, "restore", reason="")
        self._on_change()


def _row(
    k: int, pulse: PulseRecord, window: Window | None, *, out: bool, picked: bool
) -> dict[str, Any]:
    row = {
        "number": k + 1,
        "onset": f"{pulse.onset_s:.1f}",
        "phase": "" if pulse.measured_pct is None else f"{pulse.measured_pct:.1f}",
        "size": None,
        "misfit": None,
        "state": (state := _short_state(pulse, out=out)),
        "picked": picked,
        "out": state != "used",
    }
    if window is not None:
        row["size"] = round(float(abs(window.response_angle).max()) * _DEG, 2)
        if window.misfit is not None:
            scale = _DEG if window.fits == "angle" else 1.0
            row["misfit"] = round(window.misfit * scale, 3)
    return row


def _short_state(pulse: PulseRecord, *, out: bool) -> str:
    """Return whether a pulse counts: ``out`` says whether it is excluded now."""
    if not pulse.code:
        return "excluded, still counted" if out else "used"
    if pulse.code not in LISTED:
        return pulse.code.replace("_", " ")
    if not out:
        return "restored, not counted"
    return "aborted" if pulse.code == Exclusion.ABORTED else "excluded"


def _about(pulse: PulseRecord, unit: str) -> str:
    words = [f"{pulse.onset_s:.3f} s in {pulse.recording}"]
    if pulse.measured_pct is not None:
        planned = "" if pulse.target_pct is None else f" (planned {pulse.target_pct:g} %)"
        words.append(f"onset {pulse.measured_pct:.1f} %{planned}")
    if pulse.amplitude is not None:
        words.append(f"{pulse.amplitude:+.3g} {unit}")
    return " · ".join(words)
