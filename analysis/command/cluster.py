"""Processes and machines that share work: a Dask cluster, by default on this machine, or any other by its address.

Workers of another cluster must see the same folders and run the same source code.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import signal
import socket
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from analysis.command import limits
from analysis.command.cli import InputError
from analysis.command.extras import has_module, installed_by
from analysis.command.interrupts import SIGNALS
from tsar.config import closed_choices, require
from tsar.memory import core_count

if TYPE_CHECKING:
    from distributed import Client, Future, LocalCluster

Case = TypeVar("Case")
WAIT_S = 30
"""Seconds to wait for an answer of a busy scheduler, or of a worker."""
CONNECT_S = 3
"""Seconds that a connection to a scheduler's port may take: the system accepts it even if the scheduler is busy."""
LOOPBACK = "127.0.0.1"
_QUIET = "ignore:resource_tracker:UserWarning"
"""An option of Python that silences the semaphore tracker about semaphores of killed workers, which it removes."""


@dataclass(frozen=True)
@closed_choices()
class ClusterOptions:
    """Where cases run."""

    workers: int = 0
    """Processes of the local cluster; 0 takes one per core."""
    scheduler: str = ""
    """Address of a running Dask scheduler, such as tcp://host:8786; empty starts a local cluster, which listens on this
    machine only. Anyone who reaches a scheduler of your own can run code on its workers: keep it in a network that you
    trust, and its dashboard on loopback (--dashboard-address 127.0.0.1:8787)."""
    workers_least: int = 0
    """Least number of processes of the local cluster, which then starts with these and adds others while work waits; 0
    starts all at once."""
    memory_limit_gib: float = 0.0
    """Most memory of each process of the local cluster, GiB; one that exceeds it is ended, and its run tried again. 0
    sets no limit."""
    retries: int = 0
    """Number of times that what failed is tried again; 0 for no run of a study, and 5 times for tiles."""
    worker_wait_s: float = WAIT_S
    """Seconds without any worker after which the runs of a study fail; workers may wait long in a queue of jobs."""
    log_level: Literal["critical", "error", "warning", "info"] = "warning"
    """Least severe messages of Dask that are shown."""

    def __post_init__(self) -> None:
        limits.within(self, workers=limits.WORKERS, workers_least=(0, self.processes), memory_limit_gib=(0.0, 1e5))
        limits.within(self, retries=(0, 100), worker_wait_s=(1.0, 1e6))
        alone = "none together with a scheduler, whose own cluster sets it"
        for name in ("workers_least", "memory_limit_gib") if self.scheduler else ():
            require(not getattr(self, name), name, alone, getattr(self, name))

    def require_port(self) -> None:
        """Checks that something listens at the scheduler's address, without importing Dask.

        Raises:
            InputError: nothing does.
        """
        try:
            _require_port(self.scheduler)
        except (OSError, OverflowError) as error:
            raise _silent(self.scheduler, error) from error

    @property
    def processes(self) -> int:
        """Processes of the local cluster."""
        return self.workers or core_count()

    @property
    def threads(self) -> int:
        """Threads for tracing in each of these processes."""
        return max(1, core_count() // self.processes)


@contextlib.contextmanager
def connected(options: ClusterOptions, say: Callable[[str], None] = lambda line: None) -> Iterator[Client]:
    """A client of the cluster; a local cluster ends with the block.

    Args:
        options: the cluster.
        say: prints a line: the address of the dashboard.

    Raises:
        InputError: nothing answers at the address.
    """
    import dask.config
    from distributed import Client, LocalCluster

    level = logging.getLevelNamesMapping()[options.log_level.upper()]
    dask.config.set({"distributed.worker.profile.enabled": False})
    logging.getLogger("distributed").setLevel(level)
    if options.scheduler:
        try:
            _require_port(options.scheduler)
            asyncio.run(_greeted(options.scheduler))
            client = Client(options.scheduler, timeout=WAIT_S)
        except (OSError, ValueError, TimeoutError) as error:
            reason = str(error) or f"it accepts connections, but sends no greeting within {WAIT_S} s"
            raise _silent(options.scheduler, reason) from error
        with client:
            say(dashboard_of(client))
            yield client
        return
    with contextlib.ExitStack() as held:
        with _interrupts_blocked():
            cluster = LocalCluster(
                n_workers=options.workers_least or options.processes,
                threads_per_worker=1,
                processes=True,
                host=LOOPBACK,
                dashboard_address=f"{LOOPBACK}:0",  # any free port, so that two studies do not collide
                memory_limit=round(options.memory_limit_gib * 2**30),
                silence_logs=level,
            )
            held.enter_context(cluster)
        if options.workers_least:
            cluster.adapt(minimum=options.workers_least, maximum=options.processes)
        client = held.enter_context(Client(cluster))
        say(dashboard_of(client))
        try:
            yield client
        except KeyboardInterrupt:
            logging.getLogger("distributed").setLevel(logging.CRITICAL)  # the end of workers is wanted
            _end_workers(cluster)
            raise


def ended(
    client: Client, waiting: Mapping[Future, Case], wait_s: float = WAIT_S
) -> Iterator[tuple[Case, Future, str | None]]:
    """Cases as their futures end, each with the reason for its failure, or None.

    If the scheduler is gone, or has had no worker for ``wait_s`` seconds, all remaining cases fail.
    """
    from distributed import wait

    pending, seen_s = set(waiting), time.monotonic()
    while pending:
        try:
            outcome: Any = wait(pending, timeout=1.0, return_when="FIRST_COMPLETED")
            done, pending = outcome
        except TimeoutError:
            done = set[Any]()
        except Exception as error:  # the connection may raise errors of several libraries
            yield from ((waiting[future], future, f"the scheduler is gone ({_reason(error)})") for future in pending)
            return
        for future in done:
            yield waiting[future], future, _failure(future)
        if done or _has_workers(client):
            seen_s = time.monotonic()
        elif time.monotonic() - seen_s > wait_s:
            yield from ((waiting[future], future, f"no worker was there for {wait_s:g} s") for future in pending)
            return


def _failure(future: Future) -> str | None:
    """The reason why a case has no result, or None if it has one."""
    if future.status == "finished":
        return None
    if future.status == "error":
        error: Any = future.exception()
        return _reason(error)
    return "the scheduler or its workers were ended"


def _has_workers(client: Client) -> bool:
    try:
        return bool(client.scheduler_info(n_workers=1)["workers"])
    except Exception:  # the connection may raise errors of several libraries
        return False


def _reason(error: BaseException | None) -> str:
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text[:300]}"


def dashboard_of(client: Client) -> str:
    """One line: the address of the dashboard, or why there is none."""
    if not has_module("bokeh"):
        return f"dashboard of Dask: none, because the package bokeh is not installed; {installed_by('study')}"
    return f"dashboard of Dask: {client.dashboard_link}"


def _require_port(address: str) -> None:
    """Raises OSError if nothing listens at an address: a client would retry until its timeout."""
    transport, _, place = address.rpartition("://")
    host, _, port = place.rpartition(":")
    if transport in ("", "tcp", "tls", "ws", "wss") and host and port.isdecimal():
        socket.create_connection((host.strip("[]"), int(port)), CONNECT_S).close()


def _silent(address: str, reason: object) -> InputError:
    """The error to report if nothing answers at an address."""
    return InputError(f"scheduler: nothing answers at {address!r} ({reason})")


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
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
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
    import psutil

    for nanny in cluster.workers.values():
        nanny.auto_restart = False
        if nanny.pid is not None:
            with contextlib.suppress(psutil.NoSuchProcess):
                psutil.Process(nanny.pid).kill()
