"""Projection of first hits onto the image at the poses of another time."""

from __future__ import annotations

import math

import torch
from jaxtyping import Float, Float64, Int
from torch import Tensor

from tsar.types import Viewpoint


def project(
    view: Viewpoint, instance: Int[Tensor, "*shape"], point: Float[Tensor, "*shape 3"]
) -> tuple[Float64[Tensor, "*shape 2"], Float64[Tensor, "*shape"]]:
    """Projects first hits (:class:`tsar.types.Hits`) onto the image.

    A point ``p`` of track ``k`` has the camera coordinates ``q = C (R_k p + t_k) + c``, with ``C, c`` from the world to
    the camera. A perspective camera shows it at ``x = (1 + q_x / (-q_z tan_x)) / 2`` and
    ``y = (1 - q_y / (-q_z tan_y)) / 2``; where rays are parallel, ``-q_z`` is omitted. A lens is treated as a pinhole
    at its centre. All arithmetic is in float64, element by element, and gives the same bits for any number of threads.

    Args:
        view: camera and poses.
        instance: number of the instance, -1 for a hit at infinity.
        point: hit point in the space of the instance's track, scene units; for a hit at infinity, a direction in the
            world.

    Returns:
        Position on the image plane, ``(x, y)`` from the top left corner, in ``[0, 1)`` where the picture shows it; and
        depth along the axis of the camera, in scene units (times the scale of the camera's placement), ``inf`` at
        infinity. A point behind the camera has a depth of at most 0, ``-inf`` at infinity, and with a perspective
        camera the position NaN. With parallel rays a point at infinity is visible everywhere or nowhere, so its
        position is NaN.

    Raises:
        ValueError: the view is a panorama, whose angles would differ in the last bit between processors.
    """
    if view.kind == "panorama":
        raise ValueError("project: expected a perspective or parallel camera, got a panorama")
    matrix, offset = to_camera(view)
    infinite = instance < 0
    row = torch.where(infinite, len(view.track_of_instance), instance).reshape(-1).to(torch.int64)
    x, y, z = (component.to(torch.float64).reshape(-1) for component in point.unbind(-1))
    away = (1.0 - infinite.to(torch.float64)).reshape(-1)

    def seen(axis: int) -> Float64[Tensor, " n"]:
        first, second, third = (matrix[:, axis, column].index_select(0, row) for column in range(3))
        return first * x + second * y + third * z + offset[:, axis].index_select(0, row)

    right, up, depth = seen(0), seen(1), -seen(2)
    unit = depth if view.kind == "perspective" else away
    inside = unit > 0.0
    position = torch.stack([0.5 + right / (2.0 * view.tan_x * unit), 0.5 - up / (2.0 * view.tan_y * unit)], dim=-1)
    position = torch.where(inside[:, None], position, math.nan)
    depth = torch.where(away > 0.0, depth, torch.where(depth > 0.0, math.inf, -math.inf))
    return position.reshape((*point.shape[:-1], 2)), depth.reshape(point.shape[:-1])


def to_camera(view: Viewpoint) -> tuple[Float64[Tensor, "rows 3 3"], Float64[Tensor, "rows 3"]]:
    """Matrices and offsets of the rows of a view."""
    return view.rows[:, :9].unflatten(1, (3, 3)), view.rows[:, 9:]
