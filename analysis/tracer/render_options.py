"""Options of plain rendering."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from analysis.command import limits
from renderer.sampling import POINT_SETS
from tsar.config import closed_choices

_NOT_OF_THE_STILLS = ("frames", "threads", "format", "explain", "out")


@dataclass(frozen=True)
@closed_choices()
class RenderOptions:
    """A still, or a sequence of stills at a constant rate."""

    scene: Annotated[str, tyro.conf.Positional]
    """Built-in scene, by name or number."""
    width_px: int = 512
    """Width, pixels; the field of view spans the shorter side."""
    height_px: int = 512
    """Height, pixels."""
    samples_per_axis: int = 2
    """Samples along a pixel's side, all at the frame's time."""
    samples: int = 0
    """Instead of that regular grid, this many samples of a point set per pixel, spread over the time the shutter is
    open as well."""
    point_set: str = "hammersley"
    """The point set; stratified takes cubes of samples only."""
    shift: Literal["white", "blue"] = "white"
    """How far each pixel shifts it: independently of its neighbours, or by spatiotemporal blue noise."""
    space_filter: Literal["box", "gaussian"] = "gaussian"
    """Reconstruction filter over the picture, of point sets."""
    time_filter: Literal["box", "triangle"] = "box"
    """Reconstruction filter over the time the shutter is open, of point sets."""
    seed: int = 0
    """Of everything random."""
    time_s: float = 0.0
    """Animation time of the first frame, seconds."""
    frames: int = 1
    """How many frames."""
    fps: float = 30.0
    """Frames per second of animation time."""
    format: Literal["png", "exr", "ppm", "mp4"] = "png"
    """Of the stills (EXR is linear, the others are sRGB); mp4 writes PNG stills and joins them into film.mp4."""
    phase: float = 0.0
    """Phase of the animation, a fraction of a wheel's turn."""
    device: Literal["cpu", "cuda:0"] = "cpu"
    """Where rays are traced."""
    threads: int = 0
    """Threads for tracing; 0 takes one per core."""
    explain: bool = False
    """Print what the scene requires of the kernels, and why, instead of rendering."""
    out: Path = Path("out/render")
    """Folder for the results; frames that an interrupted run of the same job left there are kept."""

    def __post_init__(self) -> None:
        POINT_SETS.require(self.point_set, "point_set")
        limits.within(
            self,
            width_px=limits.SIDES_PX,
            height_px=limits.SIDES_PX,
            samples_per_axis=(1, 64),
            samples=(0, 1 << 16),
            frames=(1, 10**6),
            fps=(1e-6, 1e5),
            time_s=limits.TIMES_S,
            phase=(0.0, 1.0),
            seed=limits.SEEDS,
            threads=limits.THREADS,
        )

    @property
    def times_s(self) -> list[float]:
        """Animation time of every frame."""
        return [self.time_s + number / self.fps for number in range(self.frames)]

    @property
    def still_ending(self) -> str:
        """Ending of a still's name."""
        return ".png" if self.format == "mp4" else f".{self.format}"

    @property
    def job(self) -> dict[str, Any]:
        """What decides the content of the stills, beside the content of the scene and the code."""
        return {name: value for name, value in dataclasses.asdict(self).items() if name not in _NOT_OF_THE_STILLS}
