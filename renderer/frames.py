"""Frames as batches of framelets: the samples of every pixel are one group, and tiles of pixels are traced by the same
kernel as framelets.

The pixels of a tile have the same bits whichever tiles are rendered together, and on any machine.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import torch
from jaxtyping import Float, Int
from numpy.typing import NDArray
from torch import Tensor

from renderer.sampling.plan import SamplePlan
from renderer.trace import Renderer
from tsar.morton import deinterleave
from tsar.types import FrameletBatch

TILE_PX = 16
"""Side of a tile. Tiles are always traced whole, even where they extend beyond the picture: the grouping of samples
into packets must not depend on the picture's size."""

Crop = tuple[int, int, int, int]
"""Part of a picture: left column, upper row, width and height, pixels."""

_SAMPLES_AT_ONCE = 1 << 18


def tile_count(width_px: int, height_px: int) -> int:
    """Number of tiles that cover a picture; they are numbered row by row."""
    return -(-width_px // TILE_PX) * -(-height_px // TILE_PX)


def tiles_of(crop: Crop, width_px: int) -> list[int]:
    """Numbers of the tiles that a part of a picture touches, row by row."""
    left, top, width, height = crop
    across = -(-width_px // TILE_PX)
    columns = range(left // TILE_PX, -(-(left + width) // TILE_PX))
    return [row * across + column for row in range(top // TILE_PX, -(-(top + height) // TILE_PX)) for column in columns]


def cut(image: Float[Tensor, "h w 3"], crop: Crop | None) -> Float[Tensor, "h w 3"]:
    """A part of a picture; all of it where there is no crop."""
    if crop is None:
        return image
    left, top, width, height = crop
    return image[top : top + height, left : left + width].contiguous()


def tile_pixels(
    tiles: Sequence[int] | NDArray[np.int64], width_px: int
) -> tuple[Int[NDArray[np.int64], "tiles 256"], Int[NDArray[np.int64], "tiles 256"]]:
    """Columns and rows of the pixels of tiles, in Morton order within each tile."""
    across = -(-width_px // TILE_PX)
    index = np.asarray(tiles, np.int64)[:, None]
    x, y = (np.asarray(part) for part in deinterleave(torch.arange(TILE_PX**2)))
    return index % across * TILE_PX + x, index // across * TILE_PX + y


def render_tiles(
    renderer: Renderer,
    plan: SamplePlan,
    tiles: Sequence[int],
    size_px: tuple[int, int],
    frame_time_s: float,
    shutter_s: tuple[float, float] = (0.0, 0.0),
    frame: int = 0,
) -> tuple[Float[Tensor, "tiles 256 3"], dict[str, int]]:
    """Means of the samples of every pixel of some tiles, and the counts of rays traced.

    Args:
        renderer: the scene.
        plan: positions of samples in the pixel, and their times within the shutter's.
        tiles: numbers of the tiles, see :func:`tile_count`.
        size_px: width and height of the whole picture.
        frame_time_s: time of the frame, seconds.
        shutter_s: opening and closing time of the shutter, relative to the frame's, seconds.
        frame: number of the frame in its sequence.

    Returns:
        Linear radiance, pixels in Morton order, including those outside the picture; and ray counts by kind.
    """
    parts, counters = [], Counter[str]()
    at_once = _tiles_at_once(plan)
    for first in range(0, len(tiles), at_once):
        some = tiles[first : first + at_once]
        samples = _tile_samples(plan, some, size_px, frame_time_s, shutter_s, frame)
        colors, rays = _traced(renderer, samples, len(some), size_px, frame, plan.seed)
        parts.append(colors)
        counters.update(rays)
    return torch.cat(parts), dict(counters)


def _tiles_at_once(plan: SamplePlan) -> int:
    return max(1, _SAMPLES_AT_ONCE // (TILE_PX**2 * plan.samples_per_pixel))


Samples = tuple[NDArray[np.float32], NDArray[np.float64]]


def _tile_samples(
    plan: SamplePlan,
    tiles: Sequence[int],
    size_px: tuple[int, int],
    frame_time_s: float,
    shutter_s: tuple[float, float],
    frame: int,
) -> Samples:
    columns, rows = tile_pixels(tiles, size_px[0])
    return plan.samples(columns.ravel(), rows.ravel(), *size_px, frame_time_s, shutter_s, frame)


def _traced(
    renderer: Renderer, samples: Samples, tiles: int, size_px: tuple[int, int], frame: int, seed: int
) -> tuple[Float[Tensor, "tiles 256 3"], dict[str, int]]:
    position, time_s = samples
    number = torch.zeros(len(position), dtype=torch.int64)
    batch = FrameletBatch(number, number, torch.as_tensor(position), torch.as_tensor(time_s), frame, seed)
    footprint_px = min(size_px) * math.sqrt(position.shape[1])
    answer = renderer.trace(batch, size_px[0] / size_px[1], footprint_px)
    # in the order of the samples, for any number of pixels
    means = answer.color.cpu().numpy().sum(axis=1, dtype=np.float64) / position.shape[1]
    return torch.as_tensor(means.reshape(tiles, TILE_PX**2, 3).astype(np.float32)), answer.counters


def place_tiles(image: Float[Tensor, "h w 3"], tiles: Sequence[int], colors: Float[Tensor, "tiles 256 3"]) -> None:
    """Copies tiles into a picture; pixels outside of it are dropped."""
    height, width = image.shape[:2]
    columns, rows = (torch.as_tensor(part) for part in tile_pixels(tiles, width))
    inside = (columns < width) & (rows < height)
    image[rows[inside], columns[inside]] = colors[inside]


def render_image(
    renderer: Renderer,
    plan: SamplePlan,
    width_px: int,
    height_px: int,
    frame_time_s: float,
    shutter_s: tuple[float, float] = (0.0, 0.0),
    frame: int = 0,
    done: Callable[[int], None] = lambda tiles: None,
    counters: Counter[str] | None = None,
    crop: Crop | None = None,
) -> Float[Tensor, "h w 3"]:
    """A whole frame, linear radiance; see :func:`render_tiles`. ``done`` receives the number of finished tiles, and
    ``counters`` the counts of rays. With ``crop``, only that part is returned, and only the tiles that it touches are
    traced.
    """
    image = torch.zeros(height_px, width_px, 3)
    wanted = tiles_of(crop or (0, 0, width_px, height_px), width_px)
    count = len(wanted)
    at_once = _tiles_at_once(plan)
    size = width_px, height_px
    chunks = [wanted[first : first + at_once] for first in range(0, count, at_once)]
    finished = 0
    with ThreadPoolExecutor(1) as ahead:  # the next samples are placed while these are traced
        waiting = ahead.submit(_tile_samples, plan, chunks[0], size, frame_time_s, shutter_s, frame)
        for tiles, following in zip(chunks, [*chunks[1:], None], strict=True):
            samples = waiting.result()
            if following is not None:
                waiting = ahead.submit(_tile_samples, plan, following, size, frame_time_s, shutter_s, frame)
            colors, rays = _traced(renderer, samples, len(tiles), size, frame, plan.seed)
            place_tiles(image, tiles, colors)
            if counters is not None:
                counters.update(rays)
            finished += len(tiles)
            done(finished)
    return cut(image, crop)


def pictures(
    renderer: Renderer, sampling: SamplePlan | int, width_px: int, height_px: int, crop: Crop | None = None
) -> Callable[[int, float], Float[Tensor, "h w 3"]]:
    """A function ``(number, time_s) -> image`` that renders a frame over the time for which the scene's shutter is
    open.

    Args:
        renderer: the scene.
        sampling: a plan; or an integer, the number of samples along a pixel's side of a regular grid at one time.
        width_px, height_px: size of every frame.
        crop: part of every frame that is returned. A regular grid is traced as a whole and then cropped.
    """
    if not isinstance(sampling, SamplePlan):
        return lambda number, time_s: cut(renderer.render_frame(time_s, width_px, height_px, sampling), crop)
    size, shutter_s = (width_px, height_px), renderer.shutter_s
    return lambda number, time_s: render_image(renderer, sampling, *size, time_s, shutter_s, number, crop=crop)
