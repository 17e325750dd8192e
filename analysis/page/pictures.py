"""Pictures of tilings and density fields as arrays, without a loop over pixels or tiles.

A map is stored as one byte for each place: 1 to 255 divide the bounds of its scale logarithmically, and 0 means no
value. Colours are applied when the map is shown.
"""

from __future__ import annotations

import io
import math
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from torch import Tensor

from tsar.morton import interleave, raster_to_morton
from tsar.types import Tiling

PagePixels = NDArray[np.uint8]

DENSITY_MAP = "viridis"
RATE_MAP = "inferno"
AGE_MAP = "YlGnBu"
NEVER = (176, 48, 48)
"""Colour of places that have not been sampled yet; no palette contains it."""
EDGE = (90, 130, 150)
"""Colour of the edges of tiles."""


@dataclass(frozen=True)
class ColorScale:
    """The meaning of the bytes of a map, and their colours.

    Attributes:
        bounds: values of the bytes 1 and 255.
        unit: unit of the values, in words.
        palette: name of a palette of monotonic lightness.
        shown: values at the two ends of the palette, within the bounds.
        special: colour of the byte 0.
        meaning: meaning of the byte 0; empty if no place has it.
    """

    bounds: tuple[float, float]
    unit: str
    palette: str
    shown: tuple[float, float]
    special: tuple[int, int, int] = NEVER
    meaning: str = ""

    @classmethod
    def of(cls, bounds: tuple[float, float], unit: str, palette: str, **more) -> ColorScale:
        """A scale whose palette spans its bounds."""
        return cls(bounds, unit, palette, bounds, **more)

    def fitted(self, counts: NDArray[np.int64]) -> ColorScale:
        """The same scale with a palette that spans the middle 98 % of the values, rounded outwards to 1, 2 or 5 times a
        power of ten.

        Args:
            counts: number of places with each of the 256 bytes.
        """
        known = np.cumsum(counts[1:])
        if known[-1] == 0:
            return self
        low, high = (int(np.searchsorted(known, share * known[-1])) for share in (0.01, 0.99))
        ends = round_number(self._value(low), up=False), round_number(self._value(high), up=True)
        least, most = max(ends[0], self.bounds[0]), min(ends[1], self.bounds[1])
        return replace(self, shown=(least, most)) if least < most else self

    def _value(self, place: int) -> float:
        return self.bounds[0] * (self.bounds[1] / self.bounds[0]) ** (place / 254)

    def colours(self) -> PagePixels:
        """``(256, 3)`` colours of the bytes."""
        values = self.bounds[0] * (self.bounds[1] / self.bounds[0]) ** (np.arange(-1, 255) / 254)
        found = colour(values, self.shown, self.palette)
        found[0] = self.special
        return found


@dataclass(frozen=True)
class ByteMap:
    """A byte for each place, ``(rows, columns)``, and the scale of the bytes."""

    places: PagePixels
    scale: ColorScale

    def pixels(self) -> PagePixels:
        """Colours, ``(rows, columns, 3)``."""
        return self.scale.colours()[self.places]


def round_number(value: float, up: bool) -> float:
    """The nearest 1, 2 or 5 times a power of ten that is not smaller, or not greater, up to rounding."""
    power = 10.0 ** math.floor(math.log10(value) + 1e-9)
    steps = [s for s in (1.0, 2.0, 5.0, 10.0) if (s * power >= value * 0.999 if up else s * power <= value * 1.001)]
    return (steps[0] if up else steps[-1]) * power


@lru_cache(maxsize=8)
def font(size_px: int) -> ImageFont.FreeTypeFont:
    """DejaVu Sans from matplotlib, so that no system font is needed."""
    import matplotlib

    path = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"
    return ImageFont.truetype(str(path), size_px)


@lru_cache(maxsize=4)
def palette(name: str) -> PagePixels:
    """``(256, 3)`` colours of a colour map of monotonic lightness."""
    import matplotlib

    return (matplotlib.colormaps[name](np.arange(256))[:, :3] * 255.0 + 0.5).astype(np.uint8)


def colour(values: NDArray[np.float64], bounds: tuple[float, float], name: str) -> PagePixels:
    """Colours of positive values on a logarithmic scale between the bounds."""
    low, high = math.log(bounds[0]), math.log(bounds[1])
    share = (np.log(np.maximum(values, bounds[0])) - low) / max(high - low, 1e-12)
    return palette(name)[np.clip(share * 255.0 + 0.5, 0, 255).astype(np.int64)]


def stored(values: NDArray[np.float64], bounds: tuple[float, float]) -> PagePixels:
    """Bytes of positive values; 0 where a value is not finite."""
    known = np.isfinite(values)
    share = np.log(np.clip(np.where(known, values, bounds[0]), *bounds) / bounds[0]) / math.log(bounds[1] / bounds[0])
    return np.where(known, share * 254.0 + 1.5, 0.0).astype(np.uint8)


@lru_cache(maxsize=4)
def _pixel_curve(resolution_px: int, level: int) -> Tensor:
    """Morton index at ``level`` of the cell that each pixel centre lies in, ``(resolution, resolution)``."""
    cell = ((torch.arange(resolution_px) * 2 + 1) << level) // (2 * resolution_px)
    return interleave(
        cell[None, :].expand(resolution_px, resolution_px), cell[:, None].expand(resolution_px, resolution_px)
    )


def tile_map(tiling: Tiling, resolution_px: int) -> NDArray[np.int64]:
    """Index of the tile that covers each pixel, ``(resolution, resolution)``."""
    level = int(tiling.level.max())
    first, order = torch.sort(tiling.index << (2 * (level - tiling.level)))
    position = torch.searchsorted(first, _pixel_curve(resolution_px, level), right=True) - 1
    return order[position].numpy()


def tiling_map(
    tiling: Tiling, temporal: Float[Tensor, " e"], resolution_px: int, bounds: tuple[float, float] = (1 / 64, 1.0)
) -> ByteMap:
    """Tiles by refresh rate, with outlines.

    Args:
        tiling: tiles that cover the image once.
        temporal: temporal density over the field elements, Morton order, refreshes per cycle.
        resolution_px: width and height of the map.
        bounds: least and greatest density of the colour scale.
    """
    field_level = (temporal.numel().bit_length() - 1) // 2
    middle = (tiling.index << (2 * (field_level - tiling.level).clamp(min=0))) >> (
        2 * (tiling.level - field_level).clamp(min=0)
    )
    last = middle + (4 ** (field_level - tiling.level).clamp(min=0))
    prefix = torch.cat((temporal.new_zeros(1, dtype=torch.float64), temporal.to(torch.float64).cumsum(0)))
    mean = ((prefix[last] - prefix[middle]) / (last - middle)).numpy()
    tiles = tile_map(tiling, resolution_px)
    places = stored(mean, bounds)[tiles]
    edge = np.zeros(tiles.shape, dtype=bool)
    edge[:, 1:] |= tiles[:, 1:] != tiles[:, :-1]
    edge[1:, :] |= tiles[1:, :] != tiles[:-1, :]
    places[edge] = 0
    scale = ColorScale.of(bounds, "refreshes per cycle", RATE_MAP, special=EDGE, meaning="edge of a tile")
    return ByteMap(places, scale)


def density_map(
    density: Float[Tensor, " e"], bounds: tuple[float, float], unit: str, name: str = DENSITY_MAP
) -> ByteMap:
    """A field in Morton order as a map in raster order, one byte an element."""
    side = math.isqrt(density.numel())
    raster = density[raster_to_morton(side)].reshape(side, side).numpy().astype(np.float64)
    return ByteMap(stored(raster, bounds), ColorScale.of(bounds, unit, name))


def age_map(newest_s: Float[Tensor, "h w"], time_s: float, bounds_s: tuple[float, float]) -> ByteMap:
    """Age of the newest samples at ``time_s``, milliseconds; ``NEVER`` where there are none."""
    bounds = 1e3 * bounds_s[0], 1e3 * bounds_s[1]
    age_ms = 1e3 * (time_s - newest_s.numpy().astype(np.float64))
    return ByteMap(stored(age_ms, bounds), ColorScale.of(bounds, "ms", AGE_MAP, meaning="not sampled yet"))


def enlarge(image: PagePixels, width_px: int, height_px: int = 0) -> PagePixels:
    """A picture at another size, by default a square: pixels are repeated if it grows by whole factors, and averaged
    smoothly otherwise."""
    size, (height, width) = (height_px or width_px, width_px), image.shape[:2]
    if (height, width) == size:
        return image
    if size[0] % height == 0 and size[1] % width == 0:
        return image.repeat(size[0] // height, 0).repeat(size[1] // width, 1)
    how = Image.Resampling.BOX if size[1] < width else Image.Resampling.BICUBIC
    return np.asarray(Image.fromarray(image).resize((size[1], size[0]), how))


def scale_strip(
    width_px: int, height_px: int, scale: ColorScale, ink: tuple[int, int, int], paper: PagePixels | tuple
) -> PagePixels:
    """A colour scale with its ends and its unit, for the place below a map: a bar, and text below it."""
    picture = Image.new("RGB", (width_px, height_px), tuple(paper))
    draw, margin, bar = ImageDraw.Draw(picture), max(4, width_px // 40), max(3, height_px // 5)
    ramp = palette(scale.palette)[np.linspace(0, 255, width_px - 2 * margin).astype(np.int64)]
    picture.paste(Image.fromarray(np.broadcast_to(ramp, (bar, *ramp.shape)).copy()), (margin, 2))
    style = {"font": font(max(6, (height_px - bar) * 5 // 9)), "fill": ink}
    middle = (height_px + bar + 2) // 2
    draw.text((margin, middle), number(scale.shown[0]), anchor="lm", **style)
    draw.text((width_px // 2, middle), scale.unit, anchor="mm", **style)
    draw.text((width_px - margin, middle), number(scale.shown[1]), anchor="rm", **style)
    return np.asarray(picture)


def number(value: float) -> str:
    """A number with three digits; reciprocals of integers as 1/n."""
    if 0 < value < 1 and abs(1 / value - round(1 / value)) < 1e-9:
        return f"1/{round(1 / value)}"
    return f"{value:.0f}" if 1000 <= value < 1e6 else f"{value:.3g}"


def picture_bytes(pixels: PagePixels, exact: bool) -> bytes:
    """An array ``(h, w, 3)`` or ``(h, w)`` uint8 as an image file for browsers: lossless WebP, or AVIF without chroma
    subsampling, whose codes are off by about 1 of 255 on average and by less than 6 in 99 % of places."""
    buffer, image = io.BytesIO(), Image.fromarray(pixels)
    if exact:
        image.save(buffer, format="WEBP", lossless=True, quality=20, method=0)
    else:
        image.save(buffer, format="AVIF", quality=92, subsampling="4:4:4", speed=9, max_threads=1)
    return buffer.getvalue()
