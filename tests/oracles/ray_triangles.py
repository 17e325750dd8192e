"""Every ray against every triangle, in float64: Möller and Trumbore 1997."""

from __future__ import annotations

import numpy as np


def nearest_hits(
    vertices: np.ndarray, faces: np.ndarray, origin: np.ndarray, direction: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Distance ``(n,)`` and face ``(n,)`` of the nearest hit, inf and -1 for a miss."""
    corner = vertices.astype(np.float64)[faces]
    edge_1, edge_2 = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    distance, face = np.full(len(origin), np.inf), np.full(len(origin), -1)
    for ray, (start, way) in enumerate(zip(origin.astype(np.float64), direction.astype(np.float64), strict=True)):
        p = np.cross(way, edge_2)
        det = (edge_1 * p).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = start - corner[:, 0]
            u = (s * p).sum(axis=1) / det
            q = np.cross(s, edge_1)
            v = (q @ way) / det
            t = (edge_2 * q).sum(axis=1) / det
            t = np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0) & (det != 0), t, np.inf)
        best = int(np.argmin(t))
        if t[best] < np.inf:
            distance[ray], face[ray] = t[best], best
    return distance, face
