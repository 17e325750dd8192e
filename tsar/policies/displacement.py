"""The change of a picture that the motion of its surfaces causes."""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Int32
from torch import Tensor

from tsar.policies.refinement import mean
from tsar.policies.resampling import bilinear
from tsar.policies.scatter import pull_push
from tsar.projection import project
from tsar.roots import encoded
from tsar.types import Viewpoint

PIXEL_FLOPS = 42
"""Operations per pixel of :func:`change`: for one pixel in four, two projections 62, the interpolation of displacements
45, and the comparison 60."""


@dataclass(frozen=True)
class FirstHits:
    """Newest sample of each pixel, raster order: its position on the image plane and its first hit, where there is
    one."""

    known: Bool[Tensor, " pixels"]
    position: Float[Tensor, "pixels 2"]
    instance: Int32[Tensor, " pixels"]
    point: Float[Tensor, "pixels 3"]


def change(image: Float[Tensor, "side side 3"], hits: FirstHits, now: Viewpoint, before: Viewpoint) -> float:
    """Mean squared change of an encoded picture whose pixels move as their first hits do.

    The pixels move from their sampled positions to those at the time as long after ``now`` as ``now`` is after
    ``before``, extrapolated linearly. One hit in four pixels is projected, and one pixel in four is compared.

    Args:
        image: linear RGB, a power of two of pixels along a side.
        hits: first hits of its samples.
        now, before: newest poses, and earlier ones.
    """
    side = image.shape[0]
    half = side // 2
    pixel = torch.where(hits.known, torch.arange(side * side), -1)
    pixel = pixel.reshape(half, 2, half, 2).amax((1, 3)).reshape(-1)  # one pixel in four
    known = (pixel >= 0).nonzero().squeeze(1)
    some = pixel[known]
    here, there = (project(at, hits.instance[some], hits.point[some])[0] for at in (now, before))
    moved = (2.0 * here - there - hits.position[some]) * side
    gone = 0.0 if now.kind == "parallel" else float(side)  # at infinity; behind the camera
    field = torch.zeros(half * half, 3)
    field[known] = F.pad(moved.to(torch.float32).nan_to_num(gone, side, -side), (0, 1), value=1.0)
    planes = field.T.reshape(3, half, half).clamp(-side, side)
    shift = pull_push(planes[:2].contiguous(), planes[2:])
    place = torch.arange(0, side, 2).to(torch.float32)
    picture = encoded(image)
    read_at = torch.stack((place[None, :] - shift[0], place[:, None] - shift[1]), dim=-1).to(torch.float64)
    difference = bilinear(picture, read_at) - picture[::2, ::2]
    return mean(difference.square())
