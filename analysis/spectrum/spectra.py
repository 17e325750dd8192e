"""Power spectra of pictures and framelets, and the options of all that ``scripts/spectrum.py`` does.

Source: Stephens 2011, sec. 1.3.4.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import tyro
from numpy.typing import NDArray

from analysis.command import limits
from analysis.command.cli import InputError, bad_input
from analysis.comparison.repetitions import INPUTS
from tsar.config import TsarConfig, closed_choices, require

if TYPE_CHECKING:
    from renderer.trace import Renderer

Floats = NDArray[np.float64]
Part = Literal["slopes", "ideal", "agreement"]

PHOTOGRAPHS = ("landscape_band.jpg", "sky.exr")
FRAMELET_SIDE = 16
_REC709 = np.array((0.2126, 0.7152, 0.0722))
_LEAST_SIDE = 32
_ROUNDING = 1e-18  # a constant picture has 1e-28 at most, one pixel of 2048² that is off by 1/255 has 3e-11
_FIRST_BIN = 2
_LAUNCH_SAMPLES = 1 << 18


@dataclass(frozen=True)
@closed_choices()
class SpectrumOptions:
    """Power-spectrum slopes, ideal sample density, and how well the streaming estimate points at it.

    The size of the thesis' example is --only ideal --samples 1024 --frames 512; it needs about 16 GiB and 32 times the
    time of the default.
    """

    images: Annotated[tuple[Path, ...], tyro.conf.Positional] = ()
    """Pictures to measure beside our own: PNG, JPEG or EXR of any size from 32 pixels."""
    only: Part | None = None
    """Do one part only: slopes (figs 1.3, 1.4), ideal (figs 5.3–5.5) or agreement; without it all three."""
    tsar: Annotated[TsarConfig, tyro.conf.arg(name=""), tyro.conf.OmitArgPrefixes] = field(default_factory=TsarConfig)
    """The adaptive pipeline: template of the error estimate, realizable rates, resolution, seed."""
    inputs: tuple[str, ...] = INPUTS
    """Built-in inputs whose slopes and tiles are measured."""
    frames_per_input: int = 4
    """Slopes: times at which frames and framelets of each input are taken."""
    samples_per_axis: int = 4
    """Slopes: samples along a pixel's side of the supersampled frames."""
    input: str = "fly-by"
    """Ideal: the input of the tile."""
    start_s: float = 0.75
    """Ideal: first time, seconds."""
    span_s: float = 0.5
    """Ideal and agreement: length of a volume, seconds."""
    samples: int = 256
    """Ideal: samples along the tile's side."""
    frames: int = 256
    """Ideal: times over the span."""
    tile_level: int = 5
    """Ideal: quad level of the tile; at level L it is 1 / 2^L of the picture wide."""
    tile_at: tuple[float, float] = (0.955, 0.45)
    """Ideal: a place in the tile, x and y in [0, 1) from the top left. The default: the car's rear edge."""
    tile_index: int | None = None
    """Ideal: Morton index of the tile, instead of its place."""
    tau: float = 0.01
    """Greatest gain an octave of rate may still bring at the ideal density, as a share of the tile's power."""
    tiles_per_input: int = 40
    """Agreement: tiles of each input, over the picture and over four times."""
    agreement_level: int = 4
    """Agreement: quad level of the tiles; the estimate is tried at this level and the two finer ones."""
    agreement_samples: int = 128
    """Agreement: samples along a tile's side, an octave above the finest rate that is tried."""
    agreement_frames: int = 64
    """Agreement: times over the span; the estimate is tried with every second, fourth and eighth."""
    threads: int = 0
    """Threads for tracing; 0 takes one per core."""
    out: Path = Path("out/spectrum")
    """Folder for the results."""

    def __post_init__(self) -> None:
        unknown = [name for name in (*self.inputs, self.input) if name not in INPUTS]
        require(not unknown and len(self.inputs) > 0, "inputs", f"names out of {', '.join(INPUTS)}", unknown)
        limits.within(self, frames_per_input=(1, 100), samples_per_axis=(1, 16), threads=limits.THREADS)
        limits.within(self, samples=(32, 1 << 15), frames=(8, 1 << 15))
        limits.within(self, agreement_samples=(64, 1 << 15), agreement_frames=(16, 1 << 15))
        limits.within(self, tile_level=(0, 10), agreement_level=(0, 9))
        for name, low in (("samples", 32), ("frames", 8), ("agreement_samples", 64), ("agreement_frames", 16)):
            value = getattr(self, name)
            require(value >= low and value & (value - 1) == 0, name, f"a power of two from {low}", value)
        require(self.tsar.framelet_side == FRAMELET_SIDE, "framelet_side", "16", self.tsar.framelet_side)
        for name, side in (("tile_level", self.samples), ("agreement_level", self.agreement_samples)):
            value = getattr(self, name)  # sample positions are multiples of 1 / 65536
            require(0 <= value and 2**value * side <= 2**15, name, "0 or more, at most 2^15 samples a picture", value)
        tiles, most = self.tiles_per_input, 4 ** (self.agreement_level + 1)
        require(4 <= tiles <= most and tiles % 4 == 0, "tiles_per_input", f"a multiple of 4 up to {most}", tiles)
        require(all(0 <= place < 1 for place in self.tile_at), "tile_at", "x and y in [0, 1)", self.tile_at)
        index, count = self.tile_index, 4**self.tile_level
        require(index is None or 0 <= index < count, "tile_index", f"between 0 and {count - 1}", index)
        require(0 < self.span_s <= 3, "span_s", "a number in (0, 3]", self.span_s)
        require(-3 <= self.start_s <= 6 - self.span_s, "start_s", "within the animation, from -3 to 6 s", self.start_s)
        require(0 < self.tau < 1, "tau", "a share in (0, 1)", self.tau)

    def does(self, part: Part) -> bool:
        """Whether a part is wanted."""
        return self.only in (None, part)

    def cycle_s(self) -> float:
        """Seconds of a cycle at the simulated machine's default speed, by the thesis' ledger."""
        from analysis.comparison.experiment import RunOptions
        from analysis.metrics.cost_model import CAPACITY_DEFAULT, adaptive_flops

        return float(adaptive_flops(RunOptions(self.input, tsar=self.tsar).cost)) / CAPACITY_DEFAULT


@dataclass(frozen=True)
class Spectrum:
    """Radial power of a picture or a set of framelets.

    Attributes:
        name, group, source: what it is, the kind it is counted with, and the input or file it comes from.
        power: mean power of compressed luminance at 1, 2, … cycles per picture.
        slope, offset: of the line through log10 power over log10 frequency.
        slope_linear: the same slope for linear luminance.
        picture: what was measured, sRGB, or None.
    """

    name: str
    group: str
    source: str
    power: Floats
    slope: float
    offset: float
    slope_linear: float
    picture: NDArray[np.uint8] | None = None


def squares(plane: Floats) -> Floats:
    """Cuts a plane ``(h, w)`` into the squares, a power of two wide, that fit side by side about its middle."""
    height, width = plane.shape
    side = 1 << (min(height, width).bit_length() - 1)
    top, left = (height % side) // 2, (width % side) // 2
    cut = plane[top : top + height // side * side, left : left + width // side * side]
    return cut.reshape(height // side, side, width // side, side).swapaxes(1, 2).reshape(-1, side, side)


def radial_power(planes: Floats) -> Floats:
    """Mean power per frequency of square planes ``(n, side, side)`` at 1 … side / 2 cycles, over angles and planes.

    The mean is taken off and a Hann window laid over each plane: its opposite borders do not meet, and their jump would
    be a bright cross along the axes, of slope -2 whatever the picture shows.
    """
    side = planes.shape[1]
    hann = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(side) / side)
    window = hann[:, None] * hann
    mean = (planes * window).sum((1, 2), keepdims=True) / window.sum()
    power = np.abs(np.fft.fft2((planes - mean) * window)) ** 2
    power = power.mean(0) / (window**2).sum()
    frequency = np.fft.fftfreq(side, 1.0 / side)
    radius = np.rint(np.hypot(frequency[:, None], frequency)).astype(np.int64).ravel()
    total = np.bincount(radius, power.ravel()) / np.bincount(radius)
    return total[1 : side // 2 + 1]


def fit_slope(power: Floats) -> tuple[float, float]:
    """Slope and offset of the least-squares line through log10 power over log10 frequency; NaN where power is zero.

    From the second bin on, for the window spreads into the first what is constant, to half the sampling rate. Bins
    weigh the inverse of their frequency, so that every octave counts alike: half of all bins lie in the last one,
    which is also the one that aliasing and pixel filters change.
    """
    frequency = np.arange(1, len(power) + 1)
    used = slice(_FIRST_BIN - 1, None)
    if not (power[used] > 0).all():
        return np.nan, np.nan
    weight = 1.0 / np.sqrt(frequency[used])  # polyfit squares it
    slope, offset = np.polyfit(np.log10(frequency[used]), np.log10(power[used]), 1, w=weight)
    return float(slope), float(offset)


def spectrum_of(planes: Callable[[Floats], Floats], color: NDArray[np.float32], **names: Any) -> Spectrum:
    """Spectrum of linear RGB ``(..., 3)``, whose luminance a function turns into square planes.

    Compressed luminance leads: the error estimate works on it, it is close to what a display is sent, and in linear
    luminance one sun is a picture's whole spectrum.
    """
    import torch

    from tsar.error import compressed_luminance

    compressed = compressed_luminance(torch.from_numpy(np.array(color))).numpy().astype(np.float64)
    power = radial_power(planes(compressed))
    slope, offset = fit_slope(power)
    linear, _ = fit_slope(radial_power(planes(color.astype(np.float64) @ _REC709)))
    return Spectrum(power=power, slope=slope, offset=offset, slope_linear=linear, **names)


def picture_spectrum(path: Path, group: str) -> Spectrum:
    """Spectrum of a picture on disk, averaged over the squares it is cut into.

    Raises:
        InputError: it cannot be read, is too small, or shows nothing.
    """
    from scenes.loading import read_image

    try:
        color = read_image(path)
    except ValueError as error:
        raise InputError(str(error).removeprefix("texture ")) from error
    if min(color.shape[:2]) < _LEAST_SIDE:
        raise InputError(f"{path}: expected at least {_LEAST_SIDE} pixels a side, got {color.shape[1::-1]}")
    side = 1 << (min(color.shape[:2]).bit_length() - 1)
    top, left = ((size - side) // 2 for size in color.shape[:2])
    picture = shown(color[top : top + side, left : left + side])
    found = spectrum_of(squares, color, name=path.name, group=group, source=path.name, picture=picture)
    if np.isnan(found.slope) or found.power.max() < _ROUNDING:
        raise InputError(f"{path}: expected a picture that shows something, got a constant one")
    return found


def shown(color: NDArray[np.float32]) -> NDArray[np.uint8]:
    """sRGB of linear RGB, at most 512 pixels wide."""
    import torch

    from renderer.film.files import encode_srgb

    step = -(-color.shape[1] // 512)
    return encode_srgb(torch.from_numpy(color[::step, ::step].copy()))


def input_spectra(options: SpectrumOptions, name: str, done: Callable[[], None]) -> Iterator[Spectrum]:
    """Frames of an input with one sample a pixel and supersampled, and its framelets at every level of the tiling."""
    renderer, duration_s = open_input(options, name)
    times_s = (np.arange(options.frames_per_input) + 0.5) * duration_s / options.frames_per_input
    side, levels = options.tsar.resolution_px, range(options.tsar.level_min, options.tsar.level_max + 1)
    for time_s in times_s:
        for axis in (1, options.samples_per_axis):
            color = renderer.render_frame(float(time_s), side, side, axis).numpy()
            names = {"name": f"{name} {time_s:.2f} s", "group": f"frames, {axis}² samples a pixel", "source": name}
            yield spectrum_of(squares, color, **names, picture=shown(color))
            done()
    for level in levels:
        color = np.concatenate([_framelets(renderer, level, float(time_s)) for time_s in times_s])
        group = f"framelets, level {level}"
        yield spectrum_of(_planes, color, name=f"{name} {group}", group=group, source=name)
        done()
    renderer.close()


def _framelets(renderer: Renderer, level: int, time_s: float) -> NDArray[np.float32]:
    """Colours of all framelets of a level at one time, ``(n, samples, 3)``, Morton order."""
    import torch

    from tsar.selection import sample_positions
    from tsar.types import FrameletBatch

    found = []
    for index in torch.arange(4**level).split(_LAUNCH_SAMPLES // FRAMELET_SIDE**2):
        position = sample_positions(torch.full_like(index, level), index, FRAMELET_SIDE)
        found.append(renderer.trace(FrameletBatch(torch.full_like(index, level), index, position, time_s)).color)
    return torch.cat(found).numpy()


def _planes(framelets: Floats) -> Floats:
    """Framelets in Morton order as planes ``(n, side, side)``."""
    from tsar.morton import raster_to_morton

    return framelets[:, raster_to_morton(FRAMELET_SIDE).numpy()].reshape(-1, FRAMELET_SIDE, FRAMELET_SIDE)


def group_statistics(spectra: Iterable[Spectrum]) -> dict[str, Any]:
    """Slopes of each group: how many, their mean, least and greatest, for both encodings."""
    groups: dict[str, list[Spectrum]] = {}
    for spectrum in spectra:
        groups.setdefault(spectrum.group, []).append(spectrum)
    found = {}
    for name, members in groups.items():
        found[name] = {"count": len(members)}
        for encoding in ("slope", "slope_linear"):
            values = np.array([getattr(member, encoding) for member in members])
            found[name][encoding] = {"mean": values.mean(), "least": values.min(), "greatest": values.max()}
    return found


def open_input(options: SpectrumOptions, name: str) -> tuple[Renderer, float]:
    """Renderer of an input, with textures filtered as for the adaptive renderer, and its length in seconds."""
    from renderer.trace import Renderer
    from scenes import catalog

    with bad_input():
        scene = catalog.load(name)
        side = float(options.tsar.resolution_px)
        return Renderer(scene, threads=options.threads or None, footprint_resolution_px=side), scene.duration_s
