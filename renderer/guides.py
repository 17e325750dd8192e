"""Auxiliary layers of a picture: depth, normal, albedo and instance of the surface in each pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
import warp as wp
from jaxtyping import Float, Int
from numpy.typing import NDArray
from torch import Tensor

from renderer.compute import device as devices
from renderer.kernels.guides import guides
from renderer.trace import Renderer

GRID = 4
"""Number of samples along a pixel's side over which depth, normal and albedo are averaged."""

_ROWS = 16


@dataclass(frozen=True, eq=False)
class Guides:
    """Auxiliary layers of a picture, rows from the top.

    Attributes:
        depth: distance from the camera along the ray, scene units, mean over the samples of a pixel that hit a surface;
            infinite where none does.
        normal: shading normal in the world, on the viewer's side, mean over the pixel, so it is not a unit vector at
            edges.
        albedo: colour with which the surface scatters or mirrors light, mean over the pixel.
        instance: number of the instance at the pixel's centre, where merged meshes count as one; -1 for none.
        point: hit point there, as in :class:`tsar.types.Hits`.
    """

    depth: Float[NDArray[np.float32], "h w"]
    normal: Float[NDArray[np.float32], "h w 3"]
    albedo: Float[NDArray[np.float32], "h w 3"]
    instance: Int[NDArray[np.int32], "h w"]
    point: Float[NDArray[np.float32], "h w 3"]


def render_guides(renderer: Renderer, width_px: int, height_px: int, time_s: float) -> Guides:
    """The auxiliary layers of a picture at one time.

    Args:
        renderer: the scene.
        width_px, height_px: size of the picture.
        time_s: animation time, seconds.
    """
    depth, instance = np.zeros((height_px, width_px), np.float32), np.zeros((height_px, width_px), np.int32)
    normal, albedo, point = (np.zeros((height_px, width_px, 3), np.float32) for _ in range(3))
    for top in range(0, height_px, _ROWS):
        rows = slice(top, min(top + _ROWS, height_px))
        fine = _met(renderer, width_px, height_px, rows, GRID, time_s)
        hits = (fine["instance"] >= 0).sum(axis=-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            depth[rows] = np.where(hits > 0, fine["distance"].sum(axis=-1) / hits, np.inf)
        normal[rows], albedo[rows] = fine["normal"].mean(axis=-2), fine["albedo"].mean(axis=-2)
        middle = _met(renderer, width_px, height_px, rows, 1, time_s)
        instance[rows], point[rows] = middle["instance"][..., 0], middle["point"][..., 0, :]
    return Guides(depth, normal, albedo, instance, point)


def _met(
    renderer: Renderer, width_px: int, height_px: int, rows: slice, grid: int, time_s: float
) -> dict[str, NDArray]:
    """First hits of a regular grid of samples in the pixels of some rows, ``(rows, width, grid², …)``."""
    step = (torch.arange(grid, dtype=torch.float64) + 0.5) / grid
    y = (torch.arange(rows.start, rows.stop)[:, None] + step) / height_px
    x = (torch.arange(width_px)[:, None] + step) / width_px
    shape = rows.stop - rows.start, width_px, grid, grid
    position = torch.stack([x[None, :, None].expand(shape), y[:, None, :, None].expand(shape)], dim=-1)
    position = position.reshape(-1, 2).to(torch.float32)
    found = _launched(renderer, position, grid**2, time_s, width_px / height_px, min(width_px, height_px) * grid)
    return {name: values.reshape(*shape[:2], grid * grid, *values.shape[1:]) for name, values in found.items()}


def _launched(renderer: Renderer, position: Tensor, group_size: int, time_s: float, aspect: float, footprint_px: float):
    """Launches the kernel over samples of one time."""
    kernel, device, count = guides(renderer.features), renderer.device, len(position)
    devices.load_kernels(kernel.module, device)
    kinds = {"instance": wp.int32, "point": wp.vec3, "distance": wp.float32, "normal": wp.vec3, "albedo": wp.vec3}
    outputs = {name: wp.empty(count, kind, device) for name, kind in kinds.items()}
    places = wp.array(position.numpy(), dtype=wp.vec2, device=device)
    times = wp.full(count, wp.float64(time_s), wp.float64, device)
    scene, view = renderer.posed(time_s, aspect, footprint_px)
    wp.launch(kernel, dim=count, inputs=[scene, view, 0, group_size, places, times, *outputs.values()], device=device)
    return {name: values.numpy() for name, values in outputs.items()}
