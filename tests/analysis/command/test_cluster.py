"""What a local cluster leaves behind when its workers are killed, and schedulers that do not answer."""

from __future__ import annotations

import socket
import subprocess
import sys
import threading
from types import SimpleNamespace
from typing import Any

import pytest

from analysis.command import cluster
from analysis.command.cli import InputError
from tests.scripts.commands import ROOT

LOST = """
import os
from multiprocessing import resource_tracker
from analysis.command.cluster import _interrupts_blocked
with _interrupts_blocked():
    resource_tracker.register("/nobody", "semaphore")
os._exit(0)
"""


def test_semaphores_of_killed_workers_are_not_reported() -> None:
    """The semaphore tracker ends after this process, so its output would follow the one line of an interrupt."""
    done = subprocess.run([sys.executable, "-c", LOST], cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.fixture
def port():
    """A bound socket that does not listen: its port is closed, and nobody else takes it."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        yield taken


def test_a_closed_port_is_told_before_a_client_tries_for_long(
    port: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("distributed.Client", lambda *_, **__: pytest.fail("a client tries until its time is up"))
    address = f"tcp://127.0.0.1:{port.getsockname()[1]}"
    with pytest.raises(InputError) as caught, cluster.connected(cluster.ClusterOptions(scheduler=address)):
        pass
    told = str(caught.value)
    with pytest.raises(InputError) as early:
        cluster.ClusterOptions(scheduler=address).require_port()
    assert str(early.value) == told
    assert told.startswith(f"scheduler: nothing answers at '{address}' (") and "refused" in told and "\n" not in told


def test_a_port_that_accepts_but_does_not_speak_the_protocol_is_refused(
    port: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "WAIT_S", 0.3)
    port.listen()
    address = f"tcp://127.0.0.1:{port.getsockname()[1]}"
    with pytest.raises(InputError, match="sends no greeting"), cluster.connected(cluster.ClusterOptions(0, address)):
        pass


def test_a_port_of_another_protocol_is_refused(port: socket.socket, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first bytes of an answer by HTTP, read as the length of a message, are more memory than any machine has."""
    port.listen()

    def answer() -> None:
        taken, _ = port.accept()
        with taken:
            taken.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")
            taken.recv(1 << 16)

    threading.Thread(target=answer, daemon=True).start()
    address = f"tcp://127.0.0.1:{port.getsockname()[1]}"
    with monkeypatch.context() as patch:
        patch.setattr(cluster, "_require_port", lambda address: None)
        with pytest.raises(InputError, match="no scheduler"), cluster.connected(cluster.ClusterOptions(0, address)):
            pass


def test_a_dashboard_elsewhere_is_told_as_it_can_be_reached(port: socket.socket) -> None:
    """Its scheduler may show it on loopback alone, lack bokeh, or run without it."""
    number = port.getsockname()[1]

    def told(package: str = "pytest", services: dict[str, int] | None = None) -> str:
        scheduler: Any = SimpleNamespace(
            run_on_scheduler=lambda function, name: function(package),
            dashboard_link=f"http://127.0.0.1:{number}/status",
            scheduler_info=lambda: {"services": {"dashboard": number} if services is None else services},
        )
        return cluster.dashboard_of(scheduler, elsewhere=True)

    assert "bokeh is not installed on the scheduler's machine" in told(package="nothing-of-this-name")
    assert told(services={}).endswith("the scheduler was started without it")
    assert f"127.0.0.1:{number} on the scheduler's machine alone" in told()
    port.listen()
    assert told() == f"dashboard of Dask: http://127.0.0.1:{number}/status"


def test_a_dead_scheduler_is_told_before_slow_imports(port: socket.socket) -> None:
    address = f"tcp://127.0.0.1:{port.getsockname()[1]}"
    program = (
        f"import sys; sys.argv = ['suitability', '--scheduler', '{address}']\n"
        "from analysis.suitability.command import main\ntry: main()\n"
        "except ValueError as error:\n"
        "    print('refused' in str(error), *(one in sys.modules for one in ('torch', 'distributed')))"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout == "True False False\n", done.stderr
