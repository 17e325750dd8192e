"""Memory that this process can still allocate: the least of what the machine, containers and its own limits leave."""

from __future__ import annotations

import os
import resource
from collections.abc import Iterator
from pathlib import Path


def free_memory_bytes(root: Path = Path("/")) -> int:
    """Bytes that can be allocated. The cache of files counts as free, for the system gives it back.

    Args:
        root: where ``proc`` and ``sys`` lie.
    """
    found = [*_machine(root), *_groups(root), *_process(root)]
    return max(0, min(found, default=os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")))


def _machine(root: Path) -> Iterator[int]:
    for name, value in _table(root / "proc/meminfo"):
        if name == "MemAvailable:":
            yield value * 1024


def _process(root: Path) -> Iterator[int]:
    """What ``ulimit -v`` and ``ulimit -d`` leave."""
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
