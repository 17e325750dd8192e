"""Reader of models without materials: PLY and STL."""

from __future__ import annotations

import io

import numpy as np

from scenes.canonical import ConstantTexture, Instance, Mesh, Phong, SceneError
from scenes.canonical.values import vertices_of
from scenes.formats.geometry.ply_files import read_coloured_ply
from scenes.formats.losses import LossReport
from scenes.loading import decode_srgb
from scenes.models.smoothing import with_corners
from scenes.models.sources import Sources
from scenes.models.vertex_colours import coloured

GREY = Phong(ConstantTexture((0.5, 0.5, 0.5)))


def read_plain(sources: Sources, report: LossReport, facets: bool = False) -> tuple[Instance, ...]:
    """The single part of a file, grey unless its vertices have colours, which are assumed to be sRGB."""
    path = sources.path
    name = f"{path.stem}/{path.stem}"
    if path.suffix.lower() == ".stl":
        mesh = _stl(path.read_bytes(), str(path))
        return () if mesh is None else (Instance(mesh, GREY, name=name),)
    mesh, colors = read_coloured_ply(path.read_bytes(), str(path), report)
    if colors is None:
        return (Instance(mesh, GREY, name=name),)
    texture, uvs = coloured(decode_srgb(colors)[mesh.faces], str(path))
    if uvs is not None:
        if mesh.uvs is not None:
            report.add(name, "texture coordinates in addition to vertex colours")
        normals = None if mesh.normals is None else mesh.normals[mesh.faces]
        mesh = with_corners(mesh.vertices[mesh.faces], normals, uvs, str(path))
    return (Instance(mesh, Phong(texture), name=name),)


def _stl(content: bytes, name: str) -> Mesh | None:
    """Triangles of an STL file; its normals are those of the triangles and are not read."""
    import trimesh  # a slow import, and most scenes read no model

    loaded = trimesh.load_mesh(io.BytesIO(_whole(content)), file_type="stl", process=False)
    vertices, faces = np.array(loaded.vertices, np.float64), np.array(loaded.faces, np.int64)
    if not len(faces):
        return None
    if not np.isfinite(vertices).all():
        raise SceneError("vertices hold non-finite values")
    points, index = np.unique(vertices, axis=0, return_inverse=True)
    return Mesh(vertices_of(points), index.reshape(-1)[faces].astype(np.int32), source=name)


def _whole(content: bytes) -> bytes:
    """A file without what follows the triangles that the header of a binary one announces.

    Raises:
        SceneError: a binary file has fewer triangles.
    """
    start, each = 84, 50
    count = int.from_bytes(content[start - 4 : start], "little")
    if len(content) >= start + each * count:  # never of a text, whose letters are the count of a huge file
        return content[: start + each * count]
    if b"\0" in content[:start]:
        raise SceneError(
            f"cannot be read: expected {count} triangles as its header says, got {max(len(content) - start, 0) // each}"
        )
    return content
