"""Writer of PLY meshes, in pieces.

Source: G. Turk, "The PLY Polygon File Format" (1994).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from scenes.canonical import Mesh

_PIECE = 1 << 16  # number of rows that are written at a time


def ply_parts(mesh: Mesh) -> Iterator[bytes | memoryview]:
    """A mesh as a binary PLY file, in pieces."""
    columns = [mesh.vertices]
    names = ["x", "y", "z"]
    if mesh.normals is not None:
        columns.append(mesh.normals)
        names += ["nx", "ny", "nz"]
    if mesh.uvs is not None:
        columns.append(mesh.uvs)
        names += ["s", "t"]  # names that both LuxCore and PBRT accept
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(mesh.vertices)}"]
    lines += [f"property float {name}" for name in names]
    lines += [f"element face {len(mesh.faces)}", "property list uchar int vertex_indices", "end_header", ""]
    yield "\n".join(lines).encode()
    for start in range(0, len(mesh.vertices), _PIECE):
        piece = [column[start : start + _PIECE] for column in columns]
        yield np.concatenate(piece, axis=1).astype("<f4", copy=False).data.cast("B")
    for start in range(0, len(mesh.faces), _PIECE):
        piece = mesh.faces[start : start + _PIECE]
        rows = np.empty(len(piece), np.dtype([("count", "u1"), ("corners", "<i4", (3,))]))
        rows["count"], rows["corners"] = 3, piece
        yield rows.tobytes()


def ply_bytes(mesh: Mesh) -> bytes:
    """A mesh as a binary PLY file."""
    return b"".join(ply_parts(mesh))
