"""The operator's console: a page that shows a session and a button that stops it.

Page and session run in different processes. The page reads the session's files and leaves commands
in shared memory: it cannot delay the loop, and the loop goes on without it.
"""

import asyncio
import threading
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from jointz.core.errors import DataError, OutputError
from jointz.core.stop_signals import end_listening
from jointz.rig.console.live_feed import LiveFeed
from jointz.rig.console.operator_commands import CONFIRMED_WITHIN_S, Heartbeat, OperatorCommands
from jointz.rig.console.session_process import SessionProcess
from jointz.rig.session.live.live_session import LiveSession, refuse_where_unseen
from jointz.rig.session.run_claim import RUN_FILE
from jointz.web.server import require_app, serve

if TYPE_CHECKING:
    from fastapi import FastAPI
    from nicegui.element import Element
    from starlette.requests import Request
    from starlette.responses import Response


STATIC = Path(__file__).parent / "static"
_LONGEST_COMMAND_BYTES = 4096
#: Between two looks for the confirmation of a stop.
_LOOK_S = 0.02


def open_console(
    study: Path,
    arguments: Sequence[str],
    *,
    resume: bool,
    host: str,
    port: int,
    announce: Callable[[str], None],
) -> str:
    """Start a session, or find the running one, and serve its page until the process ends.

    A session that nobody has started by then ends with its page.
    """
    refuse_where_unseen()
    require_app()
    process = SessionProcess(study, arguments)
    if not process.can_start and not (study / RUN_FILE).exists():
        raise DataError(
            f"{study}: holds no {RUN_FILE}: no session to show. Give a protocol to begin one.",
            path=str(study),
        )
    begin = process.can_start and not (resume and process.alive())
    if begin and not resume and study.is_dir() and any(study.iterdir()):
        raise OutputError(
            f"{study}: exists and is kept. Name another folder, or add --resume to go on with the "
            "run in it."
        )
    live = LiveSession(study, alive=process.alive)
    feed = LiveFeed(live, process)
    commands = OperatorCommands(study, process, feed.look)
    if begin:
        feed.poll()  # existing files are not from the process to be started

    def ready(address: str) -> None:
        # Last step: a session begins only when there is a page to stop it with.
        if begin:
            process.start(resume=resume)
        for work in (feed.run, Heartbeat(live, feed.somebody).run):
            threading.Thread(target=work, daemon=True).start()
        announce(address)

    try:
        with suppress(KeyboardInterrupt):  # raised by some versions of uvicorn
            serve(
                build_page,
                title=f"jointz console - {study.name}",
                host=host,
                port=port,
                routes=lambda app: add_routes(app, feed, commands),
                announce=ready,
            )
        return _left(commands)
    finally:
        process.close()


def _left(commands: OperatorCommands) -> str:
    """Say what becomes of the session, without interruption: the process ends next."""
    if threading.current_thread() is threading.main_thread():
        end_listening()  # a terminal may be closed right after the Ctrl-C
    return commands.leave()


def add_routes(app: "FastAPI", feed: LiveFeed, commands: OperatorCommands) -> None:
    """Add the routes of the page's script, independent of NiceGUI."""
    from starlette.responses import JSONResponse
    from starlette.routing import Mount, Route, WebSocketRoute
    from starlette.staticfiles import StaticFiles

    async def stop(request: "Request") -> "Response":
        n_sent = commands.stop()  # before any await
        del request
        if unheard := commands.unheard(n_sent):
            return JSONResponse({"refused": unheard}, 409)
        if await _is_confirmed(commands):
            return JSONResponse({})
        return JSONResponse({"refused": commands.unconfirmed(n_sent)}, 504)

    async def command(request: "Request") -> "Response":
        message = bytearray()
        async for part in request.stream():
            message += part
            if len(message) > _LONGEST_COMMAND_BYTES:
                return JSONResponse({"refused": "too long"}, status_code=413)
        try:
            # In a thread: a stop must not wait for a command.
            await asyncio.to_thread(commands.ask, bytes(message))
        except DataError as exc:
            return JSONResponse({"refused": str(exc)}, status_code=422)
        return JSONResponse({})

    app.router.routes += [
        Route("/stop", stop, methods=["POST"]),
        Route("/command", command, methods=["POST"]),
        WebSocketRoute("/live", feed.answer),
        Mount("/console-files", StaticFiles(directory=STATIC)),
    ]


async def _is_confirmed(commands: OperatorCommands) -> bool:
    """Wait until the session's files say that it stops, for a limited time."""
    try:
        async with asyncio.timeout(CONFIRMED_WITHIN_S):
            while not await asyncio.to_thread(commands.is_confirmed):
                await asyncio.sleep(_LOOK_S)
    except TimeoutError:
        return False
    return True


@cache
def _independent_parts() -> str:
    """Return the parts that must work without NiceGUI: the bar with the stop, the alarm."""
    return (STATIC / "console.html").read_text(encoding="utf-8")


def build_page() -> None:
    """Make the page for one browser."""
    from nicegui import ui

    ui.add_head_html('<link rel="stylesheet" href="/console-files/console.css">')
    ui.add_body_html(_independent_parts())
    with ui.element("main").classes("jz-grid"):
        with ui.element("div").classes("jz-main"):
            _controls()
            _filled("Controller", "controller")  # hidden where none runs
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
            _filled("Estimates so far, half-width in %", "estimates")  # hidden without --live
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
