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
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING, Literal

from analysis.command import limits
from analysis.command.cli import InputError
from analysis.command.extras import has_module, installed_by
from analysis.command.interrupts import SIGNALS
from tsar.config import closed_choices, require
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
    """Seconds without any worker after which a command stops waiting; workers may wait long in a queue of jobs."""
    log_level: Literal["critical", "error", "warning", "info"] = "warning"
    """Least severe messages of Dask that are shown."""

    def __post_init__(self) -> None:
        limits.within(self, workers=limits.WORKERS, workers_least=(0, self.processes), memory_limit_gib=(0.0, 1e5))
        limits.within(self, retries=(0, 100), worker_wait_s=limits.WORKER_WAITS_S)
        placed = not self.scheduler or _place_of(self.scheduler) is not None
        require(placed, "scheduler", "an address such as tcp://host:8786", self.scheduler)
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
        except MemoryError as error:  # the length of a message, read from another protocol
            raise _silent(options.scheduler, "what does is no scheduler of Dask") from error
        except (OSError, ValueError, TimeoutError) as error:
            reason = str(error) or f"it accepts connections, but sends no greeting within {WAIT_S} s"
            raise _silent(options.scheduler, reason) from error
        logging.getLogger("distributed.client").addFilter(_NO_TRACEBACKS)
        with client:
            say(dashboard_of(client, elsewhere=True))
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
        say(dashboard_of(client, elsewhere=False))
        try:
            yield client
        except KeyboardInterrupt:
            logging.getLogger("distributed").setLevel(logging.CRITICAL)  # the end of workers is wanted
            _end_workers(cluster)
            raise


def dashboard_of(client: Client, elsewhere: bool) -> str:
    """One line: the address of the dashboard, or why there is none.

    Args:
        client: a client of the scheduler.
        elsewhere: whether the scheduler is not of this process, so that its packages and its network are others.
    """
    if not _has_bokeh(client, elsewhere):
        where = " on the scheduler's machine" if elsewhere else ""
        return f"dashboard of Dask: none, because the package bokeh is not installed{where}; {installed_by('study')}"
    link, port = client.dashboard_link or "", client.scheduler_info()["services"].get("dashboard")
    if elsewhere and not port:
        return "dashboard of Dask: none, because the scheduler was started without it"
    try:
        if elsewhere:
            _require_port(link.removesuffix("/status").replace("http", "tcp", 1))
    except OSError:
        place = f"{LOOPBACK}:{port}"
        return f"dashboard of Dask: {place} on the scheduler's machine alone; ssh -L {port}:{place} forwards it"
    return f"dashboard of Dask: {link}"


def _has_bokeh(client: Client, elsewhere: bool) -> bool:
    if not elsewhere:
        return has_module("bokeh")
    try:
        client.run_on_scheduler(version, "bokeh")  # a function that every scheduler has, whatever its source
    except PackageNotFoundError:
        return False
    return True


class _NoTracebacks(logging.Filter):
    """Drops what the client of a scheduler that went away logs: tracebacks of its tries to connect again."""

    def filter(self, record: logging.LogRecord) -> bool:
        return record.exc_info is None


_NO_TRACEBACKS = _NoTracebacks()


def _require_port(address: str) -> None:
    """Raises OSError if nothing listens at an address: a client would retry until its timeout."""
    place = _place_of(address)
    if place:
        socket.create_connection(place, CONNECT_S).close()


def _place_of(address: str) -> tuple[str, int] | tuple[()] | None:
    """Host and port of an address; none for a transport that has no ports, None for an address without them."""
    transport, _, place = address.rpartition("://")
    if transport not in ("", "tcp", "tls", "ws", "wss"):
        return ()
    host, _, port = place.rpartition(":")
    return (host.strip("[]"), int(port)) if host and port.isdecimal() else None


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
