"""What every worker of a study does first."""

from __future__ import annotations

import ctypes

from distributed import Worker, WorkerPlugin


class Prepared(WorkerPlugin):
    """Prepares every worker of a study, those that come later too."""

    def setup(self, worker: Worker) -> None:
        """Keeps freed memory, and forgets the scenes of an earlier study."""
        from analysis.study.scenery import forget

        _keep_freed_memory()
        forget()


def _keep_freed_memory() -> None:
    """Makes a worker keep the memory that it frees, in one heap for all of its threads.

    A worker allocates and frees hundreds of images a second. By default glibc returns each to the system, and
    allocating them again takes a third of the worker's time. With another C library this function does nothing.
    """
    arena_max, mmap_threshold, trim_threshold = -8, -3, -1
    try:
        tune = ctypes.CDLL("libc.so.6").mallopt
    except (OSError, AttributeError):
        return
    for option, value in ((arena_max, 1), (mmap_threshold, 1 << 30), (trim_threshold, (1 << 31) - 1)):
        tune(option, value)
