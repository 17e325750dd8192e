"""Mitsuba's serialized meshes, also broken ones."""

from __future__ import annotations

import struct
import zlib

import numpy as np
import pytest

from scenes.canonical import (
    Mesh,
    SceneError,
)
from scenes.formats.geometry.mesh_files import read_serialized


def serialized(meshes: list[Mesh], version: int = 4) -> bytes:
    """A file as Mitsuba writes it."""
    content, starts = b"", []
    for mesh in meshes:
        starts.append(len(content))
        flags = 0x1000 | (mesh.normals is not None) | 0x2 * (mesh.uvs is not None)
        body = struct.pack("<I", flags) + (b"name\0" if version == 4 else b"")
        body += struct.pack("<QQ", len(mesh.vertices), len(mesh.faces)) + mesh.vertices.tobytes()
        body += b"" if mesh.normals is None else mesh.normals.tobytes()
        body += b"" if mesh.uvs is None else mesh.uvs.tobytes()
        content += struct.pack("<HH", 0x041C, version) + zlib.compress(body + mesh.faces.astype("<u4").tobytes())
    return (
        content
        + b"".join(struct.pack("<Q" if version == 4 else "<I", at) for at in starts)
        + struct.pack("<I", len(starts))
    )


@pytest.mark.parametrize("version", [3, 4])
def test_serialized_meshes(version: int) -> None:
    rng = np.random.default_rng(0)
    points, uvs = rng.random((5, 3)).astype(np.float32), rng.random((5, 2)).astype(np.float32)
    faces = np.array([[0, 1, 2], [2, 3, 4]], np.int32)
    content = serialized([Mesh(points, faces), Mesh(points[::-1].copy(), faces, None, uvs)], version)
    second = read_serialized(content, 1, "a")
    np.testing.assert_array_equal(second.vertices, points[::-1])
    np.testing.assert_array_equal(second.uvs, uvs)
    np.testing.assert_array_equal(second.faces, faces)
    assert read_serialized(content, 0, "a").uvs is None
    with pytest.raises(SceneError, match="expected a shape index below 2, got 2"):
        read_serialized(content, 2, "a")
    rng = np.random.default_rng(1)
    for _ in range(300):
        broken = bytearray(content)
        for at in rng.integers(0, len(broken), 3):
            broken[at] = rng.integers(0, 256)
        try:
            read_serialized(bytes(broken), 1, "a")
        except SceneError:
            pass
    with pytest.raises(SceneError, match="expected a serialized mesh"):
        read_serialized(b"nothing", 0, "a")
