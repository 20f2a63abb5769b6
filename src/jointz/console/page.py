"""Elements of the console page; its script fills them in, its style sheet places them."""

from contextlib import AbstractContextManager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from nicegui.element import Element

_HERE = Path(__file__).parent / "static"


@cache
def _independent_parts() -> str:
    """Return the parts that must work without NiceGUI: the bar with the stop, the alarm."""
    return (_HERE / "console.html").read_text(encoding="utf-8")


def build_page() -> None:
    """Make the page for one browser."""
    from nicegui import ui

    ui.add_head_html('<link rel="stylesheet" href="/console-files/console.css">')
    ui.add_body_html(_independent_parts())
    with ui.element("main").classes("jz-grid"):
        with ui.element("div").classes("jz-main"):
            _controls()
            _traces()
            with ui.element("div").classes("jz-row"):
                _filled("Onset error, % of the cycle", "onsets", canvas=True)
                _filled("Loop", "loop")
                _filled("Device and limits", "device")
        with ui.element("div").classes("jz-side"):
            _filled("Gait phase", "dial", canvas=True)
            with _card("Plan", "plan"):
                with ui.element("div").props("id=jz-next hidden").classes("jz-next"):
                    ui.element("b")
                    ui.element("span")
                ui.element("div").props("id=jz-plan")
            _filled("Safety", "safety")
            _filled("Journal", "told")


def _card(title: str, name: str) -> "AbstractContextManager[Element]":
    from nicegui import ui

    card = ui.element("section").classes(f"jz-card jz-{name}")
    with card:
        ui.label(title).classes("jz-title")
    return card


def _filled(title: str, name: str, *, canvas: bool = False) -> None:
    """Make a card that the script fills in."""
    from nicegui import ui

    with _card(title, name):
        ui.element("canvas" if canvas else "div").props(f"id=jz-{name}")


def _traces() -> None:
    from nicegui import ui

    with _card("Joint angle and torque", "traces"):
        ui.element("div").props("id=jz-legend")
        ui.element("canvas").props("id=jz-traces")


def _controls() -> None:
    """Make the card with the next step and all commands of the operator."""
    from nicegui import ui

    def button(text: str, icon: str, name: str) -> None:
        element = ui.button(text, icon=icon, color=None)
        element.props(f"id=jz-{name} no-caps unelevated size=lg")
        element.classes(f"jz-button jz-when jz-{name}")
        element.on("click", js_handler=f"() => jointzConsole.{name}()")

    with ui.element("section").classes("jz-card jz-conduct"):
        with ui.element("div").classes("jz-words"):
            ui.element("div").props("id=jz-doing")
            ui.element("div").props("id=jz-prompt")
        with ui.element("div").classes("jz-buttons"):
            button("Start", "play_arrow", "start")
            button("Pause pulses", "pause", "pause")
            button("Go on", "play_arrow", "goOn")
            button("Re-arm", "restart_alt", "rearm")
        with ui.element("div").classes("jz-note"):
            field = ui.input(placeholder="Note for the journal").props("for=jz-note outlined dense")
            field.on("keydown.enter", js_handler="() => jointzConsole.note()")
            add = ui.button("Add", icon="edit_note", color=None).props("no-caps flat size=md")
            add.classes("jz-add").on("click", js_handler="() => jointzConsole.note()")
