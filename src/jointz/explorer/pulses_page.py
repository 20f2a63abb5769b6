"""Pulses of a timing point: all together, one by one, left out and brought back."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from jointz.core.events import PulseRecord
from jointz.explorer.exclusions import is_excluded, last_line
from jointz.explorer.plots import Overlaid, overlay_figure, pulse_figure
from jointz.explorer.traces import Window
from jointz.explorer.view import View
from jointz.report.pulse_words import pulse_unit
from jointz.report.wording import exclusion_meaning, method_name

if TYPE_CHECKING:
    from nicegui.events import GenericEventArguments

_REASONS = (
    "stumbled",
    "looked aside or spoke",
    "sensor slipped",
    "strap slipped",
    "pulse at the wrong moment",
)
_COLUMNS = (
    ("number", "#"),
    ("onset", "onset (s)"),
    ("phase", "at (%)"),
    ("size", "peak (deg)"),
    ("misfit", "residual"),
    ("state", "state"),
)
_ROW = """
<q-tr :props="props" :class="{picked: props.row.picked, out: props.row.out}"
      @click="$parent.$emit('pick', props.row.number)">
  <q-td v-for="col in props.cols" :key="col.name" :props="props">{{ col.value }}</q-td>
</q-tr>
"""


class PulsesTab:
    """The tab of pulses."""

    def __init__(self, view: View, changed: Callable[[], None]) -> None:
        self._view = view
        self._changed = changed

    def build(self) -> None:
        """Make the tab."""
        from nicegui import ui

        with ui.element("div").classes("grid"):
            with ui.element("div").classes("card wide"):
                with ui.element("div").classes("head line"):
                    self._title = ui.label()
                    ui.space()
                    self._quantity = ui.toggle(
                        {"angle": "Angle", "torque": "Torque"},
                        value="angle",
                        on_change=lambda event: self._look_at(str(event.value)),
                    ).props("dense no-caps unelevated size=sm")
                self._overlay = ui.plotly(overlay_figure([], None, None, quantity="angle"))
                self._overlay.classes("plot short").on(
                    "plotly_click",
                    self._clicked,
                    js_handler="(e) => emit(e.points[0].customdata)",
                )
            with ui.element("div").classes("card narrow"):
                self._table = (
                    ui.table(columns=_columns(), rows=[], row_key="number", pagination=0)
                    .classes("pulses")
                    .props("dense flat hide-bottom")
                )
                self._table.add_slot("body", _ROW)
                self._table.on("pick", self._chosen)
        with ui.element("div").classes("card"):
            self._one()

    def _one(self) -> None:
        from nicegui import ui

        with ui.element("div").classes("head line wraps"):
            ui.button(icon="chevron_left", on_click=lambda: self.step(-1)).props(
                'flat round dense aria-label="previous pulse"'
            )
            self._name = ui.label().classes("pulse-name")
            ui.button(icon="chevron_right", on_click=lambda: self.step(1)).props(
                'flat round dense aria-label="next pulse"'
            )
            self._about = ui.label().classes("pulse-about")
            ui.space()
            self._methods = ui.toggle([], on_change=lambda event: self._by(event.value)).props(
                "dense no-caps unelevated size=sm"
            )
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
        """Look at a pulse further on."""
        number = self._view.number()
        if number is not None:
            self._view.pick(number + by)
            self.refresh()

    def refresh(self) -> None:
        """Draw anew."""
        view = self._view
        names = {name: method_name(name) for name in view.window_methods()}
        if names and view.method not in names:  # as of whole trials, which have no windows
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
        self._table.rows = [
            _row(k, pulse, window, picked=k == picked)
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
        study = view.explorer.found.study
        out = study is not None and is_excluded(study, pulse)
        self._state.set_text(self._words(pulse, out=out, window=window))
        self._state.classes(
            add="out" if pulse.code or out else "", remove="" if pulse.code or out else "out"
        )
        self._reason.set_visibility(study is not None and not out)
        self._out.set_visibility(study is not None and not out)
        self._back.set_visibility(out)

    def _words(self, pulse: PulseRecord, *, out: bool, window: Window | None) -> str:
        study = self._view.explorer.found.study
        if study is None:
            return exclusion_meaning(pulse.code) if pulse.code else "used"
        if self._view.trace_of(pulse) is None:
            return "reading the recordings …"
        if out:
            line = last_line(study, pulse)
            reason = line.reason if line is not None else ""
            said = f": {reason}" if reason else ""
            shown = "shown as if restored" if window is not None else "jointz leaves it out too"
            return f"left out by you{said} ({shown})"
        if pulse.code and pulse.code != "user":
            return f"left out: {exclusion_meaning(pulse.code)}"
        return "used"

    def _look_at(self, quantity: str) -> None:
        if quantity in ("angle", "torque"):
            self._view.quantity = quantity
            self.refresh()

    def _by(self, method: Any) -> None:
        if method in self._view.window_methods() and method != self._view.method:
            self._view.method = str(method)
            self.refresh()

    def _clicked(self, event: "GenericEventArguments") -> None:
        self._go(event.args)

    def _chosen(self, event: "GenericEventArguments") -> None:
        self._go(event.args - 1 if _whole(event.args) else None)

    def _go(self, number: Any) -> None:
        # Whatever a browser sends: only the number of a pulse means anything.
        if _whole(number) and 0 <= number < len(self._view.pulses()):
            self._view.pick(number)
            self.refresh()

    async def _exclude(self) -> None:
        from nicegui import ui

        reason = str(self._reason.value or "").strip()
        if not reason:
            self._reason.run_method("focus")
            ui.notify("Say why: the reason goes into the study's exclusions.csv.", type="warning")
            return
        pulse = self._view.pulse()
        if pulse is None or self._view.explorer.found.study is None:
            return
        self._view.pick(self._view.number() or 0)  # stays where it is while others come and go
        if await self._view.explorer.decide(pulse, "exclude", reason=reason):
            self._reason.set_value("")
        self._changed()

    async def _restore(self) -> None:
        pulse = self._view.pulse()
        if pulse is None:
            return
        self._view.pick(self._view.number() or 0)
        await self._view.explorer.decide(pulse, "restore", reason="")
        self._changed()


def _whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _columns() -> list[dict[str, Any]]:
    return [
        {
            "name": name,
            "label": label,
            "field": name,
            "sortable": True,
            "align": "left" if name == "state" else "right",
        }
        for name, label in _COLUMNS
    ]


def _row(k: int, pulse: PulseRecord, window: Window | None, *, picked: bool) -> dict[str, Any]:
    state = "excluded" if pulse.code == "user" else pulse.code.replace("_", " ") or "used"
    row = {
        "number": k + 1,
        "onset": f"{pulse.onset_s:.1f}",
        "phase": "" if pulse.measured_pct is None else f"{pulse.measured_pct:.1f}",
        "size": None,
        "misfit": None,
        "state": state,
        "picked": picked,
        "out": bool(pulse.code),
    }
    if window is not None:
        row["size"] = round(float(abs(window.response_angle).max()) * 57.29578, 2)
        if window.misfit is not None:
            scale = 57.29578 if window.fits == "angle" else 1.0
            row["misfit"] = round(window.misfit * scale, 3)
    return row


def _about(pulse: PulseRecord, unit: str) -> str:
    words = [f"{pulse.onset_s:.3f} s in {pulse.recording}"]
    if pulse.measured_pct is not None:
        planned = "" if pulse.target_pct is None else f" (planned {pulse.target_pct:g} %)"
        words.append(f"onset {pulse.measured_pct:.1f} %{planned}")
    if pulse.amplitude is not None:
        words.append(f"{pulse.amplitude:+.3g} {unit}")
    return " · ".join(words)
