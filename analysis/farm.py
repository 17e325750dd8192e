"""Many cases over many processes or machines, each durable before it counts.

Cases are independent, so they go through Dask: a cluster on this machine by default, or any other by its address,
whose workers see the same folders and run the same source.
"""

from __future__ import annotations

import contextlib
import ctypes
import logging
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from analysis import limits
from analysis.cases import Case, Scale
from analysis.cli import InputError

if TYPE_CHECKING:
    from distributed import Client

    from analysis.evaluation import Place

_WAIT_S = 30


@dataclass(frozen=True)
class FarmOptions:
    """Where cases are run."""

    workers: int = 0
    """Processes of the local cluster; 0 takes one per core."""
    scheduler: str = ""
    """Address of a running Dask scheduler, such as tcp://host:8786; empty starts a local cluster."""

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
    logging.getLogger("distributed").setLevel(logging.ERROR)
    if options.scheduler:
        try:
            client = Client(options.scheduler, timeout=_WAIT_S)
        except (OSError, ValueError, TimeoutError) as error:
            raise InputError(f"scheduler: nothing answers at {options.scheduler!r} ({error})") from error
        with client:
            yield client
        return
    cluster = LocalCluster(
        n_workers=options.processes,
        threads_per_worker=1,
        processes=True,
        dashboard_address=":0",  # any free port, so that two studies do not meet
        memory_limit=0,
        silence_logs=logging.ERROR,
    )
    with cluster, Client(cluster) as client:
        yield client


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
    with connected(options) as client:
        client.run(_keep_freed_memory)
        waiting = _submit(client, missing, keys, place)
        from distributed import as_completed

        for future in as_completed(list(waiting)):
            error = future.exception()
            if error is not None:
                failures[waiting[future]] = _reason(error)
            done += 1
            on_done(done)
    return keys, failures


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


def _submit(client: Client, missing: Sequence[Case], keys: dict[Case, str], place: Place) -> dict[Any, Case]:
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


def _reason(error: BaseException) -> str:
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text[:300]}"
