"""Carries events and messages between the page and its session, on this machine alone.

Whoever knows the token may look: it is the first part of each path. Other sites' pages can guess neither it nor what is
in Host and Origin, which browsers write.
"""

from __future__ import annotations

import asyncio
import secrets
import socket
from collections.abc import AsyncIterator, Awaitable, Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from importlib import resources
from pathlib import PurePosixPath

from aiohttp import WSCloseCode, WSMsgType, web

from cltrace.viewer.messages import Event, Message
from cltrace.viewer.session import Session, SessionRunner
from cltrace.viewer.stage import Stage

HOST, PORT = "127.0.0.1", 8042
# Seconds after which a window that does not answer counts as closed.
HEARTBEAT = 20.0
# Windows whose line was broken that keep their camera.
LEFT = 16
# Bytes of an event, at most.
LARGEST = 512
KINDS = {".html": "text/html", ".js": "text/javascript", ".css": "text/css"}
PAGE = resources.files("cltrace.viewer") / "page"
HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "default-src 'self'; img-src 'self' blob: data:; frame-ancestors 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


class Server:
    """A stage's page, and a session for each window of it. address: where it is."""

    def __init__(self, stage: Stage) -> None:
        self._stage, self._token = stage, secrets.token_urlsafe(16)
        # One thread draws for all windows; one answers, also while another one writes a movie.
        self._draws, self._answers = ThreadPoolExecutor(1), ThreadPoolExecutor(2)
        self._left = dict[str, Session]()  # of windows whose line was broken, which may come again
        self._socket = _listening()
        self.port: int = self._socket.getsockname()[1]
        self.address = f"http://{HOST}:{self.port}/{self._token}/"

    def run(self, ready: Callable[[], object]) -> None:
        """Serves until a signal raises. ready: is called once, when it does."""
        asyncio.run(self._serve(ready))

    async def _serve(self, ready: Callable[[], object]) -> None:
        app = web.Application(middlewares=[self._guarded])
        app.router.add_get("/{token}/socket", self._window)
        app.router.add_get("/{token}/{name:.*}", self._file)
        runner = web.AppRunner(app, access_log=None, shutdown_timeout=0.1)  # of 0, it waits for ever
        await runner.setup()
        await web.SockSite(runner, self._socket).start()
        ready()
        try:
            await asyncio.Event().wait()
        finally:
            await runner.cleanup()
            for pool in (self._draws, self._answers):
                pool.shutdown(wait=False, cancel_futures=True)

    @web.middleware
    async def _guarded(
        self, request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
    ) -> web.StreamResponse:
        """Answers those alone who have the token, and come by this machine's name and from this page."""
        hosts = [f"{name}:{self.port}" for name in (HOST, "localhost")]
        origin, host = request.headers.get("Origin"), request.headers.get("Host")
        socket_ = request.path.endswith("/socket")
        if host not in hosts or (origin != f"http://{host}" and (origin is not None or socket_)):
            raise web.HTTPForbidden
        if not secrets.compare_digest(request.match_info.get("token", "").encode(), self._token.encode()):
            raise web.HTTPNotFound
        return await handler(request)

    async def _file(self, request: web.Request) -> web.Response:
        """A file of the page."""
        name = request.match_info["name"] or "index.html"
        if name not in [file.name for file in PAGE.iterdir()]:
            raise web.HTTPNotFound
        kind = KINDS[PurePosixPath(name).suffix]
        return web.Response(text=(PAGE / name).read_text("utf-8"), content_type=kind, headers=HEADERS)

    async def _window(self, request: web.Request) -> web.WebSocketResponse:
        """A window, until it is closed."""
        line = web.WebSocketResponse(max_msg_size=LARGEST, heartbeat=HEARTBEAT, compress=False)
        await line.prepare(request)
        name = request.query.get("window", secrets.token_urlsafe())
        session = self._left.pop(name, None) or Session(self._stage)
        session.reopen()
        try:
            await SessionRunner(session, partial(_send, line), self._draws, self._answers).live(_events(line))
        except ValueError as error:
            await line.close(code=WSCloseCode.POLICY_VIOLATION, message=str(error)[:100].encode())
        self._left[name] = session
        if len(self._left) > LEFT:
            del self._left[next(iter(self._left))]
        return line


async def _events(line: web.WebSocketResponse) -> AsyncIterator[Event]:
    """What the page says until it is closed. Raises ValueError for what no page says."""
    async for said in line:
        if said.type != WSMsgType.TEXT:
            return
        yield Event.of(said.data)


async def _send(line: web.WebSocketResponse, message: Message) -> None:
    with suppress(ConnectionError):  # the window has gone
        await line.send_bytes(message.encoded())


def _listening() -> socket.socket:
    """A socket on this machine alone, on a port that is free."""
    try:
        return socket.create_server((HOST, PORT))
    except OSError:
        return socket.create_server((HOST, 0))
