"""Memory that this process can still allocate, the least of what the machine, its containers and its own limits leave;
and the cores that it may use. Systems other than Linux report fewer of these limits.

psutil is imported when it is asked: a Python without packages must reach the line that says so."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path


def core_count() -> int:
    """Number of CPU cores this process may use; all cores of the machine on macOS, which has no affinity."""
    import psutil

    process = psutil.Process()
    if hasattr(process, "cpu_affinity"):
        return len(process.cpu_affinity() or ())
    return os.cpu_count() or 1


def free_memory_bytes(root: Path = Path("/")) -> int:
    """Bytes that can be allocated. The page cache counts as free, because the system releases it on demand.

    Args:
        root: directory that contains the ``proc`` and ``sys`` of control groups.
    """
    import psutil

    return max(0, min([psutil.virtual_memory().available, *_control_groups(root), *_process()]))


def _process() -> Iterator[int]:
    """Bytes left by ``ulimit -v`` and by ``ulimit -d``. macOS does not enforce the first, and Windows has neither."""
    import psutil

    process = psutil.Process()
    if not hasattr(process, "rlimit"):
        return
    used = process.memory_info()
    for limit, held in ((psutil.RLIMIT_AS, used.vms), (psutil.RLIMIT_DATA, used.data)):
        most, _ = process.rlimit(limit)
        if most != psutil.RLIM_INFINITY:
            yield most - held


def _control_groups(root: Path) -> Iterator[int]:
    """Bytes left by the control groups of this process and by their ancestors, in versions 1 and 2 of cgroups."""
    for line in _lines(root / "proc/self/cgroup"):
        _, controllers, name = line.split(":", 2)
        if controllers and "memory" not in controllers.split(","):
            continue
        mount = root / "sys/fs/cgroup" / ("memory" if controllers else "")
        names = ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")
        limit, usage, cached = names if controllers else ("memory.max", "memory.current", "inactive_file")
        # within a container the name may be the one outside of it, and the mount point is the group itself
        for folder in {mount, *(mount / part for part in (Path(name[1:]), *Path(name[1:]).parents))}:
            most, used = (_number(folder / file) for file in (limit, usage))
            if most is not None and used is not None:
                yield most - used + dict(_table(folder / "memory.stat")).get(cached, 0)


def _number(path: Path) -> int | None:
    """The number in a file; None if there is no such file or it does not hold a number, as ``max``."""
    text = "".join(_lines(path)).strip()
    return int(text) if text.isdecimal() else None


def _table(path: Path) -> Iterator[tuple[str, int]]:
    """The name and the number of every line that begins with both."""
    for line in _lines(path):
        name, _, rest = line.replace("\t", " ").partition(" ")
        value = rest.strip().partition(" ")[0]
        if value.isdecimal():
            yield name, int(value)


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="utf-8").splitlines()
    except OSError:
        return []
