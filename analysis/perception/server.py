"""A page on this machine that shows a session's trials and takes the answers.

The server listens on the loopback interface, accepts only requests to that address from its own page, and takes answers
only with the token in the page, which other pages of the browser cannot read.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import hmac
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from http import HTTPStatus
from pathlib import Path
from typing import Any

from tornado.web import HTTPError

from analysis.command.cli import InputError
from analysis.command.pages import Answering, served
from analysis.page.environment import environment
from analysis.perception.protocol import TrialSession

_HERE = Path(__file__).parent
_THREADS = 4


@dataclass(frozen=True)
class _Service:
    session: TrialSession
    break_every: int
    threads: concurrent.futures.Executor


class _Handler(Answering):
    """Answers requests from the page of this session."""

    @property
    def service(self) -> _Service:
        return self.state

    def send_state(self) -> None:
        self.set_header("Cache-Control", "no-store")
        self.finish(_state(self.service.session, self.service.break_every))


class _Asset(_Handler):
    def get(self, name: str) -> None:
        self.set_header("Content-Type", "text/javascript" if name else "text/html; charset=utf-8")
        # the same address may serve another session later
        self.set_header("Cache-Control", "no-store")
        self.set_header("X-Frame-Options", "DENY")
        if name:
            self.finish((_HERE / name).read_text(encoding="utf-8"))
        else:
            self.finish(environment().get_template("trial.html.j2").render(token=self.service.session.token))


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
        self.send_state()


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
        self.send_state()


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


def _state(session: TrialSession, break_every: int) -> dict[str, Any]:
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
def serving(session: TrialSession, port: int = 0, break_every: int = 24) -> Iterator[str]:
    """Serves a session while the block runs; yields the address of its page.

    Raises:
        InputError: the port is not available.
    """
    paths = {
        r"/(|trial_page\.js)": _Asset,
        "/state": _State,
        "/answer": _Answer,
        "/frame/([0-9]{1,9})/([0-9]{1,9})": _Frame,
    }
    with concurrent.futures.ThreadPoolExecutor(_THREADS) as threads:
        try:
            with served(paths, _Service(session, break_every, threads), port) as address:
                yield address
        finally:
            session.export()
