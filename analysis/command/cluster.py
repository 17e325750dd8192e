"""Processes and machines that share work: a Dask cluster, by default on this machine, or any other by its address.

Workers of another cluster must see the same folders and run the same source code.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import signal
import socket
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING

from analysis.command import limits
from analysis.command.cli import InputError
from analysis.command.interrupts import SIGNALS
from tsar.memory import core_count

if TYPE_CHECKING:
    from distributed import Client, LocalCluster

WAIT_S = 30
"""Seconds to wait for an answer of a busy scheduler, or of a worker."""
CONNECT_S = 3
"""Seconds that a connection to a scheduler's port may take: the system accepts it even if the scheduler is busy."""
LOOPBACK = "127.0.0.1"
_QUIET = "ignore:resource_tracker:UserWarning"
"""An option of Python that silences the semaphore tracker about semaphores of killed workers, which it removes."""


@dataclass(frozen=True)
class ClusterOptions:
    """Where cases run."""

    workers: int = 0
    """Processes of the local cluster; 0 takes one per core."""
    scheduler: str = ""
    """Address of a running Dask scheduler, such as tcp://host:8786; empty starts a local cluster, which listens on this
    machine only. Anyone who reaches a scheduler of your own can run code on its workers: keep it in a network that you
    trust, and its dashboard on loopback (--dashboard-address 127.0.0.1:8787)."""

    def __post_init__(self) -> None:
        limits.within(self, workers=limits.WORKERS)

    @property
    def processes(self) -> int:
        """Processes of the local cluster."""
        return self.workers or core_count()

    @property
    def threads(self) -> int:
        """Threads for tracing in each of these processes."""
        return max(1, core_count() // self.processes)


@contextlib.contextmanager
def connected(options: ClusterOptions) -> Iterator[Client]:
    """A client of the cluster; a local cluster ends with the block.

    Raises:
        InputError: nothing answers at the address.
    """
    import dask.config
    from distributed import Client, LocalCluster

    dask.config.set({"distributed.worker.profile.enabled": False})
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # each failure is reported in one line
    if options.scheduler:
        try:
            _require_port(options.scheduler)
            asyncio.run(_greeted(options.scheduler))
            client = Client(options.scheduler, timeout=WAIT_S)
        except (OSError, ValueError, TimeoutError) as error:
            reason = str(error) or f"it accepts connections, but sends no greeting within {WAIT_S} s"
            raise InputError(f"scheduler: nothing answers at {options.scheduler!r} ({reason})") from error
        with client:
            yield client
        return
    with contextlib.ExitStack() as held:
        with _interrupts_blocked():
            cluster = LocalCluster(
                n_workers=options.processes,
                threads_per_worker=1,
                processes=True,
                host=LOOPBACK,
                dashboard_address=f"{LOOPBACK}:0",  # any free port, so that two studies do not collide
                memory_limit=0,
                silence_logs=logging.CRITICAL,
            )
            held.enter_context(cluster)
        client = held.enter_context(Client(cluster))
        try:
            yield client
        except KeyboardInterrupt:
            _end_workers(cluster)
            raise


def _require_port(address: str) -> None:
    """Raises OSError if nothing listens at an address: a client would retry until its timeout."""
    from distributed.comm.addressing import parse_address, parse_host_port

    transport, place = parse_address(address)
    if transport in ("tcp", "tls", "ws", "wss"):
        host, port = parse_host_port(place)
        socket.create_connection((host, port), CONNECT_S).close()


async def _greeted(address: str) -> None:
    """Raises OSError if what listens at an address does not speak Dask's protocol: a client would wait forever."""
    from distributed.comm.core import connect

    comm = await asyncio.wait_for(connect(address, timeout=WAIT_S), WAIT_S)
    await comm.close()


@contextlib.contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """Threads and processes that are started in the block ignore Ctrl-C, which a terminal sends to all of them; this
    thread receives it after the block.

    An earlier thread can still take the signal. Python would then raise KeyboardInterrupt here, inside libraries that
    may lose it, so the signal is recorded instead.
    """
    if _QUIET not in sys.warnoptions:
        sys.warnoptions.append(_QUIET)
    resource_tracker.ensure_running()  # its start unblocks interrupts, so it must start before the block
    heard = list[int]()
    handlers = {number: signal.signal(number, lambda number, frame: heard.append(number)) for number in SIGNALS}
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        for number, handler in handlers.items():
            signal.signal(number, handler)
    if heard:
        signal.raise_signal(signal.SIGINT)


def _end_workers(cluster: LocalCluster) -> None:
    """Kills the workers. Finished results are on disk, and waiting would take as long as a run."""
    for nanny in cluster.workers.values():
        nanny.auto_restart = False
        if nanny.pid is not None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(nanny.pid, signal.SIGKILL)
