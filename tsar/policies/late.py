"""A finished image, warped to the poses of a later time.

Every pixel moves to the later position of its surface. Of several that arrive in the same pixel the nearest counts; the
image is interpolated at the position from which it came. A gap of one pixel takes the deepest of its neighbours. A
wider gap repeats the border of the image where it lay outside of it. A gap that was hidden is filled from its
surroundings, from static surfaces if there are any, because a surface that comes into view from behind an object is
background.

Source: McMillan and Bishop 1995 (forward warping); Mark, McMillan and Bishop 1997 (warping of a frame to the newest
poses).
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Float64, Int64
from torch import Tensor

from tsar.policies.resampling import BILINEAR_FLOPS, bilinear, nearest
from tsar.policies.scatter import pull_push
from tsar.policies.surfaces import PROJECT_FLOPS, Surfaces, centres, seen, within
from tsar.types import Viewpoint

NEARER = 0.93
"""A surface nearer than this share of a depth lies in front of it and is not the same surface."""

WARP_FLOPS = PROJECT_FLOPS + 4.0 + 17.0 + 4.0 + 2.0 + BILINEAR_FLOPS + 4.0 / 3.0 * 2.0 * 64.0
"""Operations of a warp per pixel: its projection; rounding and comparison; the deepest of eight neighbours, for gaps;
the source position; whether a surface covers it; interpolation; and two pyramids, of motion and of colours, whose
levels have a third more pixels than the image. Each takes products of weights and channels, their sums, a division, two
enlargements and a blend."""


def warped(image: Float[Tensor, "h w 3"], surfaces: Surfaces, view: Viewpoint) -> Float[Tensor, "h w 3"]:
    """The image as its surfaces appear in another view.

    Args:
        image: linear RGB of the surfaces.
        surfaces: first hits of the same pixels.
        view: the poses to warp to.
    """
    centre = centres(*image.shape[:2])
    landing, deep = seen(surfaces, view)
    depth = deep.clamp(min=0.0).to(torch.float32)
    arrived = _winners(landing, depth)
    source = torch.where(arrived < 0, _deepest_beside(arrived, depth), arrived)
    known, place = source >= 0, source.clamp(min=0)
    back = torch.where(known[..., None], (centre - landing).reshape(-1, 2)[place], 0.0)
    at_depth = torch.where(known, depth.reshape(-1)[place], 0.0)
    # a narrow gap may lie on the same surface, or beside a nearer one, which must not be read
    read_at = centre + back
    covered = (arrived < 0) & (nearest(depth, read_at) < NEARER * at_depth)
    read_at = torch.where(covered[..., None], centre.reshape(-1, 2)[place], read_at)
    if not bool(known.all()):
        read_at = torch.where(known[..., None], read_at, centre + _spread(back, known))
    shown = bilinear(image, read_at)
    hidden = ~known & within(read_at)
    if not bool(hidden.any()):
        return shown
    moves = (surfaces.instance >= 0) & (view.track_of_instance[surfaces.instance.clamp(min=0).to(torch.int64)] > 0)
    still = known & ~moves.reshape(-1)[place]
    around = (still if bool(still.any()) else known).to(torch.float32)
    filled = pull_push(shown.permute(2, 0, 1), around[None]).permute(1, 2, 0)
    return torch.where(hidden[..., None], filled, shown)


def _winners(landing: Float64[Tensor, "h w 2"], depth: Float[Tensor, "h w"]) -> Int64[Tensor, "h w"]:
    """Index of the nearest pixel that arrives in each pixel, -1 where none does; among equals the first."""
    (height, width), count = landing.shape[:2], landing.shape[0] * landing.shape[1]
    target = (landing + 0.5).nan_to_num(nan=-1.0, posinf=-1.0, neginf=-1.0).floor()
    inside = ((target >= 0) & (target < target.new_tensor((width, height)))).all(-1) & (depth > 0)
    cell = torch.where(inside, target[..., 1] * width + target[..., 0], count).to(torch.int64).reshape(-1)
    # the bits of positive floats are ordered as the floats are
    key = (depth.view(torch.int32).to(torch.int64).reshape(-1) << 32) | torch.arange(count)
    none = torch.iinfo(torch.int64).max
    best = torch.full((count + 1,), none).scatter_reduce(0, cell, key, "amin")[:-1]
    return torch.where(best == none, -1, best & 0xFFFFFFFF).reshape(height, width)


def _deepest_beside(arrived: Int64[Tensor, "h w"], depth: Float[Tensor, "h w"]) -> Int64[Tensor, "h w"]:
    """Index of the deepest pixel that arrived in the eight pixels around; -1 where none did; among equals the first."""
    height, width = arrived.shape
    sources = F.pad(arrived, (1, 1, 1, 1), value=-1)
    depths = torch.where(sources >= 0, depth.reshape(-1)[sources.clamp(min=0)], -1.0)
    deepest, found = torch.full_like(depth, -1.0), torch.full_like(arrived, -1)
    for row in range(3):
        for column in range(3):
            there = depths[row : row + height, column : column + width]
            deeper = there > deepest
            deepest = torch.where(deeper, there, deepest)
            found = torch.where(deeper, sources[row : row + height, column : column + width], found)
    return found


def _spread(back: Float64[Tensor, "h w 2"], known: Bool[Tensor, "h w"]) -> Float64[Tensor, "h w 2"]:
    """The motion, with unknown pixels filled from the known ones around them."""
    planes = F.pad(back.permute(2, 0, 1), (0, 0, 0, 0, 0, 1)).to(torch.float32)
    return pull_push(planes, known[None].to(torch.float32))[:2].permute(1, 2, 0).to(torch.float64)
