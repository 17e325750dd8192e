"""Options of the command that renders stills; imports little, so that ``--help`` is quick."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from analysis.command import limits
from analysis.command.options import Device, Seed, Threads
from analysis.tracer.film_options import FilmOptions
from renderer.sampling import require_point_set
from tsar.config import closed_choices, require

_NOT_OF_THE_STILLS = ("frames", "threads", "format", "explain", "out")


@dataclass(frozen=True)
@closed_choices()
class RenderOptions(FilmOptions):
    """A still, or a sequence of stills at a constant rate, of a scene or a model."""

    scene: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE")]
    """Built-in scene, by name or number; a scene file; or a model (OBJ, PLY, STL, GLB, glTF, USD), by default seen as a
    whole from the front."""
    samples_per_axis: int = 2
    """Samples along a pixel's side; all at the frame's time."""
    samples: int = 0
    """Samples per pixel; those of a point set, in place of the regular grid; they also spread over the time the shutter
    is open."""
    point_set: str = "hammersley"
    """Point set that places the samples in the pixel and in the shutter's time; stratified needs a cube as the number
    of samples."""
    rounds: int = 0
    """Take the samples of a still in this many rounds of the point set, so that an interrupted still continues where it
    was and its error is known. 0 takes 16 if an error target or layers are asked for, else none."""
    error_target: float = 0.0
    """Root mean square error, in encoded colour from 0 to 1, at which a tile gets no further rounds; 0 gives every tile
    all samples."""
    layers: bool = False
    """Also write depth, normal, albedo, instance, motion, sample count and variance as layers of the EXR files."""
    denoise: bool = False
    """Filter the stills by Open Image Denoise, guided by albedo and normals (extra denoise)."""
    shift: Literal["white", "blue"] = "white"
    """Shift of the point set from pixel to pixel: independent, or by spatiotemporal blue noise."""
    space_filter: Literal["box", "gaussian"] = "gaussian"
    """Reconstruction filter over the picture; for point sets."""
    time_filter: Literal["box", "triangle"] = "box"
    """Reconstruction filter over the time the shutter is open, for point sets."""
    seed: Seed = 0
    frames: int = 1
    """Number of frames."""
    fps: float = 30.0
    """Frames per second of animation time."""
    format: Literal["png", "exr", "ppm", "mp4"] = "png"
    """Format of the frames; EXR is linear, the others are sRGB, and mp4 writes PNG stills and joins them into
    film.mp4."""
    phase: float = 0.0
    """Phase of the animation; a fraction of a wheel's turn."""
    device: Device = "cpu"
    threads: Threads = 0
    explain: bool = False
    """Print the kernel features that the scene requires, with reasons, instead of rendering."""
    out: Path = Path("out/render")
    """Folder for the results; frames that an interrupted run of the same job left there are kept."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_point_set(self.point_set, self.samples or 1)  # none are those of the regular grid
        limits.within(
            self,
            samples_per_axis=(1, 64),
            samples=(0, 1 << 16),
            rounds=(0, 1 << 12),
            error_target=(0.0, 1.0),
            frames=(1, 10**6),
            fps=(1e-6, 1e5),
            phase=(0.0, 1.0),
            seed=limits.SEEDS,
            threads=limits.THREADS,
        )
        require(not self.layers or self.format == "exr", "layers", "the format exr", self.format)
        if self.in_rounds:
            require(self.rounds != 1, "rounds", "at least 2", self.rounds)
            needed = self.in_rounds
            whole = self.samples > 0 and self.samples % needed == 0
            require(whole, "samples", f"a multiple of the {needed} rounds", self.samples)

    @property
    def in_rounds(self) -> int:
        """Rounds of a still; 0 if its samples are taken at once."""
        return self.rounds or (16 if self.error_target or self.layers else 0)

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
        """Options that decide the content of the stills, beside the scene and the code."""
        return {name: value for name, value in dataclasses.asdict(self).items() if name not in _NOT_OF_THE_STILLS}
