"""Live data of a session for browsers.

A browser requests the next message after each one: a slow browser gets fewer messages, each with
the newest data, and no messages accumulate.
"""

import asyncio
import json
import math
import threading
import time
from typing import TYPE_CHECKING, Any

import numpy as np

from jointz.core.errors import JointzError
from jointz.rig.console.session_process import SessionProcess
from jointz.rig.session.live.live_session import LiveSession

if TYPE_CHECKING:
    from starlette.websockets import WebSocket

_PERIOD_S = 1.0 / 30.0
#: The status is updated less often than the traces.
_STATUS_S = 0.1
#: After this time without a request a browser is taken for gone.
ALIVE_S = 2.0
_PATIENCE_S = 20.0
_MOST_BROWSERS = 8
_NEXT = "next"
_MALFORMED, _TOO_MANY = 1008, 1013
#: Decimals of the columns of the traces: time, angle, torques, phase, pulse.
_DECIMALS = (3, 4, 2, 2, 2, 1, 0)


class LiveFeed:
    """Follows a session in a thread and sends its data to browsers."""

    def __init__(self, live: LiveSession, process: SessionProcess) -> None:
        self._live = live
        self._process = process
        self._lock = threading.Lock()
        self._status = "{}"
        self._version = 0
        self._updated_s = 0.0
        self._last_status: dict[str, Any] = {"state": "idle"}
        self._seen: dict[int, float] = {}
        self._browsers = 0

    def run(self) -> None:
        """Follow the session while the page's process lives."""
        while True:
            began = time.monotonic()
            self.poll()
            time.sleep(max(0.005, began + _PERIOD_S - time.monotonic()))

    def poll(self) -> None:
        """Read the session once; problems of its files are shown, and reading is tried again."""
        with self._lock:
            try:
                self._live.poll()
                if time.monotonic() - self._updated_s >= _STATUS_S:
                    self._update("", self._live.status())
            except JointzError as exc:
                self._update(str(exc), self._live.status())
            except Exception as exc:  # noqa: BLE001 - a page that freezes would look as if all were well
                self._update(
                    f"this page has failed ({type(exc).__name__}: {exc}); what it shows is old",
                    self._last_status,
                )

    def look(self) -> dict[str, Any]:
        """Return the current status of the session."""
        self.poll()
        with self._lock:
            return self._live.status()

    def _update(self, problem: str, status: dict[str, Any]) -> None:
        self._updated_s = time.monotonic()
        status = status | {"problem": problem, "can_start": self._process.can_start}
        if status.get("state") in ("idle", "failed", "stopped", "tripped"):
            status["words"] = self._process.last_words()
        self._last_status = status
        text = json.dumps(_finite(status), allow_nan=False)
        if text != self._status:
            self._status = text
            self._version += 1

    def somebody(self) -> bool:
        """Tell whether a browser shows the page."""
        return self._answering() > 0

    def _answering(self) -> int:
        now = time.monotonic()
        return sum(now - seen < ALIVE_S for seen in list(self._seen.values()))

    def frame(self, known: tuple[int, int, int]) -> tuple[str, tuple[int, int, int]]:
        """Return the data that are new for a browser as JSON, and what it knows afterwards."""
        with self._lock:
            generation = self._live.generation
            is_new = generation != known[0]
            rows, last = self._live.rows_after(0 if is_new else known[1])
            strikes = self._live.strikes_s()
            status, version = self._status, self._version
        parts = [f'"anew":{json.dumps(is_new)}', f'"rows":{_columns(rows)}']
        parts.append(f'"strikes":{json.dumps(strikes)}')
        if version != known[2]:
            parts.append(f'"status":{status}')
        return "{" + ",".join(parts) + "}", (generation, last, version)

    async def answer(self, socket: "WebSocket") -> None:
        """Serve one browser until it leaves or sends a malformed message."""
        from starlette.websockets import WebSocketDisconnect

        await socket.accept()
        if self._answering() >= _MOST_BROWSERS:  # idle browsers do not count
            await socket.close(_TOO_MANY)
            return
        self._browsers += 1
        browser = self._browsers
        self._seen[browser] = -math.inf
        try:
            await self._send_frames(socket, browser)
        except (TimeoutError, RuntimeError, WebSocketDisconnect):
            return  # the browser is gone
        finally:
            del self._seen[browser]

    async def _send_frames(self, socket: "WebSocket", browser: int) -> None:
        known = (-1, 0, -1)
        while True:
            began = time.monotonic()
            frame, known = self.frame(known)
            await asyncio.wait_for(socket.send_text(frame), _PATIENCE_S)
            message = await asyncio.wait_for(socket.receive(), _PATIENCE_S)
            if message["type"] == "websocket.disconnect":
                return
            if message.get("text") != _NEXT:
                await socket.close(_MALFORMED)
                return
            self._seen[browser] = time.monotonic()
            await asyncio.sleep(max(0.0, began + _PERIOD_S - time.monotonic()))


def _columns(rows: np.ndarray) -> str:
    columns = (np.round(rows[:, k], d).tolist() for k, d in enumerate(_DECIMALS))
    return json.dumps([[None if math.isnan(v) else v for v in column] for column in columns])


def _finite(value: Any) -> Any:
    """Return plain values with few digits, None for numbers that JSON cannot hold."""
    if isinstance(value, float):
        return float(f"{value:.5g}") if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return value
