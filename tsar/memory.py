"""Memory that this process can still allocate, the least of what the machine, its containers and its own limits leave;
and the cores that it may use. Systems other than Linux report fewer of these limits."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

try:
    import resource
except ModuleNotFoundError:  # Windows
    resource = None


def core_count() -> int:
    """Number of CPU cores this process may use; all cores of the machine where the system does not report it."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def free_memory_bytes(root: Path = Path("/")) -> int:
    """Bytes that can be allocated. The page cache counts as free, because the system releases it on demand.

    Args:
        root: directory that contains ``proc`` and ``sys``.
    """
    found = [*_machine(root), *_control_groups(root), *_process(root)]
    return max(0, min(found) if found else _whole())


def _whole() -> int:
    """Total memory of the machine, bytes, for systems that do not report free memory; 2^62 where it is unknown too."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return 1 << 62


def _machine(root: Path) -> Iterator[int]:
    for name, value in _table(root / "proc/meminfo"):
        if name == "MemAvailable:":
            yield value * 1024


def _process(root: Path) -> Iterator[int]:
    """Bytes left by ``ulimit -v`` and by ``ulimit -d``."""
    if resource is None:
        return
    used = dict(_table(root / "proc/self/status"))
    for limit, name in ((resource.RLIMIT_AS, "VmSize:"), (resource.RLIMIT_DATA, "VmData:")):
        most, _ = resource.getrlimit(limit)
        if most != resource.RLIM_INFINITY and name in used:
            yield most - used[name] * 1024


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
        return path.read_text().splitlines()
    except OSError:
        return []
