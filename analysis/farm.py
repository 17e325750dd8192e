"""Many cases over many processes or machines, each durable before it counts.

Cases are independent, so they go through Dask: a cluster on this machine by default, or any other by its address,
whose workers see the same folders and run the same source.
"""

from __future__ import annotations

import contextlib
import ctypes
import logging
import os
import signal
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING, Any

from analysis import limits
from analysis.cases import Case, Scale
from analysis.cli import InputError
from analysis.files import PARTIAL

if TYPE_CHECKING:
    from distributed import Client, Future, LocalCluster

    from analysis.evaluation import Place

_WAIT_S = 30
LOOPBACK = "127.0.0.1"


@dataclass(frozen=True)
class FarmOptions:
    """Where cases are run."""

    workers: int = 0
    """Processes of the local cluster; 0 takes one per core."""
    scheduler: str = ""
    """Address of a running Dask scheduler, such as tcp://host:8786; empty starts a local cluster, which listens on this
    machine only. A scheduler of your own listens where it is told to, and whoever reaches it can run code: keep it in a
    network that you trust, and have its dashboard on loopback (--dashboard-address 127.0.0.1:8787)."""

    def __post_init__(self) -> None:
        limits.within(self, workers=limits.WORKERS)

    @property
    def processes(self) -> int:
        """Processes of the local cluster."""
        return self.workers or len(os.sched_getaffinity(0))

    @property
    def threads(self) -> int:
        """Threads that each of them traces with."""
        return max(1, len(os.sched_getaffinity(0)) // self.processes)


@contextlib.contextmanager
def connected(options: FarmOptions) -> Iterator[Client]:
    """A client of the cluster; a local one ends with the block.

    Raises:
        InputError: nothing answers at the address.
    """
    import dask.config
    from distributed import Client, LocalCluster

    dask.config.set({"distributed.worker.profile.enabled": False})
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # reasons are told in a line
    if options.scheduler:
        try:
            client = Client(options.scheduler, timeout=_WAIT_S)
        except (OSError, ValueError, TimeoutError) as error:
            raise InputError(f"scheduler: nothing answers at {options.scheduler!r} ({error})") from error
        with client:
            yield client
        return
    with contextlib.ExitStack() as held:
        with _interrupts_blocked():
            cluster = held.enter_context(
                LocalCluster(
                    n_workers=options.processes,
                    threads_per_worker=1,
                    processes=True,
                    host=LOOPBACK,
                    dashboard_address=f"{LOOPBACK}:0",  # any free port, so that two studies do not meet
                    memory_limit=0,
                    silence_logs=logging.CRITICAL,
                )
            )
        client = held.enter_context(Client(cluster))
        try:
            yield client
        except KeyboardInterrupt:
            _end_workers(cluster)
            raise


@contextlib.contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """Has threads and processes that are started within not hear of Ctrl-C, which a terminal sends to all of them; this
    thread hears of it after the block."""
    resource_tracker.ensure_running()  # it unblocks interrupts where it is started, so it must not be started within
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _end_workers(cluster: LocalCluster) -> None:
    """Ends workers in the middle of what they do: what counts is on disk, and to wait would take as long as a run."""
    for nanny in cluster.workers.values():
        nanny.auto_restart = False
        if nanny.pid is not None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(nanny.pid, signal.SIGKILL)


def run_cases(
    cases: Sequence[Case], place: Place, options: FarmOptions, on_done: Callable[[int], None] = lambda done: None
) -> tuple[dict[Case, str], dict[Case, str]]:
    """Runs every case whose result is not on disk yet; a case that fails does not stop the others.

    Args:
        cases: what to run; one that occurs twice is run once.
        place: where results and references go; on a cluster, folders that all of its machines see.
        options: the cluster.
        on_done: told how many cases are done.

    Returns:
        The key of every case's result, and the reason of every failure.
    """
    from analysis.evaluation import finished, source_of_results

    source = source_of_results()
    keys = {case: case.key(source) for case in dict.fromkeys(cases)}
    missing = [case for case in keys if finished(keys[case], place) is None]
    done, failures = len(keys) - len(missing), dict[Case, str]()
    on_done(done)
    if not missing:
        return keys, failures
    try:
        with connected(options) as client:
            client.run(_keep_freed_memory, on_error="ignore")
            for case, reason in _outcomes(client, _submit(client, missing, keys, place)):
                if reason is not None:
                    failures[case] = reason
                done += 1
                on_done(done)
    except KeyboardInterrupt:
        if not options.scheduler:  # its workers cannot do it any more
            for left in place.results.rglob(f"*{PARTIAL}*"):
                left.unlink(missing_ok=True)
        raise
    return keys, failures


def _outcomes(client: Client, waiting: dict[Future, Case]) -> Iterator[tuple[Case, str | None]]:
    """Cases as they end, each with the reason why it failed, or None.

    A scheduler that is gone, or that has had no worker for a while, fails all that are left.
    """
    from distributed import wait

    pending, seen_s = set(waiting), time.monotonic()
    while pending:
        try:
            done, pending = wait(pending, timeout=1.0, return_when="FIRST_COMPLETED")
        except TimeoutError:
            done = set[Any]()
        except Exception as error:  # of whatever library the connection is made of
            yield from ((waiting[future], f"the scheduler is gone ({_reason(error)})") for future in pending)
            return
        for future in done:
            yield waiting[future], _failure(future)
        if done or _has_workers(client):
            seen_s = time.monotonic()
        elif time.monotonic() - seen_s > _WAIT_S:
            yield from ((waiting[future], f"no worker was there for {_WAIT_S} s") for future in pending)
            return


def _failure(future: Future) -> str | None:
    """Why a case has no result, or None where it has one."""
    if future.status == "finished":
        return None
    if future.status == "error":
        return _reason(future.exception())
    return "the scheduler or its workers were ended"


def _has_workers(client: Client) -> bool:
    try:
        return bool(client.scheduler_info(n_workers=1)["workers"])
    except Exception:  # of whatever library the connection is made of
        return False


def describe_failures(failures: Mapping[str, str]) -> list[str]:
    """A line for each reason, with the name of the first run that failed for it and how many others did."""
    by_reason: dict[str, list[str]] = {}
    for name, reason in failures.items():
        by_reason.setdefault(reason, []).append(name)
    return [
        f"failed: {names[0]}{f' and {len(names) - 1} more' if len(names) > 1 else ''}: {reason}"
        for reason, names in by_reason.items()
    ]


def _keep_freed_memory() -> None:
    """Has a worker keep the memory it frees, from one heap for all of its threads.

    Images come and go by the hundred a second; glibc would give each back to the system, from the heaps of threads at
    once, and a third of a worker's time would go into having them again. Elsewhere this does nothing.
    """
    arena_max, mmap_threshold, trim_threshold = -8, -3, -1
    try:
        tune = ctypes.CDLL("libc.so.6").mallopt
    except (OSError, AttributeError):
        return
    for option, value in ((arena_max, 1), (mmap_threshold, 1 << 30), (trim_threshold, (1 << 31) - 1)):
        tune(option, value)


def _submit(client: Client, missing: Sequence[Case], keys: dict[Case, str], place: Place) -> dict[Future, Case]:
    """Futures of the cases, each behind that of its reference, in an order in which the references come early."""
    references = {_reference_of(case): None for case in missing}
    behind = {wanted: client.submit(_prepare, *wanted, place, pure=False) for wanted in references}
    return {
        client.submit(_evaluate, case, keys[case], place, behind[_reference_of(case)], pure=False): case
        for case in missing
    }


def _reference_of(case: Case) -> tuple[str, float, float, Scale]:
    return case.input, case.phase, case.start_s, case.scale


def _prepare(input: str, phase: float, start_s: float, scale: Scale, place: Place) -> None:
    from analysis.evaluation import render_reference

    render_reference(input, phase, start_s, scale, place)


def _evaluate(case: Case, key: str, place: Place, reference: None) -> str:
    from analysis.evaluation import evaluate

    return evaluate(case, key, place)


def _reason(error: BaseException | None) -> str:
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text[:300]}"
