"""Options that several commands share, each stated once: type, help and, in :mod:`analysis.command.limits`, bounds."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, TypeVar

import tyro

Record = TypeVar("Record")

Seed = Annotated[int, tyro.conf.arg(help="Seed of all random numbers.")]
"""In :data:`analysis.command.limits.SEEDS`."""

Threads = Annotated[int, tyro.conf.arg(help="Threads for tracing; 0 takes one per core.")]
"""In :data:`analysis.command.limits.THREADS`."""

Scheduler = Annotated[
    str,
    tyro.conf.arg(
        help="Address of a running Dask scheduler, such as tcp://host:8786; its workers render the frames, see the "
        "same folders and run the same source; empty renders here."
    ),
]

WorkerWait = Annotated[
    float,
    tyro.conf.arg(
        help="Seconds without any worker after which a command stops waiting; workers may wait long in a queue of jobs."
    ),
]

Device = Annotated[Literal["cpu", "cuda:0"], tyro.conf.arg(help="Where rays are traced.")]

References = Annotated[Path, tyro.conf.arg(help="Folder for references, shared by all runs.")]
REFERENCES = Path(".cache/reference")
"""The folder that commands share by default."""

RENAMED = {
    "--cache": ("--references",),
    "--clock": ("--ledger",),
    "--error-target": ("--mse-target",),
    "--farm.scheduler": ("--scheduler",),
    "--farm.workers": ("--workers",),
    "--frames": ("--write-frames", "--ideal-frames"),
    "--samples": ("--ideal-samples",),
    "--scale": ("--image-scale",),
    "--span-s": ("--jod-span-s",),
    "--start-s": ("--ideal-start-s",),
    "--stride": ("--metric-stride",),
}
"""Earlier names of options that had two meanings, with what a command may call each now."""

Unprefixed = Annotated[Record, tyro.conf.arg(name=""), tyro.conf.OmitArgPrefixes]
"""A record whose fields are options of the command itself, without the record's name as a prefix."""
