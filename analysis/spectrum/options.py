"""Options of the study of spectra."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from analysis.command import limits
from analysis.command.options import Threads, Unprefixed
from analysis.metrics.cost_model import CAPACITY_DEFAULT, SEGMENTS_DEFAULT, adaptive_flops, parameters_of
from analysis.study.asked import require_inputs
from analysis.study.inputs import INPUTS
from tsar.config import TsarConfig, closed_choices, require

Part = Literal["slopes", "ideal", "agreement"]

FRAMELET_SIDE = 16


@dataclass(frozen=True)
@closed_choices()
class SpectrumOptions:
    """Power-spectrum slopes, ideal sample density, and the agreement of the streaming estimate with it. The size of the
    thesis' example is --only ideal --ideal-samples 1024 --ideal-frames 512; it needs about 16 GiB and 32 times the time
    of the default."""

    images: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="[IMAGE ...]")] = ()
    """Pictures to measure beside our own: PNG, JPEG or EXR of any size from 32 pixels."""
    only: Part | None = None
    """What to do, instead of everything: slopes (figs 1.3, 1.4), ideal (figs 5.3–5.5) or agreement; without it all
    three."""
    tsar: Unprefixed[TsarConfig] = field(default_factory=TsarConfig)
    """The adaptive pipeline: template of the error estimate, realizable rates, resolution, seed."""
    inputs: tuple[str, ...] = INPUTS
    """Built-in inputs, or other scenes by their names; those whose slopes and tiles are measured."""
    frames_per_input: int = 4
    """Slopes: times at which frames and framelets of each input are taken."""
    samples_per_axis: int = 4
    """Samples along a pixel's side; for the slopes, of the supersampled frames."""
    input: str = "fly-by"
    """Built-in input, by name or number; the one of the tile of the ideal density."""
    ideal_start_s: float = 0.75
    """Ideal: first time, seconds."""
    span_s: float = 0.5
    """Ideal and agreement: length of a volume, seconds."""
    ideal_samples: int = 256
    """Ideal: samples along the tile's side."""
    ideal_frames: int = 256
    """Ideal: times over the span."""
    tile_level: int = 5
    """Ideal: quad level of the tile; at level L it is 1 / 2^L of the picture wide."""
    tile_at: tuple[float, float] = (0.955, 0.45)
    """Ideal: a place in the tile, x and y in [0, 1) from the top left; by default the car's rear edge."""
    tile_index: int | None = None
    """Ideal: Morton index of the tile, instead of its place."""
    tau: float = 0.01
    """Greatest gain of a further octave of rate at the ideal density, as a share of the tile's power."""
    tiles_per_input: int = 40
    """Agreement: tiles of each input, over the picture and over four times."""
    agreement_level: int = 4
    """Agreement: quad level of the tiles; the estimate is evaluated at this level and the next two finer ones."""
    agreement_samples: int = 128
    """Agreement: samples along a tile's side, an octave above the finest rate of the estimate."""
    agreement_frames: int = 64
    """Agreement: times over the span; the estimate uses every second, fourth and eighth of them."""
    threads: Threads = 0
    out: Path = Path("out/spectrum")
    """Folder for the results."""

    def __post_init__(self) -> None:
        require(not self.tsar.width_px, "width_px", "none here, where pictures are squares", self.tsar.width_px)
        require(len(self.inputs) > 0, "inputs", "at least one", self.inputs)
        require_inputs(self.inputs)
        require_inputs((self.input,), "input", numbers=True)
        limits.within(self, frames_per_input=(1, 100), samples_per_axis=(1, 16), threads=limits.THREADS)
        limits.within(self, ideal_samples=(32, 1 << 15), ideal_frames=(8, 1 << 15))
        limits.within(self, agreement_samples=(64, 1 << 15), agreement_frames=(16, 1 << 15))
        limits.within(self, tile_level=(0, 10), agreement_level=(0, 9))
        for name, low in (
            ("ideal_samples", 32),
            ("ideal_frames", 8),
            ("agreement_samples", 64),
            ("agreement_frames", 16),
        ):
            value = getattr(self, name)
            require(value >= low and value & (value - 1) == 0, name, f"a power of two from {low}", value)
        require(self.tsar.framelet_side == FRAMELET_SIDE, "framelet_side", "16", self.tsar.framelet_side)
        for name, side in (("tile_level", self.ideal_samples), ("agreement_level", self.agreement_samples)):
            value = getattr(self, name)  # sample positions are multiples of 1 / 65536
            require(0 <= value and 2**value * side <= 2**15, name, "0 or more, at most 2^15 samples a picture", value)
        tiles, most = self.tiles_per_input, 4 ** (self.agreement_level + 1)
        require(4 <= tiles <= most and tiles % 4 == 0, "tiles_per_input", f"a multiple of 4 up to {most}", tiles)
        require(all(0 <= place < 1 for place in self.tile_at), "tile_at", "x and y in [0, 1)", self.tile_at)
        index, count = self.tile_index, 4**self.tile_level
        require(index is None or 0 <= index < count, "tile_index", f"between 0 and {count - 1}", index)
        require(0 < self.span_s <= 3, "span_s", "a number in (0, 3]", self.span_s)
        start_s = self.ideal_start_s
        require(-3 <= start_s <= 6 - self.span_s, "ideal_start_s", "within the animation, from -3 to 6 s", start_s)
        require(0 < self.tau < 1, "tau", "a share in (0, 1)", self.tau)

    @property
    def sampled(self) -> list[int]:
        """Samples along a pixel's side of the frames whose slopes are compared: one, and those of the option."""
        return sorted({1, self.samples_per_axis})

    def does(self, part: Part) -> bool:
        """Whether a part is to be run."""
        return self.only in (None, part)

    def cycle_s(self) -> float:
        """Seconds of a cycle at the simulated machine's default speed, by the thesis' ledger."""
        return float(adaptive_flops(parameters_of(self.tsar, SEGMENTS_DEFAULT))) / CAPACITY_DEFAULT
