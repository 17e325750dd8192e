"""OBJ and Mitsuba's serialized meshes, read from their content only: no material library or other file is read.

Source: Mitsuba 0.5 documentation, section on the serialized shape; OBJ by the mesh library.
"""

from __future__ import annotations

import io
import re
import struct
import zlib
from collections.abc import Container, Iterator

import numpy as np

from scenes.canonical import Mesh, SceneError
from scenes.formats.geometry.checked import checked_mesh
from scenes.loading import one_line

_MAGIC = 0x041C
_NORMALS, _UVS, _COLORS, _FACETED, _SINGLE, _DOUBLE = 0x1, 0x2, 0x8, 0x10, 0x1000, 0x2000
_HAS_NORMALS = re.compile(rb"^[ \t]*vn[ \t]", re.MULTILINE)
_BYTES_MAX = 2 << 30


def read_obj(content: bytes, name: str) -> Mesh:
    """An OBJ file as one mesh.

    Raises:
        SceneError: the file cannot be read, or has no faces.
    """
    import trimesh  # slow

    try:
        mesh = trimesh.load_mesh(io.BytesIO(content), file_type="obj", process=False, skip_materials=True)
        mesh = mesh.to_mesh() if isinstance(mesh, trimesh.Scene) else mesh
        uvs = getattr(mesh.visual, "uv", None)
        arrays = np.array(mesh.vertices, np.float64), np.array(mesh.faces, np.float64)
        normals = np.array(mesh.vertex_normals, np.float64) if _HAS_NORMALS.search(content) else None
    except Exception as error:  # parsers raise arbitrary exceptions on broken files
        raise SceneError(f"{name}: cannot be read as OBJ: {one_line(error)[:200]}") from None
    if not len(arrays[1]):
        raise SceneError(f"{name}: expected faces, found none")
    same = uvs is not None and len(uvs) == len(arrays[0])
    return checked_mesh(*arrays, normals, np.array(uvs, np.float64)[:, :2] if same else None, name)


def obj_materials(content: bytes) -> list[str]:
    """Names after ``usemtl`` in an OBJ file that are used by faces, in order; an empty name stands for faces before the
    first."""
    return list(dict.fromkeys(name for name, is_face, _ in _obj_lines(content) if is_face))


def obj_part(content: bytes, names: Container[str]) -> bytes:
    """An OBJ file reduced to the faces whose material has one of these names."""
    return b"\n".join(line for name, is_face, line in _obj_lines(content) if not is_face or name in names)


def _obj_lines(content: bytes) -> Iterator[tuple[str, bool, bytes]]:
    """Lines with their current material, and whether they are faces."""
    name = ""
    for line in content.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ").splitlines():
        words = line.split(maxsplit=1)
        keyword = words[0] if words else b""
        if keyword == b"usemtl":
            name = words[1].decode("utf-8", "replace").strip() if len(words) > 1 else ""
        yield name, keyword == b"f", line


def read_serialized(content: bytes, index: int, name: str, smooth: bool = False) -> Mesh:
    """One mesh of a serialized file; the faces of one that asks for flat ones share no vertices, unless ``smooth``.

    Raises:
        SceneError: it is not such a file, or does not match its header.
    """
    if len(content) < 8 or struct.unpack_from("<H", content)[0] != _MAGIC:
        raise SceneError(f"{name}: expected a serialized mesh")
    version = struct.unpack_from("<H", content, 2)[0]
    (count,) = struct.unpack_from("<I", content, len(content) - 4)
    size, kind = (8, "<Q") if version >= 4 else (4, "<I")
    if not 0 <= index < count or count * size + 4 > len(content):
        raise SceneError(f"{name}: expected a shape index below {count}, got {index}")
    (start,) = struct.unpack_from(kind, content, len(content) - 4 - size * (count - index))
    if start + 4 > len(content):
        raise SceneError(f"{name}: expected a mesh at byte {start}")
    try:
        body = zlib.decompressobj().decompress(content[start + 4 :], _BYTES_MAX)
        return _serialized_mesh(body, version, name, smooth)
    except (zlib.error, struct.error, ValueError) as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError(f"{name}: cannot be read as a serialized mesh ({one_line(error)})") from None


def _serialized_mesh(body: bytes, version: int, name: str, smooth: bool) -> Mesh:
    (flags,) = struct.unpack_from("<I", body)
    at = 4 if version < 4 else body.index(b"\0", 4) + 1
    vertices, triangles = struct.unpack_from("<QQ", body, at)
    at += 16
    kind = np.dtype("<f8" if flags & _DOUBLE else "<f4")
    widths = [3] + [3] * bool(flags & _NORMALS) + [2] * bool(flags & _UVS) + [3] * bool(flags & _COLORS)
    if at + vertices * sum(widths) * kind.itemsize + triangles * 12 > len(body):
        raise SceneError(
            f"{name}: expected {vertices} vertices and {triangles} triangles as its header says, got fewer"
        )
    columns = []
    for width in widths:
        columns.append(np.frombuffer(body, kind, vertices * width, at).reshape(-1, width).astype(np.float64))
        at += vertices * width * kind.itemsize
    faces = np.frombuffer(body, "<u4", triangles * 3, at).reshape(-1, 3).astype(np.float64)
    rest = iter(columns[1:])
    normals = next(rest) if flags & _NORMALS else None
    uvs = next(rest) if flags & _UVS else None
    mesh = checked_mesh(columns[0], faces, normals, uvs, name)
    if smooth or not flags & _FACETED:
        return mesh
    corners = mesh.faces.reshape(-1)
    apart = np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
    return Mesh(mesh.vertices[corners], apart, None, None if mesh.uvs is None else mesh.uvs[corners], name)
