"""Reader of models without materials: PLY and STL."""

from __future__ import annotations

import io

import numpy as np

from scenes.canonical import ConstantTexture, ImageTexture, Instance, Mesh, Phong, SceneError
from scenes.canonical.values import vertices_of
from scenes.formats.geometry.ply_files import read_coloured_ply
from scenes.formats.geometry.ply_headers import header_of, texture_of
from scenes.formats.losses import LossReport
from scenes.loading import decode_srgb, read_image
from scenes.models.smoothing import with_corners
from scenes.models.sources import Sources
from scenes.models.vertex_colours import coloured

GREY = Phong(ConstantTexture((0.5, 0.5, 0.5)))


_HEADER = 80  # bytes of a binary STL file
_REDS = ("red", "r", "diffuse_red")


def read_plain(sources: Sources, report: LossReport, facets: bool = False) -> tuple[Instance, ...]:
    """The single part of a file, grey unless its vertices have colours, assumed to be sRGB, or a PLY file a picture."""
    path = sources.path
    name = f"{path.stem}/{path.stem}"
    if path.suffix.lower() == ".stl":
        mesh = _stl(path.read_bytes(), str(path), name, report)
        return () if mesh is None else (Instance(mesh, GREY, name=name),)
    content = path.read_bytes()
    mesh, colors = read_coloured_ply(content, str(path), report)
    if any(part[0] in _REDS for one in header_of(content, name)[1] if one.name == "face" for part in one.properties):
        report.add(name, "colours of faces")
    if colors is None:
        return (Instance(mesh, _pictured(texture_of(content), mesh, sources, name, report), name=name),)
    texture, uvs = coloured(decode_srgb(colors)[mesh.faces], str(path))
    if uvs is not None:
        if mesh.uvs is not None:
            report.add(name, "texture coordinates in addition to vertex colours")
        normals = None if mesh.normals is None else mesh.normals[mesh.faces]
        mesh = with_corners(mesh.vertices[mesh.faces], normals, uvs, str(path))
    return (Instance(mesh, Phong(texture), name=name),)


def _pictured(picture: str, mesh: Mesh, sources: Sources, name: str, report: LossReport) -> Phong:
    """The material of a PLY file: the picture that it names, where its vertices have coordinates."""
    if picture and mesh.uvs is None:
        report.add(name, f"the picture {picture!r}, for which vertices have no coordinates", "grey")
    path = sources.known(picture, name, report, "the picture", "grey") if picture and mesh.uvs is not None else None
    return GREY if path is None else Phong(ImageTexture(read_image(path), source=str(path)))


def _stl(content: bytes, name: str, where: str, report: LossReport) -> Mesh | None:
    """Triangles of an STL file; its normals are those of the triangles and are not read."""
    import trimesh  # a slow import, and most scenes read no model

    whole = _whole(content)
    if b"COLOR=" in whole[:_HEADER]:  # only binary files of some programs have colours, and say so here
        report.add(where, "colours of an STL file", "grey")
    loaded = trimesh.load_mesh(io.BytesIO(whole), file_type="stl", process=False)
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
