"""Changes the code in one place at a time and runs the tests nearest to it: ``python -m tests.mutants --count 300``.

A mutant is one change by an operator of cosmic-ray, such as ``<`` to ``<=`` or 3 to 4. All mutants of :data:`MUTATED`
are listed by file and line, and every k-th is drawn, so every module has its share. They run in random order in a copy
of the checkout, each in a process of its own that is forked after the libraries are loaded. What was found is kept in
``OUT/found.jsonl``; the command continues where it ended. Annotations are not changed.
"""

from __future__ import annotations

import ast
import csv
import importlib
import os
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tests.test_architecture import ROOT
from tests.trials import Record, Trial, digest

MUTATED = ("tsar", "analysis/metrics", "analysis/storage")
LIBRARIES = (
    "torch warp pandas pyarrow.parquet scipy.stats xarray matplotlib.pyplot PIL.Image tyro kornia pytest hypothesis "
    "beartype jaxtyping"
).split()
"""Loaded once; every mutant's process has them from the beginning."""


@dataclass(frozen=True)
class Options:
    """Options of the command line.

    Attributes:
        out: folder of what was found, and of the copy of the checkout.
        count: mutants that are drawn.
        seed: decides which.
        again: whether those that survived are tried again, with the tests as they are now.
        reach: whether to find out first what every test reaches, which pays from some hundred mutants on.
        hours: time after which no other mutant is begun; 0 only says what is known.
    """

    out: Path = Path("out/mutants")
    count: int = 300
    seed: int = 0
    again: bool = False
    reach: bool = True
    hours: float = 24.0


@dataclass(frozen=True, order=True)
class Mutant:
    """One change: the n-th place at which an operator of cosmic-ray applies to a file."""

    file: str
    line: int
    column: int
    operator: str
    occurrence: int

    def applied(self, source: str) -> str | None:
        """The changed source, or None if the change is not Python, or the operator cannot make it."""
        from cosmic_ray.mutating import mutate_code
        from cosmic_ray.plugins import get_operator

        try:
            changed = mutate_code(source, get_operator(self.operator)(), self.occurrence)
            ast.parse(changed or "")
        except (AttributeError, SyntaxError):
            return None
        return changed


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


def tried(trial: Trial, mutant: Mutant, again: bool, late: bool) -> dict[str, Any] | None:
    """Whether tests notice a mutant; as it was found before, unless a survivor is to be tried again. None if there is
    no such mutant, or it is too late to try it."""
    source = (ROOT / mutant.file).read_text(encoding="utf-8")
    key = digest(source, *map(str, asdict(mutant).values()))
    known = trial.record.found.get(key)
    if known and (known["killed"] or not again or late):
        return known
    changed = None if late else mutant.applied(source)
    if changed is None:
        return None
    killed, by, passing = trial.noticed(mutant.file, mutant.line, changed)
    lines = zip(source.splitlines(), changed.splitlines(), strict=False)
    before, after = next(((a, b) for a, b in lines if a != b), ("", "a line is gone"))
    where = {"before": before.strip(), "after": after.strip(), "passing": passing}
    return trial.record.put(key, **asdict(mutant), **where, killed=killed, by=by)


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
    tree = out / "tree"
    kept = {"OMP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": str(tree)}
    os.environ.update(kept, TMPDIR=f"{tree}.tmp", WARP_CACHE_PATH=f"{out}/warp")
    Path(f"{tree}.tmp").mkdir(exist_ok=True)
    sample, existing = drawn(options.count, options.seed)
    for name in LIBRARIES:
        importlib.import_module(name)
    end_s, trial = time.monotonic() + 3600.0 * options.hours, Trial(tree, Record(out / "found.jsonl"), options.reach)
    found = list[dict]()
    try:
        for number, mutant in enumerate(sample, 1):
            entry = tried(trial, mutant, options.again, time.monotonic() >= end_s)
            if entry is None:
                continue
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
