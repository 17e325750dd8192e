"""Progressive rendering in rounds of samples: the error is estimated after each, and tiles below the target get no
more."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Int
from numpy.typing import NDArray
from torch import Tensor

from renderer.frames import TILE_PX, Crop, cut, place_tiles, render_tiles, tiles_of
from renderer.sampling.plan import SamplePlan
from renderer.trace import Renderer

ROUNDS_LEAST = 4
"""Least number of rounds of a tile: fewer do not suffice to estimate its error."""


@dataclass
class Rounds:
    """Sums over the rounds so far, by tiles. Changes in place.

    Attributes:
        total: sum of the means of all rounds, linear radiance.
        coded, squares: sums of the encoded means, ``sqrt(clip(c, 0, 1))`` as in policies, and of their squares.
        count: number of rounds of each tile.
    """

    total: Float[NDArray[np.float64], "tiles 256 3"]
    coded: Float[NDArray[np.float64], "tiles 256 3"]
    squares: Float[NDArray[np.float64], "tiles 256 3"]
    count: Int[NDArray[np.int64], " tiles"]

    @classmethod
    def empty(cls, tiles: int) -> Rounds:
        """The state before the first round."""
        sums = (np.zeros((tiles, TILE_PX**2, 3)) for _ in range(3))
        return cls(*sums, np.zeros(tiles, np.int64))

    def variance(self) -> Float[NDArray[np.float64], "tiles 256 3"]:
        """Variance of each pixel's mean, squared encoded colour: the variance of its rounds over their number."""
        count = np.maximum(self.count, 2)[:, None, None].astype(np.float64)
        spread = (self.squares - self.coded**2 / count) / (count - 1.0)
        return np.where(self.count[:, None, None] > 1, np.maximum(spread, 0.0) / count, math.inf)

    def errors(self) -> Float[NDArray[np.float64], " tiles"]:
        """Root mean square error of each tile, estimated from its rounds, in encoded colour."""
        return np.sqrt(self.variance().mean(axis=(1, 2)))


@dataclass(frozen=True, eq=False)
class Made:
    """A picture rendered in rounds.

    Attributes:
        image: linear radiance.
        samples: number of samples of each pixel.
        variance: variance of each pixel's encoded colour.
        error: root mean square error over the picture, from that variance.
    """

    image: Float[Tensor, "h w 3"]
    samples: Float[Tensor, "h w"]
    variance: Float[Tensor, "h w 3"]
    error: float


def render_rounds(
    renderer: Renderer,
    plan: SamplePlan,
    rounds: int,
    width_px: int,
    height_px: int,
    frame_time_s: float,
    shutter_s: tuple[float, float] = (0.0, 0.0),
    frame: int = 0,
    error_target: float = 0.0,
    crop: Crop | None = None,
    state: Rounds | None = None,
    done: Callable[[int, Rounds], None] = lambda samples, state: None,
) -> Made:
    """Renders a whole frame in rounds; the bits are the same for any number of threads, and wherever it was
    interrupted.

    Args:
        renderer: the scene.
        plan: samples of one round; later rounds take other seeds.
        rounds: maximum number of rounds, at least 2.
        width_px, height_px: size of the picture.
        frame_time_s, shutter_s, frame: see :func:`renderer.frames.render_tiles`.
        error_target: after the first few rounds, a tile with at most this error gets no further ones; 0 for no target.
        crop: part of the picture that is rendered.
        state: state of an earlier call that was interrupted; changes in place.
        done: receives, after each round, the number of its samples and the state.

    Returns:
        The picture and its estimated error.
    """
    tiles = np.array(tiles_of(crop or (0, 0, width_px, height_px), width_px))
    state = state or Rounds.empty(len(tiles))
    for number in range(int(state.count.max()), rounds):
        open_ = np.flatnonzero((state.errors() > error_target) | (state.count < ROUNDS_LEAST))
        open_ = open_[state.count[open_] == number]
        if not len(open_):
            break
        own = dataclasses.replace(plan, seed=(plan.seed + 0x9E3779B9 * number) % (1 << 62))
        colors, _ = render_tiles(
            renderer, own, tiles[open_].tolist(), (width_px, height_px), frame_time_s, shutter_s, frame
        )
        found = colors.numpy().astype(np.float64)
        coded = np.sqrt(np.clip(found, 0.0, 1.0))  # a scale on which equal differences look about equal
        state.total[open_] += found
        state.coded[open_] += coded
        state.squares[open_] += coded**2
        state.count[open_] += 1
        done(len(open_) * TILE_PX**2 * plan.samples_per_pixel, state)
    counts = np.broadcast_to(state.count[:, None, None], state.total.shape)
    variance = _placed(state.variance(), tiles, width_px, height_px, crop)
    return Made(
        _placed(state.total / counts, tiles, width_px, height_px, crop),
        _placed(counts * plan.samples_per_pixel, tiles, width_px, height_px, crop)[..., 0],
        variance,
        float(variance.mean().sqrt()),
    )


def _placed(values: NDArray, tiles: NDArray, width_px: int, height_px: int, crop: Crop | None) -> Tensor:
    image = torch.zeros(height_px, width_px, 3)
    place_tiles(image, tiles.tolist(), torch.from_numpy(values.astype(np.float32)))
    return cut(image, crop)
