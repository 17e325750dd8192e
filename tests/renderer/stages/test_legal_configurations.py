"""For every accepted configuration compiled and reference stages neither crash nor hang, and agree."""

from __future__ import annotations

import queue
import subprocess
import sys
import threading
from collections import Counter
from pathlib import Path
from typing import TextIO

import pytest

from tests.oracles.configurations import legal_configuration

ROOT = Path(__file__).resolve().parents[3]
LIMIT_S = 120.0


def outcomes(first: int, count: int, cycles: int) -> tuple[Counter[str], list[str]]:
    """Runs random configurations in processes of their own, a new one after each that crashes or hangs.

    Returns:
        How many were the same, differed, crashed or hung, and a line for each that was not the same.
    """
    found: Counter[str] = Counter(dict.fromkeys(("same", "differences", "crashes", "hangs"), 0))
    number, lines = first, []
    while number < first + count:
        numbers = map(str, (number, first + count - number, cycles))
        command = [sys.executable, "-m", "tests.renderer.stages.twins", *numbers]
        process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
        said = _lines(process.stdout)
        try:
            while number < first + count:
                line = said.get(timeout=LIMIT_S)
                if line is None:
                    kind, line = "crashes", f"{number} ended with {process.wait()}"
                elif line.endswith(" begins"):
                    continue
                else:
                    kind = "same" if line == f"{number} same" else "differences"
                found[kind] += 1
                number += 1
                if kind != "same":
                    lines.append(line)
                if kind == "crashes":
                    break
        except queue.Empty:
            found["hangs"] += 1
            lines.append(f"{number} took longer than {LIMIT_S:g} s")
            number += 1
        finally:
            process.kill()
            process.wait()
    return found, lines


def _lines(stream: TextIO | None) -> queue.Queue[str | None]:
    """Lines as they arrive, then None."""
    said: queue.Queue[str | None] = queue.Queue()

    def read() -> None:
        for line in stream or ():
            said.put(line.rstrip("\n"))
        said.put(None)

    threading.Thread(target=read, daemon=True).start()
    return said


@pytest.mark.parametrize(
    ("first", "count", "cycles"), [(1000, 20, 2), pytest.param(0, 500, 3, marks=pytest.mark.slow)], ids=["20", "500"]
)
def test_both_sets_of_stages_agree_on_every_legal_configuration(first: int, count: int, cycles: int) -> None:
    found, lines = outcomes(first, count, cycles)
    print(dict(found))
    assert found == {"same": count, "differences": 0, "crashes": 0, "hangs": 0}, lines


def test_configurations_reach_the_bounds_of_what_is_accepted() -> None:
    drawn = [legal_configuration(number) for number in range(500)]
    full = [config for config in drawn if 0 < config.tile_count_max < config.batch_size + 3]
    assert len(full) > 50, "the batch is as large as the tiling"
    spent = [c for c in drawn if c.response.temporal_min * 4**c.level_min > 0.99 * c.batch_size]
    assert len(spent) > 20, "the least densities take the whole budget"
    steep = [c for c in drawn if c.error.spatial_slope > 45 or c.error.temporal_slope > 45]
    assert len(steep) > 50 and {c.framelet_side for c in drawn} == {16, 32}
    assert len({c.response.solver for c in drawn}) == 7 and len({(c.error.norm, c.error.form) for c in drawn}) == 4
