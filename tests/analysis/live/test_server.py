"""The server of a live view: pages that close early leave, and its address can be opened."""

from __future__ import annotations

import asyncio
import re
import threading
import urllib.request
from types import SimpleNamespace
from typing import Any

import pytest
from tornado.websocket import websocket_connect

from analysis.live.hub import Watcher
from analysis.live.server import watching
from tests.analysis.live.builders import until


class _Slow:
    """A hub at which a page takes a while to come."""

    def __init__(self) -> None:
        self.begun, self.go_on, self.gone = threading.Event(), threading.Event(), []

    def came(self) -> Watcher:
        self.begun.set()
        self.go_on.wait(30.0)
        return Watcher(7)

    def left(self, watcher: Watcher) -> None:
        self.gone.append(watcher.number)


def test_a_page_that_closes_while_it_comes_leaves() -> None:
    hub: Any = _Slow()
    with watching(hub, "chase") as address:
        token = re.findall(r'name="token" content="([^"]+)"', urllib.request.urlopen(address).read().decode())[0]

        async def opened_and_closed() -> None:
            socket = await websocket_connect(f"{address.replace('http', 'ws')}watch?token={token}")
            await asyncio.to_thread(hub.begun.wait, 30.0)
            socket.close()
            assert await socket.read_message() is None

        asyncio.run(opened_and_closed())
        hub.go_on.set()
        until(lambda: hub.gone)
    assert hub.gone == [7]


@pytest.mark.parametrize(("host", "shown"), [("", "0.0.0.0"), ("::1", "[::1]")])
def test_addresses_can_be_opened(host: str, shown: str) -> None:
    try:
        with watching(SimpleNamespace(), "chase", host=host) as address:  # type: ignore[arg-type]
            assert address.startswith(f"http://{shown}:")
            assert urllib.request.urlopen(address).status == 200
    except ValueError as error:
        if host != "::1":
            raise
        pytest.skip(f"no IPv6 here: {error}")
