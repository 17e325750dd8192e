"""A page on this machine that shows a session's trials and takes the answers.

The server listens on the loopback interface, accepts only requests to that address from its own page, and takes answers
only with the token in the page, which other pages of the browser cannot read.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import hmac
import json
import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from http import HTTPStatus
from pathlib import Path
from typing import Any

from tornado.httpserver import HTTPServer
from tornado.iostream import IOStream
from tornado.netutil import bind_sockets
from tornado.web import Application, HTTPError, RequestHandler

from analysis.command.cli import InputError
from analysis.command.cluster import LOOPBACK
from analysis.perception.protocol import Session

BODY_MAX = 1 << 16
"""Most bytes of an answer."""
CONNECTIONS_MAX = 64
"""Most open connections; one more closes the oldest, so that idle connections block no others."""
TIMEOUT_S = 30.0
"""Seconds within which a whole request must arrive."""

_HERE = Path(__file__).parent
_THREADS = 4


@dataclass(frozen=True)
class _Service:
    session: Session
    break_every: int
    hosts: frozenset[str]
    threads: concurrent.futures.Executor


class _Handler(RequestHandler):
    """Refuses requests that do not come from the page of this session."""

    def initialize(self, service: _Service) -> None:
        self.service = service

    def prepare(self) -> None:
        hosts, headers = self.service.hosts, self.request.headers
        if headers.get("Host") not in hosts:
            raise HTTPError(HTTPStatus.MISDIRECTED_REQUEST)
        origin = headers.get("Origin")
        if origin is not None and origin not in {f"http://{host}" for host in hosts}:
            raise HTTPError(HTTPStatus.FORBIDDEN, "the request comes from the page of another server")

    def write_error(self, status_code: int, **facts: Any) -> None:
        """Answers an error with one line of text."""
        error = facts.get("exc_info", (None, None))[1]
        said = error.log_message % error.args if isinstance(error, HTTPError) and error.log_message else None
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(f"{said or self._reason}\n")

    def log_exception(self, *error: Any) -> None:
        """Logs nothing, because the page shows the error."""

    def state(self) -> None:
        self.set_header("Cache-Control", "no-store")
        self.finish(_state(self.service.session, self.service.break_every))


class _Asset(_Handler):
    def get(self, name: str) -> None:
        name = name or "trial_page.html"
        self.set_header("Content-Type", "text/javascript" if name.endswith(".js") else "text/html; charset=utf-8")
        # the same address may serve another session later
        self.set_header("Cache-Control", "no-store")
        self.set_header("X-Frame-Options", "DENY")
        self.finish((_HERE / name).read_text(encoding="utf-8").replace("{{token}}", self.service.session.token))


class _Guarded(_Handler):
    def prepare(self) -> None:
        super().prepare()
        if not hmac.compare_digest(self.request.headers.get("X-Token", "").encode(), self._token.encode()):
            raise HTTPError(HTTPStatus.FORBIDDEN, "expected the token of the page")

    @property
    def _token(self) -> str:
        return self.service.session.token


class _State(_Guarded):
    def get(self) -> None:
        self.state()


class _Answer(_Guarded):
    def post(self) -> None:
        try:
            facts = json.loads(self.request.body)
            number, side = facts.pop("trial"), facts.pop("answer")
            if type(number) is not int:
                raise ValueError("answer: expected the number of a trial")
            self.service.session.answer(number, side, facts)
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise HTTPError(HTTPStatus.BAD_REQUEST, "%s", str(error)[:200]) from None
        except OSError as error:
            raise HTTPError(HTTPStatus.INSUFFICIENT_STORAGE, "%s", error.strerror or str(error)) from None
        self.state()


class _Frame(_Guarded):
    async def get(self, stimulus: str, number: str) -> None:
        """Sends a frame of a stimulus by its numbers; no path from a request reaches the disk."""
        session, loop = self.service.session, asyncio.get_running_loop()
        try:
            content = await loop.run_in_executor(self.service.threads, session.frame, int(stimulus), int(number))
        except IndexError:
            raise HTTPError(HTTPStatus.NOT_FOUND) from None
        except InputError as error:
            raise HTTPError(HTTPStatus.INTERNAL_SERVER_ERROR, "%s", str(error)) from None
        self.set_header("Content-Type", "image/png")
        # the browser may cache it, but not for another session at this address
        self.set_header("Cache-Control", "private, max-age=3600")
        self.set_header("Vary", "X-Token")
        self.finish(content)


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


def _state(session: Session, break_every: int) -> dict[str, Any]:
    """State of the page: the current trial, without naming the pair that differs."""
    trial = session.current
    done, total = len(session.answers), len(session.trials)
    found: dict[str, Any] = {
        "done": done,
        "total": total,
        "rest": bool(done and done % break_every == 0 and trial is not None),
        "frame_rate_hz": session.manifest["frame_rate_hz"],
        "size_px": session.manifest["size_px"],
        "trial": None,
    }
    if trial is not None:
        differs = [trial.test, trial.reference] if trial.test_first else [trial.reference, trial.test]
        same = [trial.reference, trial.reference]
        left, right = (differs, same) if trial.side == "left" else (same, differs)
        frames = len(session.rows[trial.test]["files"])
        found["trial"] = {"number": trial.number, "left": left, "right": right, "frames": frames}
    return found


@contextmanager
def serving(session: Session, port: int = 0, break_every: int = 24) -> Iterator[str]:
    """Serves a session while the block runs; yields the address of its page.

    Raises:
        InputError: the port is not available.
    """
    logging.getLogger("tornado").setLevel(logging.CRITICAL)  # no log: the terminal shows the progress
    try:
        (listener,) = bind_sockets(port, LOOPBACK)
    except OSError as error:
        raise InputError(f"port: expected a free one, got {port} ({error.strerror})") from None
    port = listener.getsockname()[1]
    hosts = frozenset(
        f"{name}{end}" for name in (LOOPBACK, "localhost") for end in [f":{port}", *([""] * (port == 80))]
    )
    loop, over = asyncio.new_event_loop(), asyncio.Event()

    async def serve(service: _Service) -> None:
        given = {"service": service}
        paths = [
            (r"/(|trial_page\.js)", _Asset, given),
            ("/state", _State, given),
            ("/answer", _Answer, given),
            ("/frame/([0-9]{1,9})/([0-9]{1,9})", _Frame, given),
        ]
        server = _Bounded(
            Application(paths, default_handler_class=_Missing, default_handler_args=given, log_function=lambda _: None),
            max_body_size=BODY_MAX, max_header_size=BODY_MAX, idle_connection_timeout=TIMEOUT_S, body_timeout=TIMEOUT_S,
        )  # fmt: skip
        server.add_socket(listener)
        await over.wait()
        server.stop()
        await server.close_all_connections()

    with concurrent.futures.ThreadPoolExecutor(_THREADS) as threads:
        service = _Service(session, break_every, hosts, threads)
        thread = threading.Thread(target=lambda: loop.run_until_complete(serve(service)), daemon=True)
        thread.start()
        try:
            yield f"http://{LOOPBACK}:{port}/"
        finally:
            loop.call_soon_threadsafe(over.set)
            thread.join()
            loop.close()
            session.export()


class _Missing(_Handler):
    def prepare(self) -> None:
        super().prepare()
        raise HTTPError(HTTPStatus.NOT_FOUND)
