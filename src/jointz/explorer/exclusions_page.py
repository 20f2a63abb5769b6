"""Tab of the pulses that user and rig excluded, and of the command for the same numbers."""

from typing import Any, Final

from jointz.core.codes import LISTED, Exclusion
from jointz.explorer.exclusions import FILE, excluded, last_line
from jointz.explorer.tab import Tab, table_columns
from jointz.explorer.traces import PulseKey

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
