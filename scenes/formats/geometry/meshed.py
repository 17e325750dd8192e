"""The canonical shapes as meshes, and whether texture coordinates affect a material.

Renderers agree only on the texture coordinates of rectangles. On spheres Mitsuba's ``v`` runs from +z to -z and PBRT's
from -z to +z, as in the canonical scene; on disks and cubes all renderers differ (measured with Mitsuba 3.9). If a
material depends on the coordinates, such a shape is converted as a mesh.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from scenes.arithmetic import product
from scenes.canonical import (
    CheckerboardTexture,
    Cube,
    Curves,
    Disk,
    HeightField,
    ImageTexture,
    Instance,
    Material,
    Mesh,
    NormalMapped,
    Rectangle,
    Shape,
    Sphere,
    Texture,
)
from scenes.canonical.values import Matrix
from scenes.formats.appearance.graphs import once_a_node, parts_of
from scenes.formats.appearance.normals import is_flat
from scenes.formats.geometry.curves import curve_mesh
from scenes.formats.geometry.orientation import area_normals, turned
from scenes.formats.geometry.revolution import partial_sphere, ring

SQUARE = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
SQUARE_UV = 0.5 * SQUARE[:, :2] + 0.5


def depends_on_uv(part: Material | Texture) -> bool:
    """Whether the appearance of a material depends on texture coordinates.

    It does if it has a texture, a normal map, or a roughness that differs between the two directions of the surface.
    """
    return once_a_node(_depends, part)


def _depends(part: Material | Texture, again: Callable[[Material | Texture], bool]) -> bool:
    if isinstance(part, ImageTexture | CheckerboardTexture | HeightField):
        return True
    if isinstance(part, NormalMapped) and not is_flat(part):
        return True
    roughness = getattr(part, "roughness", 0.0)
    if isinstance(roughness, tuple) and roughness[0] != roughness[1]:
        return True
    return any(map(again, parts_of(part)))


@lru_cache(maxsize=1)
def mitsuba_cube() -> Mesh:
    """The cube with Mitsuba's texture coordinates."""
    corners = {
        (0, -1, 0): ((1, -1, -1), (1, -1, 1), (-1, -1, 1), (-1, -1, -1)),
        (0, 1, 0): ((1, 1, -1), (-1, 1, -1), (-1, 1, 1), (1, 1, 1)),
        (1, 0, 0): ((1, -1, -1), (1, 1, -1), (1, 1, 1), (1, -1, 1)),
        (0, 0, 1): ((1, -1, 1), (1, 1, 1), (-1, 1, 1), (-1, -1, 1)),
        (-1, 0, 0): ((-1, -1, 1), (-1, 1, 1), (-1, 1, -1), (-1, -1, -1)),
        (0, 0, -1): ((1, 1, -1), (1, -1, -1), (-1, -1, -1), (-1, 1, -1)),
    }
    points = np.array([corner for side in corners.values() for corner in side], np.float32)
    normals = np.repeat(np.array(list(corners), np.float32), 4, axis=0)
    uvs = np.tile(np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32), (6, 1))
    first = 4 * np.arange(6)[:, None]
    faces = (first + np.array([0, 1, 2, 3, 0, 2])).reshape(-1, 3).astype(np.int32)
    inward = (area_normals(points[faces]) * normals[faces[:, 0]]).sum(axis=1) < 0.0
    return Mesh(points, np.where(inward[:, None], faces[:, ::-1], faces), normals, uvs, "cube")


@lru_cache(maxsize=1)
def mitsuba_disk() -> Mesh:
    """The disk with Mitsuba's texture coordinates: u is the radius, v the angle."""
    mesh = as_mesh(Disk())
    assert mesh.uvs is not None
    uvs = np.stack([1.0 - mesh.uvs[:, 1], mesh.uvs[:, 0]], axis=1)
    return Mesh(mesh.vertices, mesh.faces, mesh.normals, uvs, "disk")


def turned_over(instance: Instance) -> Instance:
    """The instance with its inside out; a rectangle without texture stays a rectangle, rotated about its y axis."""
    if isinstance(instance.shape, Rectangle) and not depends_on_uv(instance.material):
        return dataclasses.replace(instance, to_world=product(instance.to_world, np.diag([-1.0, 1.0, -1.0, 1.0])))
    instance = of_radius_one(instance)
    return dataclasses.replace(instance, shape=turned(as_mesh(instance.shape)))


def of_radius_one(instance: Instance) -> Instance:
    """The instance with a sphere or disk of radius 1, which its placement scales: the mesh of all sizes is shared."""
    shape = instance.shape
    if not isinstance(shape, Disk | Sphere) or shape.radius == 1.0:
        return instance
    scale = np.array([shape.radius, shape.radius, shape.radius, 1.0])
    return dataclasses.replace(instance, shape=type(shape)(), to_world=instance.to_world * scale)


def as_mesh(shape: Shape) -> Mesh:
    """A shape as triangles: exact for rectangle and cube, approximate for sphere, disk and curves."""
    if isinstance(shape, Curves):
        return curve_mesh(shape)
    return shape if isinstance(shape, Mesh) else _meshed(shape)


def shape_name(shape: Shape) -> str:
    """What a shape is called in reports."""
    return "curves" if isinstance(shape, Curves) else f"a {type(shape).__name__.lower()}"


@lru_cache(maxsize=256)
def _meshed(shape: Rectangle | Cube | Disk | Sphere) -> Mesh:
    """The shared mesh for all equal shapes, so that it is written once."""
    if isinstance(shape, Rectangle):
        faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
        normals = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (4, 1))
        return Mesh(SQUARE.astype(np.float32), faces, normals, SQUARE_UV.astype(np.float32), "rectangle")
    if isinstance(shape, Cube):
        return _cube()
    if isinstance(shape, Disk):
        return ring(shape.radius, 0.0, 0.0)
    assert isinstance(shape, Sphere)
    return partial_sphere(shape.radius, -shape.radius, shape.radius)


def _cube() -> Mesh:
    vertices: list[np.ndarray] = []
    normals: list[np.ndarray] = []
    uvs: list[np.ndarray] = []
    faces: list[list[int]] = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            normal = sign * np.eye(3)[axis]
            right = np.eye(3)[(axis + 1) % 3]
            up = np.cross(normal, right)
            start = len(vertices)
            for x, y in SQUARE[:, :2].tolist():
                vertices.append(normal + x * right + y * up)
                normals.append(normal)
            uvs.extend(SQUARE_UV)
            faces += [[start, start + 1, start + 2], [start, start + 2, start + 3]]
    arrays = (np.array(part, np.float32) for part in (vertices, normals, uvs))
    points, outward, texture = arrays
    return Mesh(points, np.array(faces, np.int32), outward, texture, "cube")


@lru_cache(maxsize=1)
def rectangle_mesh() -> Mesh:
    """The rectangle, cut so that :mod:`scenes.formats.geometry.recognition` begins at its first corner."""
    mesh = as_mesh(Rectangle())
    return Mesh(mesh.vertices, np.array([[0, 1, 3], [1, 2, 3]], np.int32), mesh.normals, mesh.uvs, mesh.source)


def about_middle(mesh: Mesh) -> tuple[NDArray[np.floating], Matrix | None]:
    """The vertices for formats with floats of 32 bits: far ones are given from their middle, whose transform is
    returned."""
    if mesh.vertices.dtype.itemsize <= 4:
        return mesh.vertices, None
    middle = np.eye(4)
    middle[:3, 3] = 0.5 * (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0))
    return mesh.vertices - middle[:3, 3], middle


def cube_sides() -> list[np.ndarray]:
    """Transforms of the rectangle to the sides of the cube, facing outwards."""
    made = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            matrix = np.eye(4)
            normal, first = sign * np.eye(3)[axis], np.eye(3)[(axis + 1) % 3]
            matrix[:3] = np.stack([first, np.cross(normal, first), normal, normal], axis=1)
            made.append(matrix)
    return made
