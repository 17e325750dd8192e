"""The peak memory of a process while a block ran, if the system reports it."""

from __future__ import annotations

import sys
from pathlib import Path

import psutil

_STATUS, _FORGET = Path("/proc/self/status"), Path("/proc/self/clear_refs")
_RESIDENT_PEAK = "5"
"""The value that makes Linux begin a new peak. Source: man proc_pid_clear_refs(5)."""


class PeakMemory:
    """A block that records the peak of resident memory while it runs.

    Memory that the process had freed before is returned to the system first, and does not count.

    Attributes:
        bytes: the peak; if the system cannot begin a new one, the peak since the process began.
        grown: the peak minus the memory that the process held when the block began, bytes.
    """

    def __init__(self) -> None:
        self.bytes = self.grown = self._before = 0

    def __enter__(self) -> PeakMemory:
        try:
            psutil.heap_trim()
            _FORGET.write_text(_RESIDENT_PEAK, encoding="utf-8")
            self._before = _status("VmRSS")
        except (OSError, AttributeError):  # not Linux, a C library without trimming, or no permission
            self._before = 0
        return self

    def __exit__(self, *error: object) -> None:
        self.bytes = _peak()
        self.grown = self.bytes - self._before


def _peak() -> int:
    """Peak of resident bytes since the last new peak, or since the process began."""
    if _STATUS.exists():
        return _status("VmHWM")
    if sys.platform == "win32":
        return psutil.Process().memory_info().peak_wset
    import resource  # psutil has no peak on macOS and BSD, and on Linux none that begins anew

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024  # macOS counts bytes, others KiB


def _status(name: str) -> int:
    lines = dict(line.split(":", 1) for line in _STATUS.read_text(encoding="utf-8").splitlines())
    return int(lines[name].split()[0]) * 1024
