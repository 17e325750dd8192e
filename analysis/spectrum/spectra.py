"""Power spectra of pictures and framelets.

Source: Stephens 2011, sec. 1.3.4.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from analysis.command.cli import InputError, bad_input
from analysis.metrics.arrays import Floats
from analysis.spectrum.options import FRAMELET_SIDE, SpectrumOptions

if TYPE_CHECKING:
    from analysis.command.progress import Task
    from renderer.trace import Renderer


PHOTOGRAPHS = ("landscape_band.jpg", "sky.exr")
_LEAST_SIDE = 32
_ROUNDING = 1e-18  # a constant picture has at most 1e-28, and one with a single pixel of 2048² off by 1/255 has 3e-11
_FIRST_BIN = 2
_LAUNCH_SAMPLES = 1 << 18


@dataclass(frozen=True)
class Spectrum:
    """Radial power of a picture or a set of framelets.

    Attributes:
        name, group, source: its name, the group it is counted in, and its input or file.
        power: mean power of compressed luminance at 1, 2, … cycles per picture.
        slope, offset: slope and offset of the line through log10 power over log10 frequency.
        slope_linear: the same slope for linear luminance.
        picture: the measured picture, sRGB, or None.
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

    The mean is subtracted and a Hann window is applied to each plane. Without the window, the jump between opposite
    borders would add a cross along the axes, of slope -2 for any picture.
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

    The fit runs from the second bin, because the window spreads the constant part into the first, to half the sampling
    rate. Bins are weighted by the inverse of their frequency, so that every octave has the same weight: half of all
    bins lie in the last octave, which aliasing and pixel filters change most.
    """
    frequency = np.arange(1, len(power) + 1)
    used = slice(_FIRST_BIN - 1, None)
    if not (power[used] > 0).all():
        return np.nan, np.nan
    weight = 1.0 / np.sqrt(frequency[used])  # polyfit squares the weights
    slope, offset = np.polyfit(np.log10(frequency[used]), np.log10(power[used]), 1, w=weight)
    return float(slope), float(offset)


def spectrum_of(planes: Callable[[Floats], Floats], color: NDArray[np.float32], **names: Any) -> Spectrum:
    """Spectrum of linear RGB ``(..., 3)``; ``planes`` cuts its luminance into square planes.

    The spectrum is that of compressed luminance: the error estimate uses it, it is close to display encoding, and in
    linear luminance the sun alone would dominate the spectrum of a picture.
    """
    import torch

    from tsar.error import compressed_luminance
    from tsar.types import LUMINANCE

    compressed = compressed_luminance(torch.from_numpy(np.array(color))).numpy().astype(np.float64)
    power = radial_power(planes(compressed))
    slope, offset = fit_slope(power)
    linear, _ = fit_slope(radial_power(planes(color.astype(np.float64) @ LUMINANCE)))
    return Spectrum(power=power, slope=slope, offset=offset, slope_linear=linear, **names)


def picture_spectrum(path: Path, group: str) -> Spectrum:
    """Spectrum of a picture on disk, averaged over the squares it is cut into.

    Raises:
        InputError: the picture cannot be read, is too small, or is constant.
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
        raise InputError(f"{path}: expected a picture that is not constant, got a constant one")
    return found


def shown(color: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Linear RGB encoded as sRGB, at most 512 pixels wide."""
    import torch

    from renderer.film.files import encode_srgb

    step = -(-color.shape[1] // 512)
    return encode_srgb(torch.from_numpy(color[::step, ::step].copy()))


def input_spectra(options: SpectrumOptions, name: str, task: Task) -> Iterator[Spectrum]:
    """Frames of an input with one sample a pixel and supersampled, and its framelets at every level of the tiling."""
    renderer, duration_s = open_input(options, name)
    times_s = (np.arange(options.frames_per_input) + 0.5) * duration_s / options.frames_per_input
    side, levels = options.tsar.resolution_px, range(options.tsar.level_min, options.tsar.level_max + 1)
    for time_s in times_s:
        for axis in options.sampled:
            color = renderer.render_frame(float(time_s), side, side, axis).numpy()
            names = {"name": f"{name} {time_s:.2f} s", "group": f"frames, {axis}² samples a pixel", "source": name}
            yield spectrum_of(squares, color, **names, picture=shown(color))
            task.advance()
    for level in levels:
        color = np.concatenate([_framelets(renderer, level, float(time_s)) for time_s in times_s])
        group = f"framelets, level {level}"
        yield spectrum_of(_planes, color, name=f"{name} {group}", group=group, source=name)
        task.advance()
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
    """Slopes of each group: their number, mean, least and greatest, for both encodings."""
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
