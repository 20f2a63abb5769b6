"""Server of one NiceGUI page, for the console and the explorer."""

import asyncio
import socket
from collections.abc import Awaitable, Callable, Iterable, MutableMapping
from hmac import compare_digest
from http.cookies import CookieError, SimpleCookie
from ipaddress import IPv4Address, IPv6Address, ip_address
from secrets import token_urlsafe
from types import FrameType
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, urlsplit

from jointz.core.errors import DataError, install_advice

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
            f"pages need NiceGUI, which is not installed. {install_advice('app')}"
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


Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
Application = Callable[[Scope, Receive, Send], Awaitable[None]]
#: Address and port of the client, as given by uvicorn.
Client = tuple[str, int] | None
#: Name in lower case -> all values.
Headers = dict[str, list[str]]

_READING = frozenset({"GET", "HEAD"})
_ITSELF = frozenset({"same-origin", "none"})
_POLICY_VIOLATION = 1008
#: Most connections without the token; a browser opens about six at a time.
_MOST_UNAUTHORIZED = 64
_REFUSAL = """<!doctype html><html lang="en"><meta charset="utf-8"><title>jointz: refused</title>
<meta name="viewport" content="width=device-width">
<style>:root {{ color-scheme: light dark }} body {{ font: 18px/1.5 system-ui, sans-serif;
max-width: 34em; margin: 12vh auto; padding: 0 20px }}</style>
<h1>Refused</h1><p>{}</p></html>
"""
#: No content from other sites, and no frames around the page (clickjacking).
_HEADERS = [
    (b"x-frame-options", b"DENY"),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (
        b"content-security-policy",
        b"default-src 'self' 'unsafe-inline' 'unsafe-eval' data: blob:; frame-ancestors 'none'; "
        b"form-action 'self'; base-uri 'self'",
    ),
]


def is_loopback(host: str) -> bool:
    """Return whether an address or name is reachable from this machine only."""
    address = _ip_address(host)
    return host == "localhost" or (address is not None and address.is_loopback)


class Access:
    """Rules of access to a page."""

    def __init__(self, host: str, port: int) -> None:
        self._loopback = is_loopback(host)
        self._host = host.lower()
        self._secret = token_urlsafe(32)
        self.token = token_urlsafe(32)
        self.cookie = f"jointz_{port}"

    def refusal(self, method: str, headers: Headers, *, socket: bool) -> str:
        """Return why a request is refused from any client; empty if it is not."""
        hosts = headers.get("host", [])
        if len(hosts) != 1 or not self._is_ours(hosts[0]):
            return "not the name of this page"
        origins = headers.get("origin", [])
        if any(origin != f"http://{hosts[0]}" for origin in origins):
            return "asked for by another site"
        if not origins and (socket or method not in _READING):
            return "a browser names the site that asks"
        if any(site not in _ITSELF for site in headers.get("sec-fetch-site", [])):
            return "asked for by another site; type the address yourself"
        return ""

    def is_known(self, headers: Headers) -> bool:
        """Return whether the browser has presented the token before."""
        cookies = (_cookie(line, self.cookie) for line in headers.get("cookie", []))
        return any(compare_digest(cookie.encode(), self._secret.encode()) for cookie in cookies)

    def introduces(self, query: bytes) -> bool:
        """Return whether an address holds the token."""
        token = parse_qs(query.decode("latin-1")).get("token", [""])[0]
        return compare_digest(token.encode(), self.token.encode())

    def set_cookie(self) -> str:
        """Return the header that admits a browser from now on."""
        return f"{self.cookie}={self._secret}; Path=/; HttpOnly; SameSite=Strict"

    def _is_ours(self, netloc: str) -> bool:
        """Tell whether a name is ours; an address cannot be rebound, a name can."""
        try:
            name = (urlsplit(f"//{netloc}").hostname or "").lower()
        except ValueError:
            return False
        if self._loopback:
            return is_loopback(name)
        return _ip_address(name) is not None or name in {self._host, "localhost", *_own_names()}


class UnauthorizedConnections:
    """Connections without the token; if there are too many, the oldest is closed.

    Idle connections thus never use up those that the operator needs.
    """

    def __init__(self) -> None:
        self._transports: dict[Client, asyncio.Transport] = {}

    def add(self, client: Client, transport: asyncio.Transport) -> None:
        """Register a new connection."""
        self.forget(client)
        if len(self._transports) >= _MOST_UNAUTHORIZED:
            self._transports.pop(next(iter(self._transports))).abort()
        self._transports[client] = transport

    def forget(self, client: Client) -> None:
        """Remove a connection that has presented the token, or is gone."""
        self._transports.pop(client, None)


class Guard:
    """Passes requests that :class:`Access` allows to an application."""

    def __init__(
        self, app: Application, access: Access, unauthorized: UnauthorizedConnections
    ) -> None:
        self.app = app
        self._access = access
        self._unauthorized = unauthorized

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or pass it on."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        access, headers = self._access, _headers(scope["headers"])
        opens_socket = scope["type"] == "websocket"
        why = access.refusal(scope.get("method", "GET"), headers, socket=opens_socket)
        if not why and not access.is_known(headers):
            if not opens_socket and access.introduces(scope["query_string"]):
                await _answer(send, 303, [("location", "/"), ("set-cookie", access.set_cookie())])
                return
            why = (
                "this page needs its token. Open the whole address that jointz has printed last; "
                "it ends with ?token= and the token"
            )
        if not why:
            self._unauthorized.forget(scope["client"])
            await self.app(scope, receive, send if opens_socket else _hardened(send))
        elif opens_socket:
            await send({"type": "websocket.close", "code": _POLICY_VIOLATION})
        else:
            about = [("content-type", "text/html; charset=utf-8"), ("connection", "close")]
            await _answer(send, 403, about, _REFUSAL.format(f"{why[0].upper()}{why[1:]}."))


def _headers(pairs: Iterable[tuple[bytes, bytes]]) -> Headers:
    headers: Headers = {}
    for name, value in pairs:
        headers.setdefault(name.decode("latin-1").lower(), []).append(value.decode("latin-1"))
    return headers


def _cookie(line: str, name: str) -> str:
    try:
        cookie = SimpleCookie(line).get(name)
    except CookieError:
        return ""
    return cookie.value if cookie else ""


def _ip_address(name: str) -> IPv4Address | IPv6Address | None:
    try:
        return ip_address(name)
    except ValueError:
        return None


def _own_names() -> tuple[str, str]:
    name = socket.gethostname().lower()
    return name, f"{name}.local"


def _hardened(send: Send) -> Send:
    async def hardened(message: Message) -> None:
        if message["type"] == "http.response.start":
            message["headers"] = [*message.get("headers", []), *_HEADERS]
        await send(message)

    return hardened


async def _answer(send: Send, status: int, headers: list[tuple[str, str]], text: str = "") -> None:
    body = text.encode()
    lines = [*headers, ("content-length", str(len(body))), ("cache-control", "no-store")]
    raw = [(name.encode(), value.encode()) for name, value in lines]
    start = {"type": "http.response.start", "status": status, "headers": raw + _HEADERS}
    await send(start)
    await send({"type": "http.response.body", "body": body})
