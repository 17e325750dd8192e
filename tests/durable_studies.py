"""Small studies, whose runs are kept, for kills: as :mod:`tests.durable`, and in one process instead of many."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any
from unittest.mock import patch

from tests.durable import Kind, call, contents

_MEASURED_COLUMNS = {"wall_s", "peak_bytes", "latency_s", "cycle_s", "run_s", "threads"}


def run_here(asked: Sequence[Any], place: Any, *rest: Any) -> tuple[dict[Any, str], dict[Any, str]]:
    """In place of ``run_cases``: makes what is missing in this process, one after another."""
    from analysis.study import evaluation

    keys = {case: case.key(evaluation.source_of_results()) for case in asked}
    for case, key in keys.items():
        if evaluation.finished(key, place) is None:
            evaluation.evaluate(case, key, place)
    return keys, {}


def _study(name: str, *arguments: str) -> Callable[[Path], int]:
    def make(folder: Path) -> int:
        from analysis.study.cases import SCALES, Scale

        tiny = Scale(4, seconds=0.2, reference_rate_hz=20.0, reference_samples_per_axis=1, stride=4)
        with ExitStack() as stack:
            stack.enter_context(patch.dict(SCALES, quick=tiny))
            stack.enter_context(patch("analysis.study.farm.run_cases", run_here))
            places = ("--out", str(folder / "out"), "--references", str(folder / "cache"))
            return call(name, *arguments, *places)

    return make


def _tables(*patterns: str) -> Callable[[Path], dict[str, Any]]:
    """The files of every run, and tables without what was measured."""
    runs = contents("out/runs/*.json", "out/runs/*.parquet", "out/runs/stills/*.png")

    def found(folder: Path) -> dict[str, Any]:
        made = runs(folder)
        for file in sorted({file for pattern in patterns for file in folder.glob(pattern)}):
            with file.open(newline="") as lines:
                rows = list(csv.DictReader(lines))
            kept = [{name: value for name, value in row.items() if name not in _MEASURED_COLUMNS} for row in rows]
            made[file.relative_to(folder).as_posix()] = kept
        return made

    return found


_RUNS = ("out/runs/**/*.*", "cache/*.*")
_ALONE = ("--inputs", "fly-by", "--repetitions", "1")

STUDIES = {
    "suitability": Kind(
        _study(
            *("suitability", *_ALONE, "--rows", "0", "6", "--rivals", "framed", "--beside"),
            *("--jod-repetitions", "0", "--jod-span-s", "0.0", "0.05"),
        ),
        _tables("out/tables/*.csv"),
        _RUNS,
    ),
    "ablation": Kind(
        _study("ablation", *_ALONE, "--rows", "0", "--rivals", "--parts", "smoothing", "latency"),
        _tables("out/tables/*.csv"),
        _RUNS,
    ),
    "trade": Kind(
        _study(
            *("trade", *_ALONE, "--seconds", "0.1", "--jod-s", "0", "--draws", "50", "--knobs", "depth"),
            *("--trials", "2", "--at-once", "2", "--search-knobs", "batch"),
        ),
        _tables("out/trade.csv", "out/tables/*.csv"),
        _RUNS,
    ),
    "sensitivity": Kind(
        _study(
            *("sensitivity", "--inputs", "fast-crossing", "--temporal-slopes", "-1", "--offsets", "--biases", "2"),
            *("--still-s", "0.05"),
        ),
        _tables("out/tables/*.csv"),
        _RUNS,
    ),
    "workloads": Kind(
        _study(
            *("workloads", "--inputs", "fly-by", "--policies", "tsar", "afr-simple", "--sample-flops", "1e4"),
            *("--image-hz", "8"),
        ),
        _tables("out/tables/*.csv"),
        _RUNS,
    ),
    "spectrum": Kind(
        lambda folder: call(
            *("spectrum", "--only", "ideal", "--resolution-px", "64", "--sdf-side", "16", "--batch-size", "16"),
            *("--tile-count-max", "16", "--ideal-samples", "32", "--ideal-frames", "16", "--out", str(folder / "out")),
        ),
        contents("out/summary.json", "out/*.png"),
        (),
    ),
}
"""By name."""
