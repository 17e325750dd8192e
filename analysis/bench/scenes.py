"""The scenes of the benchmark: the bumpy sphere, the room, the driving scenes, and batches of framelets over them."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from math import log2
from typing import TYPE_CHECKING

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from analysis.bench.options import FRAMELET_SIDE, BenchOptions
from scenes.canonical import (
    ConstantTexture,
    Glass,
    Instance,
    Integrator,
    Matrix,
    Matte,
    Mesh,
    Metal,
    PerspectiveCamera,
    PointLight,
    Rectangle,
    Scene,
    Sphere,
    identity,
)
from tsar.morton import deinterleave
from tsar.types import FrameletBatch

if TYPE_CHECKING:
    from renderer.trace import Renderer

EYE = (0.0, 0.0, 3.2)
FOV_DEG = 38.0
LIGHT = (1.5, 2.5, 4.5)
_INTENSITY = (60.0, 57.0, 51.0)
_ALBEDO = (0.62, 0.5, 0.4)
SHADED_SUBDIVISIONS = 5
"""Subdivisions of the mesh that is shaded: 20,480 triangles."""


@lru_cache(maxsize=8)
def bumpy_sphere(subdivisions: int) -> Mesh:
    """A closed mesh of ``20 * 4^subdivisions`` triangles: a sphere of radius 1 with bumps that shadow each other.

    Args:
        subdivisions: of an icosahedron.
    """
    import trimesh

    sphere = trimesh.creation.icosphere(subdivisions=subdivisions)
    sphere.vertices = np.asarray(sphere.vertices) * _bumps(np.asarray(sphere.vertices))[:, None]
    normals = np.asarray(sphere.vertex_normals, np.float32)
    return Mesh(np.asarray(sphere.vertices, np.float32), np.asarray(sphere.faces, np.int32), normals, source="bumpy")


def bumpy_globe(triangles: int) -> Mesh:
    """The same surface as rows of quads from pole to pole, two triangles each, for meshes of any size.

    Args:
        triangles: about how many; there are twice as many columns as rows.
    """
    rows = max(2, round((triangles / 4) ** 0.5))
    columns = 2 * rows
    polar, azimuth = np.meshgrid(
        np.linspace(1e-3, np.pi - 1e-3, rows + 1), np.arange(columns) * (2.0 * np.pi / columns), indexing="ij"
    )
    ring = np.sin(polar)
    points = np.stack([ring * np.cos(azimuth), np.cos(polar), ring * np.sin(azimuth)], axis=-1).reshape(-1, 3)
    points *= _bumps(points)[:, None]
    corner = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    right, below = np.roll(corner, -1, axis=1), corner + columns
    upper, lower = np.stack([corner, right, below], axis=-1), np.stack([right, right + columns, below], axis=-1)
    return Mesh(points.astype(np.float32), np.stack([upper, lower], axis=2).reshape(-1, 3), source="globe")


def _bumps(points: NDArray[np.floating]) -> NDArray[np.floating]:
    """Distances from the middle of the surface, for points ``(n, 3)`` of the unit sphere."""
    x, y, z = points.T
    return 1.0 + 0.035 * (np.sin(9.0 * x + 2.0 * y) + np.sin(8.0 * y - 3.0 * z) + np.sin(10.0 * z + 2.5 * x))


def bumpy_scene(subdivisions: int = SHADED_SUBDIVISIONS) -> Scene:
    """The bumpy sphere, diffuse, under one point light and nothing else."""
    pose = identity()
    pose[:3, 3] = EYE
    return Scene(
        camera=PerspectiveCamera(pose, FOV_DEG),
        instances=(Instance(bumpy_sphere(subdivisions), Matte(ConstantTexture(_ALBEDO)), name="bumpy"),),
        lights=(PointLight(LIGHT, _INTENSITY),),
        integrator=Integrator("direct", depth=0),
        name="bumpy sphere",
    )


def room_scene() -> Scene:
    """A room with a lamp, a bumpy sphere of rough metal in it and a ball of glass: most of its light is indirect."""
    half = np.pi / 2.0
    walls = {"floor": (-half, 0.0, _ALBEDO), "ceiling": (half, 0.0, _ALBEDO), "back": (0.0, 0.0, _ALBEDO),
             "left": (0.0, half, (0.6, 0.1, 0.1)), "right": (0.0, -half, (0.1, 0.5, 0.1))}  # fmt: skip
    instances = [
        Instance(Rectangle(), Matte(ConstantTexture(color)), _placed(about_x, about_y), name=name)
        for name, (about_x, about_y, color) in walls.items()
    ]
    lamp = _placed(half, 0.0, (0.0, 0.98, 0.0), 0.25)
    dark = Matte(ConstantTexture((0.0, 0.0, 0.0)))
    metal = Metal((0.2, 0.9, 1.3), (3.9, 2.4, 2.2), (0.3, 0.3))
    pose = [np.diag([size, size, size, 1.0]) for size in (0.35, 0.3)]
    pose[0][:3, 3], pose[1][:3, 3] = (-0.4, -0.6, -0.2), (0.45, -0.7, 0.2)
    instances += [
        Instance(Rectangle(), dark, lamp, name="lamp", emission=(12.0, 11.0, 9.0)),
        Instance(bumpy_sphere(SHADED_SUBDIVISIONS), metal, pose[0], name="metal"),
        Instance(Sphere(), Glass(), pose[1], name="glass"),
    ]
    eye = identity()
    eye[2, 3] = 3.4
    camera = PerspectiveCamera(eye, FOV_DEG)
    return Scene(camera, tuple(instances), integrator=Integrator("path", depth=8), name="room")


def _placed(about_x: float, about_y: float, at: tuple[float, float, float] | None = None, size: float = 1.0) -> Matrix:
    """Transform of the unit square: rotated, then moved to ``at``, by default one unit back along its normal."""
    turn = Rotation.from_euler("xy", (about_x, about_y)).as_matrix()
    matrix = identity()
    matrix[:3, :3] = turn * size
    matrix[:3, 3] = -turn[:, 2] if at is None else at
    return matrix


def driving_scenes(options: BenchOptions) -> dict[str, Scene]:
    """The scenes asked for, by name.

    Raises:
        SceneError: no driving scene has that name.
    """
    from scenes import catalog

    return {name: catalog.load(name) for name in options.scenes or catalog.NAMES}


def renderer_of(scene: Scene, options: BenchOptions, threads: int | None = None) -> Renderer:
    """Our renderer for pictures of the size asked for, by default on all cores."""
    from renderer.trace import Renderer

    return Renderer(scene, options.device, threads, options.resolution_px)


def morton_batches(options: BenchOptions, duration_s: float) -> list[FrameletBatch]:
    """Batches that together cover the picture once, each spread over all of it like those of the pipeline.

    Args:
        options: size of the picture and of a batch.
        duration_s: length of the animation, over which the batches are spread too.
    """
    side = FRAMELET_SIDE
    level = int(log2(options.resolution_px // side))
    number_of = -(-(4**level) // options.batch_size)
    offset = (torch.stack(deinterleave(torch.arange(side * side)), dim=1) + 0.5) / side
    batches = []
    for number in range(number_of):
        index = torch.arange(number, 4**level, number_of)
        corner = torch.stack(deinterleave(index), dim=1)
        position = ((corner[:, None, :] + offset) * 0.5**level).to(torch.float32)
        time_s = duration_s * (number + 0.5) / number_of
        batches.append(FrameletBatch(torch.full_like(index, level), index, position, time_s))
    return batches


def in_rows(batch: FrameletBatch) -> FrameletBatch:
    """The same samples, all of one time, row by row across all tiles of the batch."""
    flat = batch.position.reshape(-1, 2)
    order = torch.argsort(flat[:, 0], stable=True)
    order = order[torch.argsort(flat[order, 1], stable=True)]
    return replace(batch, position=flat[order].reshape(batch.position.shape))


def camera_rays(batch: FrameletBatch) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Origins and directions ``(n, 3)`` of a batch's rays at the bumpy sphere, framelet by framelet."""
    position = batch.position.reshape(-1, 2).numpy()
    tangent = np.float32(np.tan(np.radians(FOV_DEG / 2.0)))
    x, y = (2.0 * position[:, 0] - 1.0) * tangent, (1.0 - 2.0 * position[:, 1]) * tangent
    direction = np.stack([x, y, -np.ones_like(x)], axis=1).astype(np.float32)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return np.broadcast_to(np.asarray(EYE, np.float32), direction.shape).copy(), direction
