"""A page on this machine that shows a session's trials and takes the answers. Nothing else can reach it."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from analysis.perception.protocol import Session
from analysis.perception.stimuli import png_of

_HERE = Path(__file__).parent
_PAGE = {"/": ("trial_page.html", "text/html"), "/trial_page.js": ("trial_page.js", "text/javascript")}
_BODY_MAX = 1 << 16
_FACTS = {"response_s": float, "display_rate_hz": float, "dropped_frames": int, "refreshes": int, "fits_window": bool,
          "device_pixel_ratio": float}  # fmt: skip


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def __init__(self, session: Session, port: int, break_every: int) -> None:
        super().__init__(("127.0.0.1", port), _Handler)
        self.session, self.break_every, self.lock = session, break_every, threading.Lock()


class _Handler(BaseHTTPRequestHandler):
    server: _Server

    def log_message(self, format: str, *args: Any) -> None:
        """Says nothing: the terminal shows the progress."""

    def do_GET(self) -> None:
        if self.path in _PAGE:
            name, kind = _PAGE[self.path]
            self._send((_HERE / name).read_bytes(), kind)
        elif self.path == "/state":
            with self.server.lock:
                self._send(json.dumps(_state(self.server)).encode(), "application/json")
        elif self.path.startswith("/frame/"):
            self._frame(self.path.removeprefix("/frame/").split("/"))
        else:
            self.send_error(HTTPStatus.NOT_FOUND)

    def do_POST(self) -> None:
        length = int(self.headers.get("Content-Length") or 0)
        if self.path != "/answer" or not 0 < length <= _BODY_MAX:
            self.send_error(HTTPStatus.NOT_FOUND)
            return
        try:
            body = json.loads(self.rfile.read(length))
            facts = {name: kind(body[name]) for name, kind in _FACTS.items() if name in body}
            with self.server.lock:
                self.server.session.answer(int(body["trial"]), str(body["answer"]), facts)
                self._send(json.dumps(_state(self.server)).encode(), "application/json")
        except (ValueError, KeyError, TypeError) as error:
            self.send_error(HTTPStatus.BAD_REQUEST, str(error)[:200])

    def _frame(self, parts: list[str]) -> None:
        """A frame of a stimulus by numbers; no path from outside reaches the disk."""
        session = self.server.session
        try:
            row = session.rows[int(parts[0])]
            file = session.stimuli / row["folder"] / row["files"][int(parts[1])]
            self._send(png_of(file), "image/png")
        except (ValueError, IndexError, OSError):
            self.send_error(HTTPStatus.NOT_FOUND)

    def _send(self, content: bytes, kind: str) -> None:
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Cache-Control", "no-store" if kind == "application/json" else "max-age=3600")
        self.end_headers()
        self.wfile.write(content)


def _state(server: _Server) -> dict[str, Any]:
    """What the page needs to go on: the current trial, without saying which pair differs in words."""
    session, trial = server.session, server.session.current
    done, total = len(session.answers), len(session.trials)
    found: dict[str, Any] = {
        "done": done,
        "total": total,
        "rest": bool(done and done % server.break_every == 0 and trial is not None),
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
    """Serves a session while the block runs; the address of its page.

    Raises:
        OSError: the port is taken.
    """
    server = _Server(session, port, break_every)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}/"
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
        session.export()
