"""Changes the code in one place at a time and runs the tests nearest to it: ``python -m tests.mutants --count 300``.

A mutant is one change by an operator of cosmic-ray, such as ``<`` to ``<=`` or 3 to 4. All mutants of :data:`MUTATED`
are listed by file and line, and every k-th is drawn, so every module has its share. They run in random order in a copy
of the checkout, each in a process of its own that is forked after the libraries are loaded. What was found is kept in
``OUT/found.jsonl``; the command continues where it ended. Annotations are not changed.
"""

from __future__ import annotations

import ast
import contextlib
import csv
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
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import psutil

from tests.changed import chosen_for, mirrored, used_by
from tests.test_architecture import PACKAGES, ROOT

MUTATED = ("tsar", "analysis/metrics", "analysis/storage")
LIBRARIES = (
    "torch warp pandas pyarrow.parquet scipy.stats xarray matplotlib.pyplot PIL.Image tyro kornia pytest hypothesis "
    "beartype jaxtyping"
).split()
"""Loaded once; every mutant's process has them from the beginning."""
TESTS_S = 180.0
"""Most seconds of tests for one mutant; a file that would exceed it is left out."""
MEMORY_BYTES, FILE_BYTES = 16 << 30, 1 << 30
_NO_TESTS = 5


@dataclass(frozen=True)
class Options:
    """Options of the command line.

    Attributes:
        out: folder of what was found, and of the copy of the checkout.
        count: mutants that are drawn.
        seed: decides which.
        again: whether those that survived are tried again, with the tests as they are now.
    """

    out: Path = Path("out/mutants")
    count: int = 300
    seed: int = 0
    again: bool = False


@dataclass(frozen=True, order=True)
class Mutant:
    """One change: the n-th place at which an operator of cosmic-ray applies to a file."""

    file: str
    line: int
    column: int
    operator: str
    occurrence: int

    def applied(self, source: str) -> str:
        from cosmic_ray.mutating import mutate_code
        from cosmic_ray.plugins import get_operator

        return mutate_code(source, get_operator(self.operator)(), self.occurrence) or source


def never_run(tree: ast.AST) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Beginnings and ends of annotations and of what only type checkers read."""
    nodes: list[ast.AST | None] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            nodes.append(node.returns)
        elif isinstance(node, ast.AnnAssign | ast.arg):
            nodes.append(node.annotation)
        elif isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            nodes.append(node)
    places = [node for node in nodes if isinstance(node, ast.expr | ast.stmt)]
    return [((n.lineno, n.col_offset), (n.end_lineno or n.lineno, n.end_col_offset or 0)) for n in places]


def mutants_of(file: str, source: str) -> Iterator[Mutant]:
    """All mutants of a file."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.plugins import get_operator, operator_names

    left_out, nodes = never_run(ast.parse(source)), list(ast_nodes(get_ast(source)))
    for name in operator_names():
        operator = get_operator(name)
        if operator.arguments():
            continue
        places = (start for node in nodes for start, _ in operator().mutation_positions(node))
        for occurrence, start in enumerate(places):
            if not any(first <= start < last for first, last in left_out):
                yield Mutant(file, *start, name, occurrence)


def drawn(count: int, seed: int) -> tuple[list[Mutant], int]:
    """A sample in random order, and how many mutants there are."""
    files = sorted(path.relative_to(ROOT).as_posix() for room in MUTATED for path in (ROOT / room).rglob("*.py"))
    every = sorted(one for file in files for one in mutants_of(file, (ROOT / file).read_text(encoding="utf-8")))
    rng = np.random.default_rng(seed)
    places = (rng.random() + np.arange(count)) * len(every) / count
    return [every[int(place)] for place in rng.permutation(places)], len(every)


# --- running tests in a copy -----------------------------------------------------------------------------------------


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


def become_tests(tree: Path, test: str, cpu_s: float, log: Path) -> int:
    """Turns a forked process into one of pytest in the copy; the exit status."""
    os.setsid()
    handle = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(handle, 1)
    os.dup2(handle, 2)
    resource.setrlimit(resource.RLIMIT_CPU, (int(cpu_s) + 1, int(cpu_s) + 3))
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_FSIZE, (FILE_BYTES, FILE_BYTES))
    for name in [name for name in sys.modules if name.split(".")[0] in (*PACKAGES, "tests")]:
        del sys.modules[name]
    os.chdir(tree)
    sys.path[:] = [str(tree), *(one for one in sys.path if one and Path(one).resolve() != ROOT)]
    importlib.invalidate_caches()
    import pytest

    options = ("-x", "-q", "--tb=line", "-rfE", "-p", "no:cacheprovider", "-p", "no:xdist", f"--basetemp={tree}.tests")
    return int(pytest.main([*options, test]))


def passed(tree: Path, test: str, cpu_s: float, keep_bytecode: bool = False) -> tuple[int, float, str]:
    """Exit status of a file of tests, seconds of CPU time, and the first failure."""
    log, limit_s = tree.with_suffix(".log"), time.monotonic() + 60 + 12 * cpu_s
    pid = os.fork()
    if not pid:
        status = 99
        try:
            sys.dont_write_bytecode = not keep_bytecode
            status = become_tests(tree, test, cpu_s, log)
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
    return status, ended[2].ru_utime + ended[2].ru_stime, failures[0] if failures else f"status {status}"


class Record:
    """What was found so far, a line each; appended to as it is found."""

    def __init__(self, path: Path) -> None:
        self.path = path
        lines = path.read_text().splitlines() if path.exists() else []
        self.found = {entry["key"]: entry for entry in map(json.loads, lines)}

    def put(self, key: str, **entry: object) -> dict:
        self.found[key] = {"key": key, **entry}
        with self.path.open("a") as lines:
            lines.write(json.dumps(self.found[key]) + "\n")
        return self.found[key]


def digest(*texts: str) -> str:
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()[:16]


class Trial:
    """Runs mutants in a copy."""

    def __init__(self, out: Path) -> None:
        self.tree, self.record, self.users = out / "tree", Record(out / "found.jsonl"), used_by(ROOT)
        copied(self.tree)

    def baseline(self, test: str) -> float:
        """Seconds of CPU time that a file of tests takes with the code as it is; infinite if it fails."""
        key = digest(test, (ROOT / test).read_text(encoding="utf-8"))
        if key not in self.record.found:
            status, seconds, failure = passed(self.tree, test, 3 * TESTS_S, keep_bytecode=True)
            self.record.put(key, test=test, seconds=seconds if status in (0, _NO_TESTS) else np.inf, failure=failure)
        return self.record.found[key]["seconds"]

    def tests_of(self, file: str) -> Iterator[tuple[str, float]]:
        """The files of tests to run for a file, its own first, and the seconds of each."""
        named, folder = mirrored(ROOT, file)
        found = chosen_for(ROOT, file, self.users)
        if not named and folder:  # those that import it may be few and far
            found |= {path.relative_to(ROOT).as_posix() for path in (ROOT / folder).glob("test_*.py")}
        total_s = 0.0
        for test in sorted(found, key=lambda test: (test != named, not test.startswith(f"{folder}/"), test)):
            if total_s + (seconds := self.baseline(test)) <= TESTS_S:
                total_s += seconds
                yield test, seconds

    def tried(self, mutant: Mutant, again: bool) -> dict:
        """Whether tests notice a mutant; as it was found before, unless a survivor is to be tried again."""
        source = (ROOT / mutant.file).read_text(encoding="utf-8")
        key = digest(source, *map(str, asdict(mutant).values()))
        known = self.record.found.get(key)
        if known and (known["killed"] or not again):
            return known
        changed, target = mutant.applied(source), self.tree / mutant.file
        status, failure, passing = 0, "", list[str]()
        for test, seconds in self.tests_of(mutant.file):
            target.write_text(changed, encoding="utf-8")
            try:
                status, _, failure = passed(self.tree, test, 20 + 3 * seconds)
            finally:
                target.write_text(source, encoding="utf-8")
            if status not in (0, _NO_TESTS):
                break
            passing.append(test)
        lines = zip(source.splitlines(), changed.splitlines(), strict=False)
        before, after = next(((a, b) for a, b in lines if a != b), ("", "a line is gone"))
        where = {"before": before.strip(), "after": after.strip(), "passing": passing}
        return self.record.put(key, **asdict(mutant), **where, killed=status not in (0, _NO_TESTS), by=failure)


# --- what came of it -------------------------------------------------------------------------------------------------


def interval(killed: int, count: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share."""
    from scipy.stats import binomtest

    found = binomtest(killed, count).proportion_ci(method="wilson")
    return found.low, found.high


def written(out: Path, options: Options, found: list[dict], existing: int) -> None:
    """Writes ``summary.json`` and ``survivors.csv``, and prints the share."""
    from analysis.storage.summary import write_summary

    killed = [entry for entry in found if entry["killed"]]
    low, high = interval(len(killed), len(found))
    rooms = Counter(next(room for room in MUTATED if entry["file"].startswith(f"{room}/")) for entry in found)
    of_rooms = Counter(next(room for room in MUTATED if entry["file"].startswith(f"{room}/")) for entry in killed)
    shares = {room: {"mutants": count, "killed": of_rooms[room]} for room, count in rooms.items()}
    totals = {"existing": existing, "mutants": len(found), "killed": len(killed), "rooms": shares}
    write_summary(out, {**totals, "share": len(killed) / len(found), "low": low, "high": high}, options)
    names = ["file", "line", "operator", "before", "after"]
    with (out / "survivors.csv").open("w", newline="") as file:
        rows = csv.DictWriter(file, names, extrasaction="ignore")
        rows.writeheader()
        rows.writerows(sorted((one for one in found if not one["killed"]), key=lambda one: (one["file"], one["line"])))
    print(f"{len(killed)} of {len(found)} mutants killed: {len(killed) / len(found):.1%} ({low:.1%} to {high:.1%})")


def main(options: Options) -> None:
    """Draws, runs, says what came of it."""
    out = options.out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    kept = {"OMP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": str(out / "tree")}
    os.environ.update(kept, TMPDIR=str(out / "tmp"), WARP_CACHE_PATH=str(out / "warp"))
    (out / "tmp").mkdir(exist_ok=True)
    sample, existing = drawn(options.count, options.seed)
    for name in LIBRARIES:
        importlib.import_module(name)
    trial, found = Trial(out), list[dict]()
    try:
        for number, mutant in enumerate(sample, 1):
            entry = trial.tried(mutant, options.again)
            found.append(entry)
            kind = "killed" if entry["killed"] else "SURVIVED"
            print(
                f"{number}/{len(sample)} {kind} {mutant.file}:{mutant.line} {entry['after']}  [{entry['by']}]",
                flush=True,
            )
    finally:
        if found:
            written(out, options, found, existing)


if __name__ == "__main__":
    import tyro

    main(tyro.cli(Options, description=__doc__))
