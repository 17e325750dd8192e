"""Pixels whose surface was out of sight before, and pixels whose light changed, from first hits alone."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float64, Int64
from torch import Tensor

from analysis.metrics.budget import Places
from tsar.morton import raster_to_morton
from tsar.projection import project
from tsar.selection import sample_positions
from tsar.tiling import uniform
from tsar.types import FrameletBatch, Hits, Trace, Viewpoint

SAME_DEPTH = 1.0 / 32.0
"""Relative difference of depth below which two hits may lie on one surface."""
_FRAMELET_SIDE = 16


def first_hits(trace: Trace, side: int, time_s: float) -> Hits:
    """First hits at the centres of a picture's pixels.

    Args:
        trace: a renderer that returns first hits.
        side: pixels along the picture's side, a power of two, at least 16.
        time_s: animation time, seconds.

    Returns:
        Hits with one row, pixels in raster order.

    Raises:
        ValueError: the renderer returns no hits.
    """
    tiling = uniform((side // _FRAMELET_SIDE).bit_length() - 1)
    position = sample_positions(tiling.level, tiling.index, _FRAMELET_SIDE)
    hits = trace(FrameletBatch(tiling.level, tiling.index, position, time_s, hits=True)).hits
    if hits is None:
        raise ValueError("first hits: expected a renderer that returns them")
    order = raster_to_morton(side)
    instance, occluder = (one.reshape(-1)[order][None] for one in (hits.instance, hits.occluder))
    return Hits(instance, hits.point.reshape(-1, 3)[order][None], occluder)


def places(now: Hits, before: Hits, view_before: Viewpoint) -> Places:
    """Pixels whose surface came into sight, and pixels whose surface the first light reaches at one of the times only.

    The surface at a pixel's centre is looked up at the earlier time in the four pixels whose centres were nearest to
    it. It was in sight if some of them show its instance and its depth lies in the range of theirs, widened by 1/32.
    Its light is unchanged if some of these pixels was lit as it is now. Both sets are dilated by one pixel on all
    sides, because the colour of a pixel depends on more than its centre.

    Args:
        now, before: first hits at the centres of all pixels, raster order.
        view_before: camera and poses at the time of ``before``; panoramas are not supported.
    """
    count = now.instance.numel()
    side = round(count**0.5)
    instance, lit = now.instance.reshape(-1), now.occluder.reshape(-1) == -1
    place, depth = project(view_before, instance, now.point.reshape(-1, 3))
    earlier, lit_then = before.instance.reshape(-1), before.occluder.reshape(-1) == -1
    depth_then = project(view_before, earlier, before.point.reshape(-1, 3))[1]
    inside = (depth > 0.0) & ((place >= 0.0) & (place < 1.0)).all(1)
    seen, alike = torch.zeros_like(inside), torch.zeros_like(inside)
    least, most = torch.full_like(depth, torch.inf), torch.full_like(depth, -torch.inf)
    for number in _around(torch.where(inside[:, None], place, 0.0), side):
        same = earlier[number] == instance
        seen |= same
        alike |= same & (lit_then[number] == lit)
        least = torch.where(same, torch.minimum(least, depth_then[number]), least)
        most = torch.where(same, torch.maximum(most, depth_then[number]), most)
    between = (depth >= least * (1.0 - SAME_DEPTH)) & (depth <= most * (1.0 + SAME_DEPTH))
    known = inside & seen & between
    uncovered = _grown(~known, side)
    return Places(uncovered, _grown(known & ~alike, side) & ~uncovered)


def _around(place: Float64[Tensor, "pixels 2"], side: int) -> list[Int64[Tensor, " pixels"]]:
    """Indices of the four pixels with the nearest centres; pixels at the border are repeated."""
    corner = (place * side - 0.5).floor().to(torch.int64)
    cells = [(corner + torch.tensor([right, down])).clamp(0, side - 1) for down in (0, 1) for right in (0, 1)]
    return [cell[:, 1] * side + cell[:, 0] for cell in cells]


def _grown(flags: Bool[Tensor, " pixels"], side: int) -> Bool[Tensor, "side side"]:
    plane = flags.reshape(1, 1, side, side).to(torch.float32)
    return F.max_pool2d(plane, 3, 1, 1)[0, 0] > 0.0
