"""Server of one NiceGUI page, for the console and the explorer."""

import asyncio
import socket
from collections.abc import Callable
from types import FrameType
from typing import TYPE_CHECKING

from jointz.core.errors import DataError
from jointz.web.security import Access, Guard, UnauthorizedConnections

if TYPE_CHECKING:
    from fastapi import FastAPI

#: Longer messages of a browser are refused.
_LONGEST_MESSAGE_BYTES = 1_000_000
_PATIENCE_S = 2


def serve(
    build: Callable[[], None],
    *,
    title: str,
    host: str = "127.0.0.1",
    port: int = 0,
    routes: "Callable[[FastAPI], None] | None" = None,
    announce: Callable[[str], None],
) -> None:
    """Serve a page until the process ends."""
    require_app()
    import uvicorn
    from fastapi import FastAPI
    from nicegui import ui
    from uvicorn.protocols.http.auto import AutoHTTPProtocol

    listening = _listen(host, port)
    port = listening.getsockname()[1]
    access, unauthorized = Access(host, port), UnauthorizedConnections()
    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    if routes is not None:
        routes(app)
    # dark=None: as the browser has it.
    ui.run_with(app, root=build, title=title, dark=None, show_welcome_message=False)

    class Protocol(AutoHTTPProtocol):  # type: ignore[misc, valid-type]
        def connection_made(self, transport: asyncio.Transport) -> None:
            super().connection_made(transport)
            unauthorized.add(self.client, transport)

        def connection_lost(self, exc: Exception | None) -> None:
            unauthorized.forget(self.client)
            super().connection_lost(exc)

    config = uvicorn.Config(
        # Outermost: no library sees a refused request.
        Guard(app, access, unauthorized),
        http=Protocol,
        log_level="warning",
        access_log=False,
        proxy_headers=False,
        server_header=False,
        ws_max_size=_LONGEST_MESSAGE_BYTES,
        timeout_graceful_shutdown=_PATIENCE_S,
    )

    class Server(uvicorn.Server):
        async def startup(self, sockets: list[socket.socket] | None = None) -> None:
            await super().startup(sockets=sockets)
            if self.started:
                announce(_address(host, port, access.token))

        def handle_exit(self, sig: int, frame: FrameType | None) -> None:
            # Once: at a second Ctrl-C uvicorn abandons its tasks, with a traceback.
            if not self.should_exit:
                super().handle_exit(sig, frame)

    with listening:
        Server(config).run(sockets=[listening])


def require_app() -> None:
    """Check that NiceGUI is installed."""
    try:
        import nicegui  # noqa: F401 - only to check that it is installed
    except ImportError as exc:
        raise DataError(
            'pages need NiceGUI, which is not installed. Install it: pip install "jointz[app]".'
        ) from exc


def _listen(host: str, port: int) -> socket.socket:
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        return socket.create_server((host, port), family=family)
    except (OSError, OverflowError) as exc:
        raise DataError(
            f"{host} port {port}: cannot be listened on ({exc}). Name another with --port or "
            "--listen."
        ) from exc


def _address(host: str, port: int, token: str) -> str:
    shown = {"0.0.0.0": socket.gethostname(), "::": socket.gethostname()}.get(host, host)
    name = f"[{shown}]" if ":" in shown else shown
    return f"http://{name}:{port}/?token={token}"
