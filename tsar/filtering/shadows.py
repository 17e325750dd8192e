"""Shadows of moving objects: where they lie, the picture will change although the visible surface is static."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from jaxtyping import Float, Float64, Int64
from torch import Tensor

from tsar.projection import to_camera
from tsar.types import Hits, Viewpoint

CONTRAST = 0.01
"""Variance of a pixel that the edge of a shadow crosses, in squared encoded colour: a difference of 0.2, a quarter of
the time. A shadow is assumed to take as long to cross a pixel as it takes to move by :attr:`FilterOptions.reach`."""
CROSSINGS_MAX = 4.0
"""Maximum number of crossings that are expected in a second."""


def drifted(
    before: Float[Tensor, "1 e e"],
    position: Float[Tensor, "n samples 2"],
    hits: Hits,
    view: Viewpoint,
    earlier: Viewpoint,
    cycle_s: float,
) -> Float[Tensor, "1 e e"]:
    """Speed of the shadows over each element after a batch, image sides per second, as observed by its newest samples.

    Args:
        before: speed before the batch, image sides per second.
        position: positions of the samples on the image plane, in ``[0, 1)``.
        hits: first hits of the samples.
        view, earlier: poses of one time and of an earlier one.
        cycle_s: seconds between the two.
    """
    across = before.shape[-1]
    place = (position.reshape(-1, 2) * across).to(torch.int64)
    return last_seen(before, drift(hits, view, earlier) / cycle_s, place[:, 1] * across + place[:, 0])


def drift(hits: Hits, view: Viewpoint, earlier: Viewpoint) -> Float64[Tensor, " samples"]:
    """Distance that the shadow on each hit has moved over the surface since an earlier view.

    Consider a point ``p`` on track ``r`` in the shadow of an object on track ``k``. Had it moved with ``k``, it would
    have been at ``P' T'_k T_k^-1 T_r p`` on the earlier image; in fact it was at ``P' T'_r p``. ``T`` takes a track to
    the world, ``P`` the world to the image, and a prime marks the earlier view. The distance between the two
    approximates the motion of the shadow of a rigid body that does not rotate against the light, where object and
    shadow are close to each other.

    Returns:
        The greater distance of both axes, as a share of the image's side; 0 without a shadow and where object and
        surface move together. Always finite.
    """
    instance, occluder = hits.instance.reshape(-1).to(torch.int64), hits.occluder.reshape(-1).to(torch.int64)
    track = view.track_of_instance
    shared = (occluder < 0) | (instance < 0)
    shared |= track[instance.clamp(min=0)] == track[occluder.clamp(min=0)]
    found = torch.zeros(instance.numel(), dtype=torch.float64)
    of = (~shared).nonzero().squeeze(1)
    if not of.numel():
        return found
    surface, body = instance[of], occluder[of]
    point = hits.point.reshape(-1, 3)[of].to(torch.float64)
    now, before = to_camera(view), to_camera(earlier)
    seen = _camera_space(*now, surface, point)
    inverse = _inverse(now[0])
    within = _camera_space(inverse, torch.zeros_like(now[1]), body, seen - now[1][body])
    moved = _image(_camera_space(*before, body, within), earlier) - _image(
        _camera_space(*before, surface, point), earlier
    )
    found[of] = moved.abs().amax(1).nan_to_num(0.0, 0.0, 0.0)
    return found


def last_seen(
    before: Float[Tensor, "1 e e"], drift_s: Float64[Tensor, " samples"], element: Int64[Tensor, " samples"]
) -> Float[Tensor, "1 e e"]:
    """Speed of the fastest shadow that the newest samples of each element have hit, image sides per second.

    Args:
        before: speed before the batch, image sides per second.
        drift_s: speed of the shadow on each sample, image sides per second.
        element: raster index of the element under each sample.
    """
    nothing = torch.full((before.numel(),), -1.0)
    newest = nothing.scatter_reduce(0, element, drift_s.to(torch.float32), "amax").reshape(before.shape)
    return torch.where(newest >= 0.0, newest, before)


def expected_rate(drift_s: Float[Tensor, "1 e e"], reach: float) -> Float[Tensor, "1 e e"]:
    """Variance per second to expect in elements, and in those beside them, from shadows that cross the share ``reach``
    of the image's side: ``0.01 min(drift / reach, 4)``."""
    wide = F.pad(drift_s, (1, 1, 1, 1))
    rows = torch.maximum(torch.maximum(wide[:, :-2], wide[:, 1:-1]), wide[:, 2:])
    near = torch.maximum(torch.maximum(rows[..., :-2], rows[..., 1:-1]), rows[..., 2:])
    return (near / reach).clamp(max=CROSSINGS_MAX) * CONTRAST


def _camera_space(
    matrix: Float64[Tensor, "rows 3 3"],
    offset: Float64[Tensor, "rows 3"],
    row: Int64[Tensor, " n"],
    point: Float64[Tensor, "n 3"],
) -> Float64[Tensor, "n 3"]:
    # by columns: the bits of a matrix product may depend on the library
    m, x = matrix[row], point
    return m[:, :, 0] * x[:, None, 0] + m[:, :, 1] * x[:, None, 1] + m[:, :, 2] * x[:, None, 2] + offset[row]


def _image(seen: Float64[Tensor, "n 3"], view: Viewpoint) -> Float64[Tensor, "n 2"]:
    """Positions on the image up to a shift, in image sides; NaN behind the camera."""
    unit = -seen[:, 2:] if view.kind == "perspective" else torch.ones_like(seen[:, 2:])
    tangent = torch.tensor([view.tan_x, view.tan_y], dtype=torch.float64)
    return torch.where(unit > 0.0, seen[:, :2] / (2.0 * tangent * unit), torch.nan)


def _inverse(matrix: Float64[Tensor, "rows 3 3"]) -> Float64[Tensor, "rows 3 3"]:
    """Inverse matrices from cofactors: the same bits on any processor."""
    rows = matrix.unbind(1)
    columns = [_cross(rows[1], rows[2]), _cross(rows[2], rows[0]), _cross(rows[0], rows[1])]
    product = rows[0] * columns[0]
    determinant = product[:, 0] + product[:, 1] + product[:, 2]
    return torch.stack(columns, dim=2) / determinant[:, None, None]


def _cross(a: Float64[Tensor, "rows 3"], b: Float64[Tensor, "rows 3"]) -> Float64[Tensor, "rows 3"]:
    (ax, ay, az), (bx, by, bz) = a.unbind(1), b.unbind(1)
    return torch.stack((ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx), dim=1)
