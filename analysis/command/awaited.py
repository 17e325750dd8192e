"""Work that a cluster does: its end, and its files where machines share folders."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from analysis.command.cluster import WAIT_S

if TYPE_CHECKING:
    from distributed import Client, Future

Case = TypeVar("Case")
SEEN_S = 60
"""Seconds until a file of another machine is seen: network file systems keep what they know of a folder this long."""
OTHER_SOURCE = "expected a worker with the source of the command, this one has another; start the workers again with it"
"""What a worker says that runs another source than the process that asked."""
_AGAIN = "the same command goes on with what is missing"


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
        except Exception:  # the connection may raise errors of several libraries
            yield from ((waiting[future], future, f"the scheduler is gone; {_AGAIN}") for future in pending)
            return
        for future in done:
            yield waiting[future], future, _failure(future)
        if done or _has_workers(client):
            seen_s = time.monotonic()
        elif time.monotonic() - seen_s > wait_s:
            reason = f"no worker was there for {wait_s:g} s (--worker-wait-s waits longer); {_AGAIN}"
            yield from ((waiting[future], future, reason) for future in pending)
            return


def _failure(future: Future) -> str | None:
    """The reason why a case has no result, or None if it has one."""
    if future.status == "finished":
        return None
    if future.status == "error":
        error: Any = future.exception()
        return _reason(error)
    return f"the scheduler or its workers were ended; {_AGAIN}"


def _has_workers(client: Client) -> bool:
    try:
        return bool(client.scheduler_info(n_workers=1)["workers"])
    except Exception:  # the connection may raise errors of several libraries
        return False


def _reason(error: BaseException | None) -> str:
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text[:300]}"


def unseen(files: Iterable[Path], wait_s: float = SEEN_S) -> list[Path]:
    """Those of the files, which workers elsewhere have written, that are not here within ``wait_s`` seconds."""
    until_s, missing = time.monotonic() + wait_s, list(files)
    while missing := [file for file in missing if not file.exists()]:
        if time.monotonic() > until_s:
            break
        time.sleep(min(0.5, wait_s))
    return missing


def not_shared(folder: Path) -> str:
    """The reason of a failure: files that workers wrote are not here."""
    return f"workers have written files that are not in {folder} here; all machines must see the same folder --out"
