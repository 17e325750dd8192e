"""The page of a live view: it sends what a browser needs, pictures as they come, and hands on what is asked for."""

from __future__ import annotations

import asyncio
import concurrent.futures
import hmac
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http import HTTPStatus
from importlib.resources import files
from typing import Any

from tornado.web import HTTPError
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from analysis.command.cluster import LOOPBACK
from analysis.command.pages import Answering, accept_page, served
from analysis.live.hub import Hub, Watcher
from analysis.live.options import BATCHES, LATENCY_MOST, NOTHING, RESOLUTIONS, policies
from analysis.page.environment import environment
from tsar.choices import SOLVERS

LEAST_S = 1.0 / 30.0
"""Seconds from one frame of a page to the next, at least; the next is sent when the page has drawn the last."""
FILES = {
    "live.js": "text/javascript",
    "live_camera.js": "text/javascript",
    "live_stage.js": "text/javascript",
    "live_curves.js": "text/javascript",
    "live.css": "text/css",
    "report.css": "text/css",
}


@dataclass(frozen=True)
class _Site:
    hub: Hub
    token: str
    title: str
    asked: bool
    doing: concurrent.futures.Executor = field(default_factory=lambda: concurrent.futures.ThreadPoolExecutor(1))
    drawing: concurrent.futures.Executor = field(default_factory=lambda: concurrent.futures.ThreadPoolExecutor(2))


def _same(given: str, token: str) -> bool:
    return hmac.compare_digest(given.encode(), token.encode())


class _Page(Answering):
    def get(self) -> None:
        site: _Site = self.state
        if site.asked and not _same(self.get_query_argument("key", ""), site.token):
            raise HTTPError(HTTPStatus.FORBIDDEN, "expected the key that the command printed")
        self.set_header("Content-Type", "text/html; charset=utf-8")
        self.set_header("Cache-Control", "no-store")
        self.set_header("X-Frame-Options", "DENY")
        self.set_header("Content-Security-Policy", "default-src 'self'; style-src 'self' 'unsafe-inline'")
        self.finish(page(site.title, site.token))


class _File(Answering):
    def get(self, name: str) -> None:
        room = "analysis.page" if name == "report.css" else "analysis.live"
        self.set_header("Content-Type", FILES[name])
        self.set_header("Cache-Control", "no-store")
        self.finish(files(room).joinpath(name).read_text(encoding="utf-8"))


class _Socket(WebSocketHandler):
    """One page that is open."""

    def initialize(self, state: _Site, hosts: frozenset[str]) -> None:
        self.site, self.hosts = state, hosts
        self._watcher: Watcher | None = None

    def prepare(self) -> None:
        accept_page(self, self.hosts)
        if not _same(self.get_query_argument("token", ""), self.site.token):
            raise HTTPError(HTTPStatus.FORBIDDEN, "expected the token of the page")

    def check_origin(self, origin: str) -> bool:
        return True  # it was checked before

    def open(self, *arguments: str, **more: str) -> None:
        self.set_nodelay(True)
        self._drawn = asyncio.Event()
        self._drawn.set()
        self._task = asyncio.create_task(self._send())

    async def on_message(self, message: str | bytes) -> None:
        if message == "drawn":
            self._drawn.set()
        elif self._watcher is not None and isinstance(message, str):
            loop = asyncio.get_running_loop()
            await loop.run_in_executor(self.site.doing, self.site.hub.heard, self._watcher, message)

    def on_close(self) -> None:
        watcher, self._watcher = self._watcher, None
        self._task.cancel()
        if watcher is not None:
            self.site.doing.submit(self.site.hub.left, watcher)

    async def _send(self) -> None:
        loop, hub = asyncio.get_running_loop(), self.site.hub
        coming = self.site.doing.submit(hub.came)
        try:
            self._watcher = watcher = await asyncio.wrap_future(coming)
        except asyncio.CancelledError:  # closed before it had come: it leaves as soon as it has
            if not coming.cancelled():
                self.site.doing.submit(lambda: hub.left(coming.result()))
            raise
        try:
            while True:
                await self._drawn.wait()
                self._drawn.clear()
                began = loop.time()
                await self.write_message(await loop.run_in_executor(self.site.drawing, hub.frame, watcher), binary=True)
                await asyncio.sleep(max(0.0, began + LEAST_S - loop.time()))
        except WebSocketClosedError:
            pass

    def log_exception(self, *error: Any) -> None:
        """Says nothing: the page is told."""


def page(title: str, token: str) -> str:
    """The page of a live view."""
    return environment().get_template("live.html.j2").render(
        title=title, token=token, policies=[NOTHING, *policies()], solvers=list(SOLVERS), resolutions=RESOLUTIONS,
        batches=BATCHES, latency_most=LATENCY_MOST,
    )  # fmt: skip


@contextmanager
def watching(hub: Hub, title: str, port: int = 0, host: str = LOOPBACK) -> Iterator[str]:
    """Serves the page of a live view while the block runs; yields its address.

    Args:
        hub: the live view.
        title: of the page.
        port: 0 takes a free one.
        host: where to listen; other than this machine's own, the page asks for the key in its address.

    Raises:
        InputError: the port cannot be had.
    """
    asked = host not in (LOOPBACK, "localhost")
    site = _Site(hub, secrets.token_urlsafe(16), title, asked)
    names = "|".join(name.replace(".", r"\.") for name in FILES)
    paths = {"/": _Page, "/watch": _Socket, f"/({names})": _File}
    with served(paths, site, port, host) as address:
        yield f"{address}?key={site.token}" if asked else address
    for threads in (site.doing, site.drawing):
        threads.shutdown()
