"""Parts of one mesh that have materials of their own, for formats whose meshes have several materials."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np

from scenes.canonical import Instance, Mesh
from scenes.formats.geometry.meshed import depends_on_uv

Body = tuple[Instance, ...]


def bodies_of(instances: Iterable[Instance], alike: Callable[[Instance, Instance], bool]) -> Iterator[Body]:
    """The instances in their order; meshes that follow each other with the same name and place are one body.

    Args:
        instances: instances of a scene.
        alike: whether a format can hold two parts in one mesh.
    """
    body: list[Instance] = []
    for one in instances:
        if body and not (_at_one_place(body[-1], one) and alike(body[-1], one)):
            yield tuple(body)
            body = []
        body.append(one)
    if body:
        yield tuple(body)


def _at_one_place(first: Instance, second: Instance) -> bool:
    return (
        bool(first.name)
        and first.name == second.name
        and first.track is second.track
        and all(isinstance(one.shape, Mesh) and one.shape.vertices.dtype == np.float32 for one in (first, second))
        and np.array_equal(first.to_world, second.to_world)
    )


def has_uvs(instance: Instance) -> bool:
    """Whether a mesh has texture coordinates that its material uses."""
    return isinstance(instance.shape, Mesh) and instance.shape.uvs is not None and depends_on_uv(instance.material)


def joined(body: Body) -> Mesh:
    """The meshes of a body as one, part after part; parts without texture coordinates in use have zeros beside others.

    All parts must have normals, or none.
    """
    meshes = [one.shape for one in body if isinstance(one.shape, Mesh)]
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)])
    normals = [mesh.normals for mesh in meshes if mesh.normals is not None]
    textured = [has_uvs(one) for one in body]
    uvs = None
    if any(textured):
        uvs = np.concatenate([
            mesh.uvs if used and mesh.uvs is not None else np.zeros((len(mesh.vertices), 2), np.float32)
            for mesh, used in zip(meshes, textured, strict=True)
        ])  # fmt: skip
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        faces.astype(np.int32),
        np.concatenate(normals) if normals else None,
        uvs,
        meshes[0].source,
    )
