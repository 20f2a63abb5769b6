"""The operator's console: a page that shows a session and a button that stops it.

The page's process is not the session's. It reads the session's files and leaves commands in a
box in memory: it cannot hold up the loop, and the loop goes on without it.
"""

import asyncio
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from jointz.console.desk import Beat, Desk
from jointz.console.live_feed import LiveFeed
from jointz.console.page import build_page
from jointz.console.session_process import SessionProcess
from jointz.core.errors import DataError, OutputError
from jointz.experiment.stop_signals import end_listening
from jointz.session.live.live_session import LiveSession, refuse_where_unseen
from jointz.session.run_claim import RUN_FILE
from jointz.web.server import require_app, serve

if TYPE_CHECKING:
    from fastapi import FastAPI
    from starlette.requests import Request
    from starlette.responses import Response

STATIC = Path(__file__).parent / "static"
_LONGEST_COMMAND_BYTES = 4096


def open_console(
    study: Path,
    arguments: Sequence[str],
    *,
    resume: bool,
    host: str,
    port: int,
    announce: Callable[[str], None],
) -> str:
    """Start a session, or find the one that runs, and serve its page until it is told to end.

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
    desk = Desk(study, process, feed.look)
    if begin:
        feed.poll()  # what stands there already is no word of the process that is begun

    def ready(address: str) -> None:
        # Last of all: a session begins only when there is a page to stop it with.
        if begin:
            process.start(resume=resume)
        for work in (feed.run, Beat(live, feed.somebody).run):
            threading.Thread(target=work, daemon=True).start()
        announce(address)

    try:
        with suppress(KeyboardInterrupt):  # by uvicorn's version it comes out of there, or not
            serve(
                build_page,
                title=f"jointz console - {study.name}",
                host=host,
                port=port,
                routes=lambda app: add_routes(app, feed, desk),
                announce=ready,
            )
        return _left(desk)
    finally:
        process.close()


def _left(desk: Desk) -> str:
    """Say what becomes of the session, undisturbed: the process ends next in any case."""
    if threading.current_thread() is threading.main_thread():
        end_listening()  # a terminal may be closed right after the Ctrl-C
    return desk.leave()


def add_routes(app: "FastAPI", feed: LiveFeed, desk: Desk) -> None:
    """Add what the page's script asks for, without NiceGUI between."""
    from starlette.responses import JSONResponse
    from starlette.routing import Mount, Route, WebSocketRoute
    from starlette.staticfiles import StaticFiles

    async def stop(request: "Request") -> "Response":
        # Before anything is waited for.
        unheard = desk.unheard(desk.stop())
        del request
        return JSONResponse({"refused": unheard} if unheard else {}, 409 if unheard else 200)

    async def command(request: "Request") -> "Response":
        message = bytearray()
        async for part in request.stream():
            message += part
            if len(message) > _LONGEST_COMMAND_BYTES:
                return JSONResponse({"refused": "too long"}, status_code=413)
        try:
            # In a thread: a stop must not wait for what is asked for here.
            await asyncio.to_thread(desk.ask, bytes(message))
        except DataError as exc:
            return JSONResponse({"refused": str(exc)}, status_code=422)
        return JSONResponse({})

    app.router.routes += [
        Route("/stop", stop, methods=["POST"]),
        Route("/command", command, methods=["POST"]),
        WebSocketRoute("/live", feed.answer),
        Mount("/console-files", StaticFiles(directory=STATIC)),
    ]
