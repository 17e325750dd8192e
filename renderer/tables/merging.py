"""Merging of meshes that move together: a ray then traverses one tree with one transform, nearest parts first."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenes.arithmetic import inverse, product
from scenes.canonical import Instance, Mesh, RigidTrack

COPIED_FACES_MAX = 1 << 20
"""Maximum number of additional faces from copies of meshes that instances share."""

SIZE_RATIO_MAX = 1024.0
"""A part that is smaller than the whole by more than this factor stays separate: float32 would be too coarse for it."""


@dataclass(frozen=True, eq=False)
class Assembly:
    """Meshes on one track, merged into one mesh in track space.

    Attributes:
        mesh: merged mesh; vertices are float64, normals are not unit vectors and are zero where a part has none.
        parts: merged instances, in the order of their faces.
    """

    mesh: Mesh
    parts: tuple[Instance, ...]

    @property
    def track(self) -> RigidTrack | None:
        return self.parts[0].track

    @property
    def face_counts(self) -> list[int]:
        """Number of faces of each part."""
        return [len(part.shape.faces) for part in self.parts if isinstance(part.shape, Mesh)]


def assemble(instances: Sequence[Instance]) -> tuple[list[Assembly], list[Instance]]:
    """Merges meshes track by track.

    Args:
        instances: instances of a scene.

    Returns:
        Merged meshes, and the instances that stay separate.
    """
    shared = _shared_meshes(instances)
    by_track: dict[int, list[Instance]] = defaultdict(list)
    for instance in instances:
        if isinstance(instance.shape, Mesh) and instance.emission is None and id(instance.shape) not in shared:
            by_track[id(instance.track)].append(instance)
    assemblies = []
    for candidates in by_track.values():
        parts = _of_like_size(candidates)
        if len(parts) > 1:
            assemblies.append(Assembly(_joined(parts), tuple(parts)))
    merged = {id(part) for assembly in assemblies for part in assembly.parts}
    return assemblies, [instance for instance in instances if id(instance) not in merged]


def _shared_meshes(instances: Sequence[Instance]) -> set[int]:
    """Ids of the meshes that are used more than once, if copies of all of them would exceed the limit."""
    meshes = [instance.shape for instance in instances if isinstance(instance.shape, Mesh)]
    uses = Counter(id(mesh) for mesh in meshes)
    copied = sum(len(mesh.faces) for mesh in meshes) - sum(
        len(mesh.faces) for mesh in {id(m): m for m in meshes}.values()
    )
    return {key for key, count in uses.items() if count > 1} if copied > COPIED_FACES_MAX else set()


def _of_like_size(instances: list[Instance]) -> list[Instance]:
    """The instances that are not tiny relative to all of them together."""
    points = [_placed(instance)[0] for instance in instances]
    sizes = np.array([np.ptp(part, axis=0).max() for part in points])
    whole = np.ptp(np.concatenate(points), axis=0).max()
    return [part for part, size in zip(instances, sizes, strict=True) if size * SIZE_RATIO_MAX >= whole]


def _placed(instance: Instance) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    """Vertices and normals in track space."""
    mesh = instance.shape
    assert isinstance(mesh, Mesh)
    linear, offset = instance.to_world[:3, :3], instance.to_world[:3, 3]
    vertices = product(mesh.vertices.astype(np.float64), linear.T) + offset
    if mesh.normals is None:
        return vertices, np.zeros((len(vertices), 3), np.float32)
    # the ratios of their lengths are kept, so that they interpolate as in object space
    normals = product(mesh.normals.astype(np.float64), inverse(linear))
    longest = np.linalg.norm(normals, axis=1).max(initial=0.0)
    return vertices, (normals / (longest if longest > 0.0 else 1.0)).astype(np.float32)


def _joined(parts: list[Instance]) -> Mesh:
    vertices, normals = zip(*(_placed(part) for part in parts), strict=True)
    first = np.cumsum([0, *(len(part) for part in vertices[:-1])])
    meshes = [part.shape for part in parts if isinstance(part.shape, Mesh)]
    # faces of a mirrored part are reversed, so that their outside stays outside
    mirrored = [np.linalg.det(part.to_world[:3, :3]) < 0.0 for part in parts]
    wound = [mesh.faces[:, ::-1] if flip else mesh.faces for mesh, flip in zip(meshes, mirrored, strict=True)]
    faces = [rows.astype(np.int64) + start for rows, start in zip(wound, first, strict=True)]
    uvs = [np.zeros((len(mesh.vertices), 2), np.float32) if mesh.uvs is None else mesh.uvs for mesh in meshes]
    joined = np.concatenate(vertices)
    return Mesh(joined, np.concatenate(faces).astype(np.int32), np.concatenate(normals), np.concatenate(uvs), "merged")
