"""Shapes of the canonical scene, and their instances; conventions as in :mod:`scenes.canonical`."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from scenes.arithmetic import determinant
from scenes.canonical.curves import Curves
from scenes.canonical.materials import Material
from scenes.canonical.media import Medium
from scenes.canonical.values import Matrix, Rgb, RigidTrack, SceneError, identity


@dataclass(frozen=True, eq=False)
class Mesh:
    """An indexed triangle mesh in object space.

    Attributes:
        vertices: ``(v, 3)`` float32, or float64 for vertices far from their origin.
        faces: ``(f, 3)`` int32, counter-clockwise seen from outside.
        normals: ``(v, 3)`` float32 unit shading normals, or None for face normals.
        uvs: ``(v, 2)`` float32, or None for zero.
    """

    vertices: NDArray[np.floating]
    faces: NDArray[np.int32]
    normals: NDArray[np.float32] | None = None
    uvs: NDArray[np.float32] | None = None
    source: str = ""

    def __post_init__(self) -> None:
        count = self.vertices.shape[0]
        if self.vertices.ndim != 2 or self.vertices.shape[1] != 3 or self.faces.ndim != 2 or self.faces.shape[1] != 3:
            raise SceneError(
                f"Mesh {self.source!r}: expected vertices (v, 3) and faces (f, 3), got {self.vertices.shape} "
                f"and {self.faces.shape}"
            )
        if self.faces.shape[0] == 0:
            raise SceneError(f"Mesh {self.source!r}: expected at least one face, got none")
        if not np.isfinite(self.vertices).all():
            raise SceneError(f"Mesh {self.source!r}: vertices hold non-finite values")
        if self.faces.min() < 0 or self.faces.max() >= count:
            raise SceneError(f"Mesh {self.source!r}: a face refers to a vertex outside 0..{count - 1}")
        for name, array, width in (("normals", self.normals, 3), ("uvs", self.uvs, 2)):
            if array is not None and array.shape != (count, width):
                raise SceneError(f"Mesh {self.source!r}: expected {name} ({count}, {width}), got {array.shape}")


@dataclass(frozen=True)
class Sphere:
    """A sphere about the object-space origin."""

    radius: float = 1.0


@dataclass(frozen=True)
class Disk:
    """A disk in the object-space plane ``z = 0``, normal ``+z``."""

    radius: float = 1.0


@dataclass(frozen=True)
class Rectangle:
    """The square ``[-1, 1]²`` in the object-space plane ``z = 0``, normal ``+z``, uv from (0, 0) to (1, 1)."""


@dataclass(frozen=True)
class Cube:
    """The cube ``[-1, 1]³`` in object space."""


Shape = Mesh | Sphere | Disk | Rectangle | Cube | Curves


@dataclass(frozen=True, eq=False)
class Instance:
    """A shape with a material, placed by ``track(t) @ to_world`` (the track is the outer, rigid motion).

    Attributes:
        shape: shape, which instances share if it is the same object.
        material: material of the shape.
        to_world: ``(4, 4)`` float64, non-singular.
        track: rigid animation, or None for a static instance.
        name: name for messages and reports.
        emission: radiance of an area light, linear RGB, or None. It is emitted on the side of the normal by a
            :class:`Rectangle` or :class:`Sphere`.
        emission_twosided: whether the back emits, too. The renderer's lamps do not; it is kept for conversion.
        one_sided: whether the back is black. The renderer treats both sides equally; it is kept for conversion.
        interior, exterior: media against the normal of the surface and along it, None for vacuum. If both are None, the
            surface is no border: the medium around it goes on behind it. A medium without coefficients on either side
            makes it the border of a hole within a medium. The renderer has no media.
    """

    shape: Shape
    material: Material
    to_world: Matrix = field(default_factory=identity)
    track: RigidTrack | None = None
    name: str = ""
    emission: Rgb | None = None
    one_sided: bool = False
    emission_twosided: bool = False
    interior: Medium | None = None
    exterior: Medium | None = None

    def __post_init__(self) -> None:
        if self.to_world.shape != (4, 4) or not np.isfinite(self.to_world).all():
            raise SceneError(f"Instance {self.name!r}: to_world must be a finite (4, 4) matrix")
        if determinant(self.to_world) == 0.0:
            raise SceneError(f"Instance {self.name!r}: to_world is singular")
