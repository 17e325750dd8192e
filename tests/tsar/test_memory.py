"""Free memory: the least that the machine, control groups of both versions and the process leave."""

from __future__ import annotations

import ast
import os
from pathlib import Path

import pytest

from tsar import memory
from tsar.memory import core_count, free_memory_bytes

MIB = 2**20


def machine(root: Path, files: dict[str, str]) -> Path:
    for name, text in {"proc/meminfo": "MemTotal: 9999999 kB\nMemAvailable:  1048576 kB\n", **files}.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    return root


V2, V1 = "sys/fs/cgroup/", "sys/fs/cgroup/memory/"


@pytest.mark.parametrize(
    ("files", "expected"),
    [
        ({}, 1024),
        ({"proc/self/cgroup": "0::/a/b\n", V2 + "a/b/memory.max": "max\n", V2 + "a/b/memory.current": "5"}, 1024),
        ({"proc/self/cgroup": "0::/a/b\n", V2 + "a/b/memory.max": f"{300 * MIB}\n",
          V2 + "a/b/memory.current": f"{100 * MIB}\n",
          V2 + "a/b/memory.stat": f"anon 5\ninactive_file {50 * MIB}\n"}, 250),
        ({"proc/self/cgroup": "0::/a/b\n", V2 + "a/memory.max": f"{90 * MIB}",
          V2 + "a/memory.current": f"{10 * MIB}"}, 80),
        ({"proc/self/cgroup": "0::/outside\n", V2 + "memory.max": f"{7 * MIB}", V2 + "memory.current": "0"}, 7),
        ({"proc/self/cgroup": "4:cpu:/c\n3:memory:/c\n", V1 + "c/memory.limit_in_bytes": f"{60 * MIB}",
          V1 + "c/memory.usage_in_bytes": f"{20 * MIB}", V1 + "c/memory.stat": f"total_inactive_file {5 * MIB}\n"}, 45),
        ({"proc/self/cgroup": "0::/a\n", V2 + "a/memory.max": "5", V2 + "a/memory.current": "9"}, 0),
    ],
)  # fmt: skip
def test_the_limit_that_holds_counts(tmp_path: Path, files: dict[str, str], expected: int) -> None:
    assert free_memory_bytes(machine(tmp_path, files)) // MIB == expected


def test_this_machine_has_memory_and_so_has_one_that_says_nothing(tmp_path: Path) -> None:
    assert 2**20 < free_memory_bytes() < 2**50 and 2**20 < free_memory_bytes(tmp_path) < 2**50


def test_systems_that_tell_less_are_served(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As on macOS, without affinity; as on Windows, without limits and sizes of memory too."""
    assert 1 <= core_count() <= (os.cpu_count() or 1)
    monkeypatch.delattr(os, "sched_getaffinity")
    assert core_count() == (os.cpu_count() or 1)
    monkeypatch.setattr(memory, "resource", None)
    monkeypatch.delattr(os, "sysconf")
    assert free_memory_bytes(tmp_path) == 1 << 62


def test_modules_of_single_systems_are_imported_where_others_have_a_way() -> None:
    """Files are locked by filelock and the machine is asked by psutil, which tells neither limits of memory nor the
    peak on POSIX: there ``resource`` does, and Windows takes another way."""
    root, single, found = Path(__file__).resolve().parents[2], {"fcntl", "resource", "termios", "pwd", "grp"}, []
    for file in (
        f for room in ("tsar", "renderer", "scenes", "analysis", "scripts") for f in (root / room).rglob("*.py")
    ):
        for node in ast.walk(ast.parse(file.read_text())):
            names = [one.name for one in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            found += [(file.relative_to(root).as_posix(), name) for name in names if name in single]
    assert sorted(found) == [("analysis/study/memory.py", "resource"), ("tsar/memory.py", "resource")]
