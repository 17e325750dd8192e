"""Pages that a command shows: a server with bounded connections, which heeds the pages that it sent and nobody else.

It listens on the loopback interface unless told otherwise, and accepts only requests to its own address.
"""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http import HTTPStatus
from typing import Any

from tornado.httpserver import HTTPServer
from tornado.iostream import IOStream
from tornado.netutil import bind_sockets
from tornado.web import Application, HTTPError, RequestHandler

from analysis.command.cli import InputError
from analysis.command.cluster import LOOPBACK

BODY_MAX = 1 << 16
"""Most bytes of the body of a request."""
CONNECTIONS_MAX = 64
"""Most open connections; one more closes the oldest, so that idle connections block no others."""
TIMEOUT_S = 30.0
"""Seconds within which a whole request must arrive."""


def accept_page(handler: RequestHandler, hosts: frozenset[str]) -> None:
    """Refuses a request to another address, or from a page of another server.

    Args:
        handler: of the request.
        hosts: addresses of this server; none of them where it listens to other machines, too.

    Raises:
        HTTPError: it is refused.
    """
    headers = handler.request.headers
    if hosts and headers.get("Host") not in hosts:
        raise HTTPError(HTTPStatus.MISDIRECTED_REQUEST)
    origin = headers.get("Origin")
    own = hosts or {headers.get("Host", "")}
    if origin is not None and origin not in {f"http://{host}" for host in own}:
        raise HTTPError(HTTPStatus.FORBIDDEN, "the request comes from the page of another server")


class Answering(RequestHandler):
    """Answers requests from this server's own pages, and says errors in one line. ``state`` is the server's."""

    def initialize(self, state: Any, hosts: frozenset[str]) -> None:
        self.state, self.hosts = state, hosts

    def prepare(self) -> None:
        accept_page(self, self.hosts)

    def write_error(self, status_code: int, **facts: Any) -> None:
        """Answers an error with one line of text."""
        error = facts.get("exc_info", (None, None))[1]
        said = error.log_message % error.args if isinstance(error, HTTPError) and error.log_message else None
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(f"{said or self._reason}\n")

    def log_exception(self, *error: Any) -> None:
        """Logs nothing, because the page shows the error."""


class _Missing(Answering):
    def prepare(self) -> None:
        super().prepare()
        raise HTTPError(HTTPStatus.NOT_FOUND)


class _Bounded(HTTPServer):
    """A server with a bounded number of connections, all of them served by one thread."""

    def initialize(self, *arguments: Any, **options: Any) -> None:
        super().initialize(*arguments, **options)
        self._open: list[IOStream] = []

    def handle_stream(self, stream: IOStream, address: tuple) -> None:
        self._open = [one for one in self._open if not one.closed()]
        while len(self._open) >= CONNECTIONS_MAX:
            self._open.pop(0).close()
        self._open.append(stream)
        super().handle_stream(stream, address)

    def close_streams(self) -> None:
        """Closes all connections, web sockets among them."""
        for stream in self._open:
            stream.close()


def _in_address(host: str) -> str:
    """A host as addresses of pages have it: an IPv6 address in brackets, as RFC 3986 has it."""
    return f"[{host}]" if ":" in host else host or "0.0.0.0"


@contextmanager
def served(paths: dict[str, type[RequestHandler]], state: Any, port: int, host: str = LOOPBACK) -> Iterator[str]:
    """Serves pages while the block runs; yields their address.

    Args:
        paths: a handler, which takes ``state`` and ``hosts`` as :class:`Answering` does, for each expression of paths.
        state: what handlers share; they are called in one thread.
        port: where to listen; 0 takes a free one.
        host: the address to listen at.

    Raises:
        InputError: it cannot be had.
    """
    logging.getLogger("tornado").setLevel(logging.CRITICAL)  # no log: the terminal shows the progress
    try:
        listener = bind_sockets(port, host)[0]
    except OSError as error:
        wrong = "port" if host == LOOPBACK else "host, port"
        got = port if host == LOOPBACK else f"{host}, {port}"
        raise InputError(f"{wrong}: expected a free one, got {got} ({error.strerror or error})") from None
    port = listener.getsockname()[1]
    own = (LOOPBACK, "localhost") if host in (LOOPBACK, "localhost") else ()
    hosts = frozenset(f"{name}{end}" for name in own for end in [f":{port}", *([""] * (port == 80))])
    given = {"state": state, "hosts": hosts}
    loop, over = asyncio.new_event_loop(), asyncio.Event()

    async def serve() -> None:
        handlers = [(path, handler, given) for path, handler in paths.items()]
        server = _Bounded(
            Application(
                handlers, default_handler_class=_Missing, default_handler_args=given, log_function=lambda _: None,
                websocket_max_message_size=BODY_MAX, websocket_ping_interval=10.0,
            ),
            max_body_size=BODY_MAX, max_header_size=BODY_MAX, idle_connection_timeout=TIMEOUT_S, body_timeout=TIMEOUT_S,
        )  # fmt: skip
        server.add_socket(listener)
        await over.wait()
        server.stop()
        await server.close_all_connections()
        server.close_streams()
        await asyncio.sleep(0)

    thread = threading.Thread(target=lambda: loop.run_until_complete(serve()), daemon=True)
    thread.start()
    try:
        yield f"http://{_in_address(host)}:{port}/"
    finally:
        loop.call_soon_threadsafe(over.set)
        thread.join()
        loop.close()
