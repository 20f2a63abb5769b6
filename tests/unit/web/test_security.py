"""Access to a page: only with the token, by its own names and from its own site."""

import asyncio

import pytest

from jointz.web.server import Access, Guard, UnauthorizedConnections, is_loopback

PORT = 8700


def call(access, *, kind="http", method="GET", path="/", query="", **headers):
    """Send one request through the guard; return its status, headers, and whether it came in.

    It shows the cookie, unless another is named.
    """
    came, sent = [], []
    headers.setdefault("cookie", access.set_cookie().split(";")[0])

    async def app(scope, receive, send):
        came.append(scope["path"])
        if scope["type"] == "http":
            await send({"type": "http.response.start", "status": 200, "headers": []})
            await send({"type": "http.response.body", "body": b""})
        else:
            await send({"type": "websocket.accept"})

    async def receive():
        return {}

    async def send(message):
        sent.append(message)

    pairs = [(name.replace("_", "-"), value) for name, value in headers.items()]
    scope = {
        "type": kind,
        "method": method,
        "path": path,
        "client": ("127.0.0.1", 50000),
        "query_string": query.encode(),
        "headers": [
            (name.encode(), one.encode())
            for name, value in pairs
            for one in ([value] if isinstance(value, str) else value)
        ],
    }
    asyncio.run(Guard(app, access, UnauthorizedConnections())(scope, receive, send))
    start = sent[0]
    found = {name.decode(): value.decode() for name, value in start.get("headers", [])}
    return start.get("status", start["type"]), found, bool(came)


@pytest.fixture
def own():
    return Access("127.0.0.1", PORT)


@pytest.fixture
def net():
    return Access("0.0.0.0", PORT)


@pytest.mark.parametrize("host", ["127.0.0.1:8700", "localhost:9000", "[::1]:8700", "127.0.0.1"])
def test_the_machine_itself_is_let_in(own, host):
    assert call(own, host=host)[2]


@pytest.mark.parametrize(
    "host", ["evil.example:8700", "192.168.1.5:8700", "127.0.0.1.evil.example", "", "[::"]
)
def test_a_name_that_was_rebound_is_refused(own, host):
    status, _, came = call(own, host=host)
    assert (status, came) == (403, False)


def test_a_request_without_a_name_or_with_two_is_refused(own):
    assert not call(own)[2]
    assert not call(own, host=["localhost:8700", "evil.example"])[2]


@pytest.mark.parametrize(
    "origin",
    ["http://evil.example", "http://localhost:9999", "https://localhost:8700", "null", ""],
)
@pytest.mark.parametrize("method", ["GET", "POST"])
def test_another_site_is_refused(own, origin, method):
    assert not call(own, method=method, host="localhost:8700", origin=origin)[2]


def test_what_changes_something_has_to_name_its_site(own):
    assert not call(own, method="POST", host="localhost:8700")[2]
    assert call(own, method="POST", host="localhost:8700", origin="http://localhost:8700")[2]


def test_what_another_site_fetches_or_links_to_is_refused(own):
    for site in ("cross-site", "same-site"):
        assert not call(own, host="localhost:8700", sec_fetch_site=site)[2]
    for site in ("same-origin", "none"):
        assert call(own, host="localhost:8700", sec_fetch_site=site)[2]


def test_sockets_pass_the_same_guard(own):
    same = {"host": "localhost:8700", "origin": "http://localhost:8700"}
    assert call(own, kind="websocket", **same) == ("websocket.accept", {}, True)
    for headers in ({"host": "localhost:8700"}, same | {"origin": "http://evil.example"}):
        kind, _, came = call(own, kind="websocket", **headers)
        assert (kind, came) == ("websocket.close", False)


@pytest.mark.parametrize("host", ["127.0.0.1", "0.0.0.0"])
@pytest.mark.parametrize("cookie", ["", "jointz_8700=x"])
def test_nobody_is_answered_without_the_token(host, cookie):
    access = Access(host, PORT)
    same = {"host": "127.0.0.1:8700", "origin": "http://127.0.0.1:8700", "cookie": cookie}
    for method in ("GET", "HEAD", "POST", "PUT", "OPTIONS"):
        for path in ("/", "/stop", "/live", "/_nicegui/x.js", "/console-files/console.js"):
            status, headers, came = call(access, method=method, path=path, **same)
            assert (status, came) == (403, False)
            assert headers["connection"] == "close"
    kind, _, came = call(access, kind="websocket", **same)
    assert (kind, came) == ("websocket.close", False)


def test_the_token_buys_a_cookie_that_only_this_site_gets(net):
    shown = {"query": f"token={net.token}", "host": "192.168.1.5:8700"}
    status, headers, came = call(net, cookie="", **shown)
    assert (status, came) == (303, False)  # the token leaves the address at once
    assert headers["location"] == "/"
    cookie = headers["set-cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    assert net.token not in cookie
    value = cookie.split(";")[0]
    assert call(net, host="192.168.1.5:8700", cookie=value)[2]
    # A name may be rebound: the cookie does not make up for that.
    assert not call(net, host="evil.example:8700", cookie=value)[2]


@pytest.mark.parametrize(
    "shown",
    ["", "x", "token", "token=", "token=x", "token=%FF", "token=é".encode().decode("latin-1")],
)
def test_a_wrong_token_buys_nothing(net, shown):
    status, headers, _ = call(net, query=shown, host="192.168.1.5:8700", cookie="")
    assert status == 403
    assert "set-cookie" not in headers


@pytest.mark.parametrize("value", ["jointz_8700=", "jointz_8700=x", "=;=", "jointz_8700=é"])
def test_a_wrong_cookie_is_none(net, value):
    assert not call(net, host="192.168.1.5:8700", cookie=value.encode().decode("latin-1"))[2]


def test_pages_cannot_be_framed_and_fetch_nothing_from_elsewhere(own):
    _, headers, _ = call(own, host="localhost:8700")
    assert headers["x-frame-options"] == "DENY"
    assert "default-src 'self'" in headers["content-security-policy"]


def test_loopback_is_told_from_the_rest():
    assert all(map(is_loopback, ("127.0.0.1", "127.1.2.3", "::1", "localhost")))
    assert not any(map(is_loopback, ("0.0.0.0", "::", "192.168.0.1", "", "example.org")))


class Connection:
    """A connection that may be closed."""

    closed = False

    def abort(self):
        self.closed = True


def test_the_oldest_of_too_many_strangers_is_closed_and_nobody_who_was_let_in():
    unauthorized = UnauthorizedConnections()
    connections = [Connection() for _ in range(200)]
    for port, connection in enumerate(connections):
        unauthorized.add(("127.0.0.1", port), connection)
        if port == 0:
            unauthorized.forget(("127.0.0.1", port))
    closed = [port for port, connection in enumerate(connections) if connection.closed]
    assert closed == list(range(1, 200 - 64))
