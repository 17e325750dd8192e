"""Options of the commands about the ray tracer; imports little, so that ``--help`` is quick."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from analysis.command import limits
from analysis.command.cluster import WAIT_S, ClusterOptions
from analysis.command.options import Device, Scheduler, Seed, Threads, Unprefixed, WorkerWait
from analysis.tracer.film_options import FilmOptions
from renderer.sampling import require_point_set
from tsar.config import closed_choices, require

LEVELS = (1, 8, 27, 64, 125, 216, 343, 512)
"""Samples per pixel of the motion-blur perception study."""


@dataclass(frozen=True)
@closed_choices()
class GalleryOptions:
    """One picture for each effect of the ray tracer."""

    effects: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="[EFFECT ...]")] = ()
    """Effects by name; all where none is named."""
    width_px: int = 480
    """Width, pixels."""
    height_px: int = 360
    """Height, pixels."""
    samples: int = 64
    """Samples per pixel; a cube for the point set stratified."""
    point_set: str = "hammersley"
    """Point set that places the samples in the pixel and in the shutter's time."""
    space_filter: Literal["box", "gaussian"] = "gaussian"
    """Reconstruction filter over the picture."""
    seed: Seed = 0
    device: Device = "cpu"
    threads: Threads = 0
    out: Path = Path("out/gallery")
    """Folder for the results; NAME.png and NAME.exr of each, gallery.jpg with all, and summary.json."""

    def __post_init__(self) -> None:
        require_point_set(self.point_set, self.samples)
        sides, samples = limits.SIDES_PX, (1, 1 << 16)
        limits.within(self, width_px=sides, height_px=sides, samples=samples, seed=limits.SEEDS, threads=limits.THREADS)


@dataclass(frozen=True)
@closed_choices()
class AcceleratorOptions:
    """Ray-triangle tests per ray of brute force, kd-tree and tree of boxes, and the two images of the report."""

    out: Path = Path("out/accelerators")
    """Folder for the results; table.csv, tests.png, the images and summary.json."""
    triangles: tuple[int, ...] = (100, 1_000, 10_080, 100_000, 1_000_000)
    """Approximate numbers of triangles of the meshes."""
    repetitions: int = 5
    """Repetitions of each; turns of a structure; the medians are reported."""
    image: tuple[Literal["report-one", "report-two"], ...] = ()
    """Images of the report to render, instead of the table."""
    image_scale: float = 1.0
    """Scale of the images' sides; 1 is the report's size."""
    structure: Literal["kdtree", "bvh"] = "kdtree"
    """Structure over the triangles of the images."""
    seed: int = 0
    """Seed of all random numbers; of rays and samples."""
    threads: Threads = 0

    def __post_init__(self) -> None:
        limits.within(self, triangles=(16, 4_000_000), repetitions=(1, 100), image_scale=(0.01, 4.0))
        limits.within(self, seed=limits.SEEDS, threads=limits.THREADS)


@dataclass(frozen=True)
class PointSetOptions:
    """Measures point sets: discrepancy, distances, projections, strata, convergence on edges and smooth functions."""

    out: Path = Path("out/pointsets")
    """Folder for the results; tables, figures and summary.json."""
    levels: tuple[int, ...] = LEVELS
    """Numbers of points, which must be cubes."""
    cases: int = 2048
    """Number of integrands of each kind over which an error is averaged."""
    sets_of_each: int = 4
    """Number of point sets of each kind, each with its own seed."""
    frame_px: int = 160
    """Side of the pictures of motion blur, pixels; 0 leaves them out."""
    seed: Seed = 0

    def __post_init__(self) -> None:
        for level in self.levels:
            ok = 1 <= level <= 4096 and round(level ** (1 / 3)) ** 3 == level
            require(ok, "levels", "cubes between 1 and 4096", level)
        require(len(set(self.levels)) >= 3, "levels", "at least three, for a slope", self.levels)
        limits.within(self, cases=(1, 1 << 20), sets_of_each=(1, 256), frame_px=(0, 2048), seed=limits.SEEDS)


@dataclass(frozen=True)
@closed_choices()
class TileOptions(FilmOptions):
    """One picture of a scene, in tiles over processes or machines."""

    scene: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE")]
    """Built-in scene by name, a scene file or a model, which all workers can read."""
    samples: int = 32
    """Samples per pixel; a cube for the point set stratified."""
    point_set: str = "hammersley"
    """Point set that places the samples in the pixel and in the shutter's time."""
    space_filter: Literal["box", "gaussian"] = "gaussian"
    """Reconstruction filter over the picture."""
    seed: Seed = 0
    chunk_tiles: int = 16
    """Tiles of 16 x 16 pixels in one task of a worker."""
    farm: Unprefixed[ClusterOptions] = field(default_factory=ClusterOptions)
    """Where tiles are rendered."""
    study: tuple[int, ...] = ()
    """Numbers of local workers to time instead on the same picture, such as 1 2 4."""
    repetitions: int = 3
    """Repetitions of each; turns of each number in a study; the medians are reported."""
    out: Path = Path("out/tiles")
    """Folder for the results; the picture, summary.json, and the chunks from which an interrupted rendering
    continues."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_point_set(self.point_set, self.samples)
        limits.within(
            self,
            samples=(1, 1 << 16),
            seed=limits.SEEDS,
            chunk_tiles=(1, 1 << 16),
            study=(1, 64),
            repetitions=(1, 100),
        )


@dataclass(frozen=True)
@closed_choices()
class JobOptions:
    """Every combination of sampling levels, point sets and time filters of a job file."""

    job: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="JOB")]
    """Job file: seven lines, as in figure 12 of the motion-blur perception thesis."""
    scene: str = ""
    """A block file, or the built-in planescene or spheresscene; by default the scene in the job's name."""
    width_px: int = 0
    """Width, pixels; of a frame, also its height; 0 takes those of the file."""
    first_frame: int = 0
    """First frame of the sequence."""
    frames: int = 0
    """Number of frames; 0 takes all from the first frame on."""
    space_filter: Literal["box", "gaussian"] = "gaussian"
    """Reconstruction filter over the picture; the thesis has a Gaussian."""
    sigma_px: float = 0.5
    """Standard deviation of the Gaussian, pixels."""
    box_share: float = 0.5
    """Share of the shutter time, in its middle, that the box filter spans; the thesis has 0.5."""
    format: Literal["png", "exr"] = "png"
    """Format of the frames."""
    seed: int = 0
    """Seed of all random numbers; of point sets and shifts."""
    threads: Threads = 0
    scheduler: Scheduler = ""
    worker_wait_s: WorkerWait = WAIT_S
    out: Path = Path("out/job")
    """Folder for the results; summary.json and a folder of frames for each combination; frames that an interrupted run
    of the same job left there are kept."""

    def __post_init__(self) -> None:
        limits.within(
            self,
            width_px=(0, limits.SIDES_PX[1]),
            first_frame=(0, 10**6),
            frames=(0, 10**6),
            sigma_px=(1e-3, 16.0),
            box_share=(1e-6, 1.0),
            seed=limits.SEEDS,
            threads=limits.THREADS,
            worker_wait_s=limits.WORKER_WAITS_S,
        )
