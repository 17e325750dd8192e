"""Small commands that keep files on disk, and the results that must be the same after damage or a kill."""

from __future__ import annotations

import dataclasses
import json
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pandas as pd
import torch

MEASURED = {
    *("provenance", "config", "start", "stage_wall_s", "wall", "conclusion_changes_with_ledger", "machine"),
    *("wall_s", "worker_s", "rendered_now", "chunks_rendered_now"),
}
"""Entries of summaries that hold measured seconds, or what was found on disk."""


@dataclass(frozen=True)
class Kind:
    """A command, small.

    Attributes:
        make: makes everything that a folder lacks; returns the exit status.
        result: the values that must be the same, read from the folder.
        prepare: puts the input of the command into a new folder.
        kept: patterns of the files that the command reads back.
    """

    make: Callable[[Path], int]
    result: Callable[[Path], Any]
    kept: tuple[str, ...]
    prepare: Callable[[Path], None] = lambda folder: None

    def files(self, folder: Path) -> list[Path]:
        """The durable files of a folder."""
        return sorted({file for pattern in self.kept for file in folder.glob(pattern) if file.stat().st_size})


def call(name: str, *arguments: str) -> int:
    """Runs the main function of a script, as from the command line; the exit status."""
    import importlib

    from analysis.command.cli import run_cli

    module = importlib.import_module(f"scripts.{name}")
    with patch.object(sys, "argv", [name, *arguments]):
        try:
            run_cli(module.main)
        except SystemExit as stop:
            return int(stop.code or 0)
    return 0


def unmeasured(value: Any) -> Any:
    """A summary without the entries that differ between two equal runs."""
    if isinstance(value, dict):
        return {name: unmeasured(item) for name, item in value.items() if name not in MEASURED}
    return [unmeasured(item) for item in value] if isinstance(value, list) else value


def read(path: Path) -> Any:
    """The content of a file that must be the same."""
    if path.suffix == ".json":
        return unmeasured(json.loads(path.read_text()))
    if path.suffix == ".parquet":
        table = pd.read_parquet(path)
        return table[[name for name in table if not name.startswith("stage_")]].to_json()
    return path.read_bytes()


def contents(*patterns: str) -> Callable[[Path], dict[str, Any]]:
    """Reads the files of some patterns, by name."""

    def found(folder: Path) -> dict[str, Any]:
        files = sorted({file for pattern in patterns for file in folder.glob(pattern)})
        return {file.relative_to(folder).as_posix(): read(file) for file in files}

    return found


# --- references ------------------------------------------------------------------------------------------------------


def _image(time_s: float) -> torch.Tensor:
    values = torch.from_numpy(np.random.default_rng(round(10 * time_s)).normal(1.0, 1.0, (8, 8, 3)))
    return values.where(values < 2.0, float("nan"))


def _obtained(folder: Path, render: Callable[[float], torch.Tensor] = _image) -> Any:
    from analysis.storage.reference import ReferenceSpec, obtain

    spec = ReferenceSpec("s", "h", "r", start_s=0.5, rate_hz=10.0, count=8, width_px=8, height_px=8, samples_per_axis=1)
    return obtain(folder / "cache", spec, render)


def _reference(folder: Path) -> int:
    found = _obtained(folder)
    (folder / "nonfinite.json").write_text(json.dumps(found.nonfinite))
    return 0


def _half_a_reference(folder: Path) -> None:
    def broken(time_s: float) -> torch.Tensor:
        if time_s > 1.0:
            raise KeyboardInterrupt
        return _image(time_s)

    try:
        _obtained(folder, broken)
    except KeyboardInterrupt:
        pass


# --- studies and runs ------------------------------------------------------------------------------------------------


def _case() -> Any:
    from analysis.study.cases import Case, Scale, framed_config

    scale = Scale(4, seconds=0.2, reference_rate_hz=30.0, reference_samples_per_axis=1, stride=2)
    return Case("fly-by", "framed", framed_config(64), scale, stills_s=(0.1,))


def _evaluated(folder: Path) -> int:
    from analysis.study import evaluation

    evaluation._store.cache_clear()  # as in a new process
    place = evaluation.Resources(folder / "runs", folder / "cache")
    key = evaluation.evaluate(_case(), _case().key(evaluation.source_of_results()), place)
    evaluation.times_of(key, place)
    return 0


_TINY = ("--seconds", "0.2", "--resolution-px", "64", "--batch-size", "16", "--warmup-cycles", "8")


def _inputs(folder: Path) -> int:
    from analysis.storage import provenance as module

    provenance = module.provenance

    def committed(*arguments: Any, **extra: Any) -> dict[str, Any]:
        return {**provenance(*arguments, **extra), "uncommitted_changes": False}

    with ExitStack() as stack:
        stack.enter_context(patch.object(module, "provenance", committed))
        runs = _in_cache(folder)
        stack.enter_context(patch("analysis.comparison.repetitions.InputsOptions.runs", runs))
        return call("inputs", "fly-by", "--repetitions", "2", *_TINY, "--out", str(folder / "out"))


def _in_cache(folder: Path) -> Callable[[Any], list[Any]]:
    """The runs of a table, with small references in the folder."""
    from analysis.comparison.repetitions import InputsOptions

    listed = InputsOptions.runs
    small = {"references": folder / "cache", "reference_samples_per_axis": 1}
    return lambda options: [dataclasses.replace(run, **small) for run in listed(options)]


def _run(folder: Path) -> int:
    reference = (
        "--reference-rate-hz",
        "30",
        "--reference-samples-per-axis",
        "1",
        "--references",
        str(folder / "cache"),
    )
    rest = ("--rivals", "framed", "thesis", "--no-film", "--write-frames", "--out", str(folder / "out"))
    return call("run", "fly-by", *_TINY, *reference, *rest)


# --- pictures --------------------------------------------------------------------------------------------------------


def _render(folder: Path) -> int:
    size = ("--width-px", "24", "--height-px", "24", "--frames", "4", "--samples-per-axis", "1")
    return call("render", "plain", *size, "--format", "png", "--out", str(folder / "out"))


def _job_file(folder: Path) -> None:
    (folder / "job.txt").write_text("Plane_scene\n2\n1 8\n1\nhammersley\n1\nbox\n")


def _job(folder: Path) -> int:
    options = ("--width-px", "16", "--frames", "2", "--out", str(folder / "out"))
    return call("job", str(folder / "job.txt"), *options)


def _stimuli(folder: Path) -> int:
    options = ("--width-px", "16", "--frames", "2", "--video", "--out", str(folder / "out"))
    return call("perception", "stimuli", str(folder / "job.txt"), *options)


def _tiles(folder: Path) -> int:
    """Without a cluster: chunks come from this process."""
    from analysis.tracer.tiles import render_chunk

    def rendered(client: Any, picture: Any, chunks: list[range], retries: int) -> Iterator[tuple[int, Any]]:
        yield from ((number, render_chunk(picture, chunk)) for number, chunk in enumerate(chunks))

    size = ("--width-px", "48", "--height-px", "32", "--samples", "4", "--chunk-tiles", "1")
    alone = patch("analysis.tracer.run.connected", lambda farm, say: nullcontext())
    with alone, patch("analysis.tracer.tiles.rendered", rendered):
        return call("tiles", "plain", *size, "--out", str(folder / "out"))


def _session_files(folder: Path) -> None:
    from tests.analysis.perception.builders import write_stimuli

    write_stimuli(folder / "stimuli", side=8, frames=1)


def _session(folder: Path) -> int:
    """Shows every stimulus, and answers the trials that are open."""
    from analysis.command.cli import InputError, bad_input
    from analysis.perception.protocol import TrialSession

    try:
        with bad_input(), TrialSession(folder / "session", folder / "stimuli", "Ann", repetitions=3, seed=1) as session:
            for trial in session.trials:
                session.frame(trial.test, 0)
            while session.current is not None:
                trial = session.current
                session.answer(trial.number, ("left", "right")[trial.number % 2], {"response_s": trial.number + 0.5})
            session.export()
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


KINDS = {
    "reference": Kind(_reference, contents("nonfinite.json", "cache/*.npy"), ("cache/*.npy", "cache/*.journal")),
    "half a reference": Kind(
        _reference,
        contents("nonfinite.json", "cache/*.npy"),
        ("cache/*.npy", "cache/*.journal"),
        _half_a_reference,
    ),
    "evaluate": Kind(
        _evaluated, contents("runs/*.json", "runs/*.parquet", "runs/stills/*.png"), ("runs/**/*.*", "cache/*.*")
    ),
    "inputs": Kind(
        _inputs,
        contents("out/summary.json", "out/*/summary.json", "out/*/steps.parquet", "out/*/error.png"),
        ("out/*/summary.json", "out/*/steps.parquet", "out/*/files.journal", "out/*/error.png", "cache/*.*"),
    ),
    "run": Kind(
        _run,
        contents("out/summary.json", "out/steps.parquet", "out/error.png", "out/frames/*.exr"),
        ("cache/*.npy", "cache/*.journal"),
    ),
    "render": Kind(_render, contents("out/*.png", "out/summary.json"), ("out/*.png", "out/*.journal", "out/job.json")),
    "job": Kind(
        _job,
        contents("out/*/*.png", "out/summary.json"),
        ("out/*/*.png", "out/*/*.journal", "out/*/job.json"),
        _job_file,
    ),
    "stimuli": Kind(
        _stimuli,
        contents("out/*/*/*.png", "out/*/*/*.mkv", "out/manifest.json", "out/summary.json"),
        ("out/**/*.png", "out/**/*.mkv", "out/**/*.journal", "out/**/job.json", "out/manifest.json"),
        _job_file,
    ),
    "tiles": Kind(
        _tiles,
        contents("out/*.png", "out/*.exr", "out/summary.json"),
        ("out/chunks/*.npz", "out/chunks/*.journal", "out/chunks/job.json"),
    ),
    "session": Kind(_session, contents("session/*.parquet"), ("session/*.sqlite", "stimuli/**/*.*"), _session_files),
}
"""By name. Those with several processes are made in one here; what workers run is the same."""


def restore(whole: Path, folder: Path) -> None:
    """Puts a folder back to what it was; its path decides results too."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(whole, folder)
