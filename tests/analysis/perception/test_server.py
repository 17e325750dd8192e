"""The server of the trials: it shows the right pair, and serves only its own page."""

from __future__ import annotations

import http.client
import json
import os
import socket
import threading
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pandas as pd
import psutil
import pytest

from analysis.command.cli import InputError
from analysis.command.pages import BODY_MAX, CONNECTIONS_MAX
from analysis.perception.protocol import TABLE, TrialSession
from analysis.perception.server import serving
from tests.analysis.perception.builders import write_stimuli


class Client:
    """Asks a server as its page does, unless told otherwise."""

    def __init__(self, address: str, token: str) -> None:
        self.port, self.token = urlsplit(address).port or 0, token

    def ask(self, path: str, body: bytes | None = None, headers: dict[str, str | None] | None = None):
        """Status and content; a header that is None is left out."""
        sent = {"Host": f"127.0.0.1:{self.port}", "X-Token": self.token, **(headers or {})}
        if body is not None:
            sent = {"Content-Length": str(len(body)), **sent}
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=10)
        connection.putrequest("GET" if body is None else "POST", f"/{path}", skip_host=True)
        for name, value in sent.items():
            if value is not None:
                connection.putheader(name, value)
        connection.endheaders(body)
        with connection.getresponse() as reply:
            content = reply.read()
        connection.close()
        return reply.status, content

    def answer(self, number: int, **facts) -> int:
        return self.ask("answer", json.dumps({"trial": number, "answer": "left", **facts}).encode())[0]

    def state(self) -> dict:
        status, content = self.ask("state")
        assert status == 200
        return json.loads(content)


@pytest.fixture
def stimuli(tmp_path: Path) -> Path:
    return write_stimuli(tmp_path / "stimuli")


@pytest.fixture
def session(tmp_path: Path, stimuli: Path) -> Iterator[TrialSession]:
    with TrialSession(tmp_path / "session", stimuli, "anna", 4, seed=3) as session:
        yield session


@pytest.fixture
def client(session: TrialSession) -> Iterator[Client]:
    with serving(session, break_every=2) as address:
        yield Client(address, session.token)


def test_the_server_hands_out_frames_and_takes_answers(client: Client, session: TrialSession, stimuli: Path) -> None:
    page, script = client.ask("", headers={"X-Token": None}), client.ask("trial_page.js", headers={"X-Token": None})
    assert page[0] == script[0] == 200 and b"requestAnimationFrame" in script[1]
    assert b"trial_page.js" in page[1] and f'content="{session.token}"'.encode() in page[1]
    state = client.state()
    assert (state["done"], state["total"], state["rest"]) == (0, 12, False)
    frame = (stimuli / "planescene/hammersley-box-0001/frame00001.png").read_bytes()
    assert client.ask("frame/0/1") == (200, frame)
    for path in ("frame/0/99", "frame/../../etc", "frame/9/0", "frame/-1/0", "frame/999999999999999/0", "nothing"):
        assert client.ask(path)[0] == 404
    for number in range(2):
        assert client.answer(number) == 200
    state = client.state()
    assert (state["done"], state["rest"], state["trial"]["number"]) == (2, True, 2)


def test_the_pair_that_differs_is_on_its_side(client: Client, session: TrialSession) -> None:
    for trial in session.trials:
        shown = client.state()["trial"]
        assert shown["number"] == trial.number
        other = "right" if trial.side == "left" else "left"
        expected = [trial.test, trial.reference]
        assert shown[trial.side] == (expected if trial.test_first else expected[::-1])
        assert shown[other] == [trial.reference] * 2
        assert client.answer(trial.number) == 200
    assert {trial.side for trial in session.trials} == {"left", "right"}


def test_it_listens_on_loopback_only(client: Client) -> None:
    listening = [one.laddr for one in psutil.Process().net_connections("inet") if one.status == psutil.CONN_LISTEN]
    assert [place.ip for place in listening if place.port == client.port] == ["127.0.0.1"]


def test_bad_answers_are_refused_and_end_nothing(client: Client, session: TrialSession, tmp_path: Path) -> None:
    bodies = (
        b"", b"{}", b"[]", b"7", b"null", b"nonsense", b"\xff", b"[" * 60_000, b'{"a":' * 10_000,
        b'{"trial": 7, "answer": "left"}', b'{"trial": 0, "answer": "up"}', b'{"trial": 0, "answer": ["left"]}',
        b'{"trial": "0", "answer": "left"}', b'{"trial": 0.0, "answer": "left"}', b'{"trial": true, "answer": "left"}',
        b'{"trial": ' + b"9" * 5000 + b', "answer": "left"}',
        b'{"trial": 0, "answer": "left", "dropped_frames": ' + b"9" * 400 + b"}",
        b'{"trial": 0, "answer": "left", "dropped_frames": 1e400}',
        b'{"trial": 0, "answer": "left", "response_s": NaN}',
    )  # fmt: skip
    for body in bodies:
        status, said = client.ask("answer", body)
        assert status == 400 and said.count(b"\n") == 1 and b"Traceback" not in said, body[:60]
    for length in ("abc", "-1", "1_0", "+9", "9" * 400, "\xb2", "1 2"):
        try:
            assert client.ask("answer", b"{}", {"Content-Length": length})[0] == 400, length
        except ConnectionError:  # what was refused unread may reset the connection before the reply is read
            pass
    assert not session.answers
    assert client.answer(0, dropped_frames=1) == 200
    assert len(pd.read_parquet(session.export())) == 1


def test_a_body_is_bounded(client: Client, session: TrialSession) -> None:
    body = b'{"trial": 0, "answer": "left"}'
    assert BODY_MAX == 65536
    try:
        assert client.ask("answer", body.ljust(BODY_MAX + 1))[0] == 400
    except ConnectionError:  # what was refused unread may reset the connection before the reply is read
        pass
    assert not session.answers
    assert client.ask("answer", body.ljust(BODY_MAX))[0] == 200 and session.answers


def test_other_hosts_and_origins_are_refused(client: Client, session: TrialSession) -> None:
    body, own = b'{"trial": 0, "answer": "left"}', f"127.0.0.1:{client.port}"
    for host in (
        None,
        "",
        "127.0.0.1",
        "evil.example",
        f"evil.example:{client.port}",
        "127.0.0.1:1",
        f"0.0.0.0:{client.port}",
    ):
        for path, content in (("", None), ("state", None), ("frame/0/0", None), ("answer", body)):
            try:
                status, said = client.ask(path, content, {"Host": host})
            except ConnectionError:
                # closed before the body was read, for these are not requests of HTTP/1.1
                assert not host and content, (host, path)
                continue
            assert status in (400, 421) and session.token.encode() not in said, (host, path)
    for origin in ("http://evil.example", "null", f"https://{own}", "http://127.0.0.1:1", f"http://{own}.evil.example"):
        assert client.ask("answer", body, {"Origin": origin})[0] == 403
        assert client.ask("state", headers={"Origin": origin})[0] == 403
    assert not session.answers
    assert client.ask("state", headers={"Host": f"localhost:{client.port}"})[0] == 200
    assert client.ask("answer", body, {"Origin": f"http://{own}"})[0] == 200


def test_only_who_knows_the_token_is_heard(client: Client, session: TrialSession) -> None:
    body = b'{"trial": 0, "answer": "left"}'
    for token in (None, "", "mine", session.token[:-1], session.token.upper(), "\xe4" * 9):
        for path, content in (("state", None), ("frame/0/0", None), ("answer", body)):
            assert client.ask(path, content, {"X-Token": token})[0] == 403, (token, path)
    assert not session.answers and len(session.token) >= 40


def test_requests_that_never_end_hold_no_threads_and_keep_nobody_out(client: Client, session: TrialSession) -> None:
    before = threading.active_count()
    half = [socket.create_connection(("127.0.0.1", client.port), timeout=10) for _ in range(3 * CONNECTIONS_MAX)]
    for number, one in enumerate(half):
        try:
            one.sendall(b"POST /answer HTTP/1.1\r\nHost: x\r\nContent-Length: 9\r\n\r\n"[: 10 + 20 * (number % 3)])
        except OSError:
            pass  # closed, for there are too many
    try:
        assert client.answer(0) == 200
        assert threading.active_count() <= before + 1
        held = [one for one in psutil.Process().net_connections("inet") if one.laddr and one.laddr.port == client.port]
        assert sum(one.status == psutil.CONN_ESTABLISHED for one in held) <= CONNECTIONS_MAX
    finally:
        for one in half:
            one.close()


def test_an_answer_that_cannot_be_stored_is_not_acknowledged(
    client: Client, session: TrialSession, monkeypatch
) -> None:
    def full(row: object) -> None:
        raise OSError(28, "database or disk is full", "answers.sqlite")

    with monkeypatch.context() as patched:
        patched.setattr(session._store, "add", full)
        status, said = client.ask("answer", b'{"trial": 0, "answer": "left"}')
    assert (status, said) == (507, b"database or disk is full\n") and client.state()["done"] == 0
    assert client.answer(0) == 200 and client.state()["done"] == 1


def test_a_stimulus_that_was_damaged_is_not_shown(client: Client, session: TrialSession, stimuli: Path) -> None:
    frame = stimuli / "planescene/hammersley-box-0008/frame00002.png"
    content = bytearray(frame.read_bytes())
    content[-30] ^= 1
    frame.write_bytes(content)
    status, said = client.ask("frame/1/0")
    assert status == 500 and b"hammersley-box-0008: expected the frames of the manifest, got others" in said
    assert isinstance(session.fault, InputError) and client.ask("frame/0/0")[0] == 200


def test_a_port_that_is_taken_is_named(session: TrialSession) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(InputError, match=f"port: expected a free one, got {port}"):
            with serving(session, port):
                pass


def test_the_table_is_written_when_serving_ends(session: TrialSession) -> None:
    with serving(session) as address:
        assert Client(address, session.token).answer(0) == 200
    assert len(pd.read_parquet(session.folder / TABLE)) == 1 and os.path.exists(session.folder / "answers.sqlite")
