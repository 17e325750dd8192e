"""Group start: the time until new processes answer, with kernels in Warp's cache and without."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from analysis.bench.options import BenchOptions
from analysis.bench.rows import Row, limit_row
from analysis.command.cli import InputError

if TYPE_CHECKING:
    from analysis.command.progress import Bars

ROOT = Path(__file__).resolve().parents[2]
HELP_LIMIT_S, FIRST_CYCLE_LIMIT_S = 0.5, 3.0
COLD_REPETITIONS = 3

_KERNELS = "WARP_CACHE_PATH"
_FIRST_CYCLE = re.compile(r"first cycle after ([0-9.]+) s")
_SHORT_RUN = (
    *("--seconds", "0.02", "--warmup-cycles", "4", "--no-film"),
    *("--rivals", "framed", "--reference-samples-per-axis", "1"),
)


@dataclass(frozen=True)
class Started:
    """A process that has ended: its wall seconds and its output on both streams."""

    seconds: float
    text: str

    @property
    def first_cycle_s(self) -> float | None:
        """Seconds to the first cycle as the process prints them, or None."""
        found = _FIRST_CYCLE.search(self.text)
        return float(found.group(1)) if found else None


def start(environment: Mapping[str, str], *arguments: str) -> Started:
    """Runs a script of the project to its end.

    Args:
        environment: variables added to those of this process.
        arguments: name of the script and its arguments.

    Raises:
        InputError: it ended with an error.
    """
    command = [sys.executable, str(ROOT / "scripts" / arguments[0]), *arguments[1:]]
    begin = time.perf_counter()
    done = subprocess.run(command, cwd=ROOT, env={**os.environ, **environment}, capture_output=True, encoding="utf-8")
    seconds = time.perf_counter() - begin
    if done.returncode:
        raise InputError(f"{' '.join(arguments[:2])}: ended with {done.returncode}: {done.stderr.strip()[-300:]}")
    return Started(seconds, done.stdout + done.stderr)


def first_cycle(found: Started) -> tuple[float, str]:
    """Seconds to the first cycle, and a note on their source."""
    if found.first_cycle_s is None:
        return found.seconds, "wall time of a whole short run"
    return found.first_cycle_s, f"whole short run {found.seconds:.1f} s"


def start_rows(options: BenchOptions, bars: Bars) -> Iterator[Row]:
    """Help and first cycle with kernels in the cache, then the first cycle without."""
    task = bars.task("start", 2 * options.repetitions + COLD_REPETITIONS + 1)
    helped, warm = [], []
    with tempfile.TemporaryDirectory() as folder:
        short = ("run.py", "fly-by", *_SHORT_RUN, "--out", f"{folder}/run", "--references", f"{folder}/references")
        start({}, *short)  # fills the caches of kernels and references
        task.advance()
        for _ in range(options.repetitions):
            helped.append(start({}, "run.py", "--help").seconds)
            task.advance()
            warm.append(first_cycle(start({}, *short)))
            task.advance()
        yield limit_row(Row("start", "run.py --help, warm", "s", 0.0, "limit"), helped, HELP_LIMIT_S)
        row = Row("start", "run.py to its first cycle, warm", "s", 0.0, "limit", note=warm[-1][1])
        yield limit_row(row, [seconds for seconds, _ in warm], FIRST_CYCLE_LIMIT_S)
        cold = []
        for number in range(COLD_REPETITIONS):
            cold.append(start({_KERNELS: f"{folder}/kernels{number}"}, *short))
            task.advance()
    yield cold_row(cold)


def cold_row(cold: list[Started]) -> Row:
    """First cycle with an empty kernel cache, and whether every run said that it compiles."""
    seconds = sorted(first_cycle(found)[0] for found in cold)
    said = all("compiling" in found.text for found in cold)
    return Row(
        "start",
        "run.py to its first cycle, cold",
        "s",
        seconds[len(seconds) // 2],
        repetitions=len(seconds),
        less_is_better=True,
        note="says that it compiles" if said else "does NOT say that it compiles",
    )
