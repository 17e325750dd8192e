"""Free memory: the least that the machine, control groups of both versions and the process leave."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import psutil
import pytest

from tsar.memory import core_count, free_memory_bytes

MIB = 2**20
ROOT = Path(__file__).resolve().parents[2]


def machine(root: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
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
def test_the_limit_that_holds_counts(
    tmp_path: Path, files: dict[str, str], expected: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(psutil, "virtual_memory", lambda: SimpleNamespace(available=1024 * MIB))
    assert free_memory_bytes(machine(tmp_path, files)) // MIB == expected


def test_this_machine_has_memory_and_so_has_one_that_says_nothing(tmp_path: Path) -> None:
    assert 2**20 < free_memory_bytes() < 2**50 and 2**20 < free_memory_bytes(tmp_path) < 2**50


def test_systems_that_tell_less_are_served(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As on macOS, without affinity and limits of memory."""
    assert 1 <= core_count() <= (os.cpu_count() or 1)
    monkeypatch.delattr(psutil.Process, "cpu_affinity")
    assert core_count() == (os.cpu_count() or 1)
    monkeypatch.delattr(psutil.Process, "rlimit")
    monkeypatch.setattr(psutil, "virtual_memory", lambda: SimpleNamespace(available=7 * MIB))
    assert free_memory_bytes(tmp_path) == 7 * MIB


@pytest.mark.parametrize(("limit", "used"), [("RLIMIT_AS", "vms"), ("RLIMIT_DATA", "data")])
def test_limits_of_the_process_hold(limit: str, used: str) -> None:
    """In a process of its own, since a hard limit cannot be raised again."""
    program = f"""
import psutil
from tsar.memory import free_memory_bytes
process = psutil.Process()
held = process.memory_info().{used}
process.rlimit(psutil.{limit}, (held + 64 * {MIB},) * 2)
print(held + 64 * {MIB} - process.memory_info().{used}, free_memory_bytes())
"""
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    left, free = map(int, done.stdout.split())
    assert abs(left - free) <= MIB and 32 * MIB < free <= 64 * MIB


def test_modules_of_single_systems_are_imported_where_others_have_a_way() -> None:
    """Files are locked by filelock and the machine is asked by psutil, which tells no peak of memory on macOS and BSD:
    there ``resource`` does, and Windows takes another way."""
    root, single, found = ROOT, {"fcntl", "resource", "termios", "pwd", "grp"}, []
    for file in (
        f for room in ("tsar", "renderer", "scenes", "analysis", "scripts") for f in (root / room).rglob("*.py")
    ):
        for node in ast.walk(ast.parse(file.read_text())):
            names = [one.name for one in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            found += [(file.relative_to(root).as_posix(), name) for name in names if name in single]
    assert sorted(found) == [("analysis/study/memory.py", "resource")]
