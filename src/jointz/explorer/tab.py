"""Base of the tabs of the explorer's page."""

from collections.abc import Callable
from typing import Any

from jointz.explorer.view import View
from jointz.report.wording import ALL_PARAMETERS, parameter_name


class Tab:
    """A tab of the page; it shows what the view selects."""

    def __init__(self, view: View) -> None:
        self._view = view

    def build(self) -> None:
        """Make the elements of the tab."""
        raise NotImplementedError

    def refresh(self) -> None:
        """Update the elements."""
        raise NotImplementedError

    def make_head(self) -> None:
        """Make the title and the choice of a parameter."""
        from nicegui import ui

        self._title = ui.label()
        ui.space()
        self._parameter = parameter_choice(self._view, self.refresh)


def parameter_choice(view: View, on_change: Callable[[], None]) -> Any:
    """Make the choice of a parameter, which all tabs share."""
    from nicegui import ui

    def choose(event: Any) -> None:
        if event.value in ALL_PARAMETERS and event.value != view.parameter:
            view.parameter = event.value
            on_change()

    present = {p.name for cell in view.explorer.analysis.cells for p in cell.parameters}
    names = {name: parameter_name(name) for name in ALL_PARAMETERS if name in present}
    choice = ui.select(names, value=view.parameter if view.parameter in names else None)
    choice.on_value_change(choose)
    return choice.props("dense outlined options-dense").classes("choice")


def table_columns(labels: dict[str, str], **properties: Any) -> list[dict[str, Any]]:
    """Return the columns of a table: name -> label."""
    return [
        {"name": name, "label": label, "field": name, **properties}
        for name, label in labels.items()
    ]
