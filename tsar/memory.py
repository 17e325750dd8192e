"""Memory that this process can still allocate, the least of what the machine, containers and its own limits leave; and
the cores that it may use. Systems other than Linux tell less of it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

try:
    import resource
except ModuleNotFoundError:  # Windows
    resource = None


def core_count() -> int:
    """Number of CPU cores this process may use; all of the machine's where the system does not tell."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def free_memory_bytes(root: Path = Path("/")) -> int:
    """Bytes that can be allocated. The cache of files counts as free, for the system gives it back.

    Args:
        root: where ``proc`` and ``sys`` lie.
    """
    found = [*_machine(root), *_groups(root), *_process(root)]
    return max(0, min(found) if found else _whole())


def _whole() -> int:
    """What the machine has where it does not tell what is free; without a bound where it tells neither."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return 1 << 62


def _machine(root: Path) -> Iterator[int]:
    for name, value in _table(root / "proc/meminfo"):
        if name == "MemAvailable:":
            yield value * 1024


def _process(root: Path) -> Iterator[int]:
    """What ``ulimit -v`` and ``ulimit -d`` leave."""
    if resource is None:
        return
    used = dict(_table(root / "proc/self/status"))
    for limit, name in ((resource.RLIMIT_AS, "VmSize:"), (resource.RLIMIT_DATA, "VmData:")):
        most, _ = resource.getrlimit(limit)
        if most != resource.RLIM_INFINITY and name in used:
            yield most - used[name] * 1024


def _groups(root: Path) -> Iterator[int]:
    """What the control groups of this process, of either version, and those above them leave."""
    for line in _lines(root / "proc/self/cgroup"):
        _, controllers, name = line.split(":", 2)
        if controllers and "memory" not in controllers.split(","):
            continue
        mount = root / "sys/fs/cgroup" / ("memory" if controllers else "")
        names = ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")
        limit, usage, cached = names if controllers else ("memory.max", "memory.current", "inactive_file")
        # within a container the name may be that outside of it, and the mount is the group itself
        for folder in {mount, *(mount / part for part in (Path(name[1:]), *Path(name[1:]).parents))}:
            most, used = (_number(folder / file) for file in (limit, usage))
            if most is not None and used is not None:
                yield most - used + dict(_table(folder / "memory.stat")).get(cached, 0)


def _number(path: Path) -> int | None:
    """The number in a file; None where there is no such file, or where it holds the word ``max``."""
    text = "".join(_lines(path)).strip()
    return int(text) if text.isdecimal() else None


def _table(path: Path) -> Iterator[tuple[str, int]]:
    """Names and numbers of lines that begin with both."""
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
