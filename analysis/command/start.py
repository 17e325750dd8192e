"""The start of a run: the time until the first cycle has ended, and imports without garbage collection."""

from __future__ import annotations

import atexit
import gc
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import chain, islice
from pathlib import Path
from typing import TypeVar

Item = TypeVar("Item")

_STAT = Path("/proc/self/stat")
_START_FIELD = 22 - 3  # index among the fields after the name: clock ticks from boot to the start of the process


def process_began_s() -> float:
    """Start of this process on the clock of :func:`time.monotonic`, seconds, to within 10 ms."""
    try:
        ticks = int(_STAT.read_text(encoding="utf-8").rpartition(")")[2].split()[_START_FIELD])
        age_s = time.clock_gettime(time.CLOCK_BOOTTIME) - ticks / os.sysconf("SC_CLK_TCK")
    except (OSError, AttributeError):  # not Linux: there psutil is as exact; on Linux it knows whole seconds only
        import psutil

        age_s = time.time() - psutil.Process().create_time()
    return time.monotonic() - age_s


@contextmanager
def first_imports() -> Iterator[None]:
    """Marks a block that imports large packages.

    The objects that an import makes live until the process ends. The garbage collector is switched off during the
    block, and ignores those objects afterwards. At exit it includes them again, because libraries print lists of the
    objects that are left then.
    """
    before, collecting = len(sys.modules), gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            gc.enable()
        if len(sys.modules) > before:
            gc.freeze()
            atexit.register(gc.unfreeze)


def first_made(items: Iterator[Item], began_s: float, say: Callable[[str], None]) -> tuple[Iterator[Item], float]:
    """Makes the first item of a run now, and reports the time that this took since the start.

    Args:
        items: cycles of the adaptive run.
        began_s: the start, on the clock of :func:`time.monotonic`, seconds.
        say: prints one line of text.

    Returns:
        The same items, and the seconds.
    """
    first = list(islice(items, 1))
    seconds = time.monotonic() - began_s
    say(f"first cycle after {seconds:.2f} s")
    return chain(first, items), seconds
