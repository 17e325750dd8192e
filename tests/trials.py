"""Runs tests of a changed checkout, in a copy of it; a part of :mod:`tests.mutants`."""

from __future__ import annotations

import ast
import contextlib
import filecmp
import hashlib
import importlib
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import psutil

from tests.changed import chosen_for, mirrored, used_by
from tests.reach import EVERYTHING
from tests.test_architecture import PACKAGES, ROOT

TESTS_S, FILE_S = 60, 100
"""Seconds of CPU time of tests for one mutant, after which no further file is begun, and most of one file of tests. It
may take three times as much with the code as it is."""
MEMORY_BYTES, FILE_BYTES = 16 << 30, 1 << 30
NONE_FAILED = (0, 5)
"""Exit statuses of pytest: all passed, and none was there."""
STOPPED = (-signal.SIGXCPU, -signal.SIGKILL)
"""Those of tests that took too long, which does not count as noticed: they may also do so with the code as it is."""


def copied(tree: Path) -> None:
    """Makes the copy what the checkout is, uncommitted changes included."""
    if not (tree / ".git").exists():
        subprocess.run(["git", "clone", "-q", "--no-hardlinks", str(ROOT), str(tree)], check=True)
    listed = ("git", "ls-files", "-co", "--exclude-standard")
    here, there = (set(subprocess.check_output(listed, cwd=one, text=True).splitlines()) for one in (ROOT, tree))
    for name in there - here:
        (tree / name).unlink(missing_ok=True)
    for name in here:
        source, target = ROOT / name, tree / name
        if source.is_file() and not (target.is_file() and filecmp.cmp(source, target, shallow=False)):
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)


def become_tests(tree: Path, file: str, only: set[str] | None, note: bool, cpu_s: int) -> int:
    """Turns a forked process into one of pytest in the copy; the exit status."""
    os.setsid()
    handle = os.open(tree.with_suffix(".log"), os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(handle, 1)
    os.dup2(handle, 2)
    resource.setrlimit(resource.RLIMIT_CPU, (cpu_s, cpu_s + 2))
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_FSIZE, (FILE_BYTES, FILE_BYTES))
    for name in [name for name in sys.modules if name.split(".")[0] in (*PACKAGES, "tests")]:
        del sys.modules[name]
    os.chdir(tree)
    sys.path[:] = [str(tree), *(one for one in sys.path if one and Path(one).resolve() != ROOT)]
    importlib.invalidate_caches()
    import pytest

    from tests.reach import Chosen, Noted

    options = ("-x", "-q", "--tb=line", "-rfE", "-p", "no:cacheprovider", "-p", "no:xdist", f"--basetemp={tree}.tests")
    plugins = [Noted(tree, tree.with_suffix(".json"))] if note else [Chosen(only)] if only is not None else []
    return int(pytest.main([*options, file], plugins))


def run(
    tree: Path, file: str, only: set[str] | None = None, note: bool = False, unchanged: bool = False
) -> tuple[int, float, str]:
    """Runs tests of a file, all or only some; may note what each reaches in ``TREE.json``. Bytecode of unchanged code
    is kept.

    Returns:
        Exit status, seconds of CPU time, and the first failure.
    """
    cpu_s, log = 3 * FILE_S if unchanged else FILE_S, tree.with_suffix(".log")
    limit_s = time.monotonic() + 12 * cpu_s
    pid = os.fork()
    if not pid:
        status = 99
        try:
            sys.dont_write_bytecode = not unchanged
            status = become_tests(tree, file, only, note, cpu_s)
        finally:
            os._exit(status)
    while not (ended := os.wait4(pid, os.WNOHANG))[0]:
        if time.monotonic() > limit_s:
            for one in psutil.Process(pid).children(recursive=True):
                with contextlib.suppress(psutil.NoSuchProcess):
                    one.kill()
            os.kill(pid, signal.SIGKILL)
        time.sleep(0.05)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(pid, signal.SIGKILL)
    failures = [line for line in log.read_text(errors="replace").splitlines() if line.startswith(("FAILED", "ERROR"))]
    status = os.waitstatus_to_exitcode(ended[1])
    if status == 99:
        raise RuntimeError(f"pytest did not run: {log.read_text(errors='replace')[-2000:]}")
    return status, ended[2].ru_utime + ended[2].ru_stime, failures[0] if failures else f"status {status}"


class Record:
    """What was found so far, a line each; appended to as it is found."""

    def __init__(self, path: Path) -> None:
        self.path = path
        # a line that a kill cut off has no end
        lines = path.read_text().splitlines(keepends=True) if path.exists() else []
        self.found = {entry["key"]: entry for entry in (json.loads(line) for line in lines if line.endswith("\n"))}
        if lines and not lines[-1].endswith("\n"):
            path.write_text("".join(lines[:-1]))

    def put(self, key: str, **entry: object) -> dict:
        self.found[key] = {"key": key, **entry}
        with self.path.open("a") as lines:
            lines.write(json.dumps(self.found[key]) + "\n")
        return self.found[key]


def digest(*texts: str) -> str:
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()[:16]


def function_at(tree: ast.AST, line: int, names: tuple[str, ...] = ()) -> str | None:
    """Qualified name of the innermost function whose body has a line, or None if it runs at import."""
    for node in ast.iter_child_nodes(tree):
        inside = node.lineno <= line <= (node.end_lineno or 0) if isinstance(node, ast.stmt) else True
        if not inside:
            continue
        if isinstance(node, ast.ClassDef):
            return function_at(node, line, (*names, node.name))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            if line < node.body[0].lineno:
                return None
            own = (*names, node.name)
            return function_at(node, line, (*own, "<locals>")) or ".".join(own)
        if isinstance(node, ast.stmt) and (found := function_at(node, line, names)):
            return found
    return None


class Trial:
    """Runs mutants in a copy.

    Args:
        tree: folder of the copy.
        record: what was found so far.
        reach: whether what tests reach is found out before files of tests are used; otherwise those of which it is not
            known run whole.
    """

    def __init__(self, tree: Path, record: Record, reach: bool) -> None:
        self.tree, self.record, self.reach, self.users = tree, record, reach, used_by(ROOT)
        copied(self.tree)

    def unchanged(self, file: str) -> dict[str, Any] | None:
        """What the tests of a file reach, and their seconds, with the code as it is; no tests if one of them fails.
        None if it is not known and not to be found out."""
        key = digest(file, (ROOT / file).read_text(encoding="utf-8"))
        if key not in self.record.found and self.reach:
            status, seconds, failure = run(self.tree, file, note=True, unchanged=True)
            reached = json.loads(self.tree.with_suffix(".json").read_text()) if status == 0 else {"tests": {}}
            self.record.put(key, file=file, seconds=seconds, failure=failure, **reached)
        return self.record.found.get(key)

    def files_of(self, file: str) -> list[str]:
        """Files of tests for a module: its own first, then the nearest, those that are known to be long later."""
        named, folder = mirrored(ROOT, file)
        nearest = chosen_for(ROOT, file, self.users)
        further = (ROOT / folder).glob("test_*.py") if folder and not named else ()  # those that import it may be few
        found = nearest | {path.relative_to(ROOT).as_posix() for path in further}
        long_s = {one["file"]: one["seconds"] for one in self.record.found.values() if "tests" in one}
        return sorted(found, key=lambda name: (name != named, name not in nearest, long_s.get(name, 20.0), name))

    def reaching(self, name: str, file: str, function: str | None) -> set[str] | None:
        """The tests of a file that reach a function, or None for all. What runs at import is reached by every test
        that calls a function of its file."""
        known = self.unchanged(name)
        if known is None:
            return None
        tests, wanted = known["tests"], f"{file}:{function or ''}"

        def reached(places: Iterable[str]) -> bool:
            return any(one in (wanted, EVERYTHING) or (not function and one.startswith(wanted)) for one in places)

        only = {one for one, (_, places) in tests.items() if reached(places)}
        every = reached(known.get("shared", ())) if function else not only
        return set(tests) if every else only

    def fails_unchanged(self, failure: str) -> bool:
        """Whether a test fails also with the code as it is."""
        test = failure.split(" - ")[0].partition(" ")[2]
        file, _, name = test.partition("::")
        if not name:
            return False
        key = digest(test, (ROOT / file).read_text(encoding="utf-8"))
        if key not in self.record.found:
            self.record.put(key, test=test, status=run(self.tree, file, {test}, unchanged=True)[0])
        return self.record.found[key]["status"] not in NONE_FAILED

    def noticed(self, file: str, line: int, changed: str) -> tuple[bool, str, list[str]]:
        """Whether tests fail with another content of a file, the first failure, and the files that passed."""
        source, target, passing = (ROOT / file).read_text(encoding="utf-8"), self.tree / file, list[str]()
        function, left_s = function_at(ast.parse(source), line), TESTS_S
        for name in self.files_of(file):
            only = self.reaching(name, file, function)
            if only == set() or left_s < 0.0:
                continue
            target.write_text(changed, encoding="utf-8")
            try:
                status, seconds, failure = run(self.tree, name, only)
            finally:
                target.write_text(source, encoding="utf-8")
            left_s -= seconds
            if status not in (*NONE_FAILED, *STOPPED) and not self.fails_unchanged(failure):
                return True, failure, passing
            passing.append(name if status not in STOPPED else f"{name} (did not end)")
        return False, "", passing
