"""Pictures of tilings and density fields as arrays, without a loop over pixels or tiles."""

from __future__ import annotations

import io
import math
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

Pixels = NDArray[np.uint8]

DENSITY_MAP = "viridis"
RATE_MAP = "inferno"
AGE_MAP = "YlGnBu"
NEVER = (176, 48, 48)
"""Colour, in no map, of what has not been sampled yet."""


@lru_cache(maxsize=8)
def font(size_px: int) -> ImageFont.FreeTypeFont:
    """DejaVu Sans as matplotlib ships it, so that no font of the system is needed."""
    import matplotlib

    path = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"
    return ImageFont.truetype(str(path), size_px)


@lru_cache(maxsize=4)
def palette(name: str) -> Pixels:
    """``(256, 3)`` colours of a map whose lightness only rises or only falls."""
    import matplotlib

    return (matplotlib.colormaps[name](np.arange(256))[:, :3] * 255.0 + 0.5).astype(np.uint8)


def colour(values: NDArray[np.float64], bounds: tuple[float, float], name: str) -> Pixels:
    """Colours of positive values on a logarithmic scale between the bounds."""
    low, high = math.log(bounds[0]), math.log(bounds[1])
    share = (np.log(np.maximum(values, bounds[0])) - low) / max(high - low, 1e-12)
    return palette(name)[np.clip(share * 255.0 + 0.5, 0, 255).astype(np.int64)]


@lru_cache(maxsize=4)
def _pixel_curve(resolution_px: int, level: int) -> Tensor:
    """Morton index at ``level`` of the cell that each pixel centre lies in, ``(resolution, resolution)``."""
    cell = ((torch.arange(resolution_px) * 2 + 1) << level) // (2 * resolution_px)
    return interleave(
        cell[None, :].expand(resolution_px, resolution_px), cell[:, None].expand(resolution_px, resolution_px)
    )


def tile_map(tiling: Tiling, resolution_px: int) -> NDArray[np.int64]:
    """For each pixel the tile that covers it, ``(resolution, resolution)``."""
    level = int(tiling.level.max())
    first, order = torch.sort(tiling.index << (2 * (level - tiling.level)))
    position = torch.searchsorted(first, _pixel_curve(resolution_px, level), right=True) - 1
    return order[position].numpy()


def tiling_image(
    tiling: Tiling, temporal: Float[Tensor, " e"], resolution_px: int, bounds: tuple[float, float] = (1 / 64, 1.0)
) -> Pixels:
    """Tiles coloured by refresh rate, with outlines.

    Args:
        tiling: tiles that cover the image once.
        temporal: temporal density over the field elements, Morton order, refreshes per cycle.
        resolution_px: width and height of the picture.
        bounds: least and greatest density of the colour scale.

    Returns:
        ``(resolution, resolution, 3)`` uint8.
    """
    field_level = (temporal.numel().bit_length() - 1) // 2
    middle = (tiling.index << (2 * (field_level - tiling.level).clamp(min=0))) >> (
        2 * (tiling.level - field_level).clamp(min=0)
    )
    last = middle + (4 ** (field_level - tiling.level).clamp(min=0))
    prefix = torch.cat((temporal.new_zeros(1, dtype=torch.float64), temporal.to(torch.float64).cumsum(0)))
    mean = ((prefix[last] - prefix[middle]) / (last - middle)).numpy()
    tiles = tile_map(tiling, resolution_px)
    image = colour(mean, bounds, RATE_MAP)[tiles]
    edge = np.zeros(tiles.shape, dtype=bool)
    edge[:, 1:] |= tiles[:, 1:] != tiles[:, :-1]
    edge[1:, :] |= tiles[1:, :] != tiles[:-1, :]
    image[edge] = (90, 130, 150)
    return image


def density_image(
    density: Float[Tensor, " e"], bounds: tuple[float, float], resolution_px: int, name: str = DENSITY_MAP
) -> Pixels:
    """A field in Morton order as a picture ``(resolution, resolution, 3)``, on a logarithmic colour scale."""
    side = math.isqrt(density.numel())
    raster = density[raster_to_morton(side)].reshape(side, side).numpy().astype(np.float64)
    return enlarge(colour(raster, bounds, name), resolution_px)


def age_image(
    newest_s: Float[Tensor, "h w"], time_s: float, bounds_s: tuple[float, float], width_px: int, height_px: int = 0
) -> Pixels:
    """Age at ``time_s`` of the newest samples, on a logarithmic colour scale; ``NEVER`` where there are none."""
    age_s = time_s - newest_s.numpy().astype(np.float64)
    image = colour(np.where(np.isfinite(age_s), age_s, bounds_s[1]), bounds_s, AGE_MAP)
    image[~np.isfinite(age_s)] = NEVER
    return enlarge(image, width_px, height_px)


def enlarge(image: Pixels, width_px: int, height_px: int = 0) -> Pixels:
    """A picture at another size, by default a square: whole pixels when it grows by whole numbers, a smooth average
    otherwise."""
    size, (height, width) = (height_px or width_px, width_px), image.shape[:2]
    if (height, width) == size:
        return image
    if size[0] % height == 0 and size[1] % width == 0:
        return image.repeat(size[0] // height, 0).repeat(size[1] // width, 1)
    how = Image.Resampling.BOX if size[1] < width else Image.Resampling.BICUBIC
    return np.asarray(Image.fromarray(image).resize((size[1], size[0]), how))


def with_scale(image: Pixels, bounds: tuple[float, float], unit: str, name: str) -> Pixels:
    """A copy with a labelled colour scale along its lower edge."""
    height, width = image.shape[:2]
    size = max(9, width // 26)
    bar, margin = max(5, size // 2), max(4, width // 40)
    picture = Image.fromarray(image)
    draw = ImageDraw.Draw(picture)
    top = height - margin - bar
    draw.rectangle((0, top - size - 3 * margin // 2, width, height), fill=(20, 20, 20))
    ramp = palette(name)[np.linspace(0, 255, width - 2 * margin).astype(np.int64)]
    picture.paste(Image.fromarray(np.broadcast_to(ramp, (bar, *ramp.shape)).copy()), (margin, top))
    style = {"font": font(size), "fill": (235, 235, 235)}
    baseline = top - margin // 2
    draw.text((margin, baseline), number(bounds[0]), anchor="ls", **style)
    draw.text((width // 2, baseline), unit, anchor="ms", **style)
    draw.text((width - margin, baseline), number(bounds[1]), anchor="rs", **style)
    return np.asarray(picture)


def number(value: float) -> str:
    """Three digits; reciprocals of whole numbers as 1/n."""
    if 0 < value < 1 and abs(1 / value - round(1 / value)) < 1e-9:
        return f"1/{round(1 / value)}"
    return f"{value:.0f}" if 1000 <= value < 1e6 else f"{value:.3g}"


def webp_bytes(pixels: Pixels, lossless: bool) -> bytes:
    """An array ``(h, w, 3)`` uint8 as WebP, exact or at a quality fit for photographs."""
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, format="WEBP", lossless=lossless, quality=60 if lossless else 90, method=4)
    return buffer.getvalue()
